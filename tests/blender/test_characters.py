"""Real rigs: every rigged glTF character that lies beside the project binds, plays and shows what Blender shows.

Two of them as FBX too, by either importer of Blender. The largest takes long and runs only where
CAGE_RIG_LARGE_CHARACTERS is set.
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import addon_utils
import bpy
import numpy as np
import pytest
import truth
from mathutils import Quaternion
from scene import Rig, bind, fat_key, rest, select, set_mesh, shown, update

from blend_fixtures import uncaged
from blend_fixtures.build import RigObjects, add_cage

ROOT = Path(__file__).parents[2]
LARGE = 2_000_000  # bytes
LARGE_ASKED = "CAGE_RIG_LARGE_CHARACTERS"


def rigged(path: Path) -> bool:
    """Whether the file carries a skeleton: the JSON of a .glb is its first chunk."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    return bool(json.loads(data[20 : 20 + length]).get("skins"))


def characters() -> list[object]:
    found = [path for path in sorted(uncaged.FOLDER.glob("*.glb")) if rigged(path)]
    if not found:
        return [pytest.param(None, marks=pytest.mark.skip(reason=f"no rigged characters in {uncaged.FOLDER}"))]
    large = pytest.mark.skipif(LARGE_ASKED not in os.environ, reason=f"large; set {LARGE_ASKED} to run it")
    return [pytest.param(path, id=path.stem, marks=large if path.stat().st_size > LARGE else ()) for path in found]


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """The demo's way to make a cage for a character that has none."""
    monkeypatch.syspath_prepend(str(ROOT / "demo"))
    from showcase.coarse_hull import coarse_hull

    yield lambda path, importer="gltf": with_hull(*imported(path, importer), coarse_hull)
    for name in [name for name in sys.modules if name.split(".")[0] == "showcase"]:
        del sys.modules[name]


def imported(path: Path, importer: str = "gltf") -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """Armature and skins as an importer of Blender makes them, vertices welded."""
    if importer == "gltf":
        bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=True)
    elif importer == "import_scene.fbx":
        addon_utils.enable("io_scene_fbx")
        bpy.ops.import_scene.fbx(filepath=str(path))
    else:
        bpy.ops.wm.fbx_import(filepath=str(path))
    armature = next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    skins = [obj for obj in bpy.data.objects if any(mod.type == "ARMATURE" for mod in obj.modifiers)]
    for skin in skins:
        skin.modifiers[0].name = "Armature"
    return armature, skins


def with_hull(armature: bpy.types.Object, skins: list[bpy.types.Object], coarse_hull: object) -> RigObjects:
    armature.data.pose_position = "REST"
    update()
    points, triangles, start = [], [], 0
    for skin in skins:
        world = np.array(skin.matrix_world)
        points.append(rest(skin) @ world[:3, :3].T + world[:3, 3])
        skin.data.calc_loop_triangles()
        triangles.append(np.array([t.vertices for t in skin.data.loop_triangles]) + start)
        start += len(points[-1])
    armature.data.pose_position = "POSE"
    return RigObjects(skins, armature, add_cage("Hull", coarse_hull(np.concatenate(points), np.concatenate(triangles))))


def frames_of(armature: bpy.types.Object) -> list[int]:
    """Frames of its own action, or of one made here that turns every bone a little."""
    data = armature.animation_data
    if data is None or data.action is None:
        curl(armature)
    first, last = (round(float(frame)) for frame in armature.animation_data.action.frame_range)
    return np.linspace(first, last, 4).round().astype(int).tolist()


def curl(armature: bpy.types.Object) -> None:
    for k, bone in enumerate(armature.pose.bones):
        bone.rotation_mode = "QUATERNION"
        for frame, share in ((1, 0.0), (10, 1.0), (20, -0.5)):
            axis = (1.0, 0.3 * (k % 3), 0.2 * (k % 5))
            bone.rotation_quaternion = Quaternion(axis, 0.12 * share)
            bone.keyframe_insert("rotation_quaternion", frame=frame)


def assert_plays(rig: Rig, frames: list[int]) -> None:
    moved = 0.0
    for frame in [frames[1], frames[-1], frames[2], frames[0]]:
        bpy.context.scene.frame_set(frame)
        assert truth.worst_against_blender(rig) < 1e-5, f"frame {frame}"
        moved = max(moved, truth.motion(rig))
    assert moved > 0.05


def assert_edits(rig: Rig, frame: int) -> None:
    """Fatten the rest cage and drag the posed cage at `frame`."""
    bpy.context.scene.frame_set(frame)
    thin = shown(rig.skin).copy()
    fat_key(rig, 1.1, value=0.5)
    assert all(np.isfinite(shown(skin)).all() for skin in rig.skins)
    assert np.abs(shown(rig.skin) - thin).max() > 1e-2 * rig.size
    size = float(np.linalg.norm(np.ptp(rest(rig.posed), axis=0)))
    wanted = rest(rig.posed)
    wanted[len(wanted) // 2] += np.float32([0.01, -0.01, 0.01]) * np.float32(size)
    set_mesh(rig.posed, wanted)
    assert rig.settings.message == "" and rig.settings.state == "LIVE", rig.settings.message
    assert np.abs(rest(rig.posed) - wanted).max() < 1e-5 * size
    assert all(np.isfinite(shown(skin)).all() for skin in rig.skins)


@pytest.mark.parametrize("path", characters())
def test_a_real_character_binds_plays_and_takes_edits(path: Path, load: object) -> None:
    rig = bind(load(path))
    assert rig.settings.state == "LIVE", rig.settings.message
    frames = frames_of(rig.armature)
    assert_plays(rig, frames)
    assert_edits(rig, frames[1])


def as_fbx(path: Path, folder: Path) -> Path:
    """The character, with a motion, through Blender's FBX exporter; an empty file is open after."""
    addon_utils.enable("io_scene_fbx")
    armature, skins = imported(path)
    frames_of(armature)
    select([armature, *skins], armature)
    file = folder / f"{path.stem}.fbx"
    bpy.ops.export_scene.fbx(filepath=str(file), use_selection=True, bake_anim_use_nla_strips=False)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return file


@pytest.mark.parametrize("importer", ["import_scene.fbx", "wm.fbx_import"])
@pytest.mark.parametrize("name", ["fox_576_24b", "human_2k_53b"])
def test_a_real_character_comes_through_fbx(name: str, importer: str, load: object, tmp_path: Path) -> None:
    path = uncaged.FOLDER / f"{name}.glb"
    if not path.is_file():
        pytest.skip(f"{path.name} is not in {uncaged.FOLDER}")
    if importer.startswith("wm") and bpy.app.version < (4, 5):
        pytest.skip("Blender has that importer from 4.5 on")
    rig = bind(load(as_fbx(path, tmp_path), importer))
    assert rig.settings.state == "LIVE", rig.settings.message
    frames = frames_of(rig.armature)
    assert_plays(rig, frames)
    assert_edits(rig, frames[1])
