# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on itself keeps in a file, brought to the form of this version where another one has written it.

Nothing that the artist made is touched: bind, shapes and keys are what they were, in every version.

    1  the form of the first builds
    2  node groups with feed and masks; memory and a driver on the posed cage; snapshots that name their bind
"""

from __future__ import annotations

import bpy

from . import binding, layers
from .adapters import modifier, positions

VERSION = 2


def problem(cage: bpy.types.Object) -> str:
    """Why this version can't take the rig in the form that it has, or an empty string. Then it is left as it is."""
    settings, home = cage.cage_rig, _home(cage)
    if settings.version > VERSION:
        return f"'{cage.name}' was bound with a newer Cage Rig; update the extension"
    if settings.version < VERSION and home is not None:
        return (
            f"'{cage.name}' was bound with an older Cage Rig in '{home.filepath}'; open and save that file, then "
            "reload it here (Outliner, Blender File, Libraries)"
        )
    return ""


def _home(obj: bpy.types.Object) -> bpy.types.Library | None:
    """The file that has the object; None where that is this one."""
    return obj.library if obj.override_library is None else obj.override_library.reference.library


def migrate(cage: bpy.types.Object) -> None:
    """Bring a rig without a `problem` to the present form. What is of another file stays, see `linked`."""
    settings = cage.cage_rig
    for skin in layers.skins_of(cage):
        if skin.library is None:
            modifier.renew(skin)
    if settings.version >= VERSION or _home(cage) is not None:
        return
    posed = settings.posed_cage
    if posed is not None and posed.type == "MESH" and posed.library is None:
        if not posed.data.is_editmode:
            positions.add_layers(posed.data, binding.MEMORY)
        for constraint in [found for found in posed.constraints if found.type == "ARMATURE"]:
            posed.constraints.remove(constraint)  # of no influence; the driver took its place
    binding.mark(cage)
    settings.version = VERSION
