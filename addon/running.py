# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig that runs: its session, and what of Blender it has seen, so that the next change can be told apart."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import binding, glance, skins
from .adapters import positions
from .session import Playback, Session, SessionError

Points = NDArray[np.float32]
Matrix = NDArray[np.float64]


class Event(enum.Enum):
    """What made Blender call us."""

    EDIT = enum.auto()  # a change in the viewport: both cages and the bones may be edits
    FRAME = enum.auto()  # playback, scrubbing, render, export: cage and pose are set together
    RESTORED = enum.auto()  # undo, redo, load, bind: the data is the truth, whatever we knew


@dataclass
class Running:
    """One rig, from its bind or load until its session is dropped."""

    session: Session
    bind: str  # that the session was made from, see binding.key
    cage_to_rig: Matrix | None  # None: the identity
    cage: Points | None = None  # rest cage, rig space, as last read
    cage_wanted: Points | None = None  # rest cage that we wrote and have not read yet
    posed: Points | None = None  # posed cage as last read or written
    stale: bool = False  # the posed cage's mesh is not that of this pose: it was hidden
    memory: bytes = b""  # what the edit mesh of the posed cage remembers
    refit_bones: Any = None  # the core's, once they were read
    bones: glance.Bones | None = None  # as last read
    playback: Playback | None = None  # of the frames since the last close look
    seen: tuple[object, ...] | None = None  # the rig at the last close look; None: look closely at the next frame too
    note: str = ""  # what the artist should know, as of the last close look
    worlds: bytes = b""  # where its objects were, see placing
    bones_note: str = ""
    modes: list[str] = field(default_factory=list)  # of the skins, and what was found of them then
    edited: str = ""
    places: skins.Places = field(default_factory=dict)
    written: dict[int, tuple[int, bytes]] = field(default_factory=dict)

    @classmethod
    def of(cls, cage: bpy.types.Object, session: Session) -> Running:
        """The rig of this rest cage, bound in `session`."""
        found = cls(session, binding.key(cage.cage_rig), None)
        found.place(cage)
        return found

    def place(self, cage: bpy.types.Object) -> None:
        """Take over where the file says that the cage is in rig space."""
        matrix = np.array(cage.cage_rig.cage_to_rig, np.float64)
        self.cage_to_rig = None if np.array_equal(matrix, np.eye(4)) else matrix

    def take_rest(self, rest: Points) -> bool:
        """Take the rest cage that was read. Whether it is another one than that of the last update, or than that which
        an edit of the posed cage wrote.
        """
        if len(rest) != len(self.session.snapshot.cage):
            raise SessionError(
                f"its modifiers make {len(rest)} vertices of {len(self.session.snapshot.cage)}; switch them off"
            )
        if self.cage_wanted is not None:
            known = positions.close(rest, self.cage_wanted, 1e-6 * self.session.size)
        else:
            known = self.cage is not None and positions.same(rest, self.cage)
        if not known:
            self.cage, self.cage_wanted = rest, None
        return not known

    def wanted(self) -> Points:
        """The rest cage that Blender has, or will have when what was written is read."""
        return self.cage if self.cage_wanted is None else self.cage_wanted
