# SPDX-License-Identifier: GPL-3.0-or-later
"""Several rigs on one skin: each names the rig that it stands on, and the one on top places the skin's vertices.

A lower cage moves the rest character, the next one moves what it finds, and the bones pose the sum.
"""

from __future__ import annotations

import bpy

from .adapters import armature, dependence, modifier


def below(cage: bpy.types.Object) -> list[bpy.types.Object]:
    """The rigs that this one stands on, the nearest first. Ends where a cycle would begin."""
    found: list[bpy.types.Object] = []
    lower = cage.cage_rig.input
    while lower is not None and lower != cage and lower not in found:
        found.append(lower)
        lower = lower.cage_rig.input
    return found


def bottom_up(cages: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """The rigs in the order in which they act."""
    return sorted(cages, key=lambda cage: len(below(cage))) if len(cages) > 1 else cages


def skins_of(cage: bpy.types.Object) -> list[bpy.types.Object]:
    """The skins of a rig that still exist, and on which its modifier was not applied."""
    return [skin.object for skin in cage.cage_rig.skins if skin.object is not None and not skin.applied]


def may_stand_on(cage: bpy.types.Object, lower: bpy.types.Object) -> bool:
    """Whether the rig could take `lower` as its input: a rig on one of its skins and its bones, and no cycle."""
    shared = set(skins_of(cage)) & set(skins_of(lower))
    same = lower.cage_rig.armature == cage.cage_rig.armature
    return lower != cage and bool(shared) and same and cage not in below(lower)


def problem(cage: bpy.types.Object) -> str:
    """Why the rig can't stand where it does, or an empty string."""
    lower = cage.cage_rig.input
    if lower is not None:
        if lower.cage_rig.state == "NONE":
            return f"'{lower.name}', on which '{cage.name}' stands, is no cage any more; choose another input or none"
        if not may_stand_on(cage, lower):
            return f"'{cage.name}' can't stand on '{lower.name}': it needs the same armature and skin, and no cycle"
    for obj in skins_of(cage):
        beside = [other for other in _tops(obj) if other not in (cage, *below(cage)) and cage not in below(other)]
        if beside and obj.cage_rig.owner != cage:
            return f"'{obj.name}' is deformed by '{beside[0].name}' too; let '{cage.name}' stand on it (Input)"
    return ""


def settle(obj: bpy.types.Object) -> None:
    """Let the rig on top place the skin's vertices."""
    if len(modifier.ours(obj)) == 1 and modifier.read(modifier.ours(obj)[0], "Attribute"):
        return
    tops = _tops(obj)
    if tops and obj.cage_rig.owner not in tops:
        obj.cage_rig.owner = tops[0]
    if tops:
        modifier.lead(obj, obj.cage_rig.owner)


def _tops(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The rigs on the skin that none of its rigs stands on."""
    cages = _cages(obj)
    return [cage for cage in cages if not any(other.cage_rig.input == cage for other in cages)]


def _cages(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The rest cages of the rigs on the skin."""
    return [cage for cage in map(modifier.cage_of, modifier.ours(obj)) if cage is not None]


def wait(cage: bpy.types.Object) -> None:
    """Have Blender evaluate cage and bones wherever it shows a skin or the posed cage of the rig, however hidden, and
    where the posed cage is.

    A skin of another file keeps no driver: it depends on both cages by its modifier, and through the posed cage on the
    bones, so that it is evaluated twice a frame.
    """
    skins, posed = skins_of(cage), cage.cage_rig.posed_cage
    for skin in skins:
        if is_own(skin):
            cages = _cages(skin)
            shown = [other.cage_rig.posed_cage for other in cages]
            dependence.settle(skin, [_read_from(other) for other in cages], places=[obj for obj in shown if obj])
        bare = is_own(skin) and len(modifier.ours(skin)) == 1
        inputs = {"Rest Cage": None if is_own(skin) else cage, "Posed Cage": None if bare else posed}
        modifier.set_inputs(modifier.find(skin, cage), inputs)
    if is_own(posed):
        far = not all(is_own(skin) for skin in skins)
        dependence.settle(posed, [_read_from(cage)] if far else [], passed_on=True)
        dependence.settle(posed, [] if far else [_read_from(cage)])


def is_own(obj: bpy.types.Object) -> bool:
    """Whether the object is this file's, and no override of another one's."""
    return obj.library is None and obj.override_library is None


def _read_from(cage: bpy.types.Object) -> dependence.Rig:
    obj = cage.cage_rig.armature
    return cage, obj, armature.ends(obj.data, [joint.name for joint in cage.cage_rig.joints])
