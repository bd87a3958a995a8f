"""The pictures of the manual, taken in a Blender window. Started by make_pictures.py."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).parent.parent.parent
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests/window"), str(ROOT)]
import driver
import gallery
import stage
from stage import LOOK

from blend_fixtures.build import add_mesh, add_shape_key, build_arm, build_character
from blend_fixtures.corrections import BULGE, driven_biceps
from blend_fixtures.doll import doll

Acts = Iterator[float | None]


def bind() -> Acts:
    """Everything selected, the panel's button; then bound, with cages and refit bones."""
    rig = stage.start(bind=False)
    rig.armature.data.pose_position = "REST"
    stage.open_panels()
    stage.only(*rig.all, active=rig.cage)
    yield from settle()
    box = stage.joined(stage.around([rig.cage]), top_of_sidebar(330))
    stage.picture("select", box)
    bpy.ops.cage_rig.bind()
    rig.armature.data.pose_position = "POSE"
    stage.only(rig.cage.cage_rig.posed_cage)
    stage.hide(rig.cage)
    yield from settle()
    stage.picture("bound", box)


def panels() -> Acts:
    """The panel: live, opened, paused, with keys."""
    rig = stage.start()
    stage.only(rig.cage)
    stage.open_panels()
    yield from settle()
    stage.picture("panel", stage.sidebar(), trim=True)
    stage.open_panels("parts", "skins", "rig")
    yield from settle()
    stage.picture("panel_open", stage.sidebar(), trim=True)
    stage.open_panels("bake")
    yield from settle()
    stage.picture("panel_bake", stage.sidebar(), trim=True)
    stage.overlays("weights", "joints")
    stage.open_panels("overlays")
    yield from settle()
    stage.picture("panel_overlays", stage.sidebar(), trim=True)
    stage.overlays()
    rig.skins[0].modifiers.remove(rig.skins[0].modifiers["Cage Rig"])
    stage.open_panels()
    yield from settle()
    stage.picture("panel_paused", stage.sidebar(), trim=True)


def drag() -> Acts:
    """A vertex of the posed cage in Edit Mode is dragged with proportional editing."""
    rig = stage.start()
    posed = rig.cage.cage_rig.posed_cage
    stage.hide(rig.armature, rig.cage, rig.cage.cage_rig.refit_armature)
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.view3d.view_axis(type="LEFT")
    tools = bpy.context.scene.tool_settings
    tools.use_proportional_edit, tools.proportional_size = True, 0.35
    stage.mode(posed, "EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    yield from settle()
    points = stage.points(posed)
    belly = 0.42 * points[:, 2].max()
    vertex = int(np.argmin(points[:, 1] + 3.0 * np.abs(points[:, 2] - belly) + 100.0 * (np.abs(points[:, 0]) > 0.2)))
    place = driver.on_screen(posed.matrix_world @ posed.data.vertices[vertex].co)
    driver.click(place)
    yield LOOK
    box = stage.around([posed], 60)
    stage.picture("drag_before", box)
    driver.key("G", at=place)
    for step in range(1, 13):
        driver.move((place[0] + 6 * step, place[1]))
        yield 0.25
    yield LOOK
    stage.picture("drag", box, side_by_side=["drag_before"])
    driver.click((place[0] + 72, place[1]))
    yield LOOK
    tools.use_proportional_edit = False


def keys() -> Acts:
    """Cage keys in the panel and in the dope sheet."""
    rig = stage.start(frame=1)
    scene, cage = bpy.context.scene, rig.cage
    stage.hide(rig.armature, cage.cage_rig.refit_armature)
    posed = cage.cage_rig.posed_cage
    for frame, factor in ((1, 1.0), (16, 1.3), (32, 0.85), (48, 1.0)):
        scene.frame_set(frame)
        widen(posed, factor)
        stage.only(cage)
        bpy.ops.cage_rig.key_cage()
        yield 0.3
    scene.frame_set(24)
    widen(posed, 1.15)
    stage.only(cage)
    stage.open_panels()
    yield from settle()
    stage.picture("panel_unkeyed", stage.sidebar(), trim=True)
    bpy.ops.cage_rig.discard_edit()
    scene.frame_set(16)
    yield from dope_sheet(cage)


def widen(posed: bpy.types.Object, factor: float) -> None:
    """Edit the posed cage's trunk as a script does."""
    if factor == 1.0:
        return
    points = stage.points(posed)
    trunk = np.abs(points[:, 0]) < 0.3
    points[trunk, :2] *= factor
    posed.data.vertices.foreach_set("co", points.ravel())
    posed.data.update()
    bpy.context.view_layer.update()


def dope_sheet(cage: bpy.types.Object) -> Acts:
    area, region = driver.view()
    known = set(driver.window().screen.areas)
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.4)
    sheet = next(other for other in driver.window().screen.areas if other not in known)
    sheet = min((sheet, area), key=lambda other: other.y)
    sheet.type = "DOPESHEET_EDITOR"
    yield LOOK
    sheet.spaces.active.mode, sheet.spaces.active.show_region_ui = "DOPESHEET", False
    sheet.spaces.active.dopesheet.show_only_selected = True
    region = next(r for r in sheet.regions if r.type == "WINDOW")
    stage.only(cage)
    yield LOOK
    with bpy.context.temp_override(window=driver.window(), area=sheet, region=region):
        bpy.ops.anim.channels_expand(all=True)
        bpy.ops.action.view_all()
        bpy.ops.action.select_all(action="DESELECT")
        bpy.ops.action.select_column(mode="CFRA")
    bpy.context.scene.frame_set(24)
    yield from settle()
    top = sheet.y + sheet.height
    stage.picture("dope_sheet", (sheet.x, top - 150, sheet.x + sheet.width, top))


