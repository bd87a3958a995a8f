"""Bind a large mesh from the menu: its progress, Esc, the end; then a method that takes long, chosen in the panel."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np

ROOT = Path(__file__).parent.parent.parent
sys.path[:0] = [str(Path(__file__).parent), str(ROOT), str(ROOT / "tests/blender")]
import driver
from scene import file_state, shown

from blend_fixtures.bar import bar, box_cage
from blend_fixtures.build import build_character

MODULE = "bl_ext.user_default.cage_rig"


def ours(name: str) -> ModuleType:
    return sys.modules[f"{MODULE}.{name}"]


def under_way() -> bool:
    return bool(ours("operators.waiting")._open)


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield 0.5
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    cage = box_cage(list(np.linspace(-1.15, 1.15, 90)), half=0.28)
    objects = build_character(replace(bar(segments=830, across=60), cage=cage, shape_keys={}))
    yield 1.0
    driver.look_from_front([*objects.skins, objects.cage])
    yield 0.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects.cage
    bpy.ops.ed.undo_push(message="Built")
    driver.show_tab()
    yield 1.0
    vertices = len(objects.skins[0].data.vertices)
    driver.check("the mesh is large", vertices > 190_000, vertices)
    yield from bind_and_escape()
    yield from the_add_on_goes()
    yield from bind_to_the_end()
    yield from choose_and_cancel()
    yield from choose_to_the_end()
    yield from one_undo_each()


def call_bind() -> Iterator[float | None]:
    driver.key("F3")
    yield 0.7
    driver.type_text("bind cage rig")
    yield 1.0
    driver.key("RET")
    for _ in range(100):
        yield 0.1
        if under_way():
            return


def bind_and_escape() -> Iterator[float | None]:
    before = file_state()
    for name, way_out in (("esc", "ESC"), ("right_mouse", "RIGHTMOUSE")):
        yield from call_bind()
        driver.check("the bind goes on beside the window", under_way())
        yield 0.6
        driver.screenshot(f"1_on_its_way_{name}")
        region = driver.view()[0].spaces.active.region_3d
        distance = region.view_distance
        driver.key("WHEELUPMOUSE")
        driver.key("X")
        yield 0.3
        driver.check("the view can be moved meanwhile", region.view_distance < distance)
        driver.check("it is still under way", under_way())
        driver.check("nothing is written yet", file_state() == before)
        driver.key(way_out)
        yield 1.0
        driver.check(f"{way_out} ends it", not under_way())
        driver.check("and nothing has changed", file_state() == before)
        header = bpy.types.STATUSBAR_HT_header
        driver.check("the status bar is Blender's again", header.draw == header._draw_orig)
        yield 2.0
        driver.screenshot(f"2_cancelled_{name}")


def the_add_on_goes() -> Iterator[float | None]:
    before = file_state()
    yield from call_bind()
    yield 0.5
    driver.check("a bind is under way", under_way())
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.5
    header = bpy.types.STATUSBAR_HT_header
    driver.check("the add-on may go meanwhile", not under_way() and header.draw == header._draw_orig)
    driver.key("A")  # a window that a modal operator still held would not hear it
    yield 0.5
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 1.0
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["BarCage"]
    driver.check("nothing has changed", file_state() == before)


def bind_to_the_end() -> Iterator[float | None]:
    yield from call_bind()
    for step in range(600):
        yield 0.1
        if step in (5, 15, 25):
            driver.screenshot(f"3_stage_{step}")
        if not under_way():
            break
    yield 1.0
    cage = bpy.data.objects["BarCage"]
    driver.check("it comes to its end", cage.cage_rig.state == "LIVE", cage.cage_rig.message)
    bone = bpy.data.objects["BarRig"].pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler.z = 1.2
    yield 0.5
    driver.screenshot("4_bound")


def choose(method: str) -> None:
    """What a click in the panel's menu does."""
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.data.objects["BarCage"].cage_rig.method = method
    bpy.ops.ed.undo_push(message="Method")


def choose_and_cancel() -> Iterator[float | None]:
    choosing = ours("choosing")
    cage, skin = bpy.data.objects["BarCage"], bpy.data.objects["Bar"]
    bpy.context.view_layer.objects.active = cage
    shape = shown(skin)
    choose("COR")
    yield 0.1  # long enough for the panel to be drawn, not for the method to be ready
    driver.check("the panel has progress", choosing.progress(cage) is not None, choosing.progress(cage))
    driver.check("the skin is as before", np.array_equal(shown(skin), shape))
    driver.screenshot("5_method_on_its_way")
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.cancel_method()
    yield 2.0
    driver.screenshot("6_method_cancelled")
    driver.check("Cancel puts the method back", cage.cage_rig.method == "LBS", cage.cage_rig.method)
    driver.check("the skin is as it was", np.array_equal(shown(skin), shape) and choosing.progress(cage) is None)


def choose_to_the_end() -> Iterator[float | None]:
    choosing = ours("choosing")
    cage, skin = bpy.data.objects["BarCage"], bpy.data.objects["Bar"]
    shape = shown(skin)
    choose("COR")
    for step in range(1200):
        yield 0.1
        if step == 25:
            driver.screenshot("7_method_on_its_way")
        if choosing.progress(cage) is None:
            break
    yield 0.7
    driver.screenshot("7_method_chosen")
    apart = float(np.abs(shown(skin) - shape).max())
    driver.check("the method comes by itself", choosing.progress(cage) is None and apart > 1e-3, apart)


def one_undo_each() -> Iterator[float | None]:
    area, region = driver.view()
    names = []
    for _ in range(3):  # two choices, then the bind
        with bpy.context.temp_override(window=driver.window(), area=area, region=region):
            bpy.ops.ed.undo()
        yield 1.5
        cage = bpy.data.objects["BarCage"]
        names.append((cage.cage_rig.state, cage.cage_rig.method))
    driver.check("the bind is one step of undo", names[-1] == ("NONE", "LBS") and names[-2][0] == "LIVE", names)
    driver.screenshot("8_undone")


driver.perform(acts())
