"""Blender tests drive the installed extension through the bpy module, as a person would."""

from __future__ import annotations

from collections.abc import Iterator

import extension
import pytest

extension.isolate()

import bpy  # noqa: E402  (after the user folder is set)
from scene import Rig, bound_bar  # noqa: E402


@pytest.fixture(scope="session", autouse=True)
def installed() -> None:
    extension.install()


@pytest.fixture(autouse=True)
def empty_file(installed: None, capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Every test starts in an empty file, and no handler may have printed an exception."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err, out + err


@pytest.fixture
def bar() -> Rig:
    """The bar, bound."""
    return bound_bar()
