"""Apply in a real window: on transforms nothing moves, on the modifier the shape stays, and Ctrl Z brings all back."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import build_bar

LOOK = 0.8
PLACED = Matrix.LocRotScale((0.3, -0.2, 0.5), Matrix.Rotation(0.4, 3, "Z").to_quaternion(), (2.0, 2.0, 2.0))


def skin() -> bpy.types.Object:
    return bpy.data.objects["Bar"]


def settings() -> bpy.types.PropertyGroup:
    return bpy.data.objects["BarCage"].cage_rig


def seen() -> np.ndarray:
    """Where the window shows the skin."""
    shown = skin().evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.empty((len(shown.data.vertices), 3), np.float32)
    shown.data.vertices.foreach_get("co", points.ravel())
    matrix = np.array(shown.matrix_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def call(operator: object, active: str, **options: object) -> None:
    """As from a menu: with a step of undo."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == active)
    bpy.context.view_layer.objects.active = bpy.data.objects[active]
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.ed.undo_push(message="Select")
        operator("EXEC_DEFAULT", True, **options)


def acts() -> Iterator[float | None]:
    driver.key("ESC")  # the splash screen
    yield LOOK
    driver.install()
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    rig = build_bar()
    for obj in (rig.armature, rig.cage):
        obj.matrix_world = PLACED @ obj.matrix_world
    bpy.context.view_layer.update()
    for obj in bpy.context.view_layer.objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    bpy.ops.cage_rig.bind("EXEC_DEFAULT", True)
    yield LOOK
    driver.look_from_front(rig.skins)
    yield LOOK
    driver.show_tab()
    for vertex in rig.cage.data.vertices:
        vertex.co.z *= 1.3
    rig.cage.data.update()
    bone = rig.armature.pose.bones[-1]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler = (0.0, 0.0, 0.7)
    yield LOOK
    bpy.ops.ed.undo_push(message="Bend")
    driver.check("the rig is live", settings().state == "LIVE", settings().message)
    yield from apply_transforms(seen())
    yield from apply_modifier(seen())


def apply_transforms(before: np.ndarray) -> Iterator[float | None]:
    for name in ("BarCage", "BarRig"):
        call(bpy.ops.object.transform_apply, name)
        yield LOOK
        driver.screenshot(f"0_{name}")
        obj = bpy.data.objects[name]
        driver.check(f"the transform of {name} is applied", np.allclose(obj.matrix_basis, np.eye(4)))
        driver.check("nothing moves", np.abs(seen() - before).max() < 1e-3, np.abs(seen() - before).max())
        driver.key("Z", ctrl=True)
        yield LOOK
        obj = bpy.data.objects[name]
        driver.check("Ctrl Z brings it back", not np.allclose(obj.matrix_basis, np.eye(4)))
        driver.check("and nothing moves", np.abs(seen() - before).max() < 1e-3, np.abs(seen() - before).max())
        driver.key("Z", ctrl=True, shift=True)
        yield LOOK
        driver.check("nor with redo", np.abs(seen() - before).max() < 1e-3, np.abs(seen() - before).max())
        driver.check("the rig is live", settings().state == "LIVE", settings().message)


def apply_modifier(before: np.ndarray) -> Iterator[float | None]:
    call(bpy.ops.object.modifier_apply, "Bar", modifier="Cage Rig")
    yield LOOK
    driver.screenshot("1_modifier")
    driver.check("the modifier is gone", "Cage Rig" not in skin().modifiers)
    driver.check("the skin keeps its shape", np.abs(seen() - before).max() < 1e-3, np.abs(seen() - before).max())
    driver.check("the panel says so", settings().message.startswith("Cage Rig was applied"), settings().message)
    driver.key("Z", ctrl=True)
    yield LOOK
    driver.check("Ctrl Z brings it back", "Cage Rig" in skin().modifiers and settings().state == "LIVE")
    driver.check("with its shape", np.abs(seen() - before).max() < 1e-3, np.abs(seen() - before).max())
    bone = bpy.data.objects["BarRig"].pose.bones[-1]
    bone.rotation_euler = (0.0, 0.0, 0.1)
    yield LOOK
    driver.screenshot("2_back")
    driver.check("it follows the bones", np.abs(seen() - before).max() > 0.1)


driver.perform(acts())
