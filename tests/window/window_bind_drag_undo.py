"""Bind from the menu, drag a posed-cage vertex, see skin and rest cage follow, undo, scrub."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import bpy
import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import build_biped


def points(obj: bpy.types.Object) -> np.ndarray:
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    out = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", out.ravel())
    return out


def base(obj: bpy.types.Object) -> np.ndarray:
    """The mesh's base coordinates; the base key's where it has shape keys."""
    out = np.empty((len(obj.data.vertices), 3), np.float32)
    keys = obj.data.shape_keys
    (keys.key_blocks[0].points if keys else obj.data.vertices).foreach_get("co", out.ravel())
    return out


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield 0.5
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_biped()
    bpy.context.scene.frame_end = 48
    yield 0.5
    driver.look_from_front([*rig.skins, rig.cage])
    yield 0.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    yield None
    driver.show_tab()
    yield 0.5
    driver.screenshot("1_before_bind")
    yield from bind_from_the_menu()
    settings = rig.cage.cage_rig
    driver.check("bound from the menu", settings.state == "LIVE", settings.message)
    yield 0.5
    driver.show_tab()
    yield 0.5
    driver.screenshot("2_bound")
    if settings.state == "LIVE":
        yield from drag_a_posed_vertex(rig)
        yield from scrub(rig)


def bind_from_the_menu() -> Iterator[float | None]:
    driver.key("F3")
    yield 0.5
    driver.type_text("bind cage rig")
    yield 0.7
    driver.screenshot("1b_search")
    driver.key("RET")
    yield 2.0


def drag_a_posed_vertex(rig: object) -> Iterator[float | None]:
    posed, skin, cage = rig.cage.cage_rig.posed_cage, rig.skins[0], rig.cage
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == posed)
    bpy.context.view_layer.objects.active = posed
    yield None
    driver.key("TAB")
    yield 0.5
    driver.check("posed cage in Edit Mode", posed.mode == "EDIT")
    area, _ = driver.view()
    area.spaces.active.shading.show_xray = True
    coordinates = base(posed)
    vertex = int(np.argmax(coordinates[:, 0] - 0.2 * coordinates[:, 1]))
    place = driver.on_screen(posed.matrix_world @ posed.data.vertices[vertex].co)
    driver.click(place)
    yield 0.4
    driver.screenshot("3_vertex_selected")
    rest_before, skin_before = base(cage), points(skin)
    driver.key("G", at=place)
    yield 0.3
    moved = []
    for step in range(1, 9):
        driver.move((place[0] + 6 * step, place[1] + 5 * step))
        yield 0.2
        moved.append((np.abs(base(cage) - rest_before).max(), np.abs(points(skin) - skin_before).max()))
        if step == 5:
            driver.screenshot("4_during_drag")
    live = all(b[0] > a[0] and b[1] > a[1] for a, b in pairwise(moved[1:]))
    driver.check("rest cage and skin follow every mouse move", live, moved[-1])
    driver.click((place[0] + 48, place[1] + 40))
    yield 0.4
    driver.screenshot("5_after_drag")
    driver.check("the rest cage moved", np.abs(base(cage) - rest_before).max() > 0.01)
    driver.key("Z", ctrl=True)
    yield 0.6
    driver.screenshot("6_undone")
    driver.check("undo in Edit Mode brings the rest cage back", np.abs(base(cage) - rest_before).max() < 1e-5)
    driver.check("undo in Edit Mode brings the skin back", np.abs(points(skin) - skin_before).max() < 1e-5)
    driver.key("Z", ctrl=True, shift=True)
    yield 0.6
    driver.check("redo moves the rest cage again", np.abs(base(cage) - rest_before).max() > 0.01)
    driver.key("TAB")
    yield 0.5
    driver.check("back in Object Mode", posed.mode == "OBJECT")
    driver.check("still live", cage.cage_rig.state == "LIVE", cage.cage_rig.message)


def scrub(rig: object) -> Iterator[float | None]:
    skin, scene = rig.skins[0], bpy.context.scene
    seen = []
    for _ in range(6):
        for _ in range(2):
            driver.key("RIGHT_ARROW")
            yield 0.15
        seen.append(points(skin))
    moved = min(np.abs(a - b).max() for a, b in pairwise(seen))
    driver.check("scrubbing moves the skin on every frame", moved > 1e-3, f"frame {scene.frame_current}")
    driver.screenshot("7_scrubbed")
    driver.key("SPACE")
    yield 2.0
    driver.screenshot("8_playing")
    driver.key("SPACE")
    yield 0.4
    driver.check("live after playback", rig.cage.cage_rig.state == "LIVE", rig.cage.cage_rig.message)


driver.perform(acts())
