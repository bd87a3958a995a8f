"""Modules of the add-on that know no bpy, loaded without it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

EXCHANGE = Path(__file__).parents[2] / "addon/exchange"
PURE = ("text", "prototype", "coordinates", "coordinate_files", "bones", "rig_files")


@pytest.fixture(scope="session")
def exchange() -> Iterator[SimpleNamespace]:
    """The modules of `exchange` that read and write files, without the package's own, which needs Blender."""
    package = ModuleType("cage_rig_exchange")
    package.__path__ = [str(EXCHANGE)]
    sys.modules[package.__name__] = package
    yield SimpleNamespace(**{name: importlib.import_module(f"{package.__name__}.{name}") for name in PURE})
    for name in [name for name in sys.modules if name.split(".")[0] == package.__name__]:
        del sys.modules[name]
