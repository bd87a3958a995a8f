"""`fit-cage`: a rough cage drawn around its character from the command line, in a file of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from rough import box, decimated
from scene import select, update

from blend_fixtures.build import build_character
from blend_fixtures.small import capsule

Main = Callable[..., tuple[int, dict]]


def points_of(cage: bpy.types.Object) -> np.ndarray:
    found = np.empty((len(cage.data.vertices), 3), np.float32)
    cage.data.vertices.foreach_get("co", found.ravel())
    return found


@pytest.fixture
def hero(tmp_path: Path) -> Path:
    """A round bar with two bones, and a decimated copy of it, which crosses it."""
    objects = build_character(capsule())
    bpy.data.meshes.remove(objects.cage.data)  # and its object
    decimated(objects.skins[0], 120)
    path = tmp_path / "hero.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_file_that_is_written_has_a_fitted_cage_that_binds(main: Main, hero: Path, tmp_path: Path) -> None:
    before, rough = hero.read_bytes(), points_of(bpy.data.objects["Rough"])
    out = tmp_path / "fitted.blend"
    code, answer = main("fit-cage", hero, "--cage", "Rough", "--out", out)
    assert code == 0 and (answer["armature"], answer["skins"]) == ("CapsuleRig", ["Capsule"])
    assert hero.read_bytes() == before and answer["vertices"] == len(rough)
    assert answer["summary"].startswith(f"'Rough' was fitted: {len(rough)} vertices, 120 faces")
    bpy.ops.wm.open_mainfile(filepath=str(out))
    objects = bpy.data.objects
    assert np.abs(points_of(objects["Rough"]) - rough).max() > 1e-3
    select([objects["Capsule"], objects["CapsuleRig"], objects["Rough"]], objects["Rough"])
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    update()
    assert objects["Rough"].cage_rig.state == "LIVE", objects["Rough"].cage_rig.message


def test_it_equals_what_the_script_makes(main: Main, hero: Path, tmp_path: Path) -> None:
    import bl_ext.user_default.cage_rig.caging as caging

    objects, options = bpy.data.objects, caging.Options(clearance=0.01, tightness=0.0, symmetry=False)
    given = [objects["Capsule"]], objects["CapsuleRig"]
    wanted = points_of(caging.fit_cage(bpy.context, objects["Rough"], *given, options))
    out = tmp_path / "fitted.blend"
    close = ("--clearance", "0.01", "--tightness", "0", "--asymmetric")
    assert main("fit-cage", hero, "--cage", "Rough", "--out", out, *close)[0] == 0
    bpy.ops.wm.open_mainfile(filepath=str(out))
    np.testing.assert_array_equal(points_of(bpy.data.objects["Rough"]), wanted)


def test_a_mesh_without_bones_is_enclosed_along_its_own_skeleton(main: Main, hero: Path, tmp_path: Path) -> None:
    bpy.data.objects.remove(bpy.data.objects["CapsuleRig"])
    bpy.data.objects["Capsule"].modifiers.clear()
    bpy.data.objects.remove(bpy.data.objects["Rough"])
    box((-0.9, -0.2, -0.2), (0.9, 0.2, 0.2))
    bare = tmp_path / "bare.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(bare))
    code, answer = main("fit-cage", bare, "--cage", "Rough", "--out", tmp_path / "fitted.blend")
    assert code == 0 and answer["armature"] is None and answer["skins"] == ["Capsule"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["{dir}/none.blend", "--cage", "Rough", "--out", "{dir}/new.blend"], "there is no file"),
        (["{hero}", "--cage", "Rough", "--out", "{hero}"], "is the file that is read; write to another one"),
        (["{hero}", "--cage", "Cage", "--out", "{dir}/new.blend"], "there is no mesh 'Cage' in scene 'Scene'"),
        (["{hero}", "--cage", "Capsule", "--skin", "Capsule", "--out", "{dir}/new.blend"], "around itself; name the"),
        (["{hero}", "--cage", "Capsule", "--skin", "Rough", "--out", "{dir}/new.blend"], "has more vertices than the"),
        (["{hero}", "--cage", "Rough", "--out", "{dir}/new.blend", "--clearance", "nan"], "clearance"),
        (["{hero}", "--out", "{dir}/new.blend"], "required: --cage"),
        (["{hero}", "--cage", "Rough"], "required: --out"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(
    main: Main, hero: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], sentence: str
) -> None:
    before = sorted(tmp_path.rglob("*"))
    code, answer = main("fit-cage", *(text.format(dir=tmp_path, hero=hero) for text in arguments))
    assert code == 2 and answer == {} and sentence in capfd.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before
