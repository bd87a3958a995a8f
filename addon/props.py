# SPDX-License-Identifier: GPL-3.0-or-later
"""The rig's settings, kept in the .blend on the rest cage object: `cage_object.cage_rig`.

Everything here is data that a file needs to open with its rigs live. Nothing is computed here.
"""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import choosing, layers

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}

# Numbers never move: they are what files store.
METHODS = [
    ("LBS", "Linear", "Linear blend skinning: what Blender's Armature modifier does by default", 0),
    ("DQS", "Dual Quaternion", "Keeps the volume of twisted and bent limbs, as the modifier's Preserve Volume", 1),
    ("COR", "Centers of Rotation", "Turns every vertex about a center of its own: bends bulge less", 2),
]
STATES = [
    ("NONE", "Not Bound", "This object is not the cage of a rig", 0),
    ("LIVE", "Live", "Cage, armature and skins follow one another", 1),
    ("PAUSED", "Paused", "The rig can't run; the message says why and what to do", 2),
]
PARTS = [
    ("NONE", "None", "Not part of a rig", 0),
    ("POSED_CAGE", "Posed Cage", "The cage as the pose deforms it", 1),
    ("REFIT_ARMATURE", "Refit Armature", "The bones, refit to the edited cage", 2),
    ("SKIN", "Skin", "A mesh that a rig deforms", 3),
]


def _tag(settings: CageRigSettings, _context: bpy.types.Context) -> None:
    """A setting changed: let Blender update the rig."""
    settings.id_data.update_tag()


def _choose(settings: CageRigSettings, context: bpy.types.Context) -> None:
    """The method changed."""
    choosing.chosen(settings.id_data, context)
    _tag(settings, context)


def _may_be_input(settings: CageRigSettings, obj: bpy.types.Object) -> bool:
    return layers.may_stand_on(settings.id_data, obj)


class CageRigJoint(bpy.types.PropertyGroup):
    """One bone of the armature as it was at bind. `name` is the bone's name (inherited)."""

    name: StringProperty(name="Bone", override=OVERRIDABLE)
    parent: IntProperty(name="Parent", default=-1, override=OVERRIDABLE)
    head: FloatVectorProperty(name="Head", description="Rest position in the armature's space", override=OVERRIDABLE)
    tail: FloatVectorProperty(name="Tail", description="Rest tail in the armature's space", override=OVERRIDABLE)
    weighted: BoolProperty(name="Weighted", description="Whether it moves any skin", override=OVERRIDABLE)
    shift: FloatVectorProperty(
        name="Shift", description="How far Apply Refit has moved the bone since the bind", override=OVERRIDABLE
    )


class CageRigSuspended(bpy.types.PropertyGroup):
    """A modifier that Cage Rig switched off, and how it was. `name` is the modifier's name."""

    name: StringProperty(name="Modifier", override=OVERRIDABLE)
    uid: IntProperty(description="The modifier's persistent number, which it keeps when renamed", override=OVERRIDABLE)
    show_viewport: BoolProperty(override=OVERRIDABLE)
    show_render: BoolProperty(override=OVERRIDABLE)
    rests: BoolProperty(description="Whether its vertex groups were taken from it", override=OVERRIDABLE)


class CageRigSkin(bpy.types.PropertyGroup):
    """One skin mesh of the rig, with its bind snapshot."""

    object: PointerProperty(type=bpy.types.Object, name="Skin", override=OVERRIDABLE)
    snapshot: PointerProperty(type=bpy.types.Mesh, name="Snapshot", override=OVERRIDABLE)
    mask: StringProperty(
        name="Mask",
        description="A vertex group that confines the cage on this skin; empty: the cage acts wherever it reaches",
        update=_tag,
        override=OVERRIDABLE,
    )
    applied: BoolProperty(
        name="Applied", description="Whether its modifier was applied, so that it left the rig", override=OVERRIDABLE
    )
    skin_to_rig: FloatVectorProperty(name="Skin to Rig", subtype="MATRIX", size=(4, 4), override=OVERRIDABLE)


