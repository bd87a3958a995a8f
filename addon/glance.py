# SPDX-License-Identifier: GPL-3.0-or-later
"""What a rig was found to be when it was last looked at closely, and how to see at a glance that it still is.

Looking closely (`health`, `layers`, modifiers, names of bones) takes longer than a frame of a small character. It is
done at every edit; a frame alone changes none of it, but scripts may have, so what they could have changed is compared
(bones apart: a frame tells itself that an armature has changed).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import health, session
from .adapters import armature, modifier, stack


@dataclass(frozen=True)
class Bones:
    """Which of an armature's bones the joints are, and their rest matrices."""

    pose_order: NDArray[np.int64] | None  # #J, among `pose.bones`; None: as they are
    rest: NDArray[np.float64]  # #J by 4 by 4
    core: Any  # the same, the core's


def read_bones(cage: bpy.types.Object, evaluated: bpy.types.Object, known: Bones | None) -> Bones:
    """The joints' bones in the evaluated armature object; what follows from `known` rest matrices is taken over."""
    rest_order, pose_order = health.bone_order(cage)
    rest = armature.read_rest_matrices(evaluated.data)[rest_order]
    as_they_are = np.array_equal(pose_order, np.arange(len(evaluated.pose.bones)))
    same = known is not None and np.array_equal(known.rest, rest)
    core = known.core if same else session.bones(rest)
    return Bones(None if as_they_are else pose_order, rest, core)


def seen(cage: bpy.types.Object) -> tuple[object, ...] | None:
    """All of a rig that a close look depends on and a frame may have changed; None where that takes a close look."""
    settings = cage.cage_rig
    bones, posed = settings.armature, settings.posed_cage
    if bones is None or posed is None or settings.input is not None:
        return None
    found = [
        settings.bind_id, settings.state, cage.users, bones.users, bones.session_uid, bones.mode, posed.users,
        posed.session_uid, cage.mode, posed.mode,
    ]  # fmt: skip
    for mesh in (cage.data, posed.data):
        if not mesh.is_editmode:
            found += len(mesh.vertices), len(mesh.loops)
    for skin in settings.skins:
        obj = skin.object
        if obj is None:
            return None
        mesh = obj.data
        found += obj.users, obj.session_uid, obj.mode, mesh.users, len(mesh.vertices), skin.mask
        for mod in obj.modifiers:
            found += mod.type, mod.show_viewport, mod.show_render
    return tuple(found)


def is_plain(cage: bpy.types.Object) -> bool:
    """Whether `seen` says all: a live rig of this file, alone on its skins, that reads nothing back from them."""
    settings = cage.cage_rig
    objects = [cage, settings.armature, settings.posed_cage, *(skin.object for skin in settings.skins)]
    if any(obj is None or obj.library or obj.override_library or obj.data.library for obj in objects):
        return False
    return settings.state == "LIVE" and all(
        skin.object.users_collection
        and skin.object.cage_rig.owner == cage
        and len(modifier.ours(skin.object)) == 1
        and not stack.reads_back(skin.object)
        and not skin.mask
        for skin in settings.skins
    )
