"""One small rig for each way in which Blender can pose bones, each with an action over `FRAMES`; `RIGS` lists them.

All are a bar along x with a box cage, built into the open scene. Blender only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from .bar import bar, box_cage
from .build import RigObjects, build_character
from .parts import Array, Bone, Character, Skin

FRAMES = (1, 6, 13, 19, 25)
_KEYED = (1, 13, 25)
_BLEND = 0.2


# Root motion, and what a pose bone can be keyed with


def moving_root_bone() -> RigObjects:
    """The root bone walks and turns."""
    rig = _build(limb())
    root = _pose(rig)[0]
    _key(root, "location", (0.0, 0.0, 0.0), (1.5, -2.0, 0.7), (3.0, 1.0, -1.0))
    _turn(rig, 0, (0.4, 1.1, -0.3))
    _turn(rig, 1, (0.0, 0.3, 0.8))
    return rig


def moving_armature_object() -> RigObjects:
    """The armature object walks, turns and grows; the skin is its child."""
    rig = _build(limb())
    _key(rig.armature, "location", (0.0, 0.0, 0.0), (2.0, 1.0, 0.5), (-1.0, 3.0, 1.0))
    _key(rig.armature, "rotation_euler", (0.0, 0.0, 0.0), (0.3, 0.2, 1.5), (0.0, -0.4, 3.0))
    _key(rig.armature, "scale", (1.0, 1.0, 1.0), (1.0, 1.5, 0.8), (0.5, 0.5, 0.5))
    _turn(rig, 1, (0.2, 0.0, 0.9))
    return rig


def moving_armature_object_and_free_skin() -> RigObjects:
    """The same, but the skin has no parent: the armature moves against it."""
    rig = moving_armature_object()
    rig.skins[0].parent = None
    return rig


def keyed_locations() -> RigObjects:
    """Every bone of the chain is moved, not only turned."""
    rig = _build(limb())
    for k, bone in enumerate(_pose(rig)):
        _key(bone, "location", (0.0, 0.0, 0.0), (0.1 * k, 0.15, -0.2), (-0.1, 0.05 * k, 0.25))
        _turn(rig, k, (0.1 * k, 0.3, 0.2))
    return rig


def scaled_bones() -> RigObjects:
    """Non-uniform scale above turned bones, which shears them, and a bone turned inside out."""
    rig = _build(limb(4))
    _key(_pose(rig)[0], "scale", (1.0, 1.0, 1.0), (1.4, 0.7, 1.1), (0.8, 1.3, 1.5))
    _key(_pose(rig)[1], "scale", (1.0, 1.0, 1.0), (0.6, 1.5, 1.0), (1.2, 1.2, 0.7))
    _key(_pose(rig)[3], "scale", (1.0, 1.0, 1.0), (-1.0, 1.0, 0.8), (-1.0, 1.2, 1.0))
    for k in range(4):
        _turn(rig, k, (0.3, 0.5 - 0.2 * k, 0.6))
    return rig


def collapsed_bone() -> RigObjects:
    """A bone scaled to nothing at frame 25, as animators do to hide a part."""
    rig = _build(limb())
    _turn(rig, 1, (0.0, 0.2, 0.7))
    _key(_pose(rig)[2], "scale", (1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (0.0, 0.0, 0.0))
    return rig


def rotation_modes() -> RigObjects:
    """Quaternion, axis-angle and an unusual Euler order in one chain."""
    rig = _build(limb())
    first, second, third = _pose(rig)
    first.rotation_mode, second.rotation_mode, third.rotation_mode = "QUATERNION", "AXIS_ANGLE", "ZYX"
    _key(first, "rotation_quaternion", (1.0, 0.0, 0.0, 0.0), (0.9, 0.3, 0.2, 0.1), (0.5, -0.5, 0.5, 0.5))
    _key(second, "rotation_axis_angle", (0.0, 0.0, 1.0, 0.0), (0.8, 1.0, 1.0, 0.0), (-1.2, 0.0, 0.3, 1.0))
    _key(third, "rotation_euler", (0.0, 0.0, 0.0), (0.3, 0.9, -0.5), (1.0, 0.2, 0.4))
    return rig


# Constraints and drivers


def stretch_to() -> RigObjects:
    """A bone that stretches to a control bone, with its volume kept, and bulges on its child."""
    rig = _build(limb(extra=[_control("hand", (1.0, 0.0, 0.0))]))
    stretch = _pose(rig)[1].constraints.new("STRETCH_TO")
    stretch.target, stretch.subtarget = rig.armature, "hand"
    stretch.rest_length = rig.armature.data.bones[1].length
    _key(rig.armature.pose.bones["hand"], "location", (0.0, 0.0, 0.0), (0.4, -0.6, 0.5), (-0.3, 0.2, -0.5))
    return rig


def ik_with_pole() -> RigObjects:
    """An IK chain of two with a pole; both controls do not deform."""
    controls = [_control("hand", (0.9, 0.0, 0.0)), _control("pole", (0.0, 0.0, 1.2))]
    rig = _build(limb(extra=controls))
    with _editing(rig.armature) as bones:
        bones["bone.1"].tail.z = bones["bone.2"].head.z = 0.05
    ik = _pose(rig)[2].constraints.new("IK")
    ik.target, ik.subtarget, ik.chain_count = rig.armature, "hand", 2
    ik.pole_target, ik.pole_subtarget, ik.pole_angle = rig.armature, "pole", -0.5 * np.pi
    _key(rig.armature.pose.bones["hand"], "location", (-0.1, 0.0, 0.0), (-0.4, 0.3, 0.3), (-0.6, -0.3, 0.0))
    _key(rig.armature.pose.bones["pole"], "location", (0.0, 0.0, 0.0), (0.0, 0.8, 0.0), (0.5, -0.8, 0.0))
    return rig


def stretchy_ik() -> RigObjects:
    """An IK chain whose bones stretch, pulled farther than it is long."""
    rig = _build(limb(extra=[_control("hand", (1.0, 0.0, 0.0))]))
    ik = _pose(rig)[2].constraints.new("IK")
    ik.target, ik.subtarget = rig.armature, "hand"
    for bone in _pose(rig)[:3]:
        bone.ik_stretch = 0.4
    _key(rig.armature.pose.bones["hand"], "location", (0.0, 0.0, 0.0), (0.8, 0.5, 0.3), (-0.5, 0.4, -0.6))
    return rig


def spline_ik() -> RigObjects:
    """A chain along a curve that is moved and bent by its own shape keys."""
    rig = _build(limb(4))
    curve = _curve("Path", [(-1.0, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.3, 0.0, 0.0), (1.1, 0.0, 0.0)])
    curve.shape_key_add(name="Basis")
    bent = curve.shape_key_add(name="Bent")
    for point, offset in zip(bent.data, (0.0, 0.3, -0.3, 0.6), strict=True):
        point.co += Vector((0.0, offset, -0.5 * offset))
    _key(bent, "value", 0.0, 1.0, 0.4)
    spline = _pose(rig)[3].constraints.new("SPLINE_IK")
    spline.target, spline.chain_count, spline.y_scale_mode = curve, 4, "FIT_CURVE"
    return rig


def copies_and_limits() -> RigObjects:
    """Copy Rotation and Copy Location from control bones, Limit Rotation and Limit Scale on keyed bones."""
    rig = _build(limb(4, extra=[_control("turn", (0.0, 0.8, 0.0)), _control("place", (0.0, -0.8, 0.0))]))
    bones = _pose(rig)
    copied = bones[1].constraints.new("COPY_ROTATION")
    copied.target, copied.subtarget, copied.influence = rig.armature, "turn", 0.7
    copied.target_space = copied.owner_space = "LOCAL"
    placed = bones[3].constraints.new("COPY_LOCATION")
    placed.target, placed.subtarget, placed.use_z, placed.influence = rig.armature, "place", False, 0.5
    limit = bones[2].constraints.new("LIMIT_ROTATION")
    limit.use_limit_x = limit.use_limit_z = True
    limit.max_x, limit.max_z, limit.owner_space = 0.2, 0.3, "LOCAL"
    size = bones[0].constraints.new("LIMIT_SCALE")
    size.use_max_x, size.max_x = True, 1.1
    _key(bones[0], "scale", (1.0, 1.0, 1.0), (1.5, 1.2, 1.0), (0.8, 0.8, 0.8))
    _turn(rig, 2, (0.9, 0.1, 0.9))
    _turn_bone(rig.armature.pose.bones["turn"], (0.5, 0.6, 0.7))
    _key(rig.armature.pose.bones["place"], "location", (0.0, 0.0, 0.0), (0.5, 0.9, 0.4), (1.0, 1.0, 0.0))
    return rig


def targets_outside() -> RigObjects:
    """Child Of and Damped Track to objects, and an Armature constraint between two bones."""
    rig = _build(limb(4))
    bones = _pose(rig)
    holder, aim = _empty("Holder", (-1.0, 0.0, 0.0)), _empty("Aim", (1.0, 0.5, 1.0))
    child = bones[0].constraints.new("CHILD_OF")
    child.target, child.inverse_matrix = holder, holder.matrix_world.inverted()
    track = bones[2].constraints.new("DAMPED_TRACK")
    track.target, track.track_axis = aim, "TRACK_Y"
    both = bones[3].constraints.new("ARMATURE")
    for name, weight in (("bone.0", 0.3), ("bone.2", 0.7)):
        target = both.targets.new()
        target.target, target.subtarget, target.weight = rig.armature, name, weight
    _key(holder, "location", (-1.0, 0.0, 0.0), (-0.5, 0.6, 0.2), (-1.5, -0.5, 0.8))
    _key(holder, "rotation_euler", (0.0, 0.0, 0.0), (0.5, 0.2, 0.4), (-0.6, 0.0, 0.9))
    _key(aim, "location", (1.0, 0.5, 1.0), (0.8, 1.4, -0.5), (1.5, -1.0, 0.5))
    return rig


def driven_bones() -> RigObjects:
    """Bones turned and scaled by drivers that read another bone."""
    rig = _build(limb(extra=[_control("slider", (0.0, 1.0, 0.0))]))
    for bone, path, index, expression in (
        (_pose(rig)[1], "rotation_euler", 2, "2 * way"),
        (_pose(rig)[2], "rotation_euler", 0, "-way"),
        (_pose(rig)[2], "scale", 1, "1 + way"),
    ):
        bone.rotation_mode = "XYZ"
        driver = bone.driver_add(path, index).driver
        variable = driver.variables.new()
        variable.name, variable.type = "way", "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target, target.transform_type = rig.armature, "slider", "LOC_X"
        target.transform_space = "LOCAL_SPACE"
        driver.expression = expression
    _key(rig.armature.pose.bones["slider"], "location", (0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (-0.4, 0.0, 0.0))
    return rig


# Hierarchy


def every_inherit_scale() -> RigObjects:
    """A scaled and turned chain where each bone inherits scale in another of Blender's six ways."""
    modes = ("FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY")
    rig = _build(limb(7))
    for bone, mode in zip(rig.armature.data.bones[1:], modes, strict=True):
        bone.inherit_scale = mode
    for k, bone in enumerate(_pose(rig)):
        _key(bone, "scale", (1.0, 1.0, 1.0), (1.2, 0.8, 1.0 + 0.1 * k), (0.9, 1.2, 0.8))
        _turn(rig, k, (0.1, 0.2, 0.3))
    return rig