class CageRigSettings(bpy.types.PropertyGroup):
    """Settings of the rig whose rest cage this object is, and marks on the objects that belong to a rig."""

    version: IntProperty(default=0, description="Of the form of what is kept; see migration", override=OVERRIDABLE)
    state: EnumProperty(items=STATES, name="State", default="NONE", override=OVERRIDABLE)
    message: StringProperty(name="Message", override=OVERRIDABLE)
    fix: StringProperty(name="Fix", description="What the panel's button does about the message", override=OVERRIDABLE)
    method: EnumProperty(
        items=METHODS,
        name="Method",
        description="How bones deform the skin",
        default="LBS",
        update=_choose,
        override=OVERRIDABLE,
    )
    influence: FloatProperty(
        name="Influence",
        description="How much of the cage's shape reaches the skin and the joints: 0 is the cage as it was bound",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_tag,
        options={"ANIMATABLE", "LIBRARY_EDITABLE"},
        override=OVERRIDABLE,
    )
    half_weights: BoolProperty(
        name="16-Bit Weights",
        description="For large characters: what the cage moves is computed in half of the memory and faster. "
        "Positions are off by no more than 0.02 % of the cage's movement",
        update=_tag,
        options={"LIBRARY_EDITABLE"},
        override=OVERRIDABLE,
    )
    input: PointerProperty(
        type=bpy.types.Object,
        name="Input",
        description="The rig that this one stands on: its cage moves the character first, then this one",
        poll=_may_be_input,
        update=_tag,
        override=OVERRIDABLE,
    )
    armature: PointerProperty(type=bpy.types.Object, name="Armature", override=OVERRIDABLE)
    posed_cage: PointerProperty(type=bpy.types.Object, name="Posed Cage", override=OVERRIDABLE)
    refit_armature: PointerProperty(type=bpy.types.Object, name="Refit Armature", override=OVERRIDABLE)
    skins: CollectionProperty(type=CageRigSkin, name="Skins", override=OVERRIDABLE | {"USE_INSERTION"})
    joints: CollectionProperty(type=CageRigJoint, name="Joints", override=OVERRIDABLE | {"USE_INSERTION"})
    snapshot: PointerProperty(type=bpy.types.Mesh, name="Cage at Bind", override=OVERRIDABLE)
    bind_id: StringProperty(name="Bind", description="Which bind the snapshots are of", override=OVERRIDABLE)
    rebased: FloatVectorProperty(
        name="Rebased",
        description="From rig space at the bind, which the snapshots are in, to that of today; zeros: the same",
        subtype="MATRIX",
        size=(4, 4),
        override=OVERRIDABLE,
    )
    place: FloatVectorProperty(
        name="Place", description="Where the cage object was last, and four points of its mesh", size=28
    )
    coordinates: StringProperty(
        name="Coordinates",
        description="Where the rig's coordinates were loaded from; empty: they are computed from the bind",
        override=OVERRIDABLE,
    )
    cage_to_rig: FloatVectorProperty(name="Cage to Rig", subtype="MATRIX", size=(4, 4), override=OVERRIDABLE)

    # Marks on participants. `owner` is the rest cage they belong to.
    part: EnumProperty(items=PARTS, default="NONE", override=OVERRIDABLE)
    owner: PointerProperty(type=bpy.types.Object, name="Owner", override=OVERRIDABLE)
    suspended: CollectionProperty(type=CageRigSuspended, override=OVERRIDABLE | {"USE_INSERTION"})


def _clear_message(overlays: CageRigOverlays, _context: bpy.types.Context) -> None:
    if overlays.message:
        overlays.message = ""


