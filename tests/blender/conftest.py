"""Blender tests drive the installed extension through the bpy module, as a person would."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import extension
import pytest

extension.isolate()

import bpy  # noqa: E402  (after the user folder is set)
from generating import uncaged  # noqa: E402
from scene import Rig, bound_bar, select  # noqa: E402

from blend_fixtures.build import RigObjects, build_character  # noqa: E402
from blend_fixtures.small import capsule  # noqa: E402


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


Main = Callable[..., tuple[int, dict]]


@pytest.fixture
def headless() -> ModuleType:
    import bl_ext.user_default.cage_rig.headless as headless

    return headless


@pytest.fixture
def main(headless: ModuleType, tmp_path: Path) -> Main:
    """Runs a command line; returns exit code and JSON."""

    def call(*arguments: object) -> tuple[int, dict]:
        answer = tmp_path / "answer.json"
        answer.unlink(missing_ok=True)
        code = headless.main([*map(str, arguments), "--quiet", "--json", str(answer)])
        return code, json.loads(answer.read_text()) if answer.exists() else {}

    return call


@pytest.fixture
def caging(installed: None) -> ModuleType:
    import bl_ext.user_default.cage_rig.caging as caging

    return caging


@pytest.fixture
def character() -> RigObjects:
    """A round bar without a cage, everything selected that Generate Cage needs."""
    found = uncaged(build_character(capsule()))
    select([*found.skins, found.armature], found.armature)
    return found