def no_inherited_rotation() -> RigObjects:
    """A bone that does not turn with its parent, scaled and not."""
    rig = _build(limb(4))
    rig.armature.data.bones[1].use_inherit_rotation = False
    rig.armature.data.bones[3].use_inherit_rotation = False
    rig.armature.data.bones[3].inherit_scale = "NONE"
    _key(_pose(rig)[0], "scale", (1.0, 1.0, 1.0), (1.3, 1.0, 0.8), (0.9, 1.1, 1.0))
    for k in range(4):
        _turn(rig, k, (0.4, 0.1 * k, 0.6))
    return rig


def no_local_location() -> RigObjects:
    """Bones moved along the armature's axes, not their own."""
    rig = _build(limb())
    for k, bone in enumerate(_pose(rig)):
        bone.bone.use_local_location = False
        _key(bone, "location", (0.0, 0.0, 0.0), (0.2, 0.1 * k, 0.3), (0.0, -0.3, 0.1))
        _turn(rig, k, (0.3, 0.4, 0.2))
    return rig


def several_roots() -> RigObjects:
    """Three bones side by side without parents, each with its own motion, weights blended between them."""
    character = limb()
    bones = [Bone(bone.name, bone.head, bone.tail) for bone in character.bones]
    rig = _build(_replaced(character, bones=bones))
    for k, bone in enumerate(_pose(rig)):
        _key(bone, "location", (0.0, 0.0, 0.0), (0.1, 0.2 * k, 0.3), (0.2 * k, -0.2, 0.0))
        _turn(rig, k, (0.5 - 0.3 * k, 0.4, 0.3 * k))
    return rig


