# make demo · test · lint · bench · bench-quick · bench-count · fixtures · zip · extension · test-matrix · soak · docs · pictures · listing
# Every target sets up what it needs in .venv; nothing but Python, a Rust toolchain and make is assumed.

PYTHON ?= $(shell sh tools/find-python)
VENV := .venv
PY := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)/python
CORE_SOURCES := $(shell find rust_core -name '*.rs' -o -name '*.toml' -o -name '*.pyi') Cargo.toml Cargo.lock
ADDON_SOURCES := $(shell find addon -name '*.py' -o -name '*.toml')
DEMO_OUT ?= build/demo

.PHONY: demo test test-rust test-python lint bench bench-quick bench-count fixtures zip extension test-matrix test-window soak docs pictures listing clean

demo: $(VENV)/.extension
	$(PY) tools/with_extension.py demo/demo.py --out $(DEMO_OUT) $(if $(QUICK),--quick) \
		$(if $(RIG),--rig "$(RIG)") $(if $(CAGE),--cage "$(CAGE)")

test: test-rust test-python

test-rust:
	cargo test --release --quiet --workspace --exclude cage_rig_py

test-python: $(VENV)/.extension
	$(PY) -m pytest

lint: $(VENV)/.core
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets --quiet -- -D warnings
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	cd addon && ../$(PY) -m mypy --config-file ../pyproject.toml session.py

# Named scenarios beside numpy, libigl and Blender's own modifiers: docs/bench.md and docs/bench.png.
bench: $(VENV)/.extension $(VENV)/.bench
	$(PY) tools/with_extension.py tests/bench/bench_blender.py
	$(PY) tests/bench/bench_core.py
	$(PY) tests/bench/bench_rust.py
	$(PY) tests/bench/report.py
	$(PY) tests/bench/bench_caging.py
	$(PY) tests/bench/bench_fitting.py

# Their answers alone, of small sizes.
bench-quick: $(VENV)/.extension
	$(PY) tools/with_extension.py tests/bench/bench_blender.py --quick
	$(PY) tests/bench/bench_core.py --quick

# Instructions under valgrind beside recorded numbers: a regression shows on a noisy machine too.
bench-count: $(VENV)/.dev
	$(PY) tests/bench/count.py

fixtures: $(VENV)/.extension
	$(PY) blend_fixtures/make_fixtures.py --out build/fixtures
	$(PY) tools/build_samples.py

# For this machine, in dist.
zip: $(VENV)/.extension

# The release: a wheel and a zip for every platform, and the index of a repository. `make test` needs this machine's alone.
extension: $(VENV)/.extension
	$(PY) tools/build_samples.py
	$(PY) tools/build_core.py --all --out dist/wheels
	$(PY) tools/build_extension.py --wheels dist/wheels --out dist --index

test-matrix: $(VENV)/.extension
	$(PY) tools/test_matrix.py

soak: $(VENV)/.extension
	$(PY) tools/with_extension.py tests/blender/soak.py 10000

test-window: $(VENV)/.extension
	$(PY) tests/window/run.py

docs: $(VENV)/.docs
	$(PY) -m sphinx --builder html --fail-on-warning --keep-going --quiet -d build/docs/doctrees docs build/docs/html
	@echo "build/docs/html/index.html"

pictures: $(VENV)/.extension
	$(PY) docs/make_pictures/make_pictures.py

listing: $(VENV)/.extension
	$(PY) tools/with_extension.py docs/make_pictures/listing_renders.py
	$(PY) docs/make_pictures/make_pictures.py listing

$(VENV)/.dev: pyproject.toml
	@test -n "$(PYTHON)" || { sh tools/find-python; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --upgrade pip
	$(PY) -m pip install --quiet --group dev
	touch $@

$(VENV)/.blender: $(VENV)/.dev
	$(PY) -m pip install --quiet --group blender
	touch $@

$(VENV)/.bench: $(VENV)/.dev
	$(PY) -m pip install --quiet --group bench
	touch $@

$(VENV)/.docs: $(VENV)/.dev
	$(PY) -m pip install --quiet --group docs
	touch $@

$(VENV)/.core: $(VENV)/.dev $(CORE_SOURCES)
	$(PY) tools/build_core.py --out dist/wheels
	$(PY) -m pip install --quiet --force-reinstall --no-deps dist/wheels/cage_rig_core-*.whl
	touch $@

$(VENV)/.extension: $(VENV)/.core $(VENV)/.blender $(ADDON_SOURCES) tools/build_extension.py tools/build_core.py
	$(PY) tools/build_extension.py --wheels dist/wheels --out dist
	touch $@

clean:
	rm -rf $(VENV) .venvs build dist target
