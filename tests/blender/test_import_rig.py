"""Rigs of [CTL*20]'s prototype come in whole, live and moving as published, or not at all."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import prototype_rig as bar
import pytest
from scene import Rig, fat_key, rest, shown

Array = np.ndarray
ROOT = Path(__file__).parents[2]
SIZE = float(np.linalg.norm(np.ptp(bar.SKIN.vertices, axis=0)))


@pytest.fixture
def skt(tmp_path: Path) -> Path:
    return bar.write_rig(tmp_path)


@pytest.fixture(scope="module")
def arm() -> Path:
    folder = Path(os.environ.get("CAGE_RIG_SHARED") or ROOT.parent / "shared") / "data/arm"
    if not (folder / "arm.skt").is_file():
        pytest.skip("the reference rig is not here; set CAGE_RIG_SHARED to the folder that holds data/arm")
    return folder


def load(path: Path, **options: object) -> tuple[bpy.types.Object, bpy.types.Object, bpy.types.Object]:
    """Import as the artist does; skin, armature and cage."""
    assert bpy.ops.cage_rig.import_rig(filepath=str(path), **options) == {"FINISHED"}
    selected = {obj.type: obj for obj in bpy.context.selected_objects if obj != bpy.context.object}
    return selected["MESH"], selected["ARMATURE"], bpy.context.object


def at(seconds: float, rate: float = 24.0) -> None:
    frame = 1.0 + seconds * rate
    bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)


def datablocks() -> dict[str, list[str]]:
    """Everything that a rig is made of, by name."""
    kinds = ("objects", "meshes", "armatures", "actions", "collections", "shape_keys", "node_groups")
    return {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds}


def test_a_rig_comes_in_live(skt: Path) -> None:
    skin, armature, cage = load(skt)
    assert (skin.name, armature.name, cage.name) == ("bar", "bar Armature", "bar Cage")
    settings = cage.cage_rig
    assert settings.state == "LIVE" and settings.message == ""
    assert settings.coordinates == "skin coordinates, centers of rotation, anchors"
    assert settings.skins[0].object == skin and settings.armature == armature
    assert np.abs(rest(skin) - bar.SKIN.vertices).max() < 1e-7
    assert np.abs(rest(cage) - bar.CAGE.vertices).max() < 1e-7
    assert [(bone.name, bone.parent and bone.parent.name) for bone in armature.data.bones] == [
        ("lower", None),
        ("upper", "lower"),
    ]
    assert np.abs(np.array([bone.head_local for bone in armature.data.bones]) - bar.JOINTS).max() < 1e-7
    assert tuple(armature.data.bones["lower"].tail_local) == (0.0, 0.0, 0.0), "its child's head"
    assert np.abs(np.array(armature.matrix_world)[:3, 1] - [0, 0, 1]).max() < 1e-6, "the files' y is up"
    for obj in (skin, cage):
        assert obj.parent == armature and obj.matrix_world == armature.matrix_world
    assert {collection.name for obj in (skin, armature, cage) for collection in obj.users_collection} == {"bar"}
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (1, 61)


def test_the_animations_are_those_of_the_files(skt: Path) -> None:
    """The skin at every key, the cage at rest and stretched, against loops."""
    skin, _, cage = load(skt)
    for k, seconds in enumerate(bar.SECONDS):
        at(seconds)
        expected = bar.skinned(bar.SKIN.vertices, bar.transforms(k))
        if k == 1:
            cage.data.shape_keys.key_blocks["Cage 1"].mute = True
            assert np.abs(shown(skin) - expected).max() < 1e-5 * SIZE
            cage.data.shape_keys.key_blocks["Cage 1"].mute = False
            at(seconds)
            assert np.abs(shown(cage) - bar.CAGE.vertices * bar.STRETCH).max() < 1e-6
            expected = bar.skinned(bar.SKIN.vertices * bar.STRETCH, stretched(k))
        assert np.abs(shown(skin) - expected).max() < 1e-5 * SIZE
    at(0.5)
    assert np.abs(shown(cage) - bar.CAGE.vertices * (0.5 + 0.5 * bar.STRETCH)).max() < 1e-6, "half way"


def stretched(key: int) -> Array:
    """T of both joints under the stretched cage: the first joint's step is kept, the second stays on the first."""
    moved = bar.transforms(key).copy()
    joints = bar.JOINTS * bar.STRETCH
    moved[0, :3, 3] = bar.ROOTS[key] - bar.JOINTS[0] + joints[0] - moved[0, :3, :3] @ joints[0]
    place = moved[0, :3, :3] @ joints[1] + moved[0, :3, 3]
    moved[1, :3, 3] = place - moved[1, :3, :3] @ joints[1]
    return moved