def control_bones_between() -> RigObjects:
    """Non-deforming bones inside the chain and outside the cage; one has a vertex group that must not count."""
    character = limb()
    bones = [
        Bone("ground", (0.0, 0.0, -3.0), (0.0, 0.5, -3.0), deform=False),
        Bone("bone.0", character.bones[0].head, character.bones[0].tail, "ground"),
        Bone("lift", character.bones[0].tail, (-0.3, 0.0, 0.5), "bone.0", deform=False),
        Bone("bone.1", character.bones[1].head, character.bones[1].tail, "lift"),
        Bone("bone.2", character.bones[2].head, character.bones[2].tail, "bone.1"),
    ]
    weights = np.zeros((len(character.skins[0].vertices), 5))
    weights[:, [1, 3, 4]] = character.skins[0].weights
    weights[:, 2] = 0.4
    rig = _build(_replaced(character, bones=bones, weights=weights))
    _key(_pose(rig)[0], "location", (0.0, 0.0, 0.0), (0.5, 0.3, 0.0), (-0.3, 1.0, 0.2))
    for k in (0, 2, 3):
        _turn(rig, k, (0.3, 0.5, -0.2))
    return rig


def bones_without_weights() -> RigObjects:
    """Deforming bones that no vertex knows: one in the chain, one at its end, one far away."""
    character = limb(5)
    weights = character.skins[0].weights.copy()
    weights[:, 1] += weights[:, 2]
    weights[:, 2] = 0.0
    bones = [
        *character.bones,
        Bone("leaf", (1.0, 0.0, 0.0), (1.4, 0.0, 0.0), "bone.4"),
        Bone("far", (5, 5, 5), (5, 5, 6)),
    ]
    rig = _build(_replaced(character, bones=bones, weights=np.pad(weights, ((0, 0), (0, 2)))))
    for k in range(7):
        _turn(rig, k, (0.1 * k, 0.3, 0.3 - 0.1 * k))
    _key(_pose(rig)[2], "location", (0.0, 0.0, 0.0), (0.0, 0.2, 0.1), (0.1, 0.0, -0.2))
    return rig


