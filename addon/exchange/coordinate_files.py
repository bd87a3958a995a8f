# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of coordinates: named arrays (.npz), or text as the prototype's (.txt). `docs/formats.md` describes both."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import prototype
from .coordinates import SHAPE_LIMIT, SIX_DIGITS, Coordinates, Describe, Rest, checked
from .text import Doubles, FileError, Ints

FORMAT, VERSION = "cage_rig coordinates", 1
SUFFIXES = (".npz", ".txt")
CAGE_WEIGHTS, JOINT_WEIGHTS, ANCHORS = "_cageWeights.txt", "_jointWeights.txt", ".maxvol"
_KINDS = (  # what has to be numbers: the types that do, and how many dimensions
    ("version", "iu", 0),
    ("cage_coords", "fiu", 2),
    ("joint_coords", "fiu", 2),
    ("center_coords", "fiu", 2),
    ("anchors", "iu", 1),
    ("skin_counts", "iu", 1),
    ("skin_points", "fiu", 2),
    ("joints", "fiu", 2),
    ("cage_points", "fiu", 2),
)


def read(path: Path, rest: Rest) -> Coordinates:
    """The coordinates of a file, checked and in the order of `rest`. Raises `FileError`."""
    if path.suffix.lower() not in SUFFIXES:
        raise FileError(f"{path.name}: coordinates are read from {' or '.join(SUFFIXES)} files")
    return read_npz(path, rest) if path.suffix.lower() == ".npz" else read_text(path, rest)


def text_files(path: Path) -> dict[str, Path]:
    """The files beside a text file of skin coordinates that hold the rest."""
    base = path.name.removesuffix(CAGE_WEIGHTS) if path.name.endswith(CAGE_WEIGHTS) else path.stem
    return {"joint_coords": path.with_name(base + JOINT_WEIGHTS), "anchors": path.with_name(base + ANCHORS)}


def read_text(path: Path, rest: Rest) -> Coordinates:
    """Skin coordinates as the prototype writes them; joint coordinates and anchors from the files beside, if any."""
    rows, joints, columns = len(rest.skin_points), len(rest.joints), len(rest.cage_points)
    beside = {name: file for name, file in text_files(path).items() if file.exists()}
    cage_coords = prototype.read_coordinates(path, rows, columns)
    joint_coords = anchors = None
    if "joint_coords" in beside:
        joint_coords = prototype.read_coordinates(beside["joint_coords"], joints, columns, what="joint")
    if "anchors" in beside:
        anchors = prototype.read_anchors(beside["anchors"], rows, min(rows, columns))
    given = Coordinates(cage_coords, joint_coords, None, anchors)
    return checked(given, rest, path.name, rounding=SIX_DIGITS)


def write_text(paths: list[Path], coordinates: Coordinates) -> None:
    """Skin coordinates, joint coordinates and anchors, each to its file."""
    prototype.write_coordinates(paths[0], coordinates.cage_coords)
    prototype.write_coordinates(paths[1], coordinates.joint_coords)
    prototype.write_anchors(paths[2], coordinates.anchors)


def write_npz(path: Path, coordinates: Coordinates, rest: Rest, faces: dict[str, NDArray[np.int32]]) -> None:
    """Write the coordinates with the rest shape that they belong to; `faces`: further arrays to go with it."""
    arrays = {name: value for name, value in vars(coordinates).items() if value is not None}
    np.savez(path, format=FORMAT, version=VERSION, **arrays, **vars(rest), **faces)


