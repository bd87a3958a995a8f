# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m cage_rig …`, from the folder it was installed into, where Blender is the bpy module: the command line."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import addon_utils
import bpy


def installed() -> str:
    """Enable the extension that this folder is, as Blender knows it; returns the name of its package."""
    folder = Path(__file__).absolute().parent
    for repository in bpy.context.preferences.extensions.repos:
        if Path(repository.directory).absolute() == folder.parent:
            name = f"bl_ext.{repository.module}.{folder.name}"
            if addon_utils.enable(name) is not None:
                return name
    sys.exit(f"cage_rig: '{folder}' is not installed as an extension; install its zip in Blender first")


if __name__ == "__main__":
    sys.exit(importlib.import_module(f"{installed()}.headless").main(sys.argv[1:]))