def mirrored_armature() -> RigObjects:
    """The armature object mirrored by a negative scale; the skin is its child."""
    rig = _bent()
    rig.armature.scale = (-1.0, 1.0, 1.0)
    _carry(rig)
    return rig


def mirrored_bones() -> RigObjects:
    """Left and right arms from a middle root, posed as mirror images of each other."""
    character = limb(4)
    bones = [Bone("root", (0.0, 0.0, -0.15), (0.0, 0.0, 0.15))]
    for side, sign in (("L", 1.0), ("R", -1.0)):
        elbow = (0.5 * sign, 0.0, 0.0)
        bones.append(Bone(f"upper.{side}", (0.0, 0.0, 0.0), elbow, "root"))
        bones.append(Bone(f"fore.{side}", elbow, (sign, 0.0, 0.0), f"upper.{side}", connected=True))
    weights = np.zeros((len(character.skins[0].vertices), 5))
    weights[:, 1:] = character.skins[0].weights[:, [2, 3, 1, 0]]  # the limb's bones run from right to left
    rig = _build(_replaced(character, bones=bones, weights=weights))
    _key(_pose(rig)[0], "location", (0.0, 0.0, 0.0), (0.0, 0.2, 0.3), (0.1, 0.0, -0.3))
    for name in ("upper", "fore"):
        left, right = (rig.armature.pose.bones[f"{name}.{side}"] for side in "LR")
        _turn_bone(left, (0.5, 0.2, 0.7))
        _turn_bone(right, (0.5, -0.2, -0.7))
    return rig


