"""`generate-cage`: a cage from the command line, in a file of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from scene import select, update

from blend_fixtures.build import build_character
from blend_fixtures.small import capsule

Main = Callable[..., tuple[int, dict]]


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def add_capsule() -> None:
    """A round bar with two bones, and no cage."""
    mesh = build_character(capsule()).cage.data
    bpy.data.meshes.remove(mesh)  # and its object


@pytest.fixture
def hero(tmp_path: Path) -> Path:
    add_capsule()
    return save(tmp_path / "hero.blend")


def test_the_file_that_is_written_has_a_cage_that_binds(main: Main, hero: Path, tmp_path: Path) -> None:
    before = hero.read_bytes()
    code, answer = main("generate-cage", hero, "--out", tmp_path / "caged.blend", "--placement", "joints")
    assert code == 0 and (answer["armature"], answer["skins"]) == ("CapsuleRig", ["Capsule"])
    assert hero.read_bytes() == before
    assert sorted(path.name for path in tmp_path.glob("*.blend*")) == ["caged.blend", "hero.blend"]
    bpy.ops.wm.open_mainfile(filepath=answer["out"])
    objects = bpy.data.objects
    cage = objects[answer["cage"]]
    assert len(cage.data.vertices) == answer["vertices"] and answer["quads"] + answer["triangles"] > 0
    assert len(cage.data.polygons) == answer["quads"] + answer["triangles"] and answer["sections"] >= 3
    assert answer["summary"].startswith(f"'{cage.name}': {answer['vertices']} vertices in {answer['sections']} cross")
    select([objects["Capsule"], objects["CapsuleRig"], cage], cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    update()
    assert cage.cage_rig.state == "LIVE", cage.cage_rig.message


def test_options_say_how_it_is_made(main: Main, hero: Path, tmp_path: Path) -> None:
    out = tmp_path / "caged.blend"
    given = ["generate-cage", hero, "--out", out, "--placement", "joints"]
    code, answer = main(*given, "--triangles", "--corners", "6", "--clearance", "0.01")
    assert code == 0 and answer["quads"] == 0
    bpy.ops.wm.open_mainfile(filepath=str(out))
    kept = bpy.data.objects[answer["cage"]].cage_rig_generated
    assert (kept.corners, kept.triangles, kept.symmetry, kept.hull) == (6, True, True, False)
    assert kept.clearance == pytest.approx(0.01)


def test_a_cage_of_the_file_can_be_what_it_is_like(
    main: Main, hero: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    _, first = main("generate-cage", hero, "--out", tmp_path / "caged.blend", "--placement", "joints", "--corners", "6")
    bpy.ops.wm.open_mainfile(filepath=first["out"])
    model = bpy.data.objects[first["cage"]]
    faces = [tuple(face.vertices) for face in model.data.polygons]
    twice = save(tmp_path / "twice.blend")
    given = ("generate-cage", twice, "--out", tmp_path / "like.blend", "--like")
    code, answer = main(*given, model.name)
    assert code == 0 and f"with the faces of '{first['cage']}'" in answer["summary"]
    bpy.ops.wm.open_mainfile(filepath=answer["out"])
    cage = bpy.data.objects[answer["cage"]]
    assert cage.name != first["cage"]
    assert [tuple(face.vertices) for face in cage.data.polygons] == faces
    code, _ = main(*given, "Capsule")
    assert code == 2 and "is no cage that Generate Cage made" in capfd.readouterr().err
    code, _ = main(*given, first["cage"], "--corners", "4")
    assert code == 2 and "has 6 corners in a cross section, not 4; set Corners to 6" in capfd.readouterr().err


def test_it_equals_what_the_script_makes(main: Main, hero: Path, tmp_path: Path) -> None:
    import bl_ext.user_default.cage_rig.caging as caging

    objects = bpy.data.objects
    options = caging.Options(placement="JOINTS")
    cage = caging.generate_cage(bpy.context, [objects["Capsule"]], objects["CapsuleRig"], options)
    wanted = [tuple(vertex.co) for vertex in cage.data.vertices]
    out = tmp_path / "caged.blend"
    code, answer = main("generate-cage", hero, "--out", out, "--placement", "joints")
    assert code == 0
    bpy.ops.wm.open_mainfile(filepath=str(out))
    assert [tuple(vertex.co) for vertex in bpy.data.objects[answer["cage"]].data.vertices] == wanted


def test_a_file_saved_in_pose_mode_and_bent_is_caged_at_rest(main: Main, hero: Path, tmp_path: Path) -> None:
    given = ("--placement", "joints", "--out")
    _, straight = main("generate-cage", hero, *given, tmp_path / "straight.blend")
    bpy.ops.wm.open_mainfile(filepath=str(hero))
    armature = bpy.data.objects["CapsuleRig"]
    select([armature], armature)
    bpy.ops.object.mode_set(mode="POSE")
    armature.pose.bones["upper"].rotation_mode = "XYZ"
    armature.pose.bones["upper"].rotation_euler.z = 1.0
    code, bent = main("generate-cage", save(tmp_path / "posed.blend"), *given, tmp_path / "bent.blend")
    assert code == 0 and bent["summary"] == straight["summary"]


def test_a_mesh_without_bones_is_caged_along_its_own_skeleton(main: Main, tmp_path: Path) -> None:
    add_capsule()
    bpy.data.objects.remove(bpy.data.objects["CapsuleRig"])
    bpy.data.objects["Capsule"].modifiers.clear()
    code, answer = main("generate-cage", save(tmp_path / "bare.blend"), "--out", tmp_path / "caged.blend")
    assert code == 0 and answer["armature"] is None and answer["vertices"] > 0


def test_of_several_characters_one_is_chosen(main: Main, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    add_capsule()
    add_capsule()
    both, out = save(tmp_path / "both.blend"), tmp_path / "caged.blend"
    code, _ = main("generate-cage", both, "--out", out)
    assert code == 2 and "several armatures: 'CapsuleRig', 'CapsuleRig.001'; choose one" in capfd.readouterr().err
    code, answer = main("generate-cage", both, "--out", out, "--armature", "CapsuleRig.001", "--placement", "joints")
    assert code == 0 and (answer["armature"], answer["skins"]) == ("CapsuleRig.001", ["Capsule.001"])
    code, answer = main("generate-cage", both, "--out", out, "--skin", "Capsule", "--placement", "joints")
    assert code == 0 and (answer["armature"], answer["skins"]) == ("CapsuleRig", ["Capsule"])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["{dir}/none.blend", "--out", "{dir}/new.blend"], "there is no file"),
        (["{hero}", "--out", "{hero}"], "is the file that is read; write to another one"),
        (["{hero}", "--out", "{dir}/new.obj"], "is no name of a .blend; let it end in .blend"),
        (["{hero}", "--out", "{dir}/no/new.blend"], "can't be written to: No such file or directory"),
        (["{hero}", "--out", "{dir}/new.blend", "--skin", "Body"], "there is no mesh 'Body' in scene 'Scene'"),
        (["{hero}", "--out", "{dir}/new.blend", "--armature", "Capsule"], "there is no armature 'Capsule'"),
        (["{empty}", "--out", "{dir}/new.blend"], "no skin is known in"),
        (["{hero}", "--out", "{dir}/new.blend", "--corners", "2"], "corners"),
        (["{hero}", "--out", "{dir}/new.blend", "--clearance", "nan"], "clearance"),
        (["{open}", "--out", "{dir}/new.blend"], "'Capsule' can't be caged: "),
        (["{hero}"], "required: --out"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(
    main: Main, hero: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], sentence: str
) -> None:
    skin = bpy.data.objects["Capsule"]
    select([skin], skin)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    for face in list(skin.data.polygons)[:30]:
        face.select = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="FACE")
    bpy.ops.object.mode_set(mode="OBJECT")
    opened = save(tmp_path / "open.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    names = {"dir": tmp_path, "hero": hero, "open": opened, "empty": save(tmp_path / "empty.blend")}
    before = sorted(tmp_path.rglob("*"))
    code, answer = main("generate-cage", *(text.format(**names) for text in arguments))
    assert code == 2 and answer == {} and sentence in capfd.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


def test_progress_is_told(
    headless: ModuleType, hero: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(headless.generate.caging.Job, "wait", lambda job, _seconds: job._job.wait(0.01))
    assert headless.main(["generate-cage", str(hero), "--out", str(tmp_path / "new.blend")]) == 0
    assert "cage_rig: generating, " in capfd.readouterr().err
