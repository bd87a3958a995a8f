# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays in, arrays out: one bound rig as the core computes it. Knows no bpy.

A session is made from a bind snapshot alone and can be thrown away at any moment: the .blend is the truth.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar

import cage_rig_core
import numpy as np
from numpy.typing import NDArray

P = ParamSpec("P")
R = TypeVar("R")
Points = NDArray[np.float32]
Mask = NDArray[np.float32]
Faces = tuple[NDArray[np.int32], NDArray[np.int32]]
Matrices = NDArray[np.float64]
Bones = cage_rig_core.Bones  # rest matrices of joints


class SessionError(Exception):
    """The core refused an input; the message is its sentence. The session is as it was."""

    fix = ""  # what a button can do about it


class SessionCrash(SessionError):
    """The core failed in a way that is a bug; the session must be dropped."""


def _door(function: Callable[P, R]) -> Callable[P, R]:
    """The one place where errors of the core become ours. A Rust panic is a BaseException and stops here too."""

    @functools.wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except (ValueError, cage_rig_core.Cancelled) as error:
            raise SessionError(str(error)) from error
        except cage_rig_core.PanicException as panic:
            raise SessionCrash(f"internal error of the core ({panic}); please report it") from None

    return guarded


@dataclass(frozen=True)
class SkinSnapshot:
    """One skin as bound: `#M by 3` rest points in rig space, (corners, sizes) faces, CSR weights."""

    points: Points
    faces: tuple[NDArray[np.int32], NDArray[np.int32]]
    weights: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


@dataclass(frozen=True)
class Known:
    """What was computed elsewhere, over all skins; None: the bind computes it. float32, which is what a file keeps."""

    cage_coords: NDArray[np.float32] | None = None  # Φ, #M by #C
    joint_coords: NDArray[np.float32] | None = None  # Ψ, #J by #C
    center_coords: NDArray[np.float32] | None = None  # Λ, #M by #C
    anchors: NDArray[np.int32] | None = None  # #C vertices (#M where there are fewer)

    @property
    def is_finite(self) -> bool:
        """Whether every number can be used."""
        return all(np.isfinite(part).all() for part in vars(self).values() if part is not None)


@dataclass(frozen=True)
class Snapshot:
    """Everything a rig is computed from, in rig space."""

    skins: list[SkinSnapshot]
    heads: Matrices  # #J by 3 rest joints
    tails: Matrices  # #J by 3
    parents: NDArray[np.int32]  # #J, -1 at roots
    cage: Points  # #C by 3
    cage_faces: tuple[NDArray[np.int32], NDArray[np.int32]]
    method: str
    known: Known = Known()


@dataclass(frozen=True)
class Below:
    """The rig that another one stands on, and which of its skins and joints the other's are (-1: none)."""

    session: Session
    skins: list[int]
    joints: NDArray[np.int64]