# Weights


def unnormalised_weights() -> RigObjects:
    """Weights that sum to 0.3 on one half and to 2.5 on the other (single ones stay below 1)."""
    character = limb(4)
    skin = character.skins[0]
    weights = 0.5 * skin.weights + 0.125
    weights *= np.where(skin.vertices[:, :1] < 0.0, 0.3, 2.5) / weights.sum(axis=1, keepdims=True)
    weights = np.minimum(weights, 1.0)
    left, right = weights.sum(axis=1).min(), weights.sum(axis=1).max()
    assert left < 0.31 and right > 2.2, (left, right)
    return _waving(_replaced(character, weights=weights))


def eight_influences() -> RigObjects:
    """Every vertex is moved by eight bones."""
    character = limb(8)
    skin = character.skins[0]
    middles = np.array([0.5 * (bone.head[0] + bone.tail[0]) for bone in character.bones])
    weights = np.exp(-2.0 * np.abs(skin.vertices[:, :1] - middles))
    return _waving(_replaced(character, weights=weights / weights.sum(axis=1, keepdims=True)))


def vertices_without_weights() -> RigObjects:
    """Some vertices in no group at all, some in groups with weight 0, some with next to none."""
    character = limb()
    skin = character.skins[0]
    weights = skin.weights.copy()
    weights[skin.vertices[:, 0] > 0.9] = 0.0
    rig = _waving(_replaced(character, weights=weights))
    last = np.flatnonzero(skin.vertices[:, 0] > 0.97).tolist()
    rig.skins[0].vertex_groups["bone.2"].add(last, 0.0, "REPLACE")
    return rig


def groups_without_bones() -> RigObjects:
    """Vertex groups that are no bone's, before, between and after those that are."""
    rig = _bent()
    groups = rig.skins[0].vertex_groups
    everything = list(range(len(rig.skins[0].data.vertices)))
    for name in ("Mask", "bone.9", "Cloth pin"):
        groups.new(name=name).add(everything, 0.8, "REPLACE")
    groups.new(name="Empty")
    with bpy.context.temp_override(object=rig.skins[0], active_object=rig.skins[0]):
        groups.active_index = groups["Mask"].index
        for _ in range(3):
            bpy.ops.object.vertex_group_move(direction="UP")
    return rig


# Objects


