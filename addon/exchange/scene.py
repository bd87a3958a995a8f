# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig of [CTL*20]'s prototype in the scene: skin, armature and cage, with its animations as actions.

The files' own axes and units are those of the armature's space; how they lie in the scene is the armature object's
transform, which skin and cage follow as its children.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .. import lifecycle
from ..adapters import armature, positions, vertex_groups
from ..bake.drafts import Draft, draft
from ..bake.keys import Keys
from ..session import SessionError, mean_value_coordinates
from . import bones, rig_files
from .coordinates import Coordinates
from .live import to_known
from .prototype import CageMotion, Mesh
from .rig_files import PrototypeRig
from .text import Doubles, FileError

UPRIGHT = {"Y": 0.5 * np.pi, "Z": 0.0}  # what turns that axis of the files up, about X


@dataclass(frozen=True)
class Options:
    """How a rig comes into the scene."""

    up: str = "Y"  # which of the files' axes points up
    scale: float = 1.0
    frame_start: int = 1  # where second 0 of the animations is
    every_frame: bool = True  # key the bones on every frame, between the files' keys as the prototype turns them
    keep_steps: bool = False  # joints go where the animation puts them, and not where they are on their fathers at rest
    set_frame_range: bool = True
    bind: bool = True
    use_coordinates: bool = True  # those of the files, and their anchors, where it is bound


@dataclass(frozen=True)
class ImportedRig:
    """What came in."""

    skin: bpy.types.Object
    armature: bpy.types.Object
    cage: bpy.types.Object
    summary: str  # one sentence for the artist


def build(context: bpy.types.Context, rig: PrototypeRig, options: Options) -> ImportedRig:
    """Make the rig's objects in a collection of their own, select them, and bind them. Object Mode.

    Raises `FileError` where it can't be bound, with nothing left.
    """
    with draft() as made:
        objects = _Objects(context, rig, options, made)
        made.finish(rig.name)
        context.view_layer.update()
        if options.bind:
            _bind(context, rig, objects, options)
    if options.set_frame_range and objects.last is not None:
        context.scene.frame_start, context.scene.frame_end = options.frame_start, int(np.ceil(objects.last))
    for obj in context.selected_objects:
        obj.select_set(False)
    for obj in (objects.skin, objects.bones, objects.cage):
        obj.select_set(True)
    context.view_layer.objects.active = objects.cage
    return ImportedRig(objects.skin, objects.bones, objects.cage, _summary(rig, objects, options))


