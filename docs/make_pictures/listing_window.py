"""Screenshots of the whole window for the extension site. Started by make_pictures.py."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

ROOT = Path(__file__).parent.parent.parent
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests/window"), str(ROOT)]
import driver
import stage
from stage import LOOK

from blend_fixtures import punch
from blend_fixtures.biped import biped
from blend_fixtures.biped_cage import biped_loops
from blend_fixtures.build import RigObjects, build_biped, build_character

Acts = Iterator[float | None]
SCALE = 1.35  # of the interface: the site shows the pictures smaller than they are
NEAR = 1.2  # the eye's distance, in sizes of the character where the view is a square
CAGE = (0.35, 0.75, 1.0, 1.0)  # the colour of its wires, where Blender's black would be lost on grey
WAVE = {"upper_arm.L": (0.75, 0.15, 0.65), "forearm.L": (-0.15, -0.1, 1.0)}  # where these bones point


def pose() -> Acts:
    """Bones are posed; the cage goes along."""
    rig = start(lambda: build_biped(walk=False), frame=1)
    stage.hide(rig.cage, rig.cage.cage_rig.refit_armature)
    stage.mode(rig.armature, "POSE")
    bones = rig.armature.pose.bones
    for name in WAVE:
        for frame in (1, 24):
            bones[name].keyframe_insert("rotation_quaternion", frame=frame)
    for name, direction in WAVE.items():
        point(bones[name], Vector(direction))
        bones[name].keyframe_insert("rotation_quaternion", frame=10)
    bpy.context.scene.frame_set(11)
    rig.armature.data.bones.active = rig.armature.data.bones["forearm.L"]
    for bone in bones:
        bone.select = bone.name == "forearm.L"
    area, region = driver.view()
    area.spaces.active.show_gizmo = True
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.wm.tool_set_by_id(name="builtin.rotate")
    yield from below("TIMELINE", 0.11)
    yield from framed(rig, turn=20.0, above=6.0)
    stage.picture("window_pose")
    area.spaces.active.show_gizmo = False
    bpy.ops.object.mode_set(mode="OBJECT")


def point(bone: bpy.types.PoseBone, direction: Vector) -> None:
    """Turn the bone until it points that way, in its armature's space."""
    turn = bone.vector.rotation_difference(direction).to_matrix().to_4x4()
    head = Matrix.Translation(bone.head)
    bone.matrix = head @ turn @ head.inverted() @ bone.matrix
    bpy.context.view_layer.update()


