"""Generate the cage of another level of detail by hand, and give it the faces of the first in the redo panel."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.doll import doll

LOOK = 0.8


def shown() -> object:
    return sys.modules["bl_ext.user_default.cage_rig"].caging.current.shown()


def built(name: str, x: float, **how: object) -> RigObjects:
    rig = build_character(doll(**how))
    bpy.data.objects.remove(rig.cage)
    rig.armature.location.x = x
    rig.skins[0].name = name
    return rig


def generated(rig: RigObjects) -> Iterator[float | None]:
    """Press the button and Enter."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in (*rig.skins, rig.armature))
    bpy.context.view_layer.objects.active = rig.armature
    bpy.ops.ed.undo_push(message="Select")  # as a click does
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.cage_rig.generate_cage("INVOKE_DEFAULT")
    yield 2.0
    driver.key("RET")
    for _ in range(300):
        yield 0.2
        if shown() is None:
            break
    yield LOOK


def faces(cage: bpy.types.Object) -> list[tuple[int, ...]]:
    return [tuple(face.vertices) for face in cage.data.polygons]


def hud() -> bpy.types.Region:
    return next(region for region in driver.view()[0].regions if region.type == "HUD")


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    first, second = built("Far", -1.2), built("Near", 1.2, cell=0.042, legs_first=True)
    bpy.context.view_layer.update()
    driver.look_from_front([*first.skins, *second.skins])
    yield LOOK
    driver.show_tab()
    yield from generated(first)
    template = bpy.context.object.name
    yield from generated(second)
    cage = bpy.context.object
    driver.check("both have cages", cage.name not in (template, "") and len(cage.cage_rig_generated.skins) == 1)
    driver.check("whose faces differ", faces(cage) != faces(bpy.data.objects[template]))
    driver.screenshot("0_generated")
    yield from choose_like(template)


def choose_like(template: str) -> Iterator[float | None]:
    panel = hud()
    driver.click((panel.x + 20, panel.y + panel.height // 2))
    yield 1.5
    driver.screenshot("1_adjust")
    panel = hud()
    driver.check("the panel opens", panel.height > 150, panel.height)
    step = panel.height / 11.3  # its title, eight options, Like, what it says of the other cage
    field = (panel.x + int(0.6 * panel.width), panel.y + int(1.9 * step))
    driver.click(field)
    yield 1.5
    driver.screenshot("2_offered")
    driver.type_text("Far")
    yield LOOK
    driver.screenshot("3_typed")
    driver.key("RET", at=field)
    for _ in range(150):
        yield 0.2
        cage = bpy.context.object
        if cage is not None and cage.name != template and cage.cage_rig_generated.like:
            break
    yield LOOK
    driver.screenshot("4_alike")
    cage, other = bpy.context.object, bpy.data.objects[template]
    driver.check("the field names the other cage", cage.cage_rig_generated.like == template, template)
    driver.check("the faces are the same, index for index", faces(cage) == faces(other))
    operator = bpy.context.window_manager.operators[-1]
    driver.check("the panel shows it", operator.like == template, operator.like)


driver.perform(acts())
