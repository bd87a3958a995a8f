"""Bars whose objects are placed, parented or split up in every way; and one that the add-on refuses."""

from __future__ import annotations

import bpy
from mathutils import Euler, Matrix, Vector

from .build import RigObjects
from .limbs import (
    FRAMES,
    add_empty,
    bent,
    build,
    connected,
    key,
    limb,
    part_where,
    replaced,
    turn,
    waving,
)
from .parts import Bone, Character


def unapplied_transforms() -> RigObjects:
    """Armature, skin and cage each under a parent of its own; all of them turned and scaled, two of them keyed."""
    rig = bent()
    skin, armature, cage = rig.skins[0], rig.armature, rig.cage
    placed = Matrix.LocRotScale(Vector((1, 2, 3)), Euler((0.3, 0.4, 0.5)), Vector((2.0, 1.5, 1.0)))
    armature.parent = add_empty("Stage", (0.5, -1.0, 0.0), scale=(1.5, 1.0, 0.8))
    armature.matrix_basis = placed
    bpy.context.view_layer.update()
    world = armature.matrix_world.copy()
    for obj, holder, basis in (
        (
            skin,
            add_empty("Dresser", (0.0, 1.0, 0.0), scale=(1.0, 0.7, 1.2)),
            ((0, 5, 1), (1.0, 0.2, 0.0), (-1.0, 2.0, 0.7)),
        ),
        (
            cage,
            add_empty("Scaffold", (2.0, 0.0, 0.0), scale=(0.5, 1.0, 1.0)),
            ((-1, 0, 2), (0.1, -0.7, 0.2), (0.5, 3.0, 1.0)),
        ),
    ):
        obj.parent = holder
        obj.matrix_parent_inverse = Matrix.Rotation(0.3, 4, "Z")
        obj.matrix_basis = Matrix.LocRotScale(Vector(basis[0]), Euler(basis[1]), Vector(basis[2]))
        bpy.context.view_layer.update()
        obj.data.transform(obj.matrix_world.inverted() @ world)  # where it is seen stays the same
    key(armature.parent, "rotation_euler", (0.0, 0.0, 0.0), (0.2, 0.5, -0.3), (0.0, 0.9, 1.0))
    key(skin.parent, "location", (0.0, 1.0, 0.0), (0.2, 0.9, 0.1), (0.0, 1.3, -0.2))
    return rig


def skin_parented_to_a_bone() -> RigObjects:
    """The skin hangs on a bone and is deformed by the armature too."""
    rig = bent()
    skin = rig.skins[0]
    skin.parent, skin.parent_type, skin.parent_bone = rig.armature, "BONE", "bone.0"
    bpy.context.scene.frame_set(FRAMES[0])
    skin.matrix_parent_inverse = (skin.matrix_world @ skin.matrix_basis.inverted()).inverted()
    turn(rig, 0, (0.2, 0.3, 0.1))
    return rig


def deformed_by_its_parent() -> RigObjects:
    """No Armature modifier: the skin is parented "Armature Deform" as old files have it."""
    rig = bent()
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
    rig = waving(replaced(character, bones=bones))
    rig.armature.scale = (0.01, 0.01, 0.01)
    rig.skins[0].matrix_parent_inverse = Matrix.Scale(times, 4)
    return rig


def two_skins_and_a_hidden_bone_collection() -> RigObjects:
    """Two meshes of one character, and bones whose collection is hidden."""
    character = limb()
    skin = character.skins[0]
    left = skin.vertices[skin.faces].mean(axis=1)[:, 0] < 0.1
    rig = waving(
        Character(
            "Limb", [part_where(skin, "Near", left), part_where(skin, "Far", ~left)], character.bones, character.cage
        )
    )
    hidden = rig.armature.data.collections.new("Hidden")
    for bone in rig.armature.data.bones:
        hidden.assign(bone)
    hidden.is_visible = False
    return rig


def bendy_bones() -> RigObjects:
    """A chain whose middle bone is a B-bone: Blender bends the skin along its segments, the add-on refuses it."""
    rig = build(connected(limb()))
    rig.armature.data.bones["bone.1"].bbone_segments = 8
    for k in range(3):
        turn(rig, k, (0.2, 0.3, 0.5))
    return rig
