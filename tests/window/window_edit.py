"""Edit both cages with Blender's own tools in a real window: proportional, mirrored, rotated, sculpted, undone."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import build_biped


def points(obj: bpy.types.Object) -> np.ndarray:
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    out = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", out.ravel())
    return out


def only(obj: bpy.types.Object) -> None:
    for other in bpy.context.view_layer.objects:
        other.select_set(other == obj)
    bpy.context.view_layer.objects.active = obj


def acts() -> Iterator[float | None]:
    driver.key("ESC")
    yield 0.5
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_biped()
    yield 0.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    yield 0.5
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.bind("EXEC_DEFAULT")
    bpy.context.scene.frame_set(12)
    driver.look_from_front([*rig.skins, rig.cage])
    area.spaces.active.shading.show_xray = True
    yield 0.5
    for name, obj in (("posed", rig.cage.cage_rig.posed_cage), ("rest", rig.cage)):
        yield from proportional(rig, obj, name)
        yield from mirrored(rig, obj, name)
        yield from turned(rig, obj, name)
        yield from sculpted(rig, obj, name)
    driver.check("live at the end", rig.cage.cage_rig.state == "LIVE", rig.cage.cage_rig.message)


def enter(obj: bpy.types.Object) -> Iterator[float | None]:
    only(obj)
    yield 0.2
    driver.key("TAB")
    yield 0.4


def proportional(rig: object, obj: bpy.types.Object, name: str) -> Iterator[float | None]:
    """Drag a vertex of the hand with proportional editing, and see how long a mouse move takes."""
    yield from enter(obj)
    settings = bpy.context.scene.tool_settings
    settings.use_proportional_edit, settings.proportional_size = True, 0.3
    vertex = max(obj.data.vertices, key=lambda v: v.co.x)
    place = driver.on_screen(obj.matrix_world @ vertex.co)
    driver.click(place)
    yield 0.3
    skin, before = rig.skins[0], points(rig.skins[0])
    driver.key("G", at=place)
    yield 0.2
    times: list[float] = []
    tell = lambda *_: times.append(time.perf_counter())  # noqa: E731
    bpy.app.handlers.depsgraph_update_post.append(tell)
    for step in range(1, 7):
        driver.move((place[0] + 8 * step, place[1] + 4 * step))
        yield 0.15
    bpy.app.handlers.depsgraph_update_post.remove(tell)
    driver.screenshot(f"{name}_1_proportional")
    driver.click((place[0] + 48, place[1] + 24))
    yield 0.3
    driver.check(f"{name}: proportional drag moves the skin", np.abs(points(skin) - before).max() > 0.01)
    driver.check(f"{name}: every mouse move was an update", len(times) >= 5, len(times))
    driver.key("Z", ctrl=True)
    yield 0.5
    driver.check(f"{name}: undo brings it back", np.abs(points(skin) - before).max() < 1e-5)
    settings.use_proportional_edit = False
    driver.key("TAB")
    yield 0.4


def mirrored(rig: object, obj: bpy.types.Object, name: str) -> Iterator[float | None]:
    """Scale with X mirror: both sides follow."""
    yield from enter(obj)
    obj.data.use_mirror_x = True
    driver.key("A")
    yield 0.2
    skin, before = rig.skins[0], points(rig.skins[0])
    rest = points(rig.cage) if obj != rig.cage else None
    driver.key("S")
    yield 0.2
    x, y = driver.centre()
    driver.move((x + 120, y + 60))
    yield 0.2
    driver.move((x + 160, y + 90))
    yield 0.2
    driver.click((x + 160, y + 90))
    yield 0.4
    driver.screenshot(f"{name}_2_scaled")
    driver.check(f"{name}: scaling moves the skin", np.abs(points(skin) - before).max() > 0.01)
    if rest is not None:
        driver.check(f"{name}: and the rest cage", np.abs(points(rig.cage) - rest).max() > 0.01)
    driver.key("Z", ctrl=True)
    yield 0.5
    driver.check(f"{name}: undo of the scale", np.abs(points(skin) - before).max() < 1e-5)
    obj.data.use_mirror_x = False
    driver.key("TAB")
    yield 0.4


def turned(rig: object, obj: bpy.types.Object, name: str) -> Iterator[float | None]:
    """Rotate with snapping on."""
    yield from enter(obj)
    bpy.context.scene.tool_settings.use_snap = True
    driver.key("A")
    yield 0.2
    skin, before = rig.skins[0], points(rig.skins[0])
    x, y = driver.centre()
    driver.key("R", at=(x + 150, y))
    yield 0.2
    for step in range(1, 4):
        driver.move((x + 150 - 10 * step, y + 20 * step))
        yield 0.15
    driver.click((x + 120, y + 60))
    yield 0.4
    driver.check(f"{name}: rotating moves the skin", np.abs(points(skin) - before).max() > 0.01)
    bpy.context.scene.tool_settings.use_snap = False
    driver.key("Z", ctrl=True)
    yield 0.5
    driver.check(f"{name}: undo of the rotation", np.abs(points(skin) - before).max() < 1e-5)
    driver.key("TAB")
    yield 0.4


def sculpted(rig: object, obj: bpy.types.Object, name: str) -> Iterator[float | None]:
    """A stroke of the draw brush on the cage in Sculpt Mode, and its undo."""
    only(obj)
    yield 0.2
    shown, obj.display_type = obj.display_type, "SOLID"
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="SCULPT")
    yield 0.6
    skin, before, cage = rig.skins[0], points(rig.skins[0]), points(rig.cage)
    middle = np.mean([vertex.co for vertex in obj.data.vertices], axis=0)
    place = driver.on_screen(obj.matrix_world @ Vector(middle))
    driver.move(place)
    yield 0.2
    driver.window().event_simulate(type="LEFTMOUSE", value="PRESS", x=place[0], y=place[1])
    for step in range(1, 12):
        driver.move((place[0] + 3 * step, place[1] + 6 * step))
        yield 0.08
    driver.window().event_simulate(type="LEFTMOUSE", value="RELEASE", x=place[0] + 33, y=place[1] + 66)
    yield 0.5
    driver.screenshot(f"{name}_3_sculpted")
    moved = np.abs(points(skin) - before).max()
    driver.check(f"{name}: sculpting the cage moves the skin", moved > 1e-4, moved)
    driver.check(f"{name}: and the rest cage", np.abs(points(rig.cage) - cage).max() > 1e-4)
    driver.key("Z", ctrl=True)
    yield 0.6
    left = np.abs(points(skin) - before).max()
    driver.check(f"{name}: undo of the stroke", left < 1e-4, left)
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="OBJECT")
    obj.display_type = shown
    yield 0.4


driver.perform(acts())
