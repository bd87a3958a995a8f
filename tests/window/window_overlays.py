"""Every overlay in a real window: what it draws where, that it follows, and that nothing of it stays when it is off."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Euler

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import build_biped

LOOK = 0.7  # seconds until a picture shows what was done


def settings() -> bpy.types.PropertyGroup:
    return driver.window().workspace.cage_rig_overlays


def switch(*names: str) -> None:
    """These overlays on, all others off."""
    for name in ("weights", "joint_weights", "joints", "anchors", "fade"):
        setattr(settings(), name, name in names)


def picture(name: str) -> np.ndarray:
    """A screenshot of the 3D View without header and sidebar, `height by width by 3`."""
    driver.screenshot(name)
    image = bpy.data.images.load(str(driver.OUT / f"{name}.png"))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    _, region = driver.view()
    rows = slice(region.y + 4, region.y + region.height - 70)
    columns = slice(region.x + 60, region.x + region.width - 280)
    return pixels.reshape(height, width, 4)[rows, columns, :3]


def changed(before: np.ndarray, after: np.ndarray, at: tuple[int, int] | None = None, radius: int = 0) -> float:
    """The share of pixels that differ by more than smoothed edges do, all or those around a place of the window."""
    differs = np.abs(before - after).max(axis=2) > 0.1
    return float((differs if at is None else differs[around(at, radius)]).mean())


def strength(before: np.ndarray, after: np.ndarray, at: tuple[int, int], radius: int) -> float:
    """The largest difference around a place of the window."""
    near = around(at, radius)
    return float(np.abs(before[near] - after[near]).max())


def around(at: tuple[int, int], radius: int) -> tuple[slice, slice]:
    """The part of a picture around a place of the window."""
    _, region = driver.view()
    x, y = at[0] - region.x - 60, at[1] - region.y - 4
    return slice(max(0, y - radius), y + radius), slice(max(0, x - radius), x + radius)


def activate(obj: bpy.types.Object, mode: str) -> None:
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for other in bpy.context.view_layer.objects:
        other.select_set(other == obj)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode=mode)


def fatten(cage: bpy.types.Object) -> None:
    """A shape key that widens the left arm's end of the cage and lengthens the head's."""
    cage.shape_key_add(name="Basis", from_mix=False)
    key = cage.shape_key_add(name="Long", from_mix=False)
    points = np.empty((len(cage.data.vertices), 3), np.float32)
    cage.data.vertices.foreach_get("co", points.ravel())
    points[:, 0] *= 1.25
    points[:, 2] += 0.18 * np.clip(points[:, 2] - 0.9, 0.0, None)
    key.points.foreach_set("co", points.ravel())
    key.value = 1.0


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_biped()
    bpy.context.scene.frame_set(8)
    yield LOOK
    driver.look_from_front([*rig.skins])
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    bpy.ops.cage_rig.bind()
    fatten(rig.cage)
    made = rig.cage.cage_rig
    driver.check("bound", made.state == "LIVE", made.message)
    for obj in (rig.cage, made.posed_cage, made.refit_armature):
        obj.hide_set(True)
    yield LOOK
    driver.show_tab()
    yield LOOK
    yield from bone(rig)
    yield from joints_and_anchors(rig)
    yield from cage_vertices(rig)
    yield from fading(rig)
    yield from light_theme(rig)
    yield from afterwards(rig)


def bone(rig: object) -> Iterator[float | None]:
    activate(rig.armature, "POSE")
    rig.armature.data.bones.active = rig.armature.data.bones["upper_arm.L"]
    rig.armature.hide_set(True)
    yield 1.5
    plain = picture("0_nothing")
    switch("weights")
    yield LOOK
    heat = picture("1_bone")
    place = driver.on_screen(rig.armature.matrix_world @ rig.armature.pose.bones["forearm.L"].head)
    driver.check("a bone's weights colour the skin there", changed(plain, heat, place, 30) > 0.3)
    driver.check("and nowhere else", changed(plain, heat) < 0.2, changed(plain, heat))
    rig.armature.data.bones.active = rig.armature.data.bones["head"]
    yield LOOK
    driver.check("it follows the active bone", changed(plain, picture("1b_head"), place, 30) < 0.05)
    switch("weights", "joint_weights")
    rig.armature.data.bones.active = rig.armature.data.bones["forearm.L"]
    yield LOOK
    dotted = picture("2_joint_weights")
    driver.check("dots on the cage", changed(heat, dotted) > 0.01)
    settings().weights_opacity = 1.0
    yield LOOK
    picture("2b_opaque")
    settings().weights_opacity = 0.75
    rig.armature.data.bones.active = rig.armature.data.bones["upper_arm.L"]
    switch()
    yield 1.5
    driver.check("nothing is left when they are off", changed(plain, picture("2c_off")) < 2e-3)
    rig.armature.hide_set(False)


def joints_and_anchors(rig: object) -> Iterator[float | None]:
    activate(rig.skins[0], "OBJECT")
    rig.armature.hide_set(True)
    yield LOOK
    plain = picture("3_nothing")
    switch("joints")
    yield LOOK
    driver.check("refit joints show", changed(plain, picture("3_joints")) > 0.005)
    settings().joints_in_front = False
    yield LOOK
    driver.check("and not through the skin", changed(plain, picture("3b_joints_behind")) < 0.01)
    settings().joints_in_front = True
    switch("anchors")
    yield LOOK
    driver.check("anchors show", changed(plain, picture("4_anchors")) > 0.002)
    switch("anchors", "joints")
    yield LOOK
    picture("4b_both")
    switch()
    rig.armature.hide_set(False)
    yield LOOK


def cage_vertices(rig: object) -> Iterator[float | None]:
    posed = rig.cage.cage_rig.posed_cage
    posed.hide_set(False)
    activate(posed, "EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    yield LOOK
    plain = picture("5_edit")
    switch("weights")
    yield LOOK
    chest = driver.on_screen(rig.armature.matrix_world @ rig.armature.pose.bones["chest"].head)
    hint = picture("5b_none")
    driver.check("no heat without a selection", changed(plain, hint, chest, 100) < 1e-3)
    driver.check("but a hint what to select", changed(plain, hint) > 2e-3, changed(plain, hint))
    points = np.array([vertex.co for vertex in posed.data.vertices])
    vertex = int(np.argmax(points[:, 0] - 0.2 * points[:, 1]))
    place = driver.on_screen(posed.matrix_world @ posed.data.vertices[vertex].co)
    area, _ = driver.view()
    area.spaces.active.shading.show_xray = True  # to click through the skin
    yield LOOK
    driver.click(place)
    yield LOOK
    area.spaces.active.shading.show_xray = False
    yield LOOK
    one = picture("6_cage_vertex")
    driver.check("a click on a cage vertex shows what it moves", changed(plain, one) > 0.01, changed(plain, one))
    bpy.ops.mesh.select_all(action="SELECT")
    yield LOOK
    driver.check("all vertices move all", changed(plain, picture("6b_all")) > 2 * changed(plain, one))
    bpy.ops.mesh.select_all(action="DESELECT")
    edit = bmesh.from_edit_mesh(posed.data)
    edit.verts.ensure_lookup_table()
    edit.verts[vertex].select = True
    bmesh.update_edit_mesh(posed.data)
    yield LOOK
    driver.key("G", at=place)
    for step in range(1, 7):
        driver.move((place[0] + 8 * step, place[1] + 8 * step))
        yield 0.15
    picture("7_dragged")
    driver.key("ESC")
    yield LOOK
    activate(posed, "OBJECT")
    posed.hide_set(True)
    switch()


def fading(rig: object) -> Iterator[float | None]:
    activate(rig.armature, "OBJECT")
    chest = driver.on_screen(rig.armature.matrix_world @ rig.armature.pose.bones["chest"].head)
    hand = driver.on_screen(rig.armature.matrix_world @ rig.armature.pose.bones["hand.L"].head)
    shown = rig.cage.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices
    corner = driver.on_screen(rig.cage.matrix_world @ min((vertex.co for vertex in shown), key=lambda co: co.x))
    driver.move(hand)
    yield 1.5
    plain = picture("8_nothing")
    switch("fade")
    settings().fade_minimum = 0.0
    yield LOOK
    driver.move((hand[0] + 2, hand[1]))
    yield 1.5
    at_hand = picture("8_at_the_hand")
    driver.check("cages show at the cursor", changed(plain, at_hand, hand, 60) > 0.02)
    driver.check("and not far from it", changed(plain, at_hand, corner, 30) == 0.0)
    driver.move(chest)
    yield LOOK
    at_chest = picture("8b_at_the_chest")
    driver.check("they follow the cursor", changed(plain, at_chest, chest, 60) > 0.02)
    driver.check("and leave where it was", changed(plain, at_chest, hand, 60) < changed(plain, at_hand, hand, 60))
    settings().fade_minimum = 0.12
    yield LOOK
    faint = picture("8c_faint_elsewhere")
    driver.check("or faintly", 0.0 < strength(plain, faint, corner, 30) < 0.3 * strength(plain, at_hand, hand, 30))
    area, _ = driver.view()
    area.spaces.active.region_3d.view_perspective = "PERSP"
    area.spaces.active.region_3d.view_rotation = Euler((1.3, 0.0, 0.6)).to_quaternion()
    yield LOOK
    driver.move((chest[0] + 3, chest[1]))
    yield LOOK
    picture("8d_perspective")


def light_theme(rig: object) -> Iterator[float | None]:
    folder = bpy.utils.preset_paths("interface_theme")[0]
    bpy.ops.script.execute_preset(
        filepath=str(Path(folder) / "Blender_Light.xml"), menu_idname="USERPREF_MT_interface_theme_presets"
    )
    activate(rig.armature, "POSE")
    rig.armature.hide_set(True)
    rig.armature.data.bones.active = rig.armature.data.bones["upper_arm.L"]
    switch("weights", "joint_weights")
    yield LOOK
    picture("10_light_weights")
    switch("joints", "anchors")
    yield LOOK
    picture("10b_light_joints")
    switch("fade")
    yield LOOK
    driver.move(driver.centre())
    yield LOOK
    picture("10c_light_cages")
    rig.skins[1].modifiers.new("Subdivision", "SUBSURF")
    switch("weights")
    yield LOOK
    picture("10d_light_subdivided")
    rig.skins[1].modifiers.remove(rig.skins[1].modifiers["Subdivision"])
    rig.armature.hide_set(False)
    bpy.ops.preferences.reset_default_theme()
    activate(rig.armature, "OBJECT")
    switch("fade")
    yield LOOK


def afterwards(rig: object) -> Iterator[float | None]:
    package = sys.modules["bl_ext.user_default.cage_rig"].ui.overlays
    path = str(driver.OUT / "overlays.blend")
    driver.check("no overlay met an error", settings().message == "", settings().message)
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.ed.undo()
    yield LOOK
    driver.check("fading goes on after an undo", settings().fade and package.cursor.is_followed())
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 1.0
    driver.check("the settings come with the file", settings().fade)
    centre = driver.centre()
    driver.move((centre[0], centre[1]))
    yield LOOK
    with_fade = picture("9_loaded")
    yield from failure(package)
    driver.check("the cursor is followed in a loaded file", package.cursor.is_followed())
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.cage_rig")
    yield LOOK
    driver.move((centre[0] + 2, centre[1]))
    yield LOOK
    driver.check("nothing is drawn without the add-on", changed(with_fade, picture("9b_disabled"), centre, 80) > 0.005)
    driver.check("and no cursor is followed", not package.cursor.is_followed() and not package._running.handles)


def failure(package: object) -> Iterator[float | None]:
    draw = package.Joints.draw
    package.Joints.draw = lambda *_, **__: 1 / 0
    settings().joints = True
    for _ in range(20):  # the view has to be drawn, and Blender to come back to its timers
        yield 0.2 if settings().joints else None
    driver.check("an overlay that fails is switched off", not settings().joints and settings().fade)
    driver.check("and says so", "ZeroDivisionError" in settings().message, settings().message)
    package.Joints.draw = draw
    picture("11_switched_off")


driver.perform(acts())