def read_npz(path: Path, rest: Rest) -> Coordinates:
    """The coordinates of a file, checked, in the order of `rest`. Raises `FileError`.

    Skins and joints are found by name where the file names them all; otherwise their order counts.
    """
    arrays = _arrays(path)
    if str(arrays.get("format", FORMAT)) != FORMAT:
        raise FileError(f"{path.name}: its format is '{arrays['format']}', expected '{FORMAT}'")
    if "version" in arrays and int(arrays["version"]) > VERSION:
        raise FileError(f"{path.name} is of a newer Cage Rig (version {arrays['version']}); update the extension")
    rows, joints = _skin_rows(arrays, rest), _order(arrays.get("joint_names"), rest.joint_names)
    _require_rest(arrays, rest, rows, joints, path.name)
    given = Coordinates(
        _picked(arrays.get("cage_coords"), rows),
        _picked(arrays.get("joint_coords"), joints),
        _picked(arrays.get("center_coords"), rows),
        _new_rows(arrays.get("anchors"), rows, path.name),
    )
    return checked(given, rest, path.name)


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of the file. Those that have to be numbers are."""
    try:
        file = np.load(path, allow_pickle=False)
        if not isinstance(file, np.lib.npyio.NpzFile):
            raise FileError(f"{path.name} is a single array, expected an .npz of named ones")
        with file:
            found = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise FileError(f"There is no file '{path}'") from None
    except FileError:
        raise
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise FileError(f"{path.name} is no .npz file of arrays: {error}") from None
    except OSError as error:
        raise FileError(f"'{path}' can't be read: {error.strerror or error}") from None
    for name, kinds, size in _KINDS:
        value = found.get(name)
        if value is not None and (value.dtype.kind not in kinds or value.ndim != size):
            raise FileError(
                f"{path.name}: {name} has {value.ndim} dimensions of {value.dtype}, expected {size} of numbers"
            )
    return found


def _order(names: NDArray[Any] | None, wanted: list[str]) -> Ints | None:
    """Where each of the wanted names is in the file; None where it does not name the same."""
    there = [] if names is None else [str(name) for name in names.ravel()]
    if sorted(there) != sorted(wanted) or len(set(there)) != len(there):
        return None
    return np.array([there.index(name) for name in wanted], np.int64)


def _skin_rows(arrays: dict[str, NDArray[Any]], rest: Rest) -> Ints | None:
    """Which row of the file each row of the rig's skins is; None: the same."""
    order = _order(arrays.get("skin_names"), rest.skin_names)
    counts = arrays.get("skin_counts")
    if order is None or counts is None or len(counts) != len(order) or counts[order].tolist() != rest.skin_counts:
        return None
    starts = np.cumsum(counts) - counts
    return np.concatenate([np.arange(starts[k], starts[k] + counts[k]) for k in order]).astype(np.int64)


def _picked(coords: NDArray[Any] | None, rows: Ints | None) -> Doubles | None:
    if coords is None:
        return None
    fits = rows is not None and len(coords) == len(rows)
    return (coords[rows] if fits else coords).astype(np.float64)


def _new_rows(anchors: NDArray[Any] | None, rows: Ints | None, name: str) -> Ints | None:
    """Anchors of the file as vertices of the rig."""
    if anchors is None or rows is None:
        return None if anchors is None else anchors.astype(np.int64)
    if len(anchors) and not (anchors.min() >= 0 and anchors.max() < len(rows)):
        raise FileError(f"{name}: anchors are of {anchors.min()} to {anchors.max()}, expected 0 to {len(rows) - 1}")
    return np.argsort(rows)[anchors]


def _require_rest(
    arrays: dict[str, NDArray[Any]], rest: Rest, rows: Ints | None, joints: Ints | None, source: str
) -> None:
    """What the file says of its rest shape has to be so here."""
    known: tuple[tuple[str, Doubles, Ints | None, Describe], ...] = (
        ("cage_points", rest.cage_points, None, rest.cage_vertex),
        ("skin_points", rest.skin_points, rows, rest.vertex),
        ("joints", rest.joints, joints, rest.joint),
    )
    for name, here, order, describe in known:
        there = _picked(arrays.get(name), order)
        if there is None:
            continue
        if there.shape != here.shape:
            raise FileError(f"{source}: it is for {len(there)} {name}, here are {len(here)}")
        off = np.linalg.norm(there - here, axis=1) / rest.size
        worst = int(off.argmax())
        if not off[worst] <= SHAPE_LIMIT:
            raise FileError(
                f"{source}: it is for another rest shape, with {describe(worst)} {off[worst]:.2g} of the character's "
                f"size away (the limit is {SHAPE_LIMIT:g})"
            )
