"""What an animator does with a bound rig: pose bones, edit and key the rest cage, play, export."""

from __future__ import annotations

import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from blend_fixtures.build import RigObjects, add_shape_key
from blend_fixtures.walk import FRAMES

from .figures import Array, mesh_points

FAT = "Fat"
SHORT = "Short"


def show_rest(rig: RigObjects, resting: bool) -> None:
    """Put the armature at rest, or back into its pose."""
    rig.armature.data.pose_position = "REST" if resting else "POSE"
    bpy.context.view_layer.update()


def set_key(rig: RigObjects, name: str, value: float) -> None:
    """Set a shape key of the rest cage; the skins follow in the same update."""
    rig.cage.data.shape_keys.key_blocks[name].value = value
    bpy.context.view_layer.update()


def clear_keys(rig: RigObjects) -> None:
    """Show the rest cage as it was bound: all its shape keys at 0."""
    for block in rig.cage.data.shape_keys.key_blocks:
        block.value = 0.0
    bpy.context.view_layer.update()


def ensure_fat_key(rig: RigObjects, *, amount: float = 0.022) -> None:
    """Give the rest cage the key "Fat" if it has none: outward by `amount` of its size."""
    keys = rig.cage.data.shape_keys
    if keys is not None and FAT in keys.key_blocks:
        return
    mesh = rig.cage.data
    points = mesh_points(mesh)
    normals = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("normal", normals)
    size = np.linalg.norm(np.ptp(points, axis=0))
    add_shape_key(rig.cage, FAT, points + amount * size * normals.reshape(-1, 3))


def animate_key(rig: RigObjects, name: str, values: dict[int, float]) -> None:
    """Keyframe a shape key of the rest cage: frame → value."""
    block = rig.cage.data.shape_keys.key_blocks[name]
    for frame, value in values.items():
        block.value = value
        block.keyframe_insert("value", frame=frame)


def turn_up(rig: RigObjects, bone_name: str, degrees: float) -> None:
    """Turn a bone that lies along x upward, about its parent."""
    bone = rig.armature.pose.bones[bone_name]
    bone.rotation_mode = "AXIS_ANGLE"
    axis = bone.bone.matrix_local.to_3x3().inverted() @ Vector((0.0, 1.0, 0.0))
    bone.rotation_axis_angle = (-np.radians(degrees), *axis)
    bpy.context.view_layer.update()


def animate_bend(rig: RigObjects, bone_name: str, angles: dict[int, float]) -> None:
    """Keyframe a bar's bend: frame → degrees, upward."""
    for frame, angle in angles.items():
        turn_up(rig, bone_name, angle)
        rig.armature.pose.bones[bone_name].keyframe_insert("rotation_axis_angle", frame=frame)


def play(first: int, last: int) -> float:
    """Step through the frames as playback does; returns seconds a frame."""
    start = time.perf_counter()
    for frame in range(first, last + 1):
        bpy.context.scene.frame_set(frame)
    return (time.perf_counter() - start) / (last - first + 1)


def evaluated_points(skin: bpy.types.Object) -> Array:
    """The deformed coordinates of a skin, in its own space (#V by 3)."""
    return mesh_points(skin.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)


def export_alembic(path: Path, skins: list[bpy.types.Object]) -> None:
    """Bake the skins over the scene's frames."""
    bpy.ops.object.select_all(action="DESELECT")
    for skin in skins:
        skin.select_set(True)
    scene = bpy.context.scene
    bpy.ops.wm.alembic_export(
        filepath=str(path), start=scene.frame_start, end=scene.frame_end, selected=True, as_background_job=False
    )
    bpy.ops.object.select_all(action="DESELECT")


def set_frames(last: int = FRAMES) -> None:
    """Frames 1 to `last` at 24 a second."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, last, 24
