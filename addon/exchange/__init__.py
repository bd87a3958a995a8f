# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes from elsewhere and goes there: rigs of [CTL*20]'s prototype, and coordinates. `docs/formats.md`.

    from bl_ext.user_default.cage_rig import exchange
    rig = exchange.import_rig("//arm/arm.skt")
    exchange.export_coordinates(rig.cage, "//arm.npz")
    exchange.load_coordinates(rig.cage, "//harmonic.npz")
    exchange.use_coordinates(rig.cage, cage_coords=phi)

All in Object Mode. Where a function can't, it raises `FileError` with a sentence, and nothing is changed: no part of a
rig, no file. Paths may begin with `//`, the folder of the .blend.
"""

from __future__ import annotations

import bpy

from . import live, rig_files, scene
from .coordinates import Coordinates
from .live import coordinates_of, drop_coordinates, export_coordinates, load_coordinates, rest_of, use_coordinates
from .scene import ImportedRig, Options
from .text import FileError

__all__ = [
    "Coordinates",
    "FileError",
    "ImportedRig",
    "Options",
    "coordinates_of",
    "drop_coordinates",
    "export_coordinates",
    "import_rig",
    "load_coordinates",
    "rest_of",
    "use_coordinates",
]


def import_rig(path: str, options: Options = Options(), **files: str) -> ImportedRig:  # noqa: B008  (frozen)
    """Import the rig of an .skt file, or of a folder with one, and what lies beside: `docs/formats.md` says the names.

    `files` says where others are, by their names in `rig_files.NAMES`: `mesh`, `weights`, `cage`, `skeleton_motion`,
    `cage_motion`, `anchors`, `coordinates`, `centers`.
    """
    given = {name: live.absolute(file) for name, file in files.items() if file}
    rig = rig_files.read(*rig_files.find(live.absolute(path), given))
    return scene.build(bpy.context, rig, options)