class Session:
    """One bound rig. `play`, `edit_posed_cage` and the results mirror the core's edits and structures."""

    @_door
    def __init__(self, snapshot: Snapshot, job: cage_rig_core.BindJob | None = None) -> None:
        """Bind, or take the result of a job that binds `snapshot`."""
        self.snapshot = snapshot
        skins = snapshot.skins
        self.starts = _starts(skins)
        self.rig = cage_rig_core.CoupledRig(**_to_core(snapshot)) if job is None else job.result()
        self.influence = 1.0
        self.method = str(self.rig.method)  # how bones deform the skin
        self.half_weights = False  # the cage's weights are kept in 16 bits
        self.reproducible = False  # frames are the same whatever was before them
        self.revision = 0  # grows whenever a result may have changed
        self.points = np.empty((self.starts[-1], 3), np.float32)  # of all skins
        self.shown = -1  # revision of all that `points` has, where a frame was played into it
        self._buffers = [self.points[start:end] for start, end in itertools.pairwise(self.starts.tolist())]
        self._offsets: list[Points | None] = [None] * len(skins)
        self.is_offset = False  # one of them is something
        self._lower: list[Points | None] = [None] * len(skins)  # what the rig below moves the skins by
        self._masks: list[Mask | None] = [None] * len(skins)
        self._below: tuple[Session, int] | None = None
        self._carry_coords: Matrices | None = None
        self._posed_cage: tuple[int, Points] | None = None

    @property
    def size(self) -> float:
        """Bounding-box diagonal of the rest skin."""
        return float(self.rig.size)

    @property
    def report(self) -> dict[str, Any]:
        """What the bind found; see the core."""
        return dict(self.rig.report)

    @property
    def coordinates(self) -> dict[str, Any]:
        """Φ, Ψ, Λ (None until a method needs it) and anchors over all skins, by their names in `Known`."""
        return {name: getattr(self.rig, name) for name in vars(self.snapshot.known)}

    @property
    def joints(self) -> Matrices:
        """Rest joints refit to the rest cage, `#J by 3` in rig space."""
        return np.asarray(self.rig.joints)

    @_door
    def play(self, cage: Points, transforms: Matrices, rest_joints: Matrices, influence: float = 1.0) -> None:
        """Set the rest cage (`#C by 3`, rig space) and the animation's transforms (`#J by 4 by 4`) together."""
        self.revision += self.rig.play(self._influenced(cage, influence), transforms, rest_joints)

    @_door
    def play_posed(self, cage: Points, bones: Bones, posed: NDArray[np.floating[Any]], influence: float = 1.0) -> None:
        """`play` where the animation's bones are `posed`, matrices (`#J by 4 by 4`) in rig space."""
        self.revision += self.rig.play_posed(self._influenced(cage, influence), bones, posed)

    def _influenced(self, cage: Points, influence: float) -> NDArray[np.floating[Any]]:
        self.influence = influence
        if influence == 1.0:
            return cage
        base = self.snapshot.cage.astype(np.float64)
        return base + influence * (cage.astype(np.float64) - base)

    @_door
    def set_method(self, name: str) -> None:
        """Choose how bones deform the skin, one of the core's `skinning_methods()`; free where it is so already."""
        if name != self.method:
            self.rig.set_method(name)
            self.method = name
            self.revision += 1

    @_door
    def keep_half_weights(self, half: bool) -> None:
        """Keep the cage's weights in 16 bits, or not; free where it is so already."""
        if half != self.half_weights:
            self.rig.half_weights = self.half_weights = half
            self.revision += 1

    @_door
    def make_reproducible(self, reproducible: bool) -> None:
        """Make frames that do not depend on those before them, or such as are fast; free where it is so already."""
        if reproducible != self.reproducible:
            self.rig.reproducible = self.reproducible = reproducible
            self.revision += 1

    @_door
    def start_method(self, name: str) -> cage_rig_core.MethodJob:
        """Begin to prepare this method in a thread. The method stays what it is until `take_method`."""
        return self.rig.start_method(name)

    @_door
    def take_method(self, job: cage_rig_core.MethodJob) -> None:
        """Choose the method that a job has prepared; waits for it."""
        job.result()
        self.method = str(self.rig.method)
        self.revision += 1

    @_door
    def edit_posed_cage(self, posed_cage: Points) -> NDArray[np.float64]:
        """Move the posed cage there; returns the rest cage (`#C by 3`, rig space) that puts it there."""
        if self.influence < 1e-3:
            raise SessionError("the rig's influence is 0, so an edit of the posed cage can't show; raise it first")
        self.rig.edit_posed_cage(posed_cage)
        self.revision += 1
        base = self.snapshot.cage.astype(np.float64)
        return base + (self.rig.rest_cage - base) / self.influence

    @property
    def offsets(self) -> list[Points | None]:
        """What `offset_skins` was last given."""
        return list(self._offsets)

    @property
    def masks(self) -> list[Mask | None]:
        """What `mask_skins` was last given."""
        return list(self._masks)

    @_door
    def offset_skins(self, offsets: list[Points | None]) -> None:
        """Add rest-pose offsets (`#M by 3`, rig space) to the skins: facial shape keys, skins moved by hand."""
        if all(_same(new, old) for new, old in zip(offsets, self._offsets, strict=True)):
            return
        self._offsets = offsets
        self.is_offset = any(offset is not None for offset in offsets)
        self._offset()

    def _offset(self) -> None:
        parts = [_sum(own, lower) for own, lower in zip(self._offsets, self._lower, strict=True)]
        self.rig.offset_rest_skin(self._joined(parts, 0.0))
        self.revision += 1

    @_door
    def mask_skins(self, masks: list[Mask | None]) -> None:
        """Confine the cage on each skin to a mask (`#M`, 0 to 1), or not at all."""
        if all(_same(new, old) for new, old in zip(masks, self._masks, strict=True)):
            return
        self._masks = masks
        self.rig.mask_skin(self._joined(masks, 1.0))
        self.revision += 1

    def _joined(self, parts: Sequence[Points | Mask | None], filling: float) -> NDArray[np.float32] | None:
        """One array of all skins, or None where no skin has a part."""
        known = [part for part in parts if part is not None]
        if not known:
            return None
        shapes = [(len(skin.points), *known[0].shape[1:]) for skin in self.snapshot.skins]
        return np.concatenate(
            [
                np.full(shape, filling, np.float32) if part is None else part
                for part, shape in zip(parts, shapes, strict=True)
            ]
        )

    @_door
    def stand_on(self, below: Below | None) -> None:
        """Take the rest character as the rig below has moved it."""
        state = None if below is None else (below.session, below.session.revision)
        if state == self._below:
            return
        if below is None:
            self.rig.carry(None, None)
            self._lower, self._carry_coords = [None] * len(self._lower), None
        else:
            lower = below.session
            if self._below is None or self._below[0] is not lower or self._carry_coords is None:
                cage, faces = lower.snapshot.cage, lower.snapshot.cage_faces
                self._carry_coords = cage_rig_core.mean_value_coordinates(self.snapshot.cage, cage, faces)
            joints = np.zeros_like(self.snapshot.heads)
            joints[below.joints >= 0] = lower.joint_movement()[below.joints[below.joints >= 0]]
            self.rig.carry(self._carry_coords @ lower.cage_movement(), joints)
            self._lower = [None if skin < 0 else lower.skin_movement(skin) for skin in below.skins]
        self._below = state
        self._offset()

    def cage_movement(self) -> Matrices:
        """How far the rest cage is from where it was bound, `#C by 3`, its own movement and what carries it."""
        own = self.rig.rest_cage - self.snapshot.cage.astype(np.float64)
        if self._below is None or self._carry_coords is None:
            return np.asarray(own)
        return np.asarray(own + self._carry_coords @ self._below[0].cage_movement())

    def joint_movement(self) -> Matrices:
        """How far the rest joints are from where they were bound, `#J by 3`."""
        return np.asarray(self.rig.joints - self.snapshot.heads)

    def skin_movement(self, index: int) -> Points:
        """How far cages move the rest shape of one skin, `#M by 3`; what else offsets it is left out."""
        rest = np.empty_like(self._buffers[index])
        self.rig.rest_skin_into(rest, start=int(self.starts[index]))
        offset = self._offsets[index]
        moved = rest - self.snapshot.skins[index].points
        return moved if offset is None else moved - offset

    @_door
    def posed_skin(self, index: int) -> Points:
        """Deformed points of one skin, `#M by 3` in rig space. The buffer is reused by the next call."""
        if self.shown != self.revision:
            self.rig.posed_skin_into(self._buffers[index], start=int(self.starts[index]))
        return self._buffers[index]

    @_door
    def posed_cage(self) -> Points:
        """The posed cage, `#C by 3` in rig space, as the float32 that Blender keeps."""
        if self._posed_cage is None or self._posed_cage[0] != self.revision:
            points = np.empty_like(self.snapshot.cage)
            self.rig.posed_cage_into(points)
            self._posed_cage = (self.revision, points)
        return self._posed_cage[1]

    def cage_influence(self, vertices: Sequence[int]) -> NDArray[np.float32]:
        """How much these cage vertices move each skin vertex together, `#M` over all skins."""
        return self.rig.cage_influence(vertices)

    def joint_coords(self, joint: int) -> Matrices:
        """How much each cage vertex moves this joint, `#C`: its row of Ψ."""
        return np.asarray(self.rig.joint_coords[joint])

    def skin_weights(self, joint: int) -> NDArray[np.float32]:
        """How much this joint moves each vertex, `#M` over all skins: its column of Ω. Rows sum to 1, or to 0."""
        weights = np.zeros(self.starts[-1], np.float32)
        for start, skin in zip(self.starts, self.snapshot.skins, strict=False):
            indptr, columns, values = skin.weights
            at = np.flatnonzero(columns == joint)
            at = at[values[at] > 0.0]
            row = np.searchsorted(indptr, at, side="right") - 1
            spans = np.stack([indptr[row], indptr[row + 1]], axis=1).ravel()
            if len(at):
                weights[start + row] = values[at] / np.add.reduceat(np.append(values, 0.0), spans)[::2]
        return weights

    def anchors(self) -> list[NDArray[np.int64]]:
        """The vertices of each skin that the posed cage is fitted to."""
        found = np.sort(self.rig.anchors)
        return [found[(found >= a) & (found < b)] - a for a, b in itertools.pairwise(self.starts.tolist())]

    def posed_bones(self) -> tuple[Matrices, Matrices]:
        """Posed heads and tails of the refit bones, each `#J by 3` in rig space; bones keep their rest length."""
        along = np.einsum("jkl,jl->jk", self.rig.transforms[:, :3, :3], self.snapshot.tails - self.snapshot.heads)
        return np.asarray(self.rig.posed_joints), np.asarray(self.rig.posed_joints + along)

    @_door
    def refit_bones(self, rest: Matrices) -> Bones:
        """The bones of a refit armature from their rest matrices, `#J by 4 by 4`.

        One whose tail was its child's head at bind is stretched along itself to reach the child's refit joint.
        """
        links, snapshot = _tail_links(self.snapshot), self.snapshot
        lengths = np.linalg.norm(snapshot.tails - snapshot.heads, axis=1)[links[:, 0]]
        return cage_rig_core.Bones(rest, links, np.maximum(lengths, 1e-12))

    @_door
    def refit_pose(self, bones: Bones) -> Matrices:
        """What poses the `refit_bones`, each in its own rest space, `#J by 4 by 4`: orientation of the animation, head
        at the refit joint.
        """
        return self.rig.refit_pose(bones)


