"""The prototype's text files, without Blender: what they hold, how they are found, and what is said of bad ones."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import prototype_rig as bar
import pytest

Lines = list[str]


@pytest.fixture
def skt(tmp_path: Path) -> Path:
    return bar.write_rig(tmp_path)


@pytest.fixture
def rig(exchange: SimpleNamespace, skt: Path) -> object:
    return exchange.rig_files.read(*exchange.rig_files.find(skt, {}))


@pytest.fixture(scope="module")
def arm() -> Path:
    folder = Path(os.environ.get("CAGE_RIG_SHARED") or Path(__file__).parents[3] / "shared") / "data/arm"
    if not (folder / "arm.skt").is_file():
        pytest.skip("the reference rig is not here; set CAGE_RIG_SHARED to the folder that holds data/arm")
    return folder


def test_a_rig_is_read_as_it_was_written(rig: object) -> None:
    assert rig.name == "bar" and rig.skeleton.names == ["lower", "upper"]
    assert rig.skeleton.parents.tolist() == [-1, 0]
    assert np.abs(rig.skeleton.joints - bar.JOINTS).max() < 1e-8
    assert np.abs(rig.mesh.vertices - bar.SKIN.vertices).max() < 1e-8
    assert rig.mesh.faces[0].tolist() == bar.SKIN.faces.ravel().tolist() and set(rig.mesh.faces[1].tolist()) == {4}
    assert rig.cage.faces[1].tolist() == [len(face) for face in bar.CAGE.faces]
    assert np.abs(rig.cage_coords - bar.PHI).max() < 1e-6
    assert rig.anchors.tolist() == bar.anchors().tolist()
    assert rig.skeleton_motion.times.tolist() == list(bar.SECONDS)
    assert np.abs(rig.skeleton_motion.angles - bar.ANGLES).max() < 1e-8
    assert np.abs(rig.cage_motion.offsets[1] - bar.CAGE.vertices * (bar.STRETCH - 1.0)).max() < 1e-8
    assert not rig.cage_motion.offsets[[0, 2]].any()


def test_weights_are_rows_of_joints(rig: object) -> None:
    indptr, columns, values = rig.weights
    dense = np.zeros_like(bar.SKIN.weights)
    dense[np.repeat(np.arange(len(dense)), np.diff(indptr)), columns] = values
    assert np.abs(dense - bar.SKIN.weights).max() < 1e-6


def test_centers_are_coordinates_through_the_skin(exchange: SimpleNamespace, rig: object) -> None:
    found = exchange.rig_files.coordinates(rig, None)
    wanted = 0.75 * bar.PHI + 0.25 * bar.PHI[[1, *[0] * (len(bar.PHI) - 1)]]
    assert np.abs(found.center_coords - wanted).max() < 2e-6
    assert np.abs(found.cage_coords.sum(axis=1) - 1.0).max() < 1e-12, "rounded coordinates sum to 1 again"


def test_a_folder_with_one_rig_means_that_rig(exchange: SimpleNamespace, skt: Path) -> None:
    find = exchange.rig_files.find
    assert find(skt.parent, {}) == find(skt, {})
    (skt.parent / "other.skt").touch()
    with pytest.raises(exchange.text.FileError, match=r"several: bar.skt, other.skt; choose one"):
        find(skt.parent, {})
    with pytest.raises(exchange.text.FileError, match=r"no \.skt file"):
        find(skt.parent.parent, {})


def test_files_elsewhere_are_given(exchange: SimpleNamespace, skt: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "weights.txt"
    (tmp_path / "bar.skw").rename(elsewhere)
    with pytest.raises(exchange.text.FileError, match=r"no 'bar.skw' beside 'bar.skt'; choose the file of the weights"):
        exchange.rig_files.find(skt, {})
    _, files = exchange.rig_files.find(skt, {"weights": elsewhere})
    assert files["weights"] == elsewhere
    with pytest.raises(exchange.text.FileError, match="There is no file"):
        exchange.rig_files.read(skt, {**files, "anchors": tmp_path / "none.maxvol"})


def test_only_skin_weights_and_cage_are_needed(exchange: SimpleNamespace, skt: Path) -> None:
    for path in skt.parent.iterdir():
        if path.name not in ("bar.skt", "bar.obj", "bar.skw", "bar_cage.obj"):
            path.unlink()
    rig = exchange.rig_files.read(*exchange.rig_files.find(skt, {}))
    assert rig.skeleton_motion is rig.cage_motion is rig.anchors is rig.cage_coords is rig.centers is None
    assert exchange.rig_files.coordinates(rig, bar.PHI).names == []


def line(number: int, text: str) -> Callable[[Lines], Lines]:
    """Put `text` in the place of a line."""
    return lambda lines: [*lines[: number - 1], text, *lines[number:]]


def without(number: int) -> Callable[[Lines], Lines]:
    return lambda lines: [*lines[: number - 1], *lines[number:]]


BAD = {
    "a word for a number": ("bar.obj", line(4, "v 1 x 2"), r"bar.obj, line 4: expected 'v x y z', found 'v 1 x 2'"),
    "too few numbers": ("bar.obj", line(5, "v 1 2"), r"line 5: expected 'v x y z', found 'v 1 2'"),
    "not finite": ("bar.obj", line(5, "v 1 nan 2"), r"line 5: expected 'v x y z' with finite numbers"),
    "no vertices": ("bar.obj", lambda lines: ["f 1 2 3"], r"bar.obj: expected lines 'v x y z'"),
    "no faces": ("bar.obj", lambda lines: lines[:50], r"bar.obj: expected lines 'f a b c'"),
    "a face beyond": (
        "bar.obj",
        lambda lines: [*lines, "f 1 2 291"],
        r"line 581: expected 'f' and 3 or more different",
    ),
    "a flat face": ("bar.obj", lambda lines: [*lines, "f 1 2 2"], r"different vertices of 1 to 290, found 'f 1 2 2'"),
    "a joint's line": ("bar.skt", line(2, "j 1 upper 0 1 2"), r"bar.skt, line 2: expected 'j index name father x y z'"),
    "rest rotations": ("bar.skt", line(2, "j 1 upper 0 0 0 0 1 2 3"), r"line 2: expected 'j index name father x y z'"),
    "half an index": ("bar.skt", line(2, "j 1 upper .5 1 2 3"), r"line 2: .* with whole numbers first"),
    "an index too far": (
        "bar.skt",
        line(2, "j 2 upper 0 1 2 3"),
        r"line 2: expected an index of 0 to 1, as there are 2",
    ),
    "an index twice": ("bar.skt", line(2, "j 0 upper 0 1 2 3"), r"line 3: expected an index that no other joint has"),
    "a name twice": ("bar.skt", line(2, "j 1 lower 0 1 2 3"), r"line 2: expected a name that no other joint has"),
    "no such father": ("bar.skt", line(2, "j 1 upper 7 1 2 3"), r"line 2: expected a father of 0 to 1, or -1"),
    "a circle": ("bar.skt", line(3, "j 0 lower 1 1 2 3"), r"line 3: expected a father that does not descend from it"),
    "no joints": ("bar.skt", lambda lines: [], r"bar.skt: expected lines 'j index name father x y z', found none"),
    "a joint too far": ("bar.skw", line(3, "2 1 0.5"), r"bar.skw, line 3: expected a joint of 0 to 1"),
    "a vertex too far": ("bar.skw", line(3, "0 290 0.5"), r"line 3: expected a vertex of 0 to 289"),
    "a negative weight": ("bar.skw", line(2, "0 1 -0.5"), r"line 2: expected a weight of 0 to 1, found '0 1 -0.5'"),
    "a weight twice": ("bar.skw", lambda lines: [*lines, lines[0]], r"expected 'joint vertex weight' once for a pair"),
    "too little weight": ("bar.skw", line(1, "0 0 0.5"), r"bar.skw: the weights of vertex 0 sum to 0.5.*, expected 1"),
    "a motion of old": ("bar_skelAnim.txt", without(1), r"bar_skelAnim.txt: expected a line '# V3'"),
    "no times": ("bar_skelAnim.txt", lambda lines: lines[:3], r"expected lines 'k seconds'"),
    "time runs back": ("bar_skelAnim.txt", line(5, "k -1"), r"line 5: expected a later time than the one before"),
    "a key without time": ("bar_skelAnim.txt", line(7, "s 3 0 0 0 0 0 0"), r"line 7: expected a key of 0 to 2, as 3"),
    "a joint's key is lost": ("bar_skelAnim.txt", without(12), r"key 2 has 1 lines 's', expected 2, one .* joints"),
    "a short key": ("bar_skelAnim.txt", line(8, "s 0 0 0 0"), r"line 8: expected 's key rx ry rz tx ty tz'"),
    "a cage key is lost": ("bar_cageAnim.txt", without(9), r"key 0 has 27 lines 'c', expected 28, .* cage vertices"),
    "no selection": ("bar_cage.maxvol", lambda lines: ["1 2 3"], r"maxvol, line 1: expected 'MAXVOLSELECTION n'"),
    "nothing at all": ("bar_cage.maxvol", lambda lines: [], r"bar_cage.maxvol: expected 'MAXVOLSELECTION n'"),
    "too few anchors": (
        "bar_cage.maxvol",
        line(2, "1 2 3"),
        r"line 1: expected 28 different vertices \(3 are listed\)",
    ),
    "an anchor too far": ("bar_cage.maxvol", line(2, "1 290"), r"line 2: expected skin vertices of 0 to 289"),
    "no number": ("bar_cage.maxvol", line(2, "1 one"), r"line 2: expected 'whole numbers', found '1 one'"),
    "a cage vertex too far": ("bar_cage_cageWeights.txt", line(1, "28 0 1"), r"expected a cage vertex of 0 to 27"),
    "wrong coordinates": ("bar_cage_cageWeights.txt", line(1, "0 0 .5"), r"cage_coords of vertex 0 of 'bar' sum to"),
    "no coordinates": ("bar_cage_cageWeights.txt", lambda lines: [], r"expected lines 'cage_vertex vertex weight'"),
    "wrong centers": (
        "bar_corWeights.txt",
        line(1, "0 0 0.5"),
        r"bar_corWeights.txt: the weights of vertex 0 sum to 0.75",
    ),
    "a picture": ("bar.skw", lambda lines: ["\x89PNG" + "y" * 99], r"bar.skw, line 1: .* found '\x89PNGyyy.*yy…'"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_named_with_its_line_and_what_was_expected(
    exchange: SimpleNamespace, skt: Path, case: str
) -> None:
    name, change, message = BAD[case]
    bar.edit(skt.parent / name, change)
    with pytest.raises(exchange.text.FileError, match=message):
        exchange.rig_files.read(*exchange.rig_files.find(skt, {}))


def test_turns_are_about_x_then_y_then_z(exchange: SimpleNamespace) -> None:
    assert np.abs(exchange.bones.rotations(bar.ANGLES)[1] - bar.transforms(1)[:, :3, :3]).max() < 1e-15


def rest_turns(count: int) -> np.ndarray:
    """Orientations of bones at rest: any."""
    found = np.linalg.qr(np.random.default_rng(5).normal(size=(count, 3, 3)))[0]
    return found * np.linalg.det(found)[:, None, None]


def played(skeleton: object, keys: list[object], rest: np.ndarray, seconds: float) -> np.ndarray:
    """T of every bone from its keys, straight between them as Blender's curves are."""
    found = np.tile(np.eye(4), (len(keys), 1, 1))
    for j, key in enumerate(keys):
        w, *xyz = (np.interp(seconds, key.rotation_times, column) for column in key.rotations.T)
        across = np.cross(np.eye(3), xyz)
        basis, bone = np.eye(4), np.eye(4)
        basis[:3, :3] = np.eye(3) + (2 * w * across + 2 * across @ across) / (w * w + np.dot(xyz, xyz))
        basis[:3, 3] = [np.interp(seconds, key.location_times, column) for column in key.locations.T]
        bone[:3, :3], bone[:3, 3] = rest[j], skeleton.joints[j]
        parent = skeleton.parents[j]
        found[j] = (found[parent] if parent >= 0 else np.eye(4)) @ bone @ basis @ np.linalg.inv(bone)
    return found


