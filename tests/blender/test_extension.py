"""The zip itself: what it holds, and that what was installed is it."""

from __future__ import annotations

import tomllib
import zipfile

import bpy
import extension


def test_the_zip_holds_the_add_on_its_wheel_and_its_licence() -> None:
    archive = zipfile.ZipFile(extension.zip_path())
    names = archive.namelist()
    manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert manifest["id"] == "cage_rig" and manifest["blender_version_min"] == "4.2.0"
    assert [name for name in names if name.endswith(".whl")] == [w.removeprefix("./") for w in manifest["wheels"]]
    assert "abi3" in manifest["wheels"][0]
    assert all(name.startswith("sample_files/") for name in names if name.endswith(".blend"))
    assert "LICENSE" in names and "__init__.py" in names
    assert not [name for name in names if "__pycache__" in name or name.endswith((".blend1", ".md"))]


def test_the_core_comes_from_the_installed_wheel() -> None:
    import bl_ext.user_default.cage_rig as package
    import cage_rig_core

    assert cage_rig_core.__version__ == "0.1.0"
    assert "user_default" in package.__file__


def test_operators_and_panel_are_registered() -> None:
    assert {"bind", "rebind", "unbind"} <= set(dir(bpy.ops.cage_rig))
    assert hasattr(bpy.types, "VIEW3D_PT_cage_rig")
    assert "cage_rig" in bpy.types.Object.bl_rna.properties


def test_method_numbers_never_move() -> None:
    import bl_ext.user_default.cage_rig.props as props

    assert {item[0]: item[3] for item in props.METHODS} == {"LBS": 0, "DQS": 1, "COR": 2}
    assert {item[0]: item[3] for item in props.STATES} == {"NONE": 0, "LIVE": 1, "PAUSED": 2}
