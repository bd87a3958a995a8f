"""Fit a rough cage from the search menu: its progress, Esc, the end, its options, undo; then a skin with a hole."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bmesh
import bpy
import numpy as np

ROOT = Path(__file__).parent.parent.parent
sys.path[:0] = [str(Path(__file__).parent), str(ROOT), str(ROOT / "tests/blender")]
import driver
from long_work import call, call_and_leave, to_the_end, under_way
from rough import decimated
from scene import rest

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.doll import doll

LOOK = 0.8


def character() -> tuple[RigObjects, bpy.types.Object]:
    """A doll and its skin decimated, everything selected that Fit Cage needs."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.data.orphans_purge(do_recursive=True)
    rig = build_character(doll(cell=0.03))
    bpy.data.objects.remove(rig.cage)
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        cage = decimated(rig.skins[0], 300)
    cage.display_type = "WIRE"
    driver.look_from_front(rig.skins)
    choose(rig, cage)
    bpy.ops.ed.undo_push(message="Built")
    return rig, cage


def choose(rig: RigObjects, cage: bpy.types.Object) -> None:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in (*rig.skins, rig.armature, cage))
    bpy.context.view_layer.objects.active = cage


def fit_and_adjust(cage: bpy.types.Object) -> Iterator[float | None]:
    name, start = cage.name, rest(cage)
    yield from call("fit cage")
    yield from to_the_end("3_on_its_way", (5,))
    fitted = rest(bpy.data.objects[name])
    driver.check("the cage is fitted", not np.array_equal(fitted, start))
    driver.screenshot("4_fitted")
    panel = hud()
    driver.click((panel.x + 20, panel.y + panel.height // 2))
    yield 1.5
    driver.screenshot("5_adjust")
    panel = hud()
    step = panel.height / 5.4  # its title and four options
    field = (panel.x + int(0.7 * panel.width), panel.y + int(1.5 * step))
    driver.click(field)  # Symmetry
    yield 6.0
    driver.screenshot("6_adjusted")
    operator = bpy.context.window_manager.operators[-1]
    driver.check("the panel repeats it with another option", not operator.symmetry, operator.bl_idname)
    cage = bpy.data.objects[name]
    driver.check("from the rough cage", not np.array_equal(rest(cage), start))
    again = rest(cage)
    driver.check("and the shape is another one", not np.array_equal(again, fitted))
    driver.move(driver.centre())
    driver.key("Z", ctrl=True)
    yield 1.5
    cage = bpy.data.objects[name]
    driver.check("one undo brings the rough cage back", np.array_equal(rest(cage), start))
    driver.key("Z", ctrl=True, shift=True)
    yield 1.5
    cage = bpy.data.objects[name]
    driver.check("and redo the fitted one", np.array_equal(rest(cage), again))
    bpy.ops.cage_rig.bind()
    driver.check("it binds", cage.cage_rig.state == "LIVE", cage.cage_rig.message)
    bone = cage.cage_rig.armature.pose.bones["upper_arm.L"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler.x = 1.0
    yield 1.0
    driver.screenshot("7_bound")


def hud() -> bpy.types.Region:
    return next(region for region in driver.view()[0].regions if region.type == "HUD")


def hole() -> Iterator[float | None]:
    """The dialog that offers the repaired hull, and yes."""
    rig, cage = character()
    work = bmesh.new()
    work.from_mesh(rig.skins[0].data)
    gone = [face for face in work.faces if face.calc_center_median().z > 1.2]
    bmesh.ops.delete(work, geom=gone, context="FACES")
    work.to_mesh(rig.skins[0].data)
    work.free()
    choose(rig, cage)
    start = rest(cage)
    yield LOOK
    yield from call("fit cage")
    yield 1.0
    driver.screenshot("8_dialog")
    driver.check("nothing is done before the answer", not under_way() and np.array_equal(rest(cage), start))
    picked = [vertex for vertex in rig.skins[0].data.vertices if vertex.select]
    driver.check("the hole is selected", 0 < len(picked) < len(rig.skins[0].data.vertices), len(picked))
    driver.key("RET")
    yield 1.0
    yield from to_the_end("9_hull_on_its_way", (5,))
    driver.screenshot("9_hull")
    driver.check("the cage goes around the repaired hull", not np.array_equal(rest(bpy.data.objects["Rough"]), start))


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    yield LOOK
    _, cage = character()
    yield LOOK
    driver.show_tab()
    yield LOOK
    driver.screenshot("0_rough")
    yield from call_and_leave("fit cage", "ESC")
    yield from fit_and_adjust(cage)
    yield from hole()


driver.perform(acts())
