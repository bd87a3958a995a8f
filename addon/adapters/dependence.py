# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender has to evaluate for a rig wherever it shows an object, however cage and bones are hidden.

Blender evaluates what is hidden only for what depends on it: bones of a hidden armature for what depends on them, and
their parents for them. A driver that reads the last bones and the cage and gives what was there anyway is such a
dependency; unlike a constraint it draws no relationship lines. Each bone that it reads costs time in every frame. On a
property that means nothing to a mesh it costs no more: the mesh itself does not wait, and is evaluated once a frame,
when its points are written. Where others depend on the object in turn it has to be on the object's place.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy

PROPERTY = "empty_display_size"
PLACE = "delta_location"
SHAPE = "dimensions[0]"
Rig = tuple[bpy.types.Object, bpy.types.Object, list[str]]  # rest cage, armature, names of bones


def settle(
    obj: bpy.types.Object,
    rigs: list[Rig],
    *,
    places: Sequence[bpy.types.Object] = (),
    passed_on: bool = False,
) -> None:
    """Let `obj`, and what depends on its place where that is `passed_on`, wait for these rigs, for the places of these
    objects and for nothing else.
    """
    found = _driver(obj, PLACE if passed_on else PROPERTY)
    wanted = [end for cage, bones, names in rigs for end in [(cage, SHAPE), *((bones, name) for name in names)]]
    wanted += [(other, "") for other in places]
    if ([] if found is None else [_end(variable) for variable in found.variables]) == wanted:
        return
    if found is not None:
        obj.driver_remove(*((PLACE, 0) if passed_on else (PROPERTY,)))
    if not wanted:
        return
    driver = (obj.driver_add(PLACE, 0) if passed_on else obj.driver_add(PROPERTY)).driver
    driver.type, driver.expression = "SCRIPTED", "0.0" if passed_on else "1.0"
    for target, read in wanted:
        variable = driver.variables.new()
        variable.type = "SINGLE_PROP" if read == SHAPE else "TRANSFORMS"
        variable.targets[0].id = target
        if read == SHAPE:
            variable.targets[0].data_path = SHAPE
        else:
            variable.targets[0].bone_target = read


def _driver(obj: bpy.types.Object, path: str) -> bpy.types.Driver | None:
    curves = obj.animation_data.drivers if obj.animation_data is not None else []
    return next((curve.driver for curve in curves if curve.data_path == path), None)


def _end(variable: bpy.types.DriverVariable) -> tuple[bpy.types.Object | None, str]:
    target = variable.targets[0]
    return target.id, target.bone_target if variable.type == "TRANSFORMS" else target.data_path