class _Objects:
    """The objects of a rig while they are made, and the last frame of its animations."""

    def __init__(self, context: bpy.types.Context, rig: PrototypeRig, options: Options, made: Draft) -> None:
        self._made, self._options = made, options
        self._rate = context.scene.render.fps / context.scene.render.fps_base
        self.last: float | None = None
        up = np.eye(3)["XYZ".index(options.up)]
        self.bones, self._names = self._new_armature(context, rig, up)
        self.bones.rotation_euler.x, self.bones.scale = UPRIGHT[options.up], (options.scale,) * 3
        self.skin = self._new_child(rig.name, rig.mesh)
        vertex_groups.write_weights(self.skin, self._names, rig.weights)
        modifier = self.skin.modifiers.new("Armature", "ARMATURE")
        modifier.object = self.bones
        self.cage = self._new_child(f"{rig.name} Cage", rig.cage)
        self.cage.data.shade_flat()
        self.cage.display_type, self.cage.hide_render = "WIRE", True
        if rig.skeleton_motion is not None:
            self._key_bones(rig)
        if rig.cage_motion is not None:
            self._key_cage(rig.cage_motion)

    def _new_object(self, name: str, data: bpy.types.ID) -> bpy.types.Object:
        self._made.add(data)
        obj = bpy.data.objects.new(name, data)
        self._made.add(obj)
        self._made.objects.append(obj)
        return obj

    def _new_armature(
        self, context: bpy.types.Context, rig: PrototypeRig, up: Doubles
    ) -> tuple[bpy.types.Object, list[str]]:
        """The armature, and the bones' names as Blender takes them, in the order of the joints."""
        skeleton = rig.skeleton
        obj = self._new_object(f"{rig.name} Armature", bpy.data.armatures.new(f"{rig.name} Armature"))
        obj.show_in_front = True
        with armature.editing(obj, context) as edit_bones:
            made = [edit_bones.new(name) for name in skeleton.names]
            for bone, head, tail in zip(made, skeleton.joints, bones.tails(skeleton, up), strict=True):
                bone.head, bone.tail = head, tail
            for bone, parent in zip(made, skeleton.parents.tolist(), strict=True):
                if parent >= 0:
                    bone.parent = made[parent]
            return obj, [bone.name for bone in made]

    def _new_child(self, name: str, mesh: Mesh) -> bpy.types.Object:
        corners, sizes = mesh.faces
        faces = (corners.astype(np.int32), sizes.astype(np.int32))
        obj = self._new_object(name, positions.new_mesh(name, mesh.vertices.astype(np.float32), faces))
        obj.parent = self.bones
        return obj

    def _frames(self, seconds: Doubles) -> Doubles:
        frames = self._options.frame_start + seconds * self._rate
        self.last = max(float(frames[-1]), self.last or float(frames[-1]))
        return frames

    def _key_bones(self, rig: PrototypeRig) -> None:
        found = {bone.name: bone for bone in self.bones.data.bones}
        rest = np.array([armature.to_array(found[name].matrix_local)[:3, :3] for name in self._names])
        rate = self._rate if self._options.every_frame else None
        keyed = bones.keys(rig.skeleton, rig.skeleton_motion, rest, rate=rate, keep_steps=self._options.keep_steps)
        curves = Keys(self.bones, self.bones.name, self._made)
        self._frames(rig.skeleton_motion.times)
        for name, bone_keys in zip(self._names, keyed, strict=True):
            bone = self.bones.pose.bones[name]
            path = bone.path_from_id()
            for k, values in enumerate(bone_keys.rotations.T):
                curves.add(f"{path}.rotation_quaternion", k, self._at(bone_keys.rotation_times), values)
            if bone_keys.locations.any():
                for k, values in enumerate(bone_keys.locations.T):
                    curves.add(f"{path}.location", k, self._at(bone_keys.location_times), values)

    def _at(self, seconds: Doubles) -> Doubles:
        return self._options.frame_start + seconds * self._rate

    def _key_cage(self, motion: CageMotion) -> None:
        """A shape key for each key that moves the cage, which fades in from the one before and out to the next."""
        frames = self._frames(motion.times)
        moving = np.flatnonzero(motion.offsets.any(axis=(1, 2)))
        if not len(moving):
            return
        rest = positions.read_base(self.cage.data)
        self.cage.shape_key_add(name="Basis", from_mix=False)
        curves = Keys(self.cage.data.shape_keys, self.cage.name, self._made)
        for k in moving.tolist():
            block = self.cage.shape_key_add(name=f"Cage {k}", from_mix=False)
            block.points.foreach_set("co", (rest + motion.offsets[k]).astype(np.float32).ravel())
            block.value = 0.0
            near = np.arange(max(k - 1, 0), min(k + 2, len(frames)))
            curves.add(f"{block.path_from_id()}.value", 0, frames[near], (near == k).astype(float))


def _bind(context: bpy.types.Context, rig: PrototypeRig, objects: _Objects, options: Options) -> None:
    given = Coordinates()
    try:
        if options.use_coordinates:
            given = _coordinates(rig)
        lifecycle.bind(
            context, objects.cage, objects.bones, [objects.skin], known=to_known(given), source=", ".join(given.names)
        )
    except (lifecycle.BindError, SessionError) as error:
        raise FileError(f"The files of '{rig.name}' are read, but: {error}") from error


def _coordinates(rig: PrototypeRig) -> Coordinates:
    computed = None
    if rig.centers is not None and rig.cage_coords is None:
        corners, sizes = rig.cage.faces
        computed = mean_value_coordinates(rig.mesh.vertices, rig.cage.vertices, (corners, sizes))
    return rig_files.coordinates(rig, computed)


def _summary(rig: PrototypeRig, objects: _Objects, options: Options) -> str:
    text = (
        f"Imported '{rig.name}': {len(rig.mesh.vertices)} vertices, {len(rig.skeleton.names)} bones, a cage of "
        f"{len(rig.cage.vertices)} vertices"
    )
    if objects.last is not None:
        text += f", animated up to frame {objects.last:g}"
    source = objects.cage.cage_rig.coordinates
    if source:
        text += f". Bound with {source} of its files"
    elif options.bind:
        text += ". Bound"
    return text