def unapplied_transforms() -> RigObjects:
    """Armature, skin and cage each under a parent of its own; all of them turned and scaled, two of them keyed."""
    rig = _bent()
    skin, armature, cage = rig.skins[0], rig.armature, rig.cage
    placed = Matrix.LocRotScale(Vector((1, 2, 3)), Euler((0.3, 0.4, 0.5)), Vector((2.0, 1.5, 1.0)))
    armature.parent = _empty("Stage", (0.5, -1.0, 0.0), scale=(1.5, 1.0, 0.8))
    armature.matrix_basis = placed
    bpy.context.view_layer.update()
    world = armature.matrix_world.copy()
    for obj, holder, basis in (
        (
            skin,
            _empty("Dresser", (0.0, 1.0, 0.0), scale=(1.0, 0.7, 1.2)),
            ((0, 5, 1), (1.0, 0.2, 0.0), (-1.0, 2.0, 0.7)),
        ),
        (
            cage,
            _empty("Scaffold", (2.0, 0.0, 0.0), scale=(0.5, 1.0, 1.0)),
            ((-1, 0, 2), (0.1, -0.7, 0.2), (0.5, 3.0, 1.0)),
        ),
    ):
        obj.parent = holder
        obj.matrix_parent_inverse = Matrix.Rotation(0.3, 4, "Z")
        obj.matrix_basis = Matrix.LocRotScale(Vector(basis[0]), Euler(basis[1]), Vector(basis[2]))
        bpy.context.view_layer.update()
        obj.data.transform(obj.matrix_world.inverted() @ world)  # where it is seen stays the same
    _key(armature.parent, "rotation_euler", (0.0, 0.0, 0.0), (0.2, 0.5, -0.3), (0.0, 0.9, 1.0))
    _key(skin.parent, "location", (0.0, 1.0, 0.0), (0.2, 0.9, 0.1), (0.0, 1.3, -0.2))
    return rig


def skin_parented_to_a_bone() -> RigObjects:
    """The skin hangs on a bone and is deformed by the armature too."""
    rig = _bent()
    skin = rig.skins[0]
    skin.parent, skin.parent_type, skin.parent_bone = rig.armature, "BONE", "bone.0"
    bpy.context.scene.frame_set(FRAMES[0])
    skin.matrix_parent_inverse = (skin.matrix_world @ skin.matrix_basis.inverted()).inverted()
    _turn(rig, 0, (0.2, 0.3, 0.1))
    return rig


def deformed_by_its_parent() -> RigObjects:
    """No Armature modifier: the skin is parented "Armature Deform" as old files have it."""
    rig = _bent()
    rig.skins[0].modifiers.clear()
    rig.skins[0].parent_type = "ARMATURE"
    return rig


def armature_in_other_units() -> RigObjects:
    """An armature in hundredths, as game formats import it: object scale 0.01, bones a hundred times as long."""
    character = limb()
    times = 100.0
    bones = [
        Bone(b.name, tuple(times * x for x in b.head), tuple(times * x for x in b.tail), b.parent, b.connected)
        for b in character.bones
    ]
    rig = _waving(_replaced(character, bones=bones))
    rig.armature.scale = (0.01, 0.01, 0.01)
    rig.skins[0].matrix_parent_inverse = Matrix.Scale(times, 4)
    return rig


def two_skins_and_a_hidden_bone_collection() -> RigObjects:
    """Two meshes of one character, and bones whose collection is hidden."""
    character = limb()
    skin = character.skins[0]
    left = skin.vertices[skin.faces].mean(axis=1)[:, 0] < 0.1
    rig = _waving(
        Character("Limb", [_part(skin, "Near", left), _part(skin, "Far", ~left)], character.bones, character.cage)
    )
    hidden = rig.armature.data.collections.new("Hidden")
    for bone in rig.armature.data.bones:
        hidden.assign(bone)
    hidden.is_visible = False
    return rig


RIGS: dict[str, Callable[[], RigObjects]] = {
    make.__name__: make
    for make in (
        moving_root_bone,
        moving_armature_object,
        moving_armature_object_and_free_skin,
        keyed_locations,
        scaled_bones,
        collapsed_bone,
        rotation_modes,
        stretch_to,
        ik_with_pole,
        stretchy_ik,
        spline_ik,
        copies_and_limits,
        targets_outside,
        driven_bones,
        every_inherit_scale,
        no_inherited_rotation,
        no_local_location,
        several_roots,
        control_bones_between,
        bones_without_weights,
        mirrored_armature,
        mirrored_bones,
        unnormalised_weights,
        eight_influences,
        vertices_without_weights,
        groups_without_bones,
        unapplied_transforms,
        skin_parented_to_a_bone,
        deformed_by_its_parent,
        armature_in_other_units,
        two_skins_and_a_hidden_bone_collection,
    )
}


