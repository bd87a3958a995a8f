"""Key the cage in a real window: the panel, the dope sheet, keys moved past one another by the mouse."""

from __future__ import annotations

import sys
from collections.abc import Iterator
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


def acts() -> Iterator[float | None]:
    driver.key("ESC")
    yield 0.5
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_biped()
    bpy.context.scene.frame_end = 48
    yield 0.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    yield 0.5
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.bind("EXEC_DEFAULT")
    cage, settings = rig.cage, rig.cage.cage_rig
    driver.look_from_front([*rig.skins, cage])
    yield 0.5
    only(cage)
    driver.show_tab()
    open_every_panel()
    yield 0.7
    driver.screenshot("1_panel_live")
    yield from key_three(rig)
    driver.screenshot("2_three_keys")
    yield from in_the_dope_sheet(rig)
    yield from paused(rig)
    yield from in_the_properties(rig)
    driver.check("live at the end", settings.state == "LIVE", settings.message)


def only(obj: bpy.types.Object) -> None:
    for other in bpy.context.view_layer.objects:
        other.select_set(other == obj)
    bpy.context.view_layer.objects.active = obj


def open_every_panel() -> None:
    area, _ = driver.view()
    for region in area.regions:
        if region.type == "UI":
            region.tag_redraw()


def key_three(rig: object) -> Iterator[float | None]:
    scene, cage = bpy.context.scene, rig.cage
    posed = cage.cage_rig.posed_cage
    for frame, factor in ((1, 1.0), (16, 1.25), (32, 0.85)):
        scene.frame_set(frame)
        yield 0.3
        if factor != 1.0:
            only(posed)
            yield None
            driver.key("TAB")
            yield 0.4
            driver.key("A")
            yield 0.2
            area, region = driver.view()
            with bpy.context.temp_override(window=driver.window(), area=area, region=region):
                bpy.ops.transform.resize(value=(factor, factor, 1.0))
            yield 0.4
            if factor > 1.0:
                driver.show_tab()
                yield 0.4
                driver.screenshot("1b_unkeyed_edit")
            driver.key("TAB")
            yield 0.4
            only(cage)
        driver.check(f"keyed at {frame}", bpy.ops.cage_rig.key_cage() == {"FINISHED"})
        yield 0.3
    scene.frame_set(24)
    yield 0.4


def in_the_dope_sheet(rig: object) -> Iterator[float | None]:
    """Turn the timeline into a dope sheet, select the key at 16 in the summary and move it past the one at 32."""
    cage = rig.cage
    timeline, _ = driver.view()
    timeline.type = "DOPESHEET_EDITOR"
    yield 0.4
    timeline.spaces.active.mode = "DOPESHEET"
    timeline.spaces.active.dopesheet.show_only_selected = True
    region = next(r for r in timeline.regions if r.type == "WINDOW")
    only(cage)
    yield 0.5
    with bpy.context.temp_override(window=driver.window(), area=timeline, region=region):
        bpy.ops.action.view_all()
    yield 0.4
    bpy.context.scene.frame_set(16)
    yield 0.3
    fat = points(cage)
    with bpy.context.temp_override(window=driver.window(), area=timeline, region=region):
        bpy.ops.action.select_all(action="DESELECT")
        bpy.ops.action.select_column(mode="CFRA")
    yield 0.4
    driver.screenshot("3_dope_sheet")
    with bpy.context.temp_override(window=driver.window(), area=timeline, region=region):
        bpy.ops.transform.transform(mode="TIME_TRANSLATE", value=(24.0, 0.0, 0.0, 0.0))
    yield 0.5
    driver.screenshot("4_moved_past")
    bpy.context.scene.frame_set(40)
    yield 0.4
    driver.check("the moved key shows its shape at its new frame", np.abs(points(cage) - fat).max() < 1e-5)
    bpy.context.scene.frame_set(16)
    yield 0.4
    between = points(cage)
    bpy.context.scene.frame_set(1)
    first = points(cage)
    bpy.context.scene.frame_set(32)
    third = points(cage)
    part = (16 - 1) / (32 - 1)
    beside = np.abs(between - first - part * (third - first)).max()
    driver.check("its old place lies on the line of its neighbours", beside < 1e-5)
    with bpy.context.temp_override(window=driver.window(), area=timeline, region=region):
        bpy.ops.action.delete(confirm=False)
    yield 0.4
    bpy.context.scene.frame_set(40)
    driver.check("a deleted key is gone", np.abs(points(cage) - third).max() < 1e-5)
    timeline.type = "VIEW_3D"
    yield 0.4


def paused(rig: object) -> Iterator[float | None]:
    skin = rig.skins[0]
    skin.modifiers.remove(skin.modifiers["Cage Rig"])
    only(rig.cage)
    yield 0.5
    driver.show_tab()
    yield 0.5
    driver.check("paused with a fix", rig.cage.cage_rig.fix == "rebind", rig.cage.cage_rig.message)
    driver.screenshot("5_paused")
    bpy.ops.cage_rig.fix_problem()
    yield 0.5


def in_the_properties(rig: object) -> Iterator[float | None]:
    only(rig.cage)
    area = next(area for area in driver.window().screen.areas if area.type == "PROPERTIES")
    area.spaces.active.context = "OBJECT"
    yield 0.6
    driver.screenshot("6_properties")


driver.perform(acts())