@pytest.mark.parametrize("rate", [None, 24.0])
@pytest.mark.parametrize("stray", [False, True])
def test_keys_play_the_animation(exchange: SimpleNamespace, rig: object, rate: float | None, stray: bool) -> None:
    rest = rest_turns(2)
    keys = exchange.bones.keys(rig.skeleton, rig.skeleton_motion, rest, rate=rate, keep_steps=stray)
    for k, seconds in enumerate(bar.SECONDS):
        assert np.abs(played(rig.skeleton, keys, rest, seconds) - bar.transforms(k, stray=stray)).max() < 1e-8
    assert keys[1].locations.any() == stray, "a joint that stays on its father needs no place"


def test_between_keys_bones_turn_evenly_about_one_axis(exchange: SimpleNamespace, rig: object) -> None:
    rest = rest_turns(2)
    keys = exchange.bones.keys(rig.skeleton, rig.skeleton_motion, rest, rate=24.0, keep_steps=False)
    assert len(keys[1].rotation_times) == 61
    first, second = (bar.transforms(k)[0, :3, :3] for k in (1, 2))
    whole = turn_of(first.T @ second)
    for share in (1 / 3, 0.5, 2 / 3):
        part = turn_of(first.T @ played(rig.skeleton, keys, rest, 1.0 + 1.5 * share)[0, :3, :3])
        assert part == pytest.approx(share * whole, abs=1e-6)


