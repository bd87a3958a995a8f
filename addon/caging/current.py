# SPDX-License-Identifier: GPL-3.0-or-later
"""The editing of bending nodes that is under way, for what shows it. There is one at most."""

from __future__ import annotations

from dataclasses import dataclass

from mathutils import Matrix

from .editing import Editing


@dataclass
class Shown:
    """What 3D Views and panels show of it."""

    editing: Editing
    to_world: Matrix  # from rig space
    working: str = ""  # what is being computed, while that is so
    failure: str = ""  # why it can't be shown
    wish: str = ""  # what a button of the panel asks for: "GENERATE" or "CANCEL"


class _Current:
    def __init__(self) -> None:
        self.shown: Shown | None = None


_current = _Current()


def begin(editing: Editing, to_world: Matrix) -> Shown:
    """Show it from now on."""
    _current.shown = Shown(editing, to_world)
    return _current.shown


def end() -> None:
    """Show nothing."""
    _current.shown = None


def shown() -> Shown | None:
    """What is shown now."""
    return _current.shown
