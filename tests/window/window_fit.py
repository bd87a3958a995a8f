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
from rough import decimated
from scene import file_state, rest

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.doll import doll

LOOK = 0.8
MODULE = "bl_ext.user_default.cage_rig"


def under_way() -> bool:
    return bool(sys.modules[f"{MODULE}.operators.waiting"]._open)


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


def call_fit() -> Iterator[float | None]:
    driver.key("F3")
    yield 0.7
    driver.type_text("fit cage")
    yield 1.0
    driver.key("RET")
    for _ in range(100):
        yield 0.1
        if under_way():
            return


def to_the_end(name: str) -> Iterator[float | None]:
    for step in range(600):
        yield 0.1
        if step == 5:
            driver.screenshot(name)
        if not under_way():
            break
    yield LOOK


def escape() -> Iterator[float | None]:
    before = file_state()
    yield from call_fit()
    driver.check("the fit goes on beside the window", under_way())
    yield 0.4
    driver.screenshot("1_on_its_way")
    region = driver.view()[0].spaces.active.region_3d
    distance = region.view_distance
    driver.key("WHEELUPMOUSE")
    driver.key("X")
    yield 0.2
    driver.check("the view can be moved meanwhile", region.view_distance < distance)
    driver.check("nothing is written yet", under_way() and file_state() == before)
    driver.key("ESC")
    yield 1.0
    driver.check("Esc ends it", not under_way())
    driver.check("and nothing has changed", file_state() == before)
    header = bpy.types.STATUSBAR_HT_header
    driver.check("the status bar is Blender's again", header.draw == header._draw_orig)
    driver.screenshot("2_cancelled")


def fit_and_adjust(cage: bpy.types.Object) -> Iterator[float | None]:
    name, start = cage.name, rest(cage)
    yield from call_fit()
    yield from to_the_end("3_on_its_way")
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
    yield from call_fit()
    yield 1.0
    driver.screenshot("8_dialog")
    driver.check("nothing is done before the answer", not under_way() and np.array_equal(rest(cage), start))
    picked = [vertex for vertex in rig.skins[0].data.vertices if vertex.select]
    driver.check("the hole is selected", 0 < len(picked) < len(rig.skins[0].data.vertices), len(picked))
    driver.key("RET")
    yield 1.0
    yield from to_the_end("9_hull_on_its_way")
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
    yield from escape()
    yield from fit_and_adjust(cage)
    yield from hole()


driver.perform(acts())
