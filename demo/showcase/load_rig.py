"""Brings a rigged file into the scene: .glb, .gltf, .fbx or .blend; its cage from a file, or made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion

from blend_fixtures.build import RigObjects, add_cage
from blend_fixtures.enclosure import check_cage
from blend_fixtures.materials import material
from blend_fixtures.parts import Cage

from . import acting, text_rig
from .coarse_hull import coarse_hull
from .figures import Array, mesh_points, to_world

_BEND = np.radians(9.0)


@dataclass(frozen=True)
class Loaded:
    """A character ready to bind. `frame` shows its pose; `edit_key` is the shape key of the cage that shows an edit."""

    rig: RigObjects
    frame: int
    edit_key: str = acting.FAT
    cage_is_animated: bool = False
    note: str = ""


def load_rig(path: Path, cage_path: Path | None) -> Loaded:
    """Import `path` and its cage. Raises ValueError with what the file lacks."""
    if path.is_dir() or path.suffix == ".skt":
        return Loaded(*text_rig.load_text_rig(path), cage_is_animated=True, note="its own cage and animations")
    objects = _import(path)
    armature, skins = _rigged(path, objects)
    for skin in skins:
        _ensure_material(skin)
    frame = _ensure_action(armature)
    cage, note = _cage_for(skins, armature, cage_path, objects)
    return Loaded(RigObjects(skins, armature, cage), frame, note=note)


def _import(path: Path) -> list[bpy.types.Object]:
    """The objects that `path` adds to the scene."""
    before = set(bpy.data.objects)
    kind = path.suffix.lower()
    if kind in (".glb", ".gltf"):
        bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=True)
    elif kind == ".fbx":
        bpy.ops.import_scene.fbx(filepath=str(path))
    elif kind == ".obj":
        bpy.ops.wm.obj_import(filepath=str(path))
    elif kind == ".ply":
        bpy.ops.wm.ply_import(filepath=str(path))
    elif kind == ".blend":
        with bpy.data.libraries.load(str(path)) as (source, target):
            target.objects = source.objects
        for obj in set(bpy.data.objects) - before:
            bpy.context.scene.collection.objects.link(obj)
    else:
        raise ValueError(f"{path.name}: give a .glb, .gltf, .fbx or .blend (a cage also as .obj or .ply)")
    bpy.context.view_layer.update()
    return [obj for obj in bpy.data.objects if obj not in before]


def _rigged(path: Path, objects: list[bpy.types.Object]) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """The armature that deforms most vertices, and its skins."""
    skins: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for obj in objects:
        for modifier in obj.modifiers:
            if modifier.type == "ARMATURE" and modifier.object is not None and obj.vertex_groups:
                skins.setdefault(modifier.object, []).append(obj)
    if not skins:
        raise ValueError(f"{path.name} has no mesh with an armature; the demo needs a rigged character")
    armature = max(skins, key=lambda owner: sum(len(skin.data.vertices) for skin in skins[owner]))
    return armature, list(dict.fromkeys(skins[armature]))


def _ensure_material(skin: bpy.types.Object) -> None:
    """Clay for a skin that has no material or only plain ones without nodes."""
    slots = skin.material_slots
    if not any(slot.material is not None and slot.material.node_tree is not None for slot in slots):
        skin.data.materials.clear()
        skin.data.materials.append(material("Clay"))


def _ensure_action(armature: bpy.types.Object) -> int:
    """Use the armature's action, or give it one that curls every chain; returns the frame to show."""
    scene = bpy.context.scene
    data = armature.animation_data
    if data is not None and data.action is not None:
        first, last = (round(frame) for frame in data.action.frame_range)
        scene.frame_start, scene.frame_end = first, max(last, first + 1)
        return first + (last - first) // 4
    acting.set_frames()
    for bone in armature.pose.bones:
        if len(bone.parent_recursive) < 2:
            continue
        bone.rotation_mode = "QUATERNION"
        for frame, share in ((1, 0.0), (12, 1.0), (36, -0.6), (48, 0.0)):
            bone.rotation_quaternion = Quaternion((1.0, 0.0, 0.0), share * _BEND)
            bone.keyframe_insert("rotation_quaternion", frame=frame)
    return 12


def _cage_for(
    skins: list[bpy.types.Object],
    armature: bpy.types.Object,
    path: Path | None,
    objects: list[bpy.types.Object],
) -> tuple[bpy.types.Object, str]:
    """The cage: from `path`, from an unskinned mesh of the file called "cage", or a coarse hull."""
    armature.data.pose_position = "REST"
    bpy.context.view_layer.update()
    points, triangles = _rest_surface(skins)
    armature.data.pose_position = "POSE"
    if path is not None:
        found = max((o for o in _import(path) if o.type == "MESH"), key=lambda o: len(o.data.vertices))
        return _as_cage(found, points), f"cage from {path.name}"
    for obj in objects:
        if obj.type == "MESH" and obj not in skins and "cage" in obj.name.lower():
            return _as_cage(obj, points), "its own cage"
    return add_cage("CoarseHull", coarse_hull(points, triangles)), "a coarse hull as cage"


def _rest_surface(skins: list[bpy.types.Object]) -> tuple[Array, Array]:
    """World vertices (#V by 3) and triangles (#F by 3) of all skins as evaluated now."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    points, triangles, start = [], [], 0
    for skin in skins:
        mesh = skin.evaluated_get(depsgraph).data
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        points.append(to_world(mesh_points(mesh), skin.matrix_world))
        triangles.append(corners.reshape(-1, 3) + start)
        start += len(mesh.vertices)
    return np.concatenate(points), np.concatenate(triangles)


def _as_cage(obj: bpy.types.Object, points: Array) -> bpy.types.Object:
    """`obj` drawn as a cage; warns if it does not enclose the skins."""
    vertices = to_world(mesh_points(obj.data), obj.matrix_world)
    report = check_cage(Cage(vertices, [list(face.vertices) for face in obj.data.polygons]), points)
    if not report.good:
        print(f"note: {obj.name} is no sound cage of this character: {report}")
    obj.display_type, obj.hide_render = "WIRE", True
    return obj
