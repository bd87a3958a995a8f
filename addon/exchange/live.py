# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates of a rig in the scene: out of it to a file, and from one into it."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from numpy.typing import ArrayLike

from .. import binding, lifecycle, sync
from ..bake import BakeError, files
from ..session import Known
from . import coordinate_files
from .coordinates import Coordinates, Rest, checked
from .text import FileError


def absolute(path: str) -> Path:
    """A path that may begin with `//`."""
    return Path(bpy.path.abspath(path))


def rest_of(cage: bpy.types.Object) -> Rest:
    """The rest shape of a rig as bound, in rig space: what its coordinates belong to."""
    settings = _bound(cage)
    bound = binding.read(cage)
    return Rest(
        [skin.object.name if skin.object else "" for skin in settings.skins],
        [len(skin.points) for skin in bound.skins],
        np.concatenate([skin.points for skin in bound.skins]).astype(np.float64),
        [joint.name for joint in settings.joints],
        bound.heads,
        bound.cage.astype(np.float64),
    )


def coordinates_of(cage: bpy.types.Object) -> Coordinates:
    """The coordinates that a live rig uses, computed or loaded; centers where its method uses them.

    Those of a cage that encloses a part of the character are left out: they are not coordinates alone.
    """
    settings = _bound(cage)
    if settings.state != "LIVE":
        raise FileError(f"'{cage.name}' is not live: {settings.message}")
    found = sync.session_of(cage).coordinates
    centers = found["center_coords"]
    if centers is not None and np.abs(centers.sum(axis=1) - 1.0).max() > 1e-5:
        found["center_coords"] = None
    return Coordinates(**found)


def export_coordinates(cage: bpy.types.Object, path: str = "") -> list[Path]:
    """Write what `coordinates_of` gives: an .npz, or text files (.txt) as the prototype reads them.

    Returns the files: one, or those of the skin, the joints and the anchors.
    """
    coordinates, rest = coordinates_of(cage), rest_of(cage)
    try:
        target = files.target(path, f"{cage.name} Coordinates", coordinate_files.SUFFIXES)
        paths = [target, *coordinate_files.text_files(target).values()] if target.suffix.lower() == ".txt" else [target]
        with files.written(paths) as drafts:
            if len(drafts) == 1:
                coordinate_files.write_npz(drafts[0], coordinates, rest, _faces(cage))
            else:
                coordinate_files.write_text(drafts, coordinates)
    except BakeError as error:
        raise FileError(str(error)) from error
    return paths


def _faces(cage: bpy.types.Object) -> dict[str, np.ndarray]:
    """Faces of cage and skins, as corner vertices (rows of the coordinates' file) and face sizes."""
    bound = binding.read(cage)
    starts = np.cumsum([0, *(len(skin.points) for skin in bound.skins)])
    return {
        "cage_corners": bound.cage_faces[0],
        "cage_sizes": bound.cage_faces[1],
        "skin_corners": np.concatenate([s.faces[0] + start for s, start in zip(bound.skins, starts, strict=False)]),
        "skin_sizes": np.concatenate([skin.faces[1] for skin in bound.skins]),
    }


def load_coordinates(cage: bpy.types.Object, path: str) -> Coordinates:
    """Let the rig use the coordinates of a file, at once and kept with the .blend. What the file lacks is computed."""
    file = absolute(path)
    return _use(cage, coordinate_files.read(file, rest_of(cage)), file.name)


def use_coordinates(
    cage: bpy.types.Object,
    *,
    cage_coords: ArrayLike | None = None,
    joint_coords: ArrayLike | None = None,
    center_coords: ArrayLike | None = None,
    anchors: ArrayLike | None = None,
    source: str = "a script",
) -> Coordinates:
    """Let the rig use arrays as coordinates: Φ (`#M by #C`), Ψ (`#J by #C`), Λ (`#M by #C`), anchors (`#C` vertices).

    Rows are in the order of `rest_of`. What is not given is computed.
    """
    given = {"cage_coords": cage_coords, "joint_coords": joint_coords, "center_coords": center_coords}
    arrays = {name: None if value is None else np.asarray(value, np.float64) for name, value in given.items()}
    chosen = None if anchors is None else np.asarray(anchors, np.int64)
    return _use(cage, checked(Coordinates(**arrays, anchors=chosen), rest_of(cage), source), source)


def drop_coordinates(cage: bpy.types.Object) -> None:
    """Let the rig use coordinates of its own again."""
    _bound(cage)
    _hand_over(cage, Known(), "")


def to_known(given: Coordinates) -> Known:
    """As a bind takes them: float32, which is what a file keeps."""
    coords = {
        name: None if value is None else value.astype(np.float32)
        for name, value in vars(given).items()
        if name != "anchors"
    }
    return Known(**coords, anchors=None if given.anchors is None else given.anchors.astype(np.int32))


def _use(cage: bpy.types.Object, given: Coordinates, source: str) -> Coordinates:
    _hand_over(cage, to_known(given), source)
    return given


def _hand_over(cage: bpy.types.Object, known: Known, source: str) -> None:
    try:
        lifecycle.use_coordinates(bpy.context, cage, known, source)
    except lifecycle.BindError as error:
        raise FileError(str(error)) from error


def _bound(cage: bpy.types.Object) -> bpy.types.PropertyGroup:
    settings = cage.cage_rig
    if settings.state == "NONE":
        raise FileError(f"'{cage.name}' is not the cage of a rig; bind it first")
    if settings.snapshot is None or any(skin.snapshot is None for skin in settings.skins):
        raise FileError(f"What was bound of '{cage.name}' is lost; press Rebind")
    return settings