def refit() -> Acts:
    """The cage lengthens the legs: the armature's own bones and those that are refit."""
    rig = stage.start(frame=1)
    points = stage.points(rig.cage)
    points[:, 2] += 0.25 * np.clip(points[:, 2], 0.0, 0.9)
    points[:, 0] *= 1.1
    add_shape_key(rig.cage, "Tall", points)
    stage.hide(rig.cage, rig.cage.cage_rig.posed_cage, rig.cage.cage_rig.refit_armature)
    stage.hide(rig.armature)
    stage.activate(rig.skins[0])
    stage.overlays("joints")
    tall = rig.cage.data.shape_keys.key_blocks["Tall"]
    tall.value = 1.0
    yield from settle()
    driver.look_from_front(rig.skins)
    stage.activate(rig.skins[0])
    yield LOOK
    box = stage.around(rig.skins)
    tall.value = 0.0
    yield from settle()
    stage.picture("refit_before", box)
    tall.value = 1.0
    yield from settle()
    stage.picture("refit", box, side_by_side=["refit_before"])
    stage.overlays()


def weights() -> Acts:
    """Heat maps, of a cage vertex and of a bone; anchors; cages that fade."""
    rig = stage.start()
    posed = rig.cage.cage_rig.posed_cage
    stage.hide(rig.armature, rig.cage, rig.cage.cage_rig.refit_armature)
    stage.mode(posed, "EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    stage.overlays("weights")
    yield from settle()
    points = stage.points(posed)
    vertex = int(np.argmax(points[:, 2] - points[:, 1] + points[:, 0]))
    driver.click(driver.on_screen(posed.matrix_world @ posed.data.vertices[vertex].co))
    yield from settle()
    box = stage.with_legend(stage.around(rig.skins, 60))
    stage.picture("weights_cage", box)
    bpy.ops.object.mode_set(mode="OBJECT")
    stage.hide(posed)
    rig.armature.hide_set(False)
    stage.mode(rig.armature, "POSE")
    rig.armature.data.bones.active = rig.armature.data.bones["upper_arm.L"]
    stage.overlays("weights", "joint_weights")
    yield from settle()
    stage.picture("weights_bone", box)
    bpy.ops.object.mode_set(mode="OBJECT")
    stage.hide(rig.armature)
    stage.activate(rig.skins[0])
    for name in ("anchors", "fade"):
        stage.overlays(name)
        driver.move(driver.on_screen(rig.armature.matrix_world @ rig.armature.pose.bones["chest"].head))
        yield from settle()
        stage.picture(name, stage.around(rig.skins, 60))
    stage.overlays()


def parts() -> Acts:
    """A second cage around a forearm stands on the cage of the body."""
    rig = stage.start(frame=1)
    bones = rig.armature.data.bones
    low, high = np.array(bones["forearm.L"].head_local), np.array(bones["hand.L"].tail_local)
    fine = add_mesh("ForearmCage", *tube(low, high, 0.11))
    fine.display_type = "WIRE"
    stage.only(*rig.skins, rig.armature, fine, active=fine)
    bpy.ops.cage_rig.bind()
    points = stage.points(fine)
    middle = np.abs(np.linspace(-1.0, 1.0, 5)).repeat(6)[:, None]
    centre = points.reshape(5, 6, 3).mean(axis=1).repeat(6, axis=0)
    add_shape_key(fine, "Thick", centre + (points - centre) * (1.6 - 0.6 * middle)).value = 1.0
    made = fine.cage_rig
    stage.hide(rig.armature, rig.cage.cage_rig.refit_armature, made.refit_armature, rig.cage.cage_rig.posed_cage)
    stage.only(fine)
    stage.open_panels("skins")
    yield from settle()
    stage.zoom(1.7, centre=tuple(0.4 * low + np.array([0.0, 0.0, 0.6 * low[2] + 0.1])))
    yield from settle()
    box = stage.view()
    stage.picture("parts", (box[0], box[1], stage.sidebar()[2], box[3]))


def tube(start: np.ndarray, end: np.ndarray, radius: float) -> tuple[np.ndarray, list[list[int]]]:
    """A closed tube of five rings of six vertices along a bone, a little longer than it."""
    along = end - start
    side = np.cross(along, (0.0, 1.0, 0.0))
    across = np.stack([side / np.linalg.norm(side), (0.0, 1.0, 0.0)])
    turns = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    ring = radius * (np.cos(turns)[:, None] * across[0] + np.sin(turns)[:, None] * across[1])
    rings = [start + share * along + ring for share in np.linspace(-0.1, 1.15, 5)]
    sides = [
        [6 * r + k, 6 * r + (k + 1) % 6, 6 * r + 6 + (k + 1) % 6, 6 * r + 6 + k] for r in range(4) for k in range(6)
    ]
    return np.concatenate(rings), [*sides, list(range(5, -1, -1)), list(range(24, 30))]


def driven() -> Acts:
    """A biceps that the elbow drives: bent without the key and with it."""
    rig = stage.start(driven_biceps, frame=24)
    stage.hide(rig.armature, rig.cage, rig.cage.cage_rig.refit_armature)
    stage.activate(rig.skins[0])
    driver.look_from_front([rig.cage.cage_rig.posed_cage])
    stage.activate(rig.skins[0])
    key = rig.cage.data.shape_keys.key_blocks[BULGE]
    key.mute = True
    yield from settle()
    box = stage.around([rig.cage.cage_rig.posed_cage], 60)
    stage.picture("driven_without", box)
    key.mute = False
    yield from settle()
    stage.picture("driven", box, side_by_side=["driven_without"])


def bake() -> Acts:
    """The dialog of a bake to a native rig."""
    rig = stage.start(build_arm)
    stage.only(rig.cage)
    area, region = driver.view()
    driver.move(driver.centre())
    yield LOOK
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.bake("INVOKE_DEFAULT", target="NATIVE_RIG")
    yield from settle()
    x, y = driver.centre()
    driver.move((x - 150, y + 60))
    yield from settle()
    stage.picture("bake_dialog", (x - 300, y - 145, x + 50, y + 60))
    driver.key("ESC")
    yield LOOK


def generate() -> Acts:
    """Cross sections while nodes are edited; the cage; an elbow bent and the belly fattened with it."""
    rig = stage.start(bind=False, frame=1)
    bpy.data.objects.remove(rig.cage)
    rig.armature.data.pose_position = "REST"
    stage.only(*rig.skins, rig.armature)
    stage.open_panels()
    yield from settle()
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.generate_cage("INVOKE_DEFAULT")
    yield from settle()
    driver.key("J", at=driver.centre())  # sections at the elbows too
    yield from settle()
    stage.zoom(0.92)
    box = stage.joined(stage.around(rig.skins, 60), top_of_sidebar(200))
    bone = rig.armature.data.bones["thigh.L"]
    driver.move(driver.on_screen(bone.head_local.lerp(bone.tail_local, 0.55)))
    yield from settle()
    stage.picture("generate_nodes", box)
    driver.click(driver.on_screen(bone.head_local.lerp(bone.tail_local, 0.55)))
    yield LOOK
    driver.key("RET")
    for _ in range(600):
        yield 0.2
        if bpy.context.object is not None and bpy.context.object.cage_rig_generated.armature is not None:
            break
    yield from settle()
    cage = bpy.context.object
    rig.armature.hide_set(True)
    stage.only(cage)
    yield from settle()
    stage.picture("generated", stage.around([cage], 30))
    yield from gallery.at_work("generate_bend", rig.skins, rig.armature, cage)


def fit() -> Acts:
    """A cage that was decimated from the skin, and crosses it; and fitted."""
    rig = stage.start(lambda: build_character(doll(cell=0.03)), bind=False, frame=1)
    bpy.data.objects.remove(rig.cage)
    skin = rig.skins[0]
    modifier = skin.modifiers.new("Decimate", "DECIMATE")
    modifier.ratio, modifier.use_collapse_triangulate = 0.02, True
    mesh = bpy.data.meshes.new_from_object(skin.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    skin.modifiers.remove(modifier)
    cage = bpy.data.objects.new("Rough", mesh)
    cage.display_type = "WIRE"
    bpy.context.scene.collection.objects.link(cage)
    rig.armature.hide_set(True)
    stage.only(cage)
    stage.turn(25.0, 8.0)
    yield from settle()
    box = stage.around([cage, skin], 40)
    stage.picture("fit_before", box)
    rig.armature.hide_set(False)
    stage.only(skin, rig.armature, cage, active=cage)
    bpy.ops.cage_rig.fit_cage()
    rig.armature.hide_set(True)
    stage.only(cage)
    yield from settle()
    stage.picture("fit", box, side_by_side=["fit_before"])


ACTS = {act.__name__: act for act in (generate, fit, bind, panels, drag, refit, weights, parts, driven, bake, keys)} | {
    "gallery": gallery.everyone
}


def settle() -> Acts:
    """Our tab in front, and time to draw."""
    yield LOOK  # tabs are there once they are drawn
    driver.show_tab()
    yield LOOK


def top_of_sidebar(height: int) -> stage.Box:
    left, _, right, top = stage.sidebar()
    return left, top - height, right, top


def all_acts() -> Acts:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    yield LOOK
    wanted = [name for name in os.environ.get("CAGE_RIG_PICTURES", "").split(",") if name]
    for name in wanted or ACTS:
        yield from ACTS[name]()


driver.perform(all_acts())
