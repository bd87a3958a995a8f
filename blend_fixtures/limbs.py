"""What the small rigs are made of: a bar along x with a chain of bones and a box cage, and its action. Blender only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from .bar import bar, box_cage
from .build import RigObjects, build_character
from .parts import Array, Bone, Character, Skin

FRAMES = (1, 6, 13, 19, 25)
KEYED = (1, 13, 25)
_BLEND = 0.2


def limb(count: int = 3, *, extra: Sequence[Bone] = ()) -> Character:
    """A bar from x = −1 to 1 with a chain `bone.0`, `bone.1`, … of `count` bones, then the `extra` bones."""
    coarse = bar(segments=6 * max(count, 4), across=4).skins[0]
    joints = np.linspace(-1.0, 1.0, count + 1)
    bones = [
        Bone(f"bone.{k}", (joints[k], 0.0, 0.0), (joints[k + 1], 0.0, 0.0), f"bone.{k - 1}" if k else None)
        for k in range(count)
    ]
    steps = [_step(coarse.vertices[:, 0] - joint) for joint in joints[1:-1]]
    ends = [np.ones(len(coarse.vertices)), *steps, np.zeros(len(coarse.vertices))]
    weights = np.column_stack([ends[k] - ends[k + 1] for k in range(count)] + [np.zeros_like(ends[0])] * len(extra))
    cage = box_cage([-1.15, *joints[1:-1], 1.15], half=0.3)
    skin = Skin("Limb", coarse.vertices, coarse.faces, weights)
    return Character("Limb", [skin], [*bones, *extra], cage)


def _step(x: Array) -> Array:
    t = np.clip(0.5 + 0.5 * x / _BLEND, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def control(name: str, head: tuple[float, float, float]) -> Bone:
    return Bone(name, head, (head[0], head[1], head[2] + 0.2), deform=False)


def connected(character: Character) -> Character:
    bones = [Bone(b.name, b.head, b.tail, b.parent, b.parent is not None, b.deform) for b in character.bones]
    return replaced(character, bones=bones)


def replaced(character: Character, *, bones: Sequence[Bone] | None = None, weights: Array | None = None) -> Character:
    skin = character.skins[0]
    skin = Skin(skin.name, skin.vertices, skin.faces, skin.weights if weights is None else weights)
    return Character(character.name, [skin], list(bones or character.bones), character.cage)


def part_where(skin: Skin, name: str, keep: Array) -> Skin:
    used, corners = np.unique(skin.faces[keep], return_inverse=True)
    return Skin(name, skin.vertices[used], corners.reshape(-1, skin.faces.shape[1]), skin.weights[used])


def build(character: Character) -> RigObjects:
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    return build_character(character)


def bent() -> RigObjects:
    return waving(limb())


def waving(character: Character) -> RigObjects:
    """The character, every bone of which turns a little."""
    rig = build(character)
    for k in range(len(character.bones)):
        turn(rig, k, (0.4 - 0.1 * k, 0.3, 0.2 + 0.1 * k))
    return rig


def pose_bones(rig: RigObjects) -> list[bpy.types.PoseBone]:
    return list(rig.armature.pose.bones)


def turn(rig: RigObjects, index: int, angles: tuple[float, float, float]) -> None:
    turn_bone(pose_bones(rig)[index], angles)


def turn_bone(bone: bpy.types.PoseBone, angles: tuple[float, float, float]) -> None:
    """Key a rotation: none, `angles`, and back past rest."""
    bone.rotation_mode = "XYZ"
    key(bone, "rotation_euler", (0.0, 0.0, 0.0), angles, tuple(-0.6 * angle for angle in angles))


def key(target: bpy.types.bpy_struct, path: str, *values: float | Sequence[float]) -> None:
    """Key three values over the action."""
    for frame, value in zip(KEYED, values, strict=True):
        setattr(target, path, value)
        target.keyframe_insert(path, frame=frame)


def add_empty(name: str, location: Sequence[float], *, scale: Sequence[float] = (1, 1, 1)) -> bpy.types.Object:
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    made.location, made.scale = location, scale
    bpy.context.view_layer.update()
    return made


def add_curve(name: str, points: Sequence[tuple[float, float, float]]) -> bpy.types.Object:
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("NURBS")
    spline.points.add(len(points) - 1)
    for point, place in zip(spline.points, points, strict=True):
        point.co = (*place, 1.0)
    spline.use_endpoint_u, spline.order_u = True, 4
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def carry(rig: RigObjects) -> None:
    """Move the cage with an armature object that was just placed."""
    bpy.context.view_layer.update()
    rig.cage.matrix_world = rig.armature.matrix_world.copy()


@contextmanager
def editing(armature: bpy.types.Object) -> Iterator[bpy.types.ArmatureEditBones]:
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    yield armature.data.edit_bones
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = None