def turn_of(matrix: np.ndarray) -> np.ndarray:
    """Axis times angle of a rotation."""
    across = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return across / np.linalg.norm(across) * np.arccos((np.trace(matrix) - 1.0) / 2.0)


def test_a_still_animation_has_one_key_a_bone(exchange: SimpleNamespace) -> None:
    skeleton = exchange.prototype.Skeleton(["a"], np.array([-1]), np.zeros((1, 3)))
    motion = exchange.prototype.SkeletonMotion(np.array([0.0, 5.0]), np.zeros((2, 1, 3)), np.zeros((2, 1, 3)))
    (key,) = exchange.bones.keys(skeleton, motion, np.eye(3)[None], rate=24.0, keep_steps=False)
    assert key.rotations.tolist() == [[1.0, 0.0, 0.0, 0.0]] and key.locations.tolist() == [[0.0, 0.0, 0.0]]
    motion = exchange.prototype.SkeletonMotion(np.array([2.0]), np.full((1, 1, 3), 90.0), np.ones((1, 1, 3)))
    (key,) = exchange.bones.keys(skeleton, motion, np.eye(3)[None], rate=24.0, keep_steps=False)
    assert key.rotation_times.tolist() == key.location_times.tolist() == [2.0]


def test_bones_end_where_a_rigger_would_let_them(exchange: SimpleNamespace) -> None:
    def ends(joints: list[tuple[float, float, float]], parents: list[int]) -> list[list[float]]:
        places = np.array(joints, float)
        skeleton = exchange.prototype.Skeleton([f"{k}" for k in parents], np.array(parents), places)
        return np.round(exchange.bones.tails(skeleton, np.array([0.0, 0.0, 1.0])) - places, 9).tolist()

    chain = ends([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [-1, 0, 1])
    assert chain == [[1, 0, 0], [1, 0, 0], [0.6, 0, 0]]
    fork = ends([(0, 0, 0), (1, 1, 0), (1, -1, 0)], [-1, 0, 0])
    assert fork[0] == [1, 0, 0], "between its children"
    hips = ends([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, 2)], [-1, 0, 0, 0, 3])
    assert hips[0] == [0, 0, 1], "along the spine, from which most descends"
    helper = ends([(0, 0, 0), (0, 0, 0), (0, 1, 0)], [-1, 0, 1])
    assert helper[:2] == [[0, 0.6, 0], [0, 1, 0]], "along the child at its own place"
    assert ends([(3, 4, 5)], [-1]) == [[0, 0, 1]]