def key() -> Acts:
    """The fist is enlarged where it strikes, in the middle of the action; its key is in the dope sheet."""
    rig = start(boxer, frame=7)
    cage, scene = rig.cage, bpy.context.scene
    posed = cage.cage_rig.posed_cage
    stage.hide(rig.armature, cage.cage_rig.refit_armature)
    for frame, operator in ((7, "key_envelope"), (punch.STRIKE, "key_cage"), (21, "key_envelope")):
        scene.frame_set(frame)
        if operator == "key_cage":
            posed.data.vertices.foreach_set("co", stretched_arm(stage.points(posed)).ravel())
            posed.data.update()
            bpy.context.view_layer.update()
        stage.only(cage)
        getattr(bpy.ops.cage_rig, operator)()
        yield 0.3
    collection = bpy.data.collections.new("Cage")  # so that the sheet can show it alone
    scene.collection.children.link(collection)
    collection.objects.link(cage)
    yield from below("DOPESHEET", 0.27, only=collection)
    scene.frame_set(punch.STRIKE)
    cage.hide_set(True)
    stage.mode(posed, "EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    for number in arm_loops("knuckles", "tips"):
        posed.data.vertices[number].select = True
    bpy.ops.object.mode_set(mode="EDIT")
    yield from framed(rig, turn=38.0, above=8.0, near=1.02)
    stage.picture("window_key")
    bpy.ops.object.mode_set(mode="OBJECT")


def generate() -> Acts:
    """Cross sections of the cage to come, while its nodes are edited."""
    rig = start(build_biped, bind=False, frame=1)
    bpy.data.objects.remove(rig.cage)
    rig.armature.data.pose_position = "REST"
    stage.only(*rig.skins, rig.armature)
    yield from below("TIMELINE", 0.11)
    yield from framed(rig, turn=20.0, above=4.0)
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.generate_cage("INVOKE_DEFAULT")
    yield LOOK
    driver.key("J", at=driver.centre())
    yield LOOK
    bone = rig.armature.data.bones["thigh.L"]
    driver.move(driver.on_screen(bone.head_local.lerp(bone.tail_local, 0.55)))
    yield LOOK
    stage.picture("window_generate")
    driver.key("ESC")
    yield LOOK


def weights() -> Acts:
    """What a vertex of the cage moves, as colours on the skin."""
    rig = start(build_biped, frame=8)
    posed = rig.cage.cage_rig.posed_cage
    stage.hide(rig.armature, rig.cage, rig.cage.cage_rig.refit_armature)
    stage.mode(posed, "EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    stage.overlays("weights")
    stage.open_panels("overlays")
    yield from below("TIMELINE", 0.11)
    yield from framed(rig, turn=24.0, above=6.0)
    points = stage.points(posed)
    belly = 0.42 * points[:, 2].max()
    vertex = int(np.argmin(points[:, 1] + 3.0 * np.abs(points[:, 0] - 0.05) + 3.0 * np.abs(points[:, 2] - belly)))
    driver.click(driver.on_screen(posed.matrix_world @ posed.data.vertices[vertex].co))
    yield LOOK
    driver.move(driver.centre())
    yield LOOK
    stage.picture("window_weights")
    bpy.ops.object.mode_set(mode="OBJECT")
    stage.overlays()


def boxer() -> RigObjects:
    """The biped with its punch."""
    rig = build_character(biped())
    punch.add_punch(rig.armature)
    return rig


def arm_loops(*names: str) -> list[int]:
    """Vertices of these loops of the cage's right arm."""
    return sorted({v for name in names for v in biped_loops()[f"{name}.R"]})


def stretched_arm(points: np.ndarray) -> np.ndarray:
    """The fist much larger, and farther away along the forearm."""
    changed = points.copy()
    along = points[arm_loops("wrist")].mean(axis=0) - points[arm_loops("forearm")].mean(axis=0)
    along /= np.linalg.norm(along)
    for names, factor, reach in ((["forearm"], 1.15, 0.05), (["wrist"], 1.6, 0.13), (["knuckles", "tips"], 2.4, 0.2)):
        loop = arm_loops(*names)
        middle = points[loop].mean(axis=0)
        changed[loop] = middle + factor * (points[loop] - middle) + reach * along
    return changed


def start(build: Callable[[], RigObjects], *, bind: bool = True, frame: int) -> RigObjects:
    rig = stage.start(build, bind=bind, frame=frame)
    bpy.context.scene.frame_end = 24
    area, _ = driver.view()
    area.spaces.active.show_region_toolbar = area.spaces.active.show_region_tool_header = False
    area.spaces.active.shading.wireframe_color_type = "OBJECT"
    if bind:
        rig.cage.cage_rig.posed_cage.color = CAGE
    stage.open_panels()
    return rig


def framed(rig: RigObjects, *, turn: float, above: float, near: float = NEAR) -> Acts:
    """The character fills the view, seen in perspective; our tab in front."""
    area, _ = driver.view()
    view = area.spaces.active.region_3d
    stage.turn(turn, above)
    view.view_perspective, area.spaces.active.lens = "PERSP", 85.0
    yield LOOK
    driver.show_tab()
    low, high = extent(rig)
    view.view_location = 0.5 * (low + high)
    region = driver.view()[1]
    view.view_distance = near * float(np.linalg.norm(high - low)) * region.width / region.height
    yield LOOK


def extent(rig: RigObjects) -> tuple[np.ndarray, np.ndarray]:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    places = []
    for skin in rig.skins:
        shown = skin.evaluated_get(depsgraph)
        places += [shown.matrix_world @ vertex.co for vertex in shown.data.vertices]
    return np.min(places, axis=0), np.max(places, axis=0)


def below(kind: str, share: float, only: bpy.types.Collection | None = None) -> Acts:
    """The window is a 3D View and, below it, a dope sheet or time line of this share of the height."""
    area, region = driver.view()
    for other in [other for other in driver.window().screen.areas if other != area]:
        with bpy.context.temp_override(window=driver.window(), area=other, region=other.regions[0]):
            bpy.ops.screen.area_close()
        yield LOOK
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=share)
    yield LOOK
    low = min(driver.window().screen.areas, key=lambda found: found.y)
    low.ui_type = kind
    yield LOOK
    space = low.spaces.active
    space.show_region_ui = False
    if only is not None:
        sheet = space.dopesheet
        sheet.show_only_selected, sheet.show_hidden, sheet.filter_collection = False, True, only
    yield LOOK
    region = next(region for region in low.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=driver.window(), area=low, region=region):
        if only is not None:
            bpy.ops.anim.channels_expand(all=True)
            bpy.ops.action.select_all(action="DESELECT")
        bpy.ops.action.view_all()
    yield LOOK


ACTS = {act.__name__: act for act in (pose, key, generate, weights)}


def all_acts() -> Acts:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    bpy.context.preferences.view.ui_scale = SCALE
    bpy.context.preferences.view.gizmo_size = 60
    yield LOOK
    wanted = [name for name in os.environ.get("CAGE_RIG_PICTURES", "").split(",") if name]
    for name in wanted or ACTS:
        yield from ACTS[name]()


driver.perform(all_acts())
