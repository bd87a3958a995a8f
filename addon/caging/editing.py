# SPDX-License-Identifier: GPL-3.0-or-later
"""Bending nodes while the artist chooses them: their places, their sections, and what was undone. Knows no bpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..generator import Generator, Points, Refusal, Section
from .course import Course, OnBone, Place, to_pixels

REACH = 22.0  # pixels in which a node or a bone is meant


@dataclass(frozen=True)
class Source:
    """What places nodes and finds sections."""

    generator: Generator
    course: Course
    placement: str


@dataclass(frozen=True)
class _State:
    source: Source
    places: tuple[Place, ...]
    own: bool  # chosen by the artist, not placed


class Editing:
    """The nodes of one character. Every change looks for the sections of what changed, and may be refused."""

    def __init__(self, source: Source, *, symmetry: bool, nodes: list[OnBone] | None) -> None:
        self.symmetry = symmetry
        self.sections: list[Section] = []
        self.hovered: int | None = None  # a node
        self.offered: Place | None = None  # where a click would add one
        self.message, self.fault = "", None  # what was refused, and where: a point or None
        self.revision = 0  # grows with all of these
        self._undone: list[_State] = []
        self._done: list[_State] = []
        self._dragged: int | None = None
        self._state = _State(source, (), own=False)
        self.fault: Points | None
        if nodes is None:
            self._place(source)
        else:
            self._look(_State(source, tuple(source.course.places(nodes)), own=True))

    @property
    def course(self) -> Course:
        """Where nodes can be."""
        return self._state.source.course

    @property
    def placement(self) -> str:
        """How nodes are placed that the artist does not choose."""
        return self._state.source.placement

    @property
    def places(self) -> tuple[Place, ...]:
        """Where the bending nodes are."""
        return self._state.places

    @property
    def bending(self) -> Points | None:
        """The nodes as the core takes them: None where it is to place them."""
        return self.course.points(list(self.places)) if self._state.own else None

    @property
    def nodes(self) -> list[OnBone] | None:
        """The nodes as the file keeps them; None where they are placed."""
        return [self.course.named(place) for place in self.places] if self._state.own else None

    def _place(self, source: Source) -> None:
        self.sections = source.generator.sections(None)
        places = (source.course.nearest(section.place, section.arc) for section in self.sections if section.bending)
        self._state = _State(source, tuple(places), own=False)
        self.revision += 1

    def _look(self, state: _State) -> None:
        """Look for the sections of a state, and take it. Raises `Refusal` where there is one without."""
        source = state.source
        state = _State(source, tuple(map(source.course.kept, state.places)), own=True)
        self.sections = source.generator.sections(source.course.points(list(state.places)))
        self._state = state
        self.refuse("", None)

    def _take(self, state: _State) -> bool:
        """Take a state, or show why it can't be."""
        try:
            self._look(state)
        except Refusal as refusal:
            self.refuse(str(refusal), refusal.place)
            return False
        return True

    def refuse(self, message: str, place: Points | None) -> None:
        """Show a sentence, and the place that it is about; an empty one takes it away."""
        self.message, self.fault = message, place
        self.revision += 1

    def _change(self, places: list[Place]) -> bool:
        before = self._state
        if not self._take(_State(self._state.source, tuple(places), own=True)):
            return False
        self._done.append(before)
        self._undone.clear()
        return True

    def _partner(self, index: int) -> int | None:
        """The node on the other side of a symmetric character."""
        image = self.course.mirrored(self.places[index]) if self.symmetry else None
        if image is None:
            return None
        near = [k for k, place in enumerate(self.places) if k != index and place.arc == image.arc]
        best = min(near, key=lambda k: abs(self.places[k].along - image.along), default=None)
        apart = np.inf if best is None else abs(self.places[best].along - image.along)
        return best if apart < 0.02 * self.course.size else None

    def add(self, place: Place) -> bool:
        """Add a node, and its image; the first one is dragged from now on."""
        image = self.course.mirrored(place) if self.symmetry else None
        added = [place] if image is None else [place, image]
        self._dragged = len(self.places)
        return self._change([*self.places, *added])

    def remove(self, index: int) -> bool:
        """Remove a node, and its image."""
        gone = {index, self._partner(index)}
        self.hovered = None
        return self._change([place for k, place in enumerate(self.places) if k not in gone])

    def grab(self, index: int) -> None:
        """Begin to drag a node."""
        self._dragged = index
        self._done.append(self._state)
        self._undone.clear()

    @property
    def is_dragging(self) -> bool:
        """Whether the mouse moves a node."""
        return self._dragged is not None

    def drag(self, place: Place) -> bool:
        """Move the dragged node there, and its image along."""
        assert self._dragged is not None
        places, partner = list(self.places), self._partner(self._dragged)
        places[self._dragged] = place
        image = self.course.mirrored(place) if partner is not None else None
        if partner is not None and image is not None:
            places[partner] = image
        return self._take(_State(self._state.source, tuple(places), own=True))

    def drop(self) -> None:
        """The dragged node stays where it is."""
        if self._dragged is not None and self._done and self._done[-1] == self._state:
            self._done.pop()  # grabbed and not moved
        self._dragged = None

    def replace(self, source: Source) -> None:
        """Place the nodes anew, by another source."""
        before = self._state
        self._place(source)
        self._done.append(before)
        self._undone.clear()
        self.refuse("", None)

    def undo(self) -> None:
        """Take the last change back."""
        self._step(self._done, self._undone)

    def redo(self) -> None:
        """Do again what was taken back."""
        self._step(self._undone, self._done)

    def _step(self, source: list[_State], target: list[_State]) -> None:
        if source:
            state, before = source.pop(), self._state
            if state.own:
                if not self._take(state):
                    return
            else:
                self._place(state.source)
            target.append(before)
            self.hovered = self.offered = None

    def point_at(self, project: Points, mouse: tuple[float, float], *, unit: float = 1.0) -> bool:
        """The mouse is there: what a click would mean. Returns whether that has changed.

        `project` brings rig space to pixels; `unit`: pixels of the interface's unit.
        """
        hovered, offered = self._hovered(project, mouse, REACH * unit), None
        if hovered is None:
            apart, place = self.course.on_screen(project, mouse)
            offered = place if apart < REACH * unit else None
        changed = (hovered, offered) != (self.hovered, self.offered)
        self.hovered, self.offered = hovered, offered
        self.revision += changed
        return changed

    def _hovered(self, project: Points, mouse: tuple[float, float], reach: float) -> int | None:
        if not self.places:
            return None
        seen, depth = to_pixels(project, self.course.points(list(self.places)))
        apart = np.where(depth > 0.0, np.linalg.norm(seen - mouse, axis=1), np.inf)
        best = int(apart.argmin())
        return best if apart[best] < 0.7 * reach else None
