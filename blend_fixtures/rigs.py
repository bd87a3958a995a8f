"""One small rig for each way in which Blender can pose bones, each with an action over `FRAMES`; `RIGS` lists them.

All are a bar along x with a box cage, built into the open scene. Blender only.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .build import RigObjects
from .limbs import FRAMES, limb
from .rigs_constrained import (
    copies_and_limits,
    driven_bones,
    ik_with_pole,
    spline_ik,
    stretch_to,
    stretchy_ik,
    targets_outside,
)
from .rigs_hierarchy import (
    bones_without_weights,
    control_bones_between,
    every_inherit_scale,
    mirrored_armature,
    mirrored_bones,
    no_inherited_rotation,
    no_local_location,
    several_roots,
)
from .rigs_keyed import (
    collapsed_bone,
    keyed_locations,
    moving_armature_object,
    moving_armature_object_and_free_skin,
    moving_root_bone,
    rotation_modes,
    scaled_bones,
)
from .rigs_objects import (
    armature_in_other_units,
    bendy_bones,
    deformed_by_its_parent,
    skin_parented_to_a_bone,
    two_skins_and_a_hidden_bone_collection,
    unapplied_transforms,
)
from .rigs_weights import eight_influences, groups_without_bones, unnormalised_weights, vertices_without_weights

__all__ = ["FRAMES", "RIGS", "bendy_bones", "build_rig", "limb"]

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


def build_rig(name: str) -> RigObjects:
    """The rig of this name, at the first frame of its action, where it rests."""
    rig = RIGS[name]()
    bpy.context.scene.frame_set(FRAMES[0])
    return rig
