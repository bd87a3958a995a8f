# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing at the mouse cursor of 3D Views, in Blender's own drawing of cursors.

It comes with the cursor's place whenever the mouse moves, during drags too, and over the finished picture of the view
under the cursor: no operator has to run (which would hold up auto-save), and the scene is not redrawn.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

_handles: list[Any] = []


def follow(draw: Callable[[tuple[int, int]], None]) -> None:
    """From now on call `draw` with the cursor's place in its window, unless that is so already."""
    if not _handles:
        _handles.append(bpy.types.WindowManager.draw_cursor_add(draw, (), "VIEW_3D", "WINDOW"))


def leave() -> None:
    """Stop. Needed before a file is loaded too: Blender forgets drawings of cursors then, and the handle is stale."""
    while _handles:
        bpy.types.WindowManager.draw_cursor_remove(_handles.pop())


def is_followed() -> bool:
    """Whether `follow` is at work."""
    return bool(_handles)