def test_the_published_arm_reads_as_its_reference_arrays(exchange: SimpleNamespace, arm: Path) -> None:
    inputs, bind = dict(np.load(arm / "inputs.npz")), dict(np.load(arm / "bind.npz"))
    skeleton, files = exchange.rig_files.find(arm, {})
    assert set(files) == set(exchange.rig_files.NAMES) - {"coordinates"}
    rig = exchange.rig_files.read(skeleton, files)
    np.testing.assert_array_equal(rig.mesh.vertices, inputs["V"])
    np.testing.assert_array_equal(rig.mesh.faces[0].reshape(-1, 3), inputs["F"])
    np.testing.assert_array_equal(rig.cage.vertices, inputs["C0"])
    np.testing.assert_array_equal(rig.skeleton.joints, inputs["joints"])
    np.testing.assert_array_equal(rig.skeleton.parents, inputs["parents"])
    np.testing.assert_array_equal(rig.anchors, inputs["maxvol"])
    np.testing.assert_array_equal(rig.cage_motion.offsets, inputs["cage_key_offset"])
    turns = exchange.bones.rotations(rig.skeleton_motion.angles)
    assert np.abs(turns - inputs["skel_key_global"][..., :3, :3]).max() < 1e-14
    np.testing.assert_array_equal(rig.skeleton_motion.places, inputs["skel_key_global"][..., :3, 3])
    centers = exchange.rig_files.coordinates(rig, bind["Phi"]).center_coords
    assert np.abs(centers - bind["Lambda"]).max() < 2e-6


def test_the_published_arm_is_keyed_as_the_prototype_plays_it(exchange: SimpleNamespace, arm: Path) -> None:
    rig = exchange.rig_files.read(*exchange.rig_files.find(arm, {}))
    poses, rest = np.load(arm / "poses.npz"), rest_turns(25)
    keys = exchange.bones.keys(rig.skeleton, rig.skeleton_motion, rest, rate=24.0, keep_steps=False)
    for k, seconds in enumerate(poses["t"]):
        assert np.abs(played(rig.skeleton, keys, rest, seconds) - poses["T_skin"][k]).max() < 1e-8