class CageRigOverlays(bpy.types.PropertyGroup):
    """What 3D Views show of a rig beside what Blender draws itself: `workspace.cage_rig_overlays`.

    On the workspace, as it is a way of looking: saved with the file like Blender's own overlays, and never undone.
    """

    weights: BoolProperty(
        name="Weights",
        description="Colour the skins by how much the selected cage vertices (in Edit Mode of a cage), "
        "or the active bone (in Pose Mode), move them. Pink is moved the other way",
        update=_clear_message,
        options=set(),
    )
    weights_opacity: FloatProperty(
        name="Opacity",
        description="How much the colours cover the skin's own look",
        default=0.75,
        min=0.05,
        max=1.0,
        subtype="FACTOR",
        options=set(),
    )
    joint_weights: BoolProperty(
        name="Joint Weights",
        description="Dots on the posed cage, in Pose Mode: how much each of its vertices moves the active bone's "
        "joint. Larger and lighter is more; pink is the other way",
        update=_clear_message,
        options=set(),
    )
    joints: BoolProperty(
        name="Refit Joints",
        description="The joints and bones as they are refit to the edited cage. "
        "Where they differ from the animation's own, those are shown in grey and a line leads from one to the other",
        update=_clear_message,
        options=set(),
    )
    joints_in_front: BoolProperty(
        name="In Front", description="Show refit joints and bones through the skin", default=True, options=set()
    )
    anchors: BoolProperty(
        name="Anchors",
        description="Dots on the skins where the posed cage holds on to them: it is fitted to these points",
        update=_clear_message,
        options=set(),
    )
    fade: BoolProperty(
        name="Fading Cages",
        description="Draw hidden cages: in full near the mouse cursor and faintly elsewhere. "
        "Cages that are not hidden are drawn by Blender as always",
        update=_clear_message,
        options=set(),
    )
    fade_radius: IntProperty(
        name="Radius",
        description="How far from the mouse cursor hidden cages have faded away",
        default=160,
        min=20,
        max=2000,
        soft_max=600,
        subtype="PIXEL",
        options=set(),
    )
    fade_minimum: FloatProperty(
        name="Elsewhere",
        description="What is left of hidden cages far from the mouse cursor",
        default=0.12,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        options=set(),
    )
    message: StringProperty(
        name="Message", description="Why an overlay was switched off, or nothing", options={"HIDDEN", "SKIP_SAVE"}
    )


class CageRigBendingNode(bpy.types.PropertyGroup):
    """Where a generated cage gets a cross section. `name` is the bone's name."""

    name: StringProperty(name="Bone")
    position: FloatProperty(
        name="Position",
        description="Along the bone: 0 at its head, 1 at its tail, more beyond; down to -1 on the way from its parent",
    )


class CageRigCaged(bpy.types.PropertyGroup):
    """A skin that a cage was generated around."""

    object: PointerProperty(type=bpy.types.Object, name="Skin")


class CageRigGenerated(bpy.types.PropertyGroup):
    """How a cage was generated, on its object: `object.cage_rig_generated`. Not the rig's, so that Unbind keeps it."""

    armature: PointerProperty(type=bpy.types.Object, name="Armature")
    skins: CollectionProperty(type=CageRigCaged, name="Skins")
    fingerprint: StringProperty(description="Of skin and skeleton as they were")
    own_nodes: BoolProperty(name="Own Nodes", description="Whether the artist has chosen the bending nodes")
    nodes: CollectionProperty(type=CageRigBendingNode, name="Bending Nodes")
    placement: StringProperty(default="AUTOMATIC")
    corners: IntProperty(default=4)
    triangles: BoolProperty()
    clearance: FloatProperty(default=3e-4)
    tightness: FloatProperty(default=1.0)
    detail: FloatProperty()
    symmetry: BoolProperty(default=True)
    hull: BoolProperty()
    like: StringProperty(name="Like", description="The cage whose cross sections and faces it has; see caging.like_of")
    arrangement: StringProperty(description="Of the arcs of the skeleton, where they are in another cage's order")


def rig_of(obj: bpy.types.Object | None) -> bpy.types.Object | None:
    """The rest cage of the rig that `obj` is part of: cage, skin, posed cage, refit bones or armature."""
    if obj is None:
        return None
    if obj.cage_rig.state != "NONE":
        return obj
    if obj.cage_rig.owner is None and obj.type == "ARMATURE":
        return next((child.cage_rig.owner for child in obj.children if child.cage_rig.owner), None)
    return obj.cage_rig.owner


CLASSES = (
    CageRigJoint,
    CageRigSuspended,
    CageRigSkin,
    CageRigSettings,
    CageRigOverlays,
    CageRigBendingNode,
    CageRigCaged,
    CageRigGenerated,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.cage_rig = PointerProperty(type=CageRigSettings, name="Cage Rig", override=OVERRIDABLE)
    bpy.types.Object.cage_rig_generated = PointerProperty(type=CageRigGenerated, name="Generated Cage")
    bpy.types.WorkSpace.cage_rig_overlays = PointerProperty(type=CageRigOverlays, name="Cage Rig Overlays")


def unregister() -> None:
    del bpy.types.WorkSpace.cage_rig_overlays
    del bpy.types.Object.cage_rig_generated
    del bpy.types.Object.cage_rig
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
