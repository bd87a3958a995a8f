# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays in, arrays out: the core's cage generator. Knows no bpy."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, ParamSpec, TypeVar

import cage_rig_core
import numpy as np
from numpy.typing import NDArray

P = ParamSpec("P")
R = TypeVar("R")
Points = NDArray[np.float64]
Faces = tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]  # corners, sizes
ROUGH = "the rough cage"  # how the core begins a sentence on one


class Refusal(Exception):
    """The core has no cage; the message is its sentence. With the skeleton's node and the place, where it has them."""

    def __init__(
        self, message: str, node: int | None = None, place: Points | None = None, section: int | None = None
    ) -> None:
        super().__init__(message)
        self.node, self.place = node, place
        self.section = section  # of a cage to be like

    @property
    def is_of_skin(self) -> bool:
        """Whether the skin itself can't be used, at a place of it."""
        return self.place is not None and self.node is None and not self.is_of_rough

    @property
    def is_of_rough(self) -> bool:
        """Whether it is a rough cage that can't be used."""
        return str(self).startswith(ROUGH)


class Cancelled(Exception):
    """The work was cancelled; nothing of it is left."""


@dataclass(frozen=True)
class Input:
    """A closed skin (`#V by 3`, faces) and a skeleton (`#N by 3`, `#E by 2`), in rig space, and the core's options."""

    points: Points
    faces: Faces
    nodes: Points
    edges: NDArray[np.int64]
    options: dict[str, Any]

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for equal inputs."""
        arrays = (self.points, *self.faces, self.nodes, self.edges)
        return (*(array.tobytes() for array in arrays), tuple(sorted(self.options.items())))

    @property
    def fingerprint(self) -> str:
        """Of the skin and the skeleton, for files: equal for equal ones."""
        found = hashlib.blake2b(digest_size=16)
        for array in (self.points, *self.faces, self.nodes, self.edges):
            found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()


class Earlier(NamedTuple):
    """A cage of the same input, in rig space: its bending nodes (None where they were placed), vertices, and faces."""

    bending: Points | None
    points: Points
    faces: Faces
    arrangement: list[int] | None = None  # of its report


class Like(NamedTuple):
    """A generated cage whose sections and faces another one is to have, in rig space."""

    points: Points
    faces: Faces
    corners: int  # of a section


@dataclass(frozen=True)
class Section:
    """A control node and its cross section, in rig space."""

    bending: bool  # else at the end of a limb
    place: Points  # on the skeleton
    point: Points  # beside it, in the middle of the skin
    radius: float
    node: int  # the nearest one of the skeleton
    arc: int
    ring: Points  # #R by 3, on the skin
    corners: Points  # of the cage


@dataclass(frozen=True)
class Cage:
    """A generated cage, in rig space."""

    points: Points
    faces: Faces
    sections: list[Section]
    owners: NDArray[np.int64]  # the section of each vertex
    dropped: list[int]  # nodes of the skeleton that took no part
    report: dict[str, Any]


@dataclass(frozen=True)
class Arc:
    """A part of the skeleton as the core uses it, from one end or branching to the next."""

    path: Points
    nodes: NDArray[np.int64]  # of the skeleton handed in, -1 between them


def _door(function: Callable[P, R]) -> Callable[P, R]:
    """Errors of the core become ours; a Rust panic, which is a BaseException, stops here too."""

    @functools.wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except cage_rig_core.Cancelled as cancelled:
            raise Cancelled from cancelled
        except cage_rig_core.CagingError as error:
            place = None if error.place is None else np.array(error.place)
            raise Refusal(str(error), error.node, place, error.section) from error
        except ValueError as error:
            raise Refusal(str(error)) from error
        except cage_rig_core.PanicException as panic:
            raise Refusal(f"internal error of the core ({panic}); please report it") from None

    return guarded


class Job:
    """A cage on its way in a thread of the core. Dropping it cancels it."""

    def __init__(self, job: cage_rig_core.CagingJob) -> None:
        self._job = job

    @property
    def done(self) -> bool:
        """Whether `result` answers at once."""
        return bool(self._job.done)

    @property
    def share(self) -> float:
        """How much is done, 0 to 1."""
        return float(self._job.progress)

    @property
    def stage(self) -> str:
        """What is being computed, for people."""
        return str(self._job.stage)

    def cancel(self) -> None:
        """Stop it soon; `result` raises `Cancelled` then."""
        self._job.cancel()

    def wait(self, seconds: float) -> bool:
        """Whether it is done, after so many seconds at most."""
        return bool(self._job.wait(seconds))

    @_door
    def result(self) -> Cage:
        """The cage; raises `Refusal`."""
        points, faces, report = self._job.result()
        if not isinstance(faces, tuple):
            faces = (faces.ravel(), np.full(len(faces), faces.shape[1]))
        sections = [_section(found) for found in report["sections"]]
        owners = np.asarray(report["vertex_sections"])
        return Cage(np.asarray(points), faces, sections, owners, list(report["dropped_nodes"]), dict(report))


class Generator:
    """A skin and its skeleton: sections for previews, and the cage. What is asked for twice is computed once."""

    @_door
    def __init__(self, given: Input) -> None:
        self.given = given
        skin, skeleton = (given.points, given.faces), (given.nodes, given.edges)
        self._core = cage_rig_core.CageGenerator(*skin, *skeleton, options=given.options)

    @_door
    def sections(self, bending: Points | None = None, like: Like | None = None) -> list[Section]:
        """Control nodes and their sections; `bending` (`#B by 3`) instead of those that are placed, or of `like`."""
        return [_section(found) for found in self._core.sections(bending, like=like)]

    @_door
    def start(self, bending: Points | None = None, earlier: Earlier | None = None, like: Like | None = None) -> Job:
        """Begin to make the cage. What an earlier one has around nodes that are still there stays."""
        arrangement = None if earlier is None else earlier.arrangement
        return Job(self._core.generate(bending, earlier and earlier[:3], like=like, arrangement=arrangement))

    @_door
    def fit(self, points: Points, faces: Faces) -> Job:
        """Begin to make a rough cage, in rig space, enclose the skin: with its own faces, index for index."""
        return Job(self._core.fit(points, faces))

    @property
    def arcs(self) -> list[Arc]:
        """The skeleton as it is used: clipped to the skin, moved to its middle, without what does not stick out."""
        return [Arc(np.asarray(arc["path"]), np.asarray(arc["nodes"])) for arc in self._core.arcs]

    @property
    def repairs(self) -> dict[str, Any]:
        """What was done to the skin before it could be used."""
        return dict(self._core.repairs)


@_door
def extract_skeleton(points: Points, faces: Faces) -> tuple[Points, NDArray[np.int64]]:
    """A skeleton for a closed skin that has no armature: nodes `#N by 3` and edges `#E by 2`."""
    nodes, edges = cage_rig_core.extract_skeleton(points, faces)
    return np.asarray(nodes), np.asarray(edges)


def _section(found: dict[str, Any]) -> Section:
    return Section(
        found["kind"] == "bending",
        np.asarray(found["place"]),
        np.asarray(found["point"]),
        float(found["radius"]),
        int(found["node"]),
        int(found["arc"]),
        np.asarray(found["ring"]),
        np.asarray(found["corners"]),
    )