def test_joints_go_where_the_animation_puts_them_on_request(skt: Path) -> None:
    skin, _, cage = load(skt, keep_steps=True)
    cage.data.shape_keys.key_blocks["Cage 1"].mute = True
    for k, seconds in enumerate(bar.SECONDS):
        at(seconds)
        assert np.abs(shown(skin) - bar.skinned(bar.SKIN.vertices, bar.transforms(k, stray=True))).max() < 1e-5 * SIZE


def test_the_scene_decides_the_frames(skt: Path) -> None:
    scene = bpy.context.scene
    scene.render.fps, scene.frame_end = 10, 77
    skin, armature, cage = load(skt, frame_start=11, every_frame=False, set_frame_range=False)
    assert (scene.frame_start, scene.frame_end) == (1, 77)
    assert tuple(armature.animation_data.action.frame_range) == (11.0, 36.0)
    cage.data.shape_keys.key_blocks["Cage 1"].mute = True
    for k, seconds in enumerate(bar.SECONDS):
        scene.frame_set(int(11 + 10 * seconds))
        assert np.abs(shown(skin) - bar.skinned(bar.SKIN.vertices, bar.transforms(k))).max() < 1e-5 * SIZE


def test_it_may_lie_otherwise_and_unbound(skt: Path) -> None:
    before = datablocks()
    skin, armature, cage = load(skt, up="Z", scale=0.01, bind=False)
    assert cage.cage_rig.state == "NONE" and not any(mod.type == "NODES" for mod in skin.modifiers)
    assert len(bpy.data.objects) == len(before["objects"]) + 3
    world = np.array(armature.matrix_world)
    assert np.abs(world - np.diag([0.01, 0.01, 0.01, 1.0])).max() < 1e-8
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}, "what is to be bound is selected"
    assert cage.cage_rig.state == "LIVE" and cage.cage_rig.coordinates == ""
    at(1.0)
    cage.data.shape_keys.key_blocks["Cage 1"].mute = True
    at(1.0)
    assert np.abs(shown(skin) - bar.skinned(bar.SKIN.vertices, bar.transforms(1))).max() < 1e-5 * SIZE


def test_files_elsewhere_may_be_named(skt: Path, tmp_path: Path) -> None:
    (tmp_path / "bar_cage.obj").rename(tmp_path / "box.obj")
    with pytest.raises(RuntimeError, match=r"no 'bar_cage.obj' beside 'bar.skt'; choose the file of the cage"):
        load(skt)
    _, _, cage = load(skt, cage=str(tmp_path / "box.obj"), use_coordinates=False)
    assert cage.cage_rig.state == "LIVE" and cage.cage_rig.coordinates == ""


def test_two_imports_do_not_meet(skt: Path) -> None:
    first, _, _ = load(skt)
    second, _, cage = load(skt)
    fat_key(Rig([second], second.parent, cage))
    at(1.0)
    assert first.name != second.name
    assert np.abs(shown(first) - shown(second)).max() > 0.05


def opened(lines: list[str]) -> list[str]:
    """Without its last face."""
    return lines[:-1]


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("bar.skw", lambda lines: [*lines, "oops"], r"bar.skw, line \d+: expected 'joint vertex weight', found 'oops'"),
        ("bar_corWeights.txt", lambda lines: lines[1:], r"bar_corWeights.txt: the weights of vertex 0 sum to"),
        (
            "bar_cage.obj",
            opened,
            r"The files of 'bar' are read, but: 'bar Cage' can't be bound: the cage is open: edge",
        ),
        ("bar_cage.obj", lambda lines: [*lines[:2], "v 0 0 0", *lines[3:]], r"cage_coords put vertex \d+ of 'bar' 0"),
    ],
)
def test_a_rig_that_can_t_come_in_leaves_nothing(skt: Path, name: str, change: object, message: str) -> None:
    bar.edit(skt.parent / name, change)
    before, active = datablocks(), bpy.context.view_layer.objects.active
    with pytest.raises(RuntimeError, match=message):
        load(skt)
    assert datablocks() == before
    assert bpy.context.view_layer.objects.active == active and bpy.context.mode == "OBJECT"


