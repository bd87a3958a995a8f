"""Cages that correct and enliven a pose: a biceps driven by the elbow, a soft body that jiggles, a cloth.

All on the rest cage, by Blender's own drivers and physics; the character follows through the cage.
"""

from __future__ import annotations

from math import pi

import bpy
import numpy as np

from .arm import ELBOW
from .build import RigObjects, add_shape_key, build_arm, build_bar

BULGE = "Biceps"
LAST_FRAME = 24


def driven_biceps() -> RigObjects:
    """The arm, whose cage has a key "Biceps" that the bend of the elbow drives; it bends over frames 1 to 24."""
    rig = build_arm()
    points = _points(rig.cage)
    over_biceps = (points[:, 0] > 0.3 * ELBOW) & (points[:, 0] < 0.8 * ELBOW) & (points[:, 2] > 0.0)
    points[over_biceps, 2] *= 1.5
    key = add_shape_key(rig.cage, BULGE, points)
    driver = key.driver_add("value").driver
    driver.type, driver.expression = "SCRIPTED", f"min(max(bend / {0.5 * pi:.4f}, 0), 1)"
    variable = driver.variables.new()
    variable.name, variable.type = "bend", "ROTATION_DIFF"
    for target, bone in zip(variable.targets, ("upper_arm", "forearm"), strict=True):
        target.id, target.bone_target = rig.armature, bone
    _turn(rig.armature, "forearm", ((1, 0.0), (LAST_FRAME, 0.5 * pi)))
    return rig


def jiggling() -> RigObjects:
    """The bar, shaken by its armature; the cage hangs on the armature as a soft body and lags behind."""
    rig = _shaken()
    group = rig.cage.vertex_groups.new(name="Goal")
    for vertex, point in enumerate(_points(rig.cage)):
        group.add([vertex], float(np.clip(0.9 - 0.45 * abs(point[0]), 0.3, 0.9)), "REPLACE")
    modifier = rig.cage.modifiers.new("Softbody", "SOFT_BODY")
    settings = modifier.settings
    settings.vertex_group_goal, settings.goal_max, settings.goal_spring = "Goal", 0.9, 0.6
    settings.use_edges, settings.pull, settings.push = True, 0.6, 0.6
    settings.effector_weights.gravity = 0.0
    modifier.point_cache.frame_start, modifier.point_cache.frame_end = 1, LAST_FRAME
    return rig


def fluttering() -> RigObjects:
    """The bar; its cage is a cloth pinned at one end that hangs and swings on the shaken armature."""
    rig = _shaken()
    pins = rig.cage.vertex_groups.new(name="Pins")
    for vertex, point in enumerate(_points(rig.cage)):
        pins.add([vertex], 1.0 if point[0] < 0.1 else 0.25, "REPLACE")
    modifier = rig.cage.modifiers.new("Cloth", "CLOTH")
    settings = modifier.settings
    settings.vertex_group_mass, settings.pin_stiffness = "Pins", 2.0
    settings.tension_stiffness = settings.compression_stiffness = 40.0
    modifier.point_cache.frame_start, modifier.point_cache.frame_end = 1, LAST_FRAME
    return rig


CORRECTIONS = {make.__name__: make for make in (driven_biceps, jiggling, fluttering)}


def _shaken() -> RigObjects:
    rig = build_bar()
    rig.cage.parent = rig.armature
    for frame, sideways in ((1, 0.0), (7, 0.5), (13, -0.4), (19, 0.3), (LAST_FRAME, 0.0)):
        rig.armature.location.y = sideways
        rig.armature.keyframe_insert("location", index=1, frame=frame)
    _turn(rig.armature, "upper", ((1, 0.0), (LAST_FRAME, 0.6)))
    bpy.context.scene.frame_set(1)
    return rig


def _turn(armature: bpy.types.Object, name: str, angles: tuple[tuple[int, float], ...]) -> None:
    bone = armature.pose.bones[name]
    bone.rotation_mode = "XYZ"
    for frame, angle in angles:
        bone.rotation_euler = (angle, 0.0, 0.0) if name == "forearm" else (0.0, 0.0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)


def _points(obj: bpy.types.Object) -> np.ndarray:
    points = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", points.ravel())
    return points
