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
from long_work import MODULE, call, call_and_leave, status_bar_is_blenders, to_the_end, under_way
from scene import file_state, shown

from blend_fixtures.bar import bar, box_cage
from blend_fixtures.build import build_character

BIND = "bind cage rig"


def ours(name: str) -> ModuleType:
    return sys.modules[f"{MODULE}.{name}"]


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
    for way_out in ("ESC", "RIGHTMOUSE"):
        yield from call_and_leave(BIND, way_out)
        yield 2.0
    yield from the_add_on_goes()
    yield from bind_to_the_end()
    yield from choose_and_cancel()
    yield from choose_to_the_end()
    yield from one_undo_each()


def the_add_on_goes() -> Iterator[float | None]:
    before = file_state()
    yield from call(BIND)
    yield 0.5
    driver.check("a bind is under way", under_way())
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.5
    driver.check("the add-on may go meanwhile", not under_way() and status_bar_is_blenders())
    driver.key("A")  # a window that a modal operator still held would not hear it
    yield 0.5
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 1.0
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["BarCage"]
    driver.check("nothing has changed", file_state() == before)


def bind_to_the_end() -> Iterator[float | None]:
    yield from call(BIND)
    yield from to_the_end("3_stage", (5, 15, 25))
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