class Playback:
    """Frames of a session without an array made for them: what they come from is filled in, what they show is there."""

    @_door
    def __init__(self, session: Session, bones: Bones, refit: Bones | None) -> None:
        """Of the animation's bones, and of those of the refit armature where there is one."""
        count, cage = len(session.snapshot.heads), session.snapshot.cage
        self.cage = np.empty_like(cage)  # rest cage, `#C by 3` in rig space, filled in
        self.bones = np.empty((count, 4, 4), np.float32)  # posed, acting on rows as Blender has them, filled in
        self.posed_cage = np.empty_like(cage)  # `#C by 3`, shown
        self.written_cage = np.empty_like(cage)  # of those the last one that was written
        self.refit_pose = None if refit is None else np.empty((count, 4, 4), np.float32)  # acting on rows, shown
        self._session, self._filled = session, False
        self._core = cage_rig_core.Playback(
            session.rig,
            bones,
            refit,
            cage=self.cage,
            posed=self.bones.transpose(0, 2, 1),
            skin=session.points,
            posed_cage=self.posed_cage,
            refit_pose=np.empty_like(self.bones) if self.refit_pose is None else self.refit_pose.transpose(0, 2, 1),
        )

    @_door
    def play(self, influence: float, *, fitted: bool, again: bool) -> bool:
        """Play what was filled in. The posed cage is made where it is `fitted`; nothing is made where nothing is new,
        but what is to be shown `again`. Returns whether anything was made.
        """
        session = self._session
        again |= session.shown != session.revision or not self._filled
        session.influence = influence
        new = self._core.play(influence, fitted=fitted, again=again)
        session.revision += new
        session.shown, self._filled = session.revision, True
        return new or again


