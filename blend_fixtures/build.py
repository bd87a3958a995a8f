"""Puts characters into the open Blender scene: meshes with weights, armature, cage.

Works on bpy 4.2 to 5.2, nothing is selected after.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .arm import arm
from .bar import bar
from .biped import biped
from .materials import material
from .parts import Array, Bone, Cage, Character, Skin
from .walk import add_walk


@dataclass(frozen=True)
class RigObjects:
    """The objects of one character in the scene, not bound."""

    skins: list[bpy.types.Object]
    armature: bpy.types.Object
    cage: bpy.types.Object

    @property
    def all(self) -> list[bpy.types.Object]:
        return [*self.skins, self.armature, self.cage]


def build_biped(*, walk: bool = True) -> RigObjects:
    """The biped with its cage, and its 48-frame walk as the armature's action."""
    rig = build_character(biped())
    if walk:
        add_walk(rig.armature)
    return rig


def build_bar() -> RigObjects:
    """The bar of [CTL*20] Figure 5 with its cage."""
    return build_character(bar())


def build_arm() -> RigObjects:
    """The arm of [CTL*20] Figure 2 with its cage."""
    return build_character(arm())


def build_character(character: Character) -> RigObjects:
    """Any character of this package as objects at the origin; the skins have an Armature modifier and are parented
    to the armature.
    """
    armature = add_armature(character.name + "Rig", character.bones)
    skins = [add_skin(skin, character.bone_names, armature) for skin in character.skins]
    cage = add_cage(character.name + "Cage", character.cage)
    for name, vertices in character.shape_keys.items():
        add_shape_key(cage, name, vertices)
    return RigObjects(skins, armature, cage)


def add_mesh(name: str, vertices: Array, faces: Array | list[list[int]]) -> bpy.types.Object:
    """A smooth-shaded mesh object. `vertices` #V by 3; `faces` #F by k or vertex lists."""
    mesh = bpy.data.meshes.new(name)
    rows = faces.tolist() if isinstance(faces, np.ndarray) else faces
    mesh.from_pydata(np.asarray(vertices, float).tolist(), [], rows)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), dtype=bool))
    mesh.update()
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def add_skin(skin: Skin, bone_names: list[str], armature: bpy.types.Object) -> bpy.types.Object:
    """A skin with materials and vertex groups, deformed by `armature`."""
    made = add_mesh(skin.name, skin.vertices, skin.faces)
    for name in skin.materials:
        made.data.materials.append(material(name))
    if skin.face_materials is not None:
        made.data.polygons.foreach_set("material_index", skin.face_materials.astype(np.int32))
    _add_groups(made, skin.weights, bone_names)
    made.parent = armature
    modifier = made.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    return made


def add_cage(name: str, cage: Cage) -> bpy.types.Object:
    """A cage object: flat faces, drawn as wire, not rendered."""
    made = add_mesh(name, cage.vertices, cage.faces)
    made.data.polygons.foreach_set("use_smooth", np.zeros(len(made.data.polygons), dtype=bool))
    made.display_type = "WIRE"
    made.hide_render = True
    return made


def add_armature(name: str, bones: list[Bone]) -> bpy.types.Object:
    """An armature of `bones` (parents first)."""
    made = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(made)
    made.show_in_front = True
    made.data.display_type = "STICK"
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in bones:
        edit = made.data.edit_bones.new(bone.name)
        edit.head, edit.tail = bone.head, bone.tail
        edit.use_deform = bone.deform
        if bone.parent is not None:
            edit.parent = made.data.edit_bones[bone.parent]
            edit.use_connect = bone.connected
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = None
    made.select_set(False)
    return made


def add_shape_key(target: bpy.types.Object, name: str, vertices: Array) -> bpy.types.ShapeKey:
    """A shape key at value 0 with the given coordinates (#V by 3); adds the basis first if there is none."""
    if target.data.shape_keys is None:
        target.shape_key_add(name="Basis", from_mix=False)
    key = target.shape_key_add(name=name, from_mix=False)
    key.data.foreach_set("co", np.asarray(vertices, np.float32).ravel())
    key.value = 0.0
    return key


def _add_groups(target: bpy.types.Object, weights: Array, names: list[str]) -> None:
    """Vertex groups for the columns of `weights` (#V by #J) that are not empty."""
    for column, name in enumerate(names):
        rows = np.flatnonzero(weights[:, column] > 0.0)
        if len(rows):
            group = target.vertex_groups.new(name=name)
            for row in rows.tolist():
                group.add([row], float(weights[row, column]), "REPLACE")
