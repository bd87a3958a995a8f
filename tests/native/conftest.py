"""A small rig for the binding's tests: a bar of square rings in a box."""

import os
from pathlib import Path

import numpy as np
import pytest


def _square_tube(rings):
    """Square rings along x, closed at both ends: vertices and (corner indices, face sizes)."""
    around = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    vertices = np.array([(x, w * y, w * z) for x, w in rings for y, z in around], dtype=float)
    last = 4 * (len(rings) - 1)
    quads = [[3, 2, 1, 0], [last, last + 1, last + 2, last + 3]]
    for ring in range(len(rings) - 1):
        for k in range(4):
            a, b = 4 * ring + k, 4 * ring + (k + 1) % 4
            quads.append([a, b, b + 4, a + 4])
    return vertices, (np.concatenate(quads), np.full(len(quads), 4))


@pytest.fixture(scope="session")
def square_tube():
    """The function of the same name."""
    return _square_tube


@pytest.fixture
def bar():
    """Keyword arguments of `CoupledRig`."""
    skin, skin_faces = _square_tube([(i / 3, 0.6) for i in range(31)])
    cage, cage_faces = _square_tube([(-0.5, 0.9), (3.4, 1.1), (6.8, 1.1), (10.5, 0.9)])
    step = 1 / (1 + np.exp((skin[:, 0] - 5) / 0.5))
    return {
        "skin_vertices": skin,
        "skin_faces": skin_faces,
        "skin_weights": np.column_stack([step, 1 - step]),
        "joints": np.array([[0.2, 0, 0], [5.0, 0, 0]]),
        "parents": np.array([-1, 0]),
        "cage_vertices": cage,
        "cage_faces": cage_faces,
    }


@pytest.fixture
def bent():
    """Transforms that turn the second bone by 60 degrees about its joint."""
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    transforms = np.tile(np.eye(4), (2, 1, 1))
    transforms[1, :3, :3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    transforms[1, :3, 3] = np.array([5, 0, 0]) - transforms[1, :3, :3] @ [5, 0, 0]
    return transforms


@pytest.fixture(scope="session")
def arm():
    """The folder of the reference rig of [CTL*20], which is not part of this repository."""
    shared = os.environ.get("CAGE_RIG_SHARED") or Path(__file__).resolve().parents[3] / "shared"
    folder = Path(shared) / "data" / "arm"
    if not (folder / "inputs.npz").is_file():
        pytest.skip("the reference rig is not here; set CAGE_RIG_SHARED to the folder that holds data/arm")
    return {path.stem: dict(np.load(path)) for path in folder.glob("*.npz")}