class BindJob:
    """A bind in a thread of the core's. Its result is a `Session`, to the last bit that of `Session(snapshot)`."""

    @_door
    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot
        self._job = cage_rig_core.BindJob(**_to_core(snapshot))

    @property
    def progress(self) -> float:
        """How much is done, 0 to 1."""
        return self._job.progress

    @property
    def stage(self) -> str:
        """What is being computed, for people."""
        return self._job.stage

    def wait(self, seconds: float) -> bool:
        """Wait until it is done, or for so long; whether it is done."""
        return self._job.wait(seconds)

    def cancel(self) -> None:
        """Stop it soon."""
        self._job.cancel()

    def result(self) -> Session:
        """The session; waits for it. Raises `SessionError` where the core refuses, or when it was cancelled."""
        return Session(self._snapshot, self._job)


@_door
def bones(rest: Matrices) -> Bones:
    """The animation's bones from their rest matrices, `#J by 4 by 4`."""
    return cage_rig_core.Bones(rest)


@_door
def mean_value_coordinates(points: Points, cage: Points, cage_faces: Faces) -> Matrices:
    """The coordinates that a bind computes (`#M by #C`), of `points` with respect to a cage."""
    return np.asarray(cage_rig_core.mean_value_coordinates(points, cage, cage_faces))


