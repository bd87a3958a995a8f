# SPDX-License-Identifier: GPL-3.0-or-later
"""What a regression keeps of a file: deformed skins, refit joints and posed cages over frames, as one .npz.

`index` is JSON: the frames, and for each rig its name, its size and its arrays: what they are and their shape.
Arrays are `#frames by #points by 3` float32, named by their place in that list.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import bake, sync
from ..bake import live
from ..bake.files import written
from .run import Refusal

Points = NDArray[np.float32]
FORMAT = 1


@dataclass
class Track:
    """The points of one thing over all frames, `#frames by #points by 3`: rig space, skins in their own."""

    rig: str
    what: str  # "skin", "joints" or "posed cage"
    name: str  # of the object
    size: float  # of the character
    points: Points

    @property
    def label(self) -> str:
        """How it is told to people."""
        return f"{self.what} '{self.name}'"

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is found again by."""
        return self.rig, self.what, self.name


@dataclass
class Golden:
    """Tracks of every rig, over the same frames."""

    frames: list[int]
    tracks: list[Track]


def record(cages: list[bpy.types.Object], frames: list[int]) -> Iterator[float | Golden]:
    """Play the frames; yields the share that is done after each, and at last the `Golden`."""
    played: dict[tuple[str, str, str], tuple[float, list[Points]]] = {}
    try:
        for cage in cages:
            live.refuse_unready(cage)
            with live.playing(cage, frames[0]) as go:
                for done, frame in enumerate(frames):
                    for key, size, points in _now(cage, go(frame)):
                        played.setdefault(key, (size, []))[1].append(points)
                    yield (cages.index(cage) + (done + 1) / len(frames)) / len(cages)
    except bake.BakeError as error:
        raise Refusal(str(error)) from error
    yield Golden(frames, [Track(*key, size, np.stack(points)) for key, (size, points) in played.items()])


def _now(
    cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> Iterator[tuple[tuple[str, str, str], float, Points]]:
    session = sync.session_of(cage)
    for skin, points in zip(live.skins_of(cage), live.posed_skins(cage, depsgraph), strict=True):
        if skin.cage == cage:  # of several rigs the one on top places it
            yield (cage.name, "skin", skin.obj.name), session.size, points.copy()
    yield (cage.name, "joints", cage.cage_rig.armature.name), session.size, np.float32(session.rig.posed_joints)
    yield (cage.name, "posed cage", cage.name), session.size, session.posed_cage().copy()


def write(path: Path, golden: Golden) -> None:
    """Write the file, as a whole or not at all."""
    tracks = [{"rig": track.rig, "what": track.what, "name": track.name, "size": track.size} for track in golden.tracks]
    index = {"format": FORMAT, "frames": golden.frames, "tracks": tracks}
    arrays = {f"track_{number}": track.points for number, track in enumerate(golden.tracks)}
    try:
        with written([path]) as (draft,), draft.open("wb") as file:
            np.savez_compressed(file, index=np.array(json.dumps(index)), **arrays)
    except bake.BakeError as error:
        raise Refusal(str(error)) from error


def read(path: Path) -> Golden:
    """Read what `write` has written; raises `Refusal`."""
    if not path.is_file():
        raise Refusal(f"there is no file '{path}'; record it with --record")
    try:
        with np.load(path, allow_pickle=False) as arrays:
            index = json.loads(str(arrays["index"]))
            if index["format"] != FORMAT:
                raise Refusal(f"'{path}' is of a newer Cage Rig; record it again or update the extension")
            tracks = [Track(**track, points=arrays[f"track_{number}"]) for number, track in enumerate(index["tracks"])]
            return Golden(index["frames"], tracks)
    except (KeyError, TypeError, ValueError, OSError, zipfile.BadZipFile) as error:
        raise Refusal(f"'{path}' is no record of Cage Rig ({error}); record it with --record") from error