def bendy_bones() -> RigObjects:
    """A chain whose middle bone is a B-bone: Blender bends the skin along its segments, the add-on refuses it."""
    rig = _build(_connected(limb()))
    rig.armature.data.bones["bone.1"].bbone_segments = 8
    for k in range(3):
        _turn(rig, k, (0.2, 0.3, 0.5))
    return rig


def build_rig(name: str) -> RigObjects:
    """The rig of this name, at the first frame of its action, where it rests."""
    rig = RIGS[name]()
    bpy.context.scene.frame_set(FRAMES[0])
    return rig


# What they are made of


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


def _control(name: str, head: tuple[float, float, float]) -> Bone:
    return Bone(name, head, (head[0], head[1], head[2] + 0.2), deform=False)


def _connected(character: Character) -> Character:
    bones = [Bone(b.name, b.head, b.tail, b.parent, b.parent is not None, b.deform) for b in character.bones]
    return _replaced(character, bones=bones)


def _replaced(character: Character, *, bones: Sequence[Bone] | None = None, weights: Array | None = None) -> Character:
    skin = character.skins[0]
    skin = Skin(skin.name, skin.vertices, skin.faces, skin.weights if weights is None else weights)
    return Character(character.name, [skin], list(bones or character.bones), character.cage)


def _part(skin: Skin, name: str, keep: Array) -> Skin:
    used, corners = np.unique(skin.faces[keep], return_inverse=True)
    return Skin(name, skin.vertices[used], corners.reshape(-1, skin.faces.shape[1]), skin.weights[used])


def _build(character: Character) -> RigObjects:
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    return build_character(character)


def _bent() -> RigObjects:
    return _waving(limb())


def _waving(character: Character) -> RigObjects:
    """The character, every bone of which turns a little."""
    rig = _build(character)
    for k in range(len(character.bones)):
        _turn(rig, k, (0.4 - 0.1 * k, 0.3, 0.2 + 0.1 * k))
    return rig


def _pose(rig: RigObjects) -> list[bpy.types.PoseBone]:
    return list(rig.armature.pose.bones)


def _turn(rig: RigObjects, index: int, angles: tuple[float, float, float]) -> None:
    _turn_bone(_pose(rig)[index], angles)


def _turn_bone(bone: bpy.types.PoseBone, angles: tuple[float, float, float]) -> None:
    """Key a rotation: none, `angles`, and back past rest."""
    bone.rotation_mode = "XYZ"
    _key(bone, "rotation_euler", (0.0, 0.0, 0.0), angles, tuple(-0.6 * angle for angle in angles))


def _key(target: bpy.types.bpy_struct, path: str, *values: float | Sequence[float]) -> None:
    """Key three values over the action."""
    for frame, value in zip(_KEYED, values, strict=True):
        setattr(target, path, value)
        target.keyframe_insert(path, frame=frame)


def _empty(name: str, location: Sequence[float], *, scale: Sequence[float] = (1, 1, 1)) -> bpy.types.Object:
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    made.location, made.scale = location, scale
    bpy.context.view_layer.update()
    return made


def _curve(name: str, points: Sequence[tuple[float, float, float]]) -> bpy.types.Object:
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


def _carry(rig: RigObjects) -> None:
    """Move the cage with an armature object that was just placed."""
    bpy.context.view_layer.update()
    rig.cage.matrix_world = rig.armature.matrix_world.copy()


@contextmanager
def _editing(armature: bpy.types.Object) -> Iterator[bpy.types.ArmatureEditBones]:
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    yield armature.data.edit_bones
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = None
