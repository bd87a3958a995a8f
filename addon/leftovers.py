# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs that were deleted as a whole leave the file when it is saved, as everything else does that was deleted.

Cage, posed cage, bones and skins use one another, so Blender would keep them in the file for ever, unseen.
"""

from __future__ import annotations

import bpy

from . import registry, sync
from .adapters import modifier


def drop() -> None:
    """Remove the rigs of which no part is in any scene, and that nothing else uses. Undo brings them back."""
    deleted = [cage for cage in registry.rigs() if _is_deleted(cage)]
    if not deleted:
        return
    unused = _unused()
    doomed = {part for cage in deleted if cage in unused for part in _parts(cage)} & unused
    for cage in deleted:
        if cage in doomed:
            sync.drop(cage)
    bpy.data.batch_remove(doomed)
    registry.forget()


def _is_deleted(obj: bpy.types.Object) -> bool:
    local = obj.library is None and obj.override_library is None
    return local and not obj.users_collection and not obj.use_fake_user and obj.asset_data is None


def _parts(cage: bpy.types.Object) -> set[bpy.types.Object]:
    settings = cage.cage_rig
    skins = [skin.object for skin in settings.skins if skin.object is not None]
    feeds = [modifier.read(ours, "Feed") for skin in skins for ours in modifier.ours(skin)]
    parts = [cage, settings.posed_cage, settings.refit_armature, settings.armature, *skins, *feeds]
    return {part for part in parts if part is not None}


def _unused() -> set[bpy.types.Object]:
    """Deleted objects that nothing uses but one another, and scenes, which remember what was edited in them."""
    found = {obj for obj in bpy.data.objects if _is_deleted(obj)}
    users = {obj: using - set(bpy.data.scenes) for obj, using in bpy.data.user_map(subset=found).items()}
    while True:
        own = found | {obj.data for obj in found} | {getattr(obj.data, "shape_keys", None) for obj in found}
        kept = {obj for obj in found if users[obj] - own}
        if not kept:
            return found
        found -= kept
