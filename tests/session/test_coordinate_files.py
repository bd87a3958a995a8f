"""Files of coordinates, without Blender: what comes back, what is checked, and what is said of bad ones."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import prototype_rig as bar
import pytest

Array = np.ndarray
PSI = np.linalg.lstsq(
    np.column_stack([bar.CAGE.vertices, np.ones(28)]).T, [[-1, 0], [0, 0], [0, 0], [1, 1]], rcond=None
)[0].T
HALF = 100  # vertices of the first of two skins


@pytest.fixture
def rest(exchange: SimpleNamespace) -> object:
    """The bar as two skins."""
    vertices = bar.SKIN.vertices
    counts = [HALF, len(vertices) - HALF]
    return exchange.coordinates.Rest(["Left", "Right"], counts, vertices, ["a", "b"], bar.JOINTS, bar.CAGE.vertices)


@pytest.fixture
def given(exchange: SimpleNamespace) -> object:
    return exchange.coordinates.Coordinates(bar.PHI, PSI, 0.5 * bar.PHI + 0.5 * bar.PHI[::-1], bar.anchors())


@pytest.fixture
def npz(exchange: SimpleNamespace, tmp_path: Path, given: object, rest: object) -> Path:
    path = tmp_path / "bar.npz"
    exchange.coordinate_files.write_npz(path, given, rest, {"cage_sizes": np.full(26, 4)})
    return path


def change(path: Path, **arrays: object) -> None:
    """Replace arrays of a file; None takes one away."""
    found = {**np.load(path), **arrays}
    np.savez(path, **{name: value for name, value in found.items() if value is not None})


def assert_same(found: object, wanted: object, limit: float) -> None:
    for name, value in vars(wanted).items():
        assert np.abs(getattr(found, name) - value).max() <= limit, name


def test_an_npz_comes_back_to_the_last_digits(
    exchange: SimpleNamespace, npz: Path, given: object, rest: object
) -> None:
    found = exchange.coordinate_files.read(npz, rest)
    assert_same(found, given, 1e-14)
    assert found.names == ["skin coordinates", "joint coordinates", "centers of rotation", "anchors"]


def test_text_comes_back_to_nine_digits(exchange: SimpleNamespace, tmp_path: Path, given: object, rest: object) -> None:
    path = tmp_path / "bar_cage_cageWeights.txt"
    beside = exchange.coordinate_files.text_files(path)
    assert {name: file.name for name, file in beside.items()} == {
        "joint_coords": "bar_cage_jointWeights.txt",
        "anchors": "bar_cage.maxvol",
    }
    exchange.coordinate_files.write_text([path, *beside.values()], given)
    found = exchange.coordinate_files.read(path, rest)
    assert found.center_coords is None
    assert_same(replace(found, center_coords=given.center_coords), given, 1e-8)
    for file in beside.values():
        file.unlink()
    assert exchange.coordinate_files.read(path, rest).names == ["skin coordinates"]


def test_six_decimals_are_taken_and_brought_back_to_sums_of_one(
    exchange: SimpleNamespace, tmp_path: Path, rest: object
) -> None:
    path = bar.write_rig(tmp_path).with_name("bar_cage_cageWeights.txt")
    found = exchange.coordinate_files.read(path, rest)
    assert np.abs(found.cage_coords - bar.PHI).max() < 3e-6
    assert np.abs(found.cage_coords.sum(axis=1) - 1.0).max() < 1e-12


def test_a_file_may_hold_a_part_and_say_nothing_of_its_rest(
    exchange: SimpleNamespace, tmp_path: Path, rest: object
) -> None:
    path = tmp_path / "part.npz"
    np.savez(path, cage_coords=bar.PHI.astype(np.float32), note="mine")
    found = exchange.coordinate_files.read(path, rest)
    assert found.names == ["skin coordinates"] and found.cage_coords.dtype == np.float64


def test_skins_and_joints_are_found_by_name(exchange: SimpleNamespace, npz: Path, given: object, rest: object) -> None:
    order = [*range(HALF, len(bar.PHI)), *range(HALF)]
    other = exchange.coordinates.Rest(
        ["Right", "Left"],
        rest.skin_counts[::-1],
        rest.skin_points[order],
        ["b", "a"],
        rest.joints[::-1],
        rest.cage_points,
    )
    found = exchange.coordinate_files.read(npz, other)
    place = np.argsort(order)
    wanted = exchange.coordinates.Coordinates(
        given.cage_coords[order], given.joint_coords[::-1], given.center_coords[order], place[given.anchors]
    )
    assert_same(found, wanted, 1e-14)


def test_other_names_let_the_order_count(exchange: SimpleNamespace, npz: Path, given: object, rest: object) -> None:
    assert_same(exchange.coordinate_files.read(npz, replace(rest, joint_names=["c", "d"])), given, 1e-14)


def test_joints_stay_in_place_to_the_last_digits(exchange: SimpleNamespace, rest: object) -> None:
    """The joints of a resting cage are those of the bind: what a limit lets through is taken out."""
    off = PSI + 2e-5 * np.random.default_rng(1).normal(size=PSI.shape)
    off /= off.sum(axis=1, keepdims=True)
    assert 1e-7 < np.abs(off @ bar.CAGE.vertices - bar.JOINTS).max() < 1e-4 * rest.size
    found = exchange.coordinates.checked(exchange.coordinates.Coordinates(joint_coords=off), rest, "here").joint_coords
    assert np.abs(found @ bar.CAGE.vertices - bar.JOINTS).max() < 1e-14
    assert np.abs(found.sum(axis=1) - 1.0).max() < 1e-14
    assert np.abs(found - off).max() < 1e-4


def at(row: int, column: int, value: float) -> Callable[[Array], Array]:
    """Change one entry."""

    def changed(array: Array) -> Array:
        found = np.array(array, float)
        found[row, column] = value
        return found

    return changed


def swapped(array: Array) -> Array:
    """Two rows in each other's place: they sum to 1, and place other vertices."""
    found = np.array(array)
    found[[3, 200]] = found[[200, 3]]
    return found


