# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on itself keeps in a file, brought to the form of this version where another one has written it.

Nothing that the artist made is touched: bind, shapes and keys are what they were, in every version.

    1  the form of the first builds
    2  node groups with feed and masks; memory and a driver on the posed cage; snapshots that name their bind
"""

from __future__ import annotations

import bpy

from . import binding, layers
from .adapters import armature, modifier, positions

VERSION = 2


def migrate(cage: bpy.types.Object) -> None:
    """Bring a rig of this file to the present form. What is of another file stays, see `linked`."""
    settings = cage.cage_rig
    for skin in layers.skins_of(cage):
        if skin.library is None and skin.override_library is None:
            modifier.renew(skin)
    if settings.version >= VERSION or cage.library is not None or cage.override_library is not None:
        return
    posed, bones = settings.posed_cage, settings.armature
    if posed is not None and posed.type == "MESH" and bones is not None and posed.library is None:
        if not posed.data.is_editmode:
            positions.add_layers(posed.data, binding.MEMORY)
        for constraint in [found for found in posed.constraints if found.type == "ARMATURE"]:
            posed.constraints.remove(constraint)  # of no influence; the driver took its place
        armature.depend_on_bones(posed, bones, [joint.name for joint in settings.joints])
    binding.mark(cage)
    settings.version = VERSION
