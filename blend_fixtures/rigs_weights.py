"""Bars with weights that are not the usual ones."""

from __future__ import annotations

import bpy
import numpy as np

from .build import RigObjects
from .limbs import (
    bent,
    limb,
    replaced,
    waving,
)


def unnormalised_weights() -> RigObjects:
    """Weights that sum to 0.3 on one half and to 2.5 on the other (single ones stay below 1)."""
    character = limb(4)
    skin = character.skins[0]
    weights = 0.5 * skin.weights + 0.125
    weights *= np.where(skin.vertices[:, :1] < 0.0, 0.3, 2.5) / weights.sum(axis=1, keepdims=True)
    weights = np.minimum(weights, 1.0)
    left, right = weights.sum(axis=1).min(), weights.sum(axis=1).max()
    assert left < 0.31 and right > 2.2, (left, right)
    return waving(replaced(character, weights=weights))


def eight_influences() -> RigObjects:
    """Every vertex is moved by eight bones."""
    character = limb(8)
    skin = character.skins[0]
    middles = np.array([0.5 * (bone.head[0] + bone.tail[0]) for bone in character.bones])
    weights = np.exp(-2.0 * np.abs(skin.vertices[:, :1] - middles))
    return waving(replaced(character, weights=weights / weights.sum(axis=1, keepdims=True)))


def vertices_without_weights() -> RigObjects:
    """Some vertices in no group at all, some in groups with weight 0, some with next to none."""
    character = limb()
    skin = character.skins[0]
    weights = skin.weights.copy()
    weights[skin.vertices[:, 0] > 0.9] = 0.0
    rig = waving(replaced(character, weights=weights))
    last = np.flatnonzero(skin.vertices[:, 0] > 0.97).tolist()
    rig.skins[0].vertex_groups["bone.2"].add(last, 0.0, "REPLACE")
    return rig


def groups_without_bones() -> RigObjects:
    """Vertex groups that are no bone's, before, between and after those that are."""
    rig = bent()
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
