"""Run the Blender tests on every Blender the extension serves, each in an environment of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Target:
    """A bpy release and the Python it is made for."""

    bpy: str
    python: str


TARGETS = (
    Target("4.2.23", "3.11"),
    Target("4.5.15", "3.11"),
    Target("5.0.1", "3.11"),
    Target("5.2.3", "3.13"),
)


def find_python(version: str) -> str | None:
    """An interpreter of this version: the running one, one on PATH, or one of pyenv's."""
    candidates = [sys.executable, shutil.which(f"python{version}")]
    candidates += sorted(str(path) for path in Path.home().glob(f".pyenv/versions/{version}*/bin/python"))
    for candidate in filter(None, candidates):
        code = f"import sys; sys.exit('%d.%d' % sys.version_info[:2] != '{version}')"
        if subprocess.run([candidate, "-c", code], capture_output=True, check=False).returncode == 0:
            return candidate
    return None


def environment(target: Target) -> Path | None:
    """Python of a venv with this bpy and pytest; None where it can't be made."""
    folder = ROOT / ".venvs" / f"bpy-{target.bpy}"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if (folder / "ready").exists():
        return python
    base = find_python(target.python)
    if base is None:
        return None
    subprocess.run([base, "-m", "venv", "--clear", str(folder)], check=True)
    install = [str(python), "-m", "pip", "install", "--quiet", f"bpy=={target.bpy}", "numpy", "openjd-cli", "pytest"]
    if subprocess.run(install, check=False).returncode:
        return None
    (folder / "ready").touch()
    return python


def main() -> None:
    results: list[tuple[Target, str]] = []
    for target in TARGETS:
        print(f"== bpy {target.bpy} on Python {target.python}", flush=True)
        python = environment(target)
        if python is None:
            results.append((target, f"NOT RUN: no Python {target.python}, or its bpy can't be installed"))
            continue
        # Tests ask the core directly too.
        wheels = [str(path) for path in (ROOT / "dist" / "wheels").glob("cage_rig_core-*.whl")]
        install = [str(python), "-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", *wheels]
        subprocess.run(install, check=True)
        done = subprocess.run([str(python), "-m", "pytest", "tests/blender"], cwd=ROOT, check=False)
        results.append((target, "passed" if done.returncode == 0 else f"FAILED (exit code {done.returncode})"))
    print()
    for target, result in results:
        print(f"bpy {target.bpy:8} Python {target.python:5} {result}")
    sys.exit(any(result != "passed" for _, result in results))


if __name__ == "__main__":
    main()