BAD = {
    "a wrong size": ("cage_coords", lambda a: a[:5], r"cage_coords is 5 by 28, expected 290 by 28"),
    "another cage": ("joint_coords", lambda a: a[:, :9], r"joint_coords is 2 by 9, expected 2 by 28"),
    "not finite": ("cage_coords", at(130, 2, np.nan), r"cage_coords of vertex 30 of 'Right' are not finite"),
    "a sum": (
        "cage_coords",
        at(7, 0, 2.0),
        r"cage_coords of vertex 7 of 'Left' sum to 2.67.*; rows have to sum to 1 within 3e-06",
    ),
    "a sum of joints": ("joint_coords", at(1, 0, 2.0), r"joint_coords of joint 'b' sum to"),
    "a sum of centers": ("center_coords", at(9, 0, 2.0), r"center_coords of vertex 9 of 'Left' sum to"),
    "not linear": (
        "cage_coords",
        swapped,
        r"cage_coords put vertex (3 of 'Left'|100 of 'Right') 0.* of the character's",
    ),
    "joints not linear": (
        "joint_coords",
        lambda a: a[::-1],
        r"joint_coords put joint '.' 0.48 of .* \(the limit is 0.0001\)",
    ),
    "few anchors": ("anchors", lambda a: a[:4], r"anchors are 4 skin vertices, expected 28 different ones"),
    "anchors twice": ("anchors", lambda a: a * 0 + 7, r"anchors are 1 skin vertices, expected 28"),
    "anchors too far": ("anchors", lambda a: a + 280, r"anchors are of .*, expected 0 to 289"),
    "words": ("cage_coords", lambda a: a.astype(str), r"cage_coords has 2 dimensions of <U\d+, expected 2 of numbers"),
    "dimensions": ("anchors", lambda a: a[None], r"anchors has 2 dimensions of int64, expected 1 of numbers"),
    "another skin": ("skin_points", lambda a: a * 1.01, r"for another rest shape, with vertex \d+ of '.*' 0.0.* away"),
    "more vertices": ("skin_points", lambda a: a[:7], r"it is for 7 skin_points, here are 290"),
    "other joints": ("joints", lambda a: a + 0.1, r"for another rest shape, with joint '.' 0.08"),
    "other cage": ("cage_points", lambda a: a + 0.1, r"for another rest shape, with cage vertex \d+ 0.08"),
    "the future": ("version", lambda a: 2, r"bar.npz is of a newer Cage Rig \(version 2\); update the extension"),
    "something else": ("format", lambda a: "pictures", r"its format is 'pictures', expected 'cage_rig coordinates'"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_npz_is_refused_with_what_and_where(
    exchange: SimpleNamespace, npz: Path, rest: object, case: str
) -> None:
    name, changed, message = BAD[case]
    change(npz, **{name: changed(np.load(npz)[name])})
    with pytest.raises(exchange.text.FileError, match=message):
        exchange.coordinate_files.read(npz, rest)


def test_a_file_that_is_no_npz_is_refused(exchange: SimpleNamespace, tmp_path: Path, npz: Path, rest: object) -> None:
    def refuse(path: Path, message: str) -> None:
        with pytest.raises(exchange.text.FileError, match=message):
            exchange.coordinate_files.read(path, rest)

    refuse(tmp_path / "none.npz", "There is no file")
    refuse(tmp_path / "bar.json", r"bar.json: coordinates are read from \.npz or \.txt files")
    single, text, cut, objects = (tmp_path / f"{name}.npz" for name in ("single", "text", "cut", "objects"))
    with single.open("wb") as file:
        np.save(file, bar.PHI)
    refuse(single, "single.npz is a single array")
    text.write_text("cage_coords = 1")
    refuse(text, "text.npz is no .npz file of arrays")
    cut.write_bytes(npz.read_bytes()[:5000])
    refuse(cut, "cut.npz is no .npz file of arrays")
    np.savez(objects, cage_coords=np.array([{}, None], object))
    refuse(objects, "objects.npz is no .npz file of arrays")
    text.write_bytes(b"")
    refuse(text, "text.npz is no .npz file of arrays")
    change(npz, cage_coords=None, joint_coords=None, center_coords=None, anchors=None)
    refuse(npz, "bar.npz holds no coordinates")
    refuse(tmp_path, r"\.npz or \.txt files")


def test_the_published_joint_coordinates_are_refused_where_they_miss(exchange: SimpleNamespace) -> None:
    """The prototype's joint coordinates miss one joint by 0.41 of 75 units; solved to the end they do not."""
    folder = Path(os.environ.get("CAGE_RIG_SHARED") or Path(__file__).parents[3] / "shared") / "data/arm"
    if not (folder / "arm.skt").is_file():
        pytest.skip("the reference rig is not here; set CAGE_RIG_SHARED to the folder that holds data/arm")
    inputs, bind, extra = (dict(np.load(folder / f"{name}.npz")) for name in ("inputs", "bind", "extra"))
    names = [f"joint {k}" for k in range(25)]
    vertices = inputs["V"]
    rest = exchange.coordinates.Rest(["arm"], [len(vertices)], vertices, names, inputs["joints"], inputs["C0"])
    coordinates, checked = exchange.coordinates.Coordinates, exchange.coordinates.checked
    with pytest.raises(
        exchange.text.FileError, match=r"joint_coords put joint 'joint 2' 0.0055 of the character's size"
    ):
        checked(coordinates(bind["Phi"], bind["Psi"]), rest, "bind.npz")
    converged, centers = extra["Psi_converged"], bind["Lambda"] / bind["Lambda"].sum(axis=1, keepdims=True)
    found = checked(coordinates(bind["Phi"], converged, centers, inputs["maxvol"]), rest, "extra.npz")
    np.testing.assert_array_equal(found.cage_coords, bind["Phi"])
    assert np.abs(found.joint_coords - converged).max() < 1e-12
