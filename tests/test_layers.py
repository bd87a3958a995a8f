"""Who may import whom. ARCHITECTURE.md draws it; this test keeps it true."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ADDON = ROOT / "addon"
CORE = ROOT / "rust_core/cage_rig/src"

# What a module of the add-on may import: packages from outside, and modules of ours.
ALLOWED: dict[str, tuple[set[str], set[str]]] = {
    "compat": ({"bpy"}, set()),
    "props": ({"bpy"}, {"choosing", "layers"}),
    "choosing": ({"bpy"}, {"session"}),
    "session": ({"cage_rig_core", "numpy"}, set()),
    "adapters": ({"bpy", "bmesh", "mathutils", "numpy"}, {"adapters", "compat"}),
    "layers": ({"bpy"}, {"adapters"}),
    "linked": ({"bpy"}, {"adapters"}),
    "applied": ({"bpy", "numpy"}, {"adapters", "binding", "layers"}),
    "registry": ({"bpy"}, {"adapters", "layers"}),
    "health": ({"bpy", "numpy"}, {"adapters", "layers", "linked"}),
    "glance": ({"bpy", "numpy"}, {"adapters", "health", "session"}),
    "migration": ({"bpy"}, {"adapters", "binding", "layers"}),
    "skins": ({"bpy", "numpy"}, {"adapters", "health", "session"}),
    "binding": ({"bpy", "numpy"}, {"adapters", "session"}),
    "running": ({"bpy", "numpy"}, {"adapters", "binding", "glance", "session", "skins"}),
    "resting": ({"bpy", "numpy"}, {"adapters", "binding", "health", "running"}),
    "placing": ({"bpy", "mathutils", "numpy"}, {"adapters", "binding", "layers", "skins"}),
    "posed_edits": ({"bpy", "numpy"}, {"adapters", "linked", "registry", "running", "session"}),
    "showing": ({"bpy", "numpy"}, {"adapters", "binding", "health", "running", "session", "skins"}),
    "playing": ({"bpy"}, {"adapters", "choosing", "running", "session", "showing", "skins"}),
    "sync": (
        {"bpy", "numpy"},
        {"adapters", "applied", "binding", "choosing", "glance", "health", "layers", "linked", "migration"}
        | {"placing", "playing", "posed_edits", "registry", "resting", "running", "session", "showing", "skins"},
    ),
    "generator": ({"cage_rig_core", "hashlib", "numpy"}, set()),
    "reading": ({"bpy", "numpy"}, {"adapters", "health", "session"}),
    "installation": ({"bpy", "numpy"}, {"adapters", "binding", "layers", "session", "sync"}),
    "lifecycle": (
        {"bpy", "numpy"},
        {"adapters", "applied", "binding", "installation", "layers", "migration", "reading", "session", "sync"},
    ),
    "bake": (
        {"bpy", "mathutils", "numpy", "pathlib", "shutil", "struct"},
        {"adapters", "bake", "compat", "health", "layers", "registry", "session", "skins", "sync"},
    ),
    "caging": ({"bpy", "mathutils", "numpy"}, {"adapters", "caging", "compat", "generator", "reading"}),
    "caging/bones": ({"numpy"}, set()),
    "caging/course": ({"numpy"}, {"caging", "generator"}),
    "caging/editing": ({"numpy"}, {"caging", "generator"}),
    "exchange": ({"numpy", "pathlib", "zipfile"}, {"exchange"}),
    "exchange/__init__": ({"bpy"}, {"exchange"}),
    "exchange/live": (
        {"bpy", "numpy", "pathlib"},
        {"bake", "binding", "exchange", "lifecycle", "session", "sync"},
    ),
    "exchange/scene": (
        {"bpy", "mathutils", "numpy", "pathlib"},
        {"adapters", "bake", "exchange", "lifecycle", "session"},
    ),
    "samples": ({"bpy", "mathutils", "pathlib"}, {"registry"}),
    "keying": ({"bpy", "numpy"}, {"adapters", "binding", "linked", "registry", "sync"}),
    "repair": ({"bpy"}, {"adapters", "lifecycle"}),
    "selection": ({"bpy", "mathutils"}, {"lifecycle", "props"}),
    "leftovers": ({"bpy"}, {"adapters", "registry", "sync"}),
    "saving": ({"bpy"}, {"adapters", "layers", "registry"}),
    "handlers": ({"bpy"}, {"leftovers", "saving", "sync"}),
    "operators": (
        {"bpy"},
        {
            "bake",
            "caging",
            "choosing",
            "exchange",
            "keying",
            "lifecycle",
            "operators",
            "props",
            "repair",
            "samples",
            "selection",
        },
    ),
    "operators/node_events": ({"bpy", "numpy"}, {"caging", "generator", "operators"}),
    "ui": ({"bpy"}, {"caging", "choosing", "keying", "props", "repair", "ui"}),
    "ui/overlays": (
        {"blf", "bpy", "gpu", "gpu_extras", "mathutils", "numpy"},
        {"adapters", "caging", "health", "props", "registry", "session", "sync", "ui"},
    ),
    "headless": (
        {"argparse", "bpy", "json", "mathutils", "numpy", "pathlib", "sys", "time", "zipfile"},
        {"adapters", "bake", "binding", "caging", "headless", "registry", "session", "sync"},
    ),
    "__init__": (set(), {"handlers", "headless", "operators", "props", "translations", "ui"}),
    "translations": ({"bpy"}, set()),
    "__main__": ({"addon_utils", "bpy", "importlib", "pathlib", "sys"}, set()),
}
STANDARD = {"__future__", "atexit", "collections", "contextlib", "dataclasses", "enum", "functools", "itertools"}
STANDARD |= {"math", "re", "textwrap", "typing", "uuid"}


def layer_of(path: Path) -> str:
    """Where in `ALLOWED` a file is: by itself, or with one of its folders."""
    inside = path.relative_to(ADDON).with_suffix("")
    return next((name for name in map(str, (inside, *inside.parents)) if name in ALLOWED), inside.parts[0])


def imports(path: Path) -> tuple[set[str], set[str], list[int]]:
    """(packages from outside, our modules, lines of imports inside functions) of one file."""
    tree = ast.parse(path.read_text())
    outside: set[str] = set()
    ours: set[str] = set()
    package = list(path.relative_to(ADDON).parts[:-1])
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            outside |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            outside.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1]
            if base:
                ours.add(base[0])
            elif node.module:
                ours.add(node.module.split(".")[0])
            else:
                ours |= {alias.name for alias in node.names}
    nested = [
        inner.lineno
        for outer in ast.walk(tree)
        if isinstance(outer, ast.FunctionDef)
        for inner in ast.walk(outer)
        if isinstance(inner, ast.Import | ast.ImportFrom)
    ]
    return outside - STANDARD, ours, nested


@pytest.mark.parametrize("path", sorted(ADDON.rglob("*.py")), ids=lambda p: str(p.relative_to(ADDON)))
def test_the_add_on_imports_only_what_its_layer_may(path: Path) -> None:
    outside, ours, nested = imports(path)
    allowed_outside, allowed_ours = ALLOWED[layer_of(path)]
    assert outside <= allowed_outside
    assert ours <= allowed_ours
    assert not nested, f"imports inside functions at lines {nested}"


def uses(folder: str) -> dict[Path, set[str]]:
    """Which top-level modules of the core each file of one of its folders names."""
    pattern = re.compile(r"\bcrate::(\w+)")
    return {path: set(pattern.findall(path.read_text())) for path in (CORE / folder).rglob("*.rs")}


def test_coordinates_and_skinning_know_nothing_above_them() -> None:
    for folder, other in (("coordinates", "skinning"), ("skinning", "coordinates")):
        assert uses(folder)
        for path, named in uses(folder).items():
            assert not named & {other, "sync", "caging"}, path


def test_nothing_below_knows_the_cage_generator() -> None:
    for folder in ("coordinates", "skinning", "sync", "geometry"):
        for path, named in uses(folder).items():
            assert "caging" not in named, path
    below = {"cage", "caging", "error", "fixtures", "geometry", "mesh", "points", "progress"}
    assert uses("caging")
    for path, named in uses("caging").items():
        assert named <= below, path


def test_geometry_knows_neither_cages_nor_skeletons() -> None:
    assert uses("geometry")
    for path, named in uses("geometry").items():
        assert named <= {"points", "geometry", "fixtures"}, path


def test_only_linalg_names_faer() -> None:
    named = [path.name for path in CORE.rglob("*.rs") if re.search(r"\bfaer\b\s*(::|;)", path.read_text())]
    assert named == ["linalg.rs"]


def test_only_simd_names_pulp_and_knows_nothing_else() -> None:
    named = {path.parent.name for path in CORE.rglob("*.rs") if re.search(r"\bpulp\b\s*(::|;)", path.read_text())}
    assert named == {"simd"}
    for path, modules in uses("simd").items():
        assert not modules, path


def test_the_core_knows_no_python_and_no_files() -> None:
    manifest = tomllib.loads((CORE.parent / "Cargo.toml").read_text())
    assert not {"pyo3", "numpy"} & set(manifest["dependencies"])
    for path in CORE.rglob("*.rs"):
        assert not re.search(r"std::(fs|io|env|process)\b", path.read_text()), path