def _sum(one: Points | None, other: Points | None) -> Points | None:
    if one is None or other is None:
        return other if one is None else one
    return one + other


def _same(new: NDArray[np.float32] | None, old: NDArray[np.float32] | None) -> bool:
    if new is None or old is None:
        return new is old
    return np.array_equal(new, old)


def _to_core(snapshot: Snapshot) -> dict[str, Any]:
    """What the core binds, by its names."""
    skins = snapshot.skins
    return {
        "skin_vertices": np.concatenate([skin.points for skin in skins]),
        "skin_faces": _join_faces(skins, _starts(skins)),
        "skin_weights": _join_weights(skins),
        "joints": snapshot.heads,
        "parents": snapshot.parents,
        "cage_vertices": snapshot.cage,
        "cage_faces": snapshot.cage_faces,
        "method": snapshot.method,
        **vars(snapshot.known),
    }


def _starts(skins: list[SkinSnapshot]) -> NDArray[np.int_]:
    """Where each skin begins among all vertices, and their count."""
    return np.concatenate([[0], np.cumsum([len(skin.points) for skin in skins])]).astype(int)


def _join_faces(skins: list[SkinSnapshot], starts: NDArray[np.int_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    corners = [skin.faces[0].astype(np.int64) + start for skin, start in zip(skins, starts, strict=False)]
    return np.concatenate(corners), np.concatenate([skin.faces[1].astype(np.int64) for skin in skins])


def _join_weights(skins: list[SkinSnapshot]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    counts = np.concatenate([np.diff(skin.weights[0]) for skin in skins])
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return (
        indptr,
        np.concatenate([skin.weights[1] for skin in skins]),
        np.concatenate([skin.weights[2] for skin in skins]),
    )


def _tail_links(snapshot: Snapshot) -> NDArray[np.int64]:
    """Pairs (bone, child) where the bone's tail is the child's head, `#links by 2`; the first child wins."""
    links: dict[int, int] = {}
    lengths = np.linalg.norm(snapshot.tails - snapshot.heads, axis=1)
    for child, parent in enumerate(snapshot.parents.tolist()):
        gap = np.linalg.norm(snapshot.heads[child] - snapshot.tails[parent]) if parent >= 0 else np.inf
        if gap <= 1e-4 * lengths[parent]:
            links.setdefault(parent, child)
    return np.array(sorted(links.items()), np.int64).reshape(-1, 2)