def test_a_cage_that_can_t_be_bound_can_still_be_looked_at(skt: Path) -> None:
    bar.edit(skt.parent / "bar_cage.obj", opened)
    _, _, cage = load(skt, bind=False)
    assert cage.cage_rig.state == "NONE"


def test_an_import_is_one_step_to_undo(skt: Path) -> None:
    bpy.ops.ed.undo_push(message="before")
    load(skt)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert "bar Cage" not in bpy.data.objects


def test_the_menu_and_a_dropped_file_import() -> None:
    handler = bpy.types.FileHandler.bl_rna_get_subclass_py("CAGE_RIG_FH_prototype")
    assert handler.bl_import_operator == "cage_rig.import_rig" and handler.bl_file_extensions == ".skt"
    drawn = [draw.__name__ for draw in bpy.types.TOPBAR_MT_file_import._dyn_ui_initialize()]
    assert "_import_menu" in drawn


@pytest.mark.parametrize("method", ["LBS", "DQS", "COR"])
def test_the_published_arm_moves_as_in_its_reference(arm: Path, method: str) -> None:
    """Skin and posed cage at eight times, each at and between keys, from centers and anchors of the files."""
    skin, _, cage = load(arm)
    assert cage.cage_rig.coordinates == "centers of rotation, anchors"
    cage.data.shape_keys.key_blocks["Cage 1"].mute = True  # the reference rests its cage
    cage.cage_rig.method = method
    poses = np.load(arm / "poses.npz")
    size = np.linalg.norm(np.ptp(poses["M"][0], axis=0))
    for k, seconds in enumerate(poses["t"]):
        at(seconds)
        assert np.abs(shown(skin) - poses[f"Mp_{method.lower()}"][k]).max() < 1e-6 * size
        assert np.abs(shown(cage.cage_rig.posed_cage) - poses["Cp_lbs"][k]).max() < 1e-6 * size


def test_the_published_arm_is_edited_by_its_cage_animation(arm: Path) -> None:
    """The edited cage under the moving skeleton, against Φ and Ψ of the reference, in loops."""
    from bl_ext.user_default.cage_rig import exchange

    skin, _, cage = load(arm)
    inputs, bind, poses, extra = (dict(np.load(arm / f"{n}.npz")) for n in ("inputs", "bind", "poses", "extra"))
    exchange.use_coordinates(cage, cage_coords=bind["Phi"], joint_coords=extra["Psi_converged"])
    size = np.linalg.norm(np.ptp(inputs["V"], axis=0))
    for k, share in ((1, 1.0), (0, 0.0)):
        seconds, offset = poses["t"][k], share * inputs["cage_key_offset"][1]
        at(seconds)
        joints = inputs["joints"] + extra["Psi_converged"] @ offset
        moved = poses["T_skin"][k].copy()
        for j, parent in enumerate(inputs["parents"]):
            if parent >= 0:
                place = moved[parent, :3, :3] @ joints[j] + moved[parent, :3, 3]
            else:
                place = joints[j] + poses["T_global_current"][k, j, :3, 3] - inputs["joints"][j]
            moved[j, :3, 3] = place - moved[j, :3, :3] @ joints[j]
        points = inputs["V"] + bind["Phi"] @ offset
        each = np.einsum("jab,ib->jia", moved[:, :3, :3], points) + moved[:, None, :3, 3]
        assert np.abs(shown(skin) - np.einsum("ij,jia->ia", inputs["Omega"], each)).max() < 1e-6 * size


@pytest.fixture
def text_rig(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "demo"))
    from showcase import text_rig

    yield text_rig
    for name in [name for name in sys.modules if name.split(".")[0] == "showcase"]:
        del sys.modules[name]


def test_the_demo_takes_such_a_rig(text_rig: ModuleType, skt: Path) -> None:
    objects, frame, edit = text_rig.load_text_rig(skt)
    assert objects.cage.cage_rig.state == "NONE" and edit == "Cage 1" and frame == 31
    assert objects.skins[0].data.materials[0].name == "Clay"
    (skt.parent / "bar.skw").unlink()
    with pytest.raises(ValueError, match=r"no 'bar.skw' beside 'bar.skt'"):
        text_rig.load_text_rig(skt)
