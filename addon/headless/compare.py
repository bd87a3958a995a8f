# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare a .blend with what was recorded of it: deformed vertices, refit joints and posed cage, frame by frame.

Record once, where the file is right, with --record; compare after every change of file, Blender or Cage Rig.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import golden, heat_picture
from .golden import Golden, Track
from .run import Answer, Refusal, Voice, folder, frames, open_file, rigs

NAME = "compare"
HELP = "a regression over frames against recorded points"
TOLERANCE = 1e-5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="a .blend file")
    parser.add_argument("golden", type=Path, metavar="GOLDEN", help="an .npz file")
    parser.add_argument("--record", action="store_true", help="write GOLDEN instead")
    parser.add_argument("--frames", metavar="A-B", help="the recorded ones; with --record the scene's")
    parser.add_argument("--rig", metavar="NAME", help="only the rig of this rest cage")
    parser.add_argument(
        "--tolerance", type=float, default=TOLERANCE, metavar="T", help=f"relative to the character's size; {TOLERANCE}"
    )
    parser.add_argument("--picture", type=Path, metavar="DIR", help="draw each skin where it first differs, into DIR")


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    if not given.tolerance >= 0.0:
        raise Refusal(f"a tolerance is 0 or more, not {given.tolerance}")
    right = None if given.record else golden.read(given.golden)
    open_file(given.file)
    cages = rigs(given.rig)
    if right is None:
        start, end = frames(given.frames)
        now = _play(cages, list(range(start, end + 1)), voice, given.file)
        golden.write(given.golden, now)
        voice.say(f"{given.golden}: {len(now.frames)} frames of {len(cages)} rig(s)")
        return Answer(ok=True, file=str(given.file), golden=str(given.golden), frames=now.frames)
    right = _chosen(right, given)
    now = _play(cages, right.frames, voice, given.file)
    found = [_difference(track, now, right.frames, given.tolerance) for track in right.tracks]
    for difference in found:
        voice.say(difference.sentence)
        if given.picture is not None and difference.differs and difference.now is not None:
            difference.picture = folder(given.picture) / f"{bpy.path.clean_name(difference.right.name)}.png"
            heat_picture.draw(difference.now, difference.errors, difference.frame, given.tolerance, difference.picture)
            voice.say(f"  {difference.picture}")
    return Answer(
        ok=not any(difference.differs for difference in found),
        file=str(given.file),
        golden=str(given.golden),
        tolerance=given.tolerance,
        tracks=[difference.record for difference in found],
    )


def _chosen(right: Golden, given: argparse.Namespace) -> Golden:
    """The recorded frames and rigs that were asked for."""
    tracks = [track for track in right.tracks if given.rig in (None, track.rig)]
    if not tracks:
        raise Refusal(f"'{given.golden}' has no rig '{given.rig}'")
    if given.frames is None:
        return Golden(right.frames, tracks)
    start, end = frames(given.frames)
    missing = set(range(start, end + 1)) - set(right.frames)
    if missing:
        raise Refusal(f"'{given.golden}' has no frame {min(missing)}; it has {right.frames[0]} to {right.frames[-1]}")
    kept = [right.frames.index(frame) for frame in range(start, end + 1)]
    for track in tracks:
        track.points = track.points[kept]
    return Golden(list(range(start, end + 1)), tracks)


def _play(cages: list[bpy.types.Object], at: list[int], voice: Voice, path: Path) -> Golden:
    for step in golden.record(cages, at):
        if isinstance(step, Golden):
            return step
        voice.progress(step, f"{path.name}: playing")
    raise AssertionError("a recording ends with what it has recorded")


@dataclass
class _Difference:
    """Between what was recorded and what is there now."""

    right: Track
    fault: str  # why they can't be compared, or nothing
    largest: float = 0.0  # relative to the size
    frame: int = 0  # the first that differs
    vertex: int = -1  # the farthest there
    errors: NDArray[np.float64] | None = None  # there, of every vertex
    now: bpy.types.Object | None = None  # the skin, where it is one
    picture: Path | None = None

    @property
    def differs(self) -> bool:
        return bool(self.fault) or self.vertex >= 0

    @property
    def sentence(self) -> str:
        head = f"{self.right.rig}: {self.right.label}: "
        if self.fault:
            return f"{head}DIFFERS: {self.fault}"
        if self.vertex < 0:
            return f"{head}equal to {self.largest:.1e} of the size"
        return (
            f"{head}DIFFERS first at frame {self.frame}, most at vertex {self.vertex}; "
            f"over all frames up to {self.largest:.1e} of the size"
        )

    @property
    def record(self) -> dict[str, Any]:
        return {
            "rig": self.right.rig,
            "what": self.right.what,
            "name": self.right.name,
            "differs": self.differs,
            "fault": self.fault,
            "largest": self.largest,
            "first_frame": self.frame if self.vertex >= 0 else None,
            "vertex": self.vertex if self.vertex >= 0 else None,
            "picture": None if self.picture is None else str(self.picture),
        }


def _difference(right: Track, now: Golden, at: list[int], tolerance: float) -> _Difference:
    found = next((track for track in now.tracks if track.key == right.key), None)
    if found is None:
        return _Difference(right, "it is not there any more")
    if found.points.shape != right.points.shape:
        return _Difference(right, f"it has {found.points.shape[1]} points, and had {right.points.shape[1]}")
    errors = np.linalg.norm(found.points.astype(np.float64) - right.points, axis=2) / right.size
    errors = np.nan_to_num(errors, nan=1e30)  # JSON knows no NaN
    worst = errors.max(axis=1)
    late = np.flatnonzero(worst > tolerance)
    if not len(late):
        return _Difference(right, "", float(worst.max()))
    first = int(late[0])
    skin = bpy.data.objects.get(right.name) if right.what == "skin" else None
    return _Difference(right, "", float(worst.max()), at[first], int(errors[first].argmax()), errors[first], skin)
