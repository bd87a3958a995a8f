"""Rest skins beside numpy's, in one process: the third table that `make bench` prints.

The peer is the best that numpy has for M0 + Phi (C - C0) in single precision: one BLAS product into an array that is
there, and one addition in place. Ours is the whole way of a script: a cage in, an array filled. Both use the threads
that they choose. Least of many rounds in turns: these machines are shared. The answers are compared once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import cage_rig_core as core
import numpy as np

SIZES = ((50, 42, 20), (100, 75, 22), (400, 104, 17), (1461, 82, 11))  # rings, around, rings of the cage


def square_tube(rings: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed square tube along x: vertices and triangles, outward."""
    around = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    vertices = np.array([(x, y, z) for x in rings for y, z in around])
    last = 4 * (len(rings) - 1)
    faces = [(0, 2, 1), (0, 3, 2), (last, last + 1, last + 2), (last, last + 2, last + 3)]
    for ring in range(len(rings) - 1):
        for k in range(4):
            a, b = 4 * ring + k, 4 * ring + (k + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    return vertices, np.array(faces)


def rig_of(rings: int, around: int, cage_rings: int) -> core.CoupledRig:
    """A tube of two bones in a square cage."""
    x, turn = np.meshgrid(np.linspace(0, 20, rings), np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij")
    skin = np.stack([x, np.cos(turn), np.sin(turn)], axis=-1).reshape(-1, 3)
    share = skin[:, 0] / 20
    cage, faces = square_tube(np.linspace(-1, 21, cage_rings), 1.6)
    joints = np.array([[0.0, 0, 0], [10, 0, 0]])
    no_faces = np.zeros((0, 3), int)
    return core.CoupledRig(skin, no_faces, np.column_stack([1 - share, share]), joints, [-1, 0], cage, faces)


def least(acts: list[Callable[[], None]], rounds: int) -> list[float]:
    """The least time of each act in milliseconds, in turns of ten, so that each finds its own arrays in the caches."""
    best = [float("inf")] * len(acts)
    for _ in range(rounds // 10):
        for k, act in enumerate(acts):
            for _ in range(10):
                start = time.perf_counter()
                act()
                best[k] = min(best[k], time.perf_counter() - start)
    return [1e3 * seconds for seconds in best]


def scenario(size: tuple[int, int, int]) -> None:
    rig = rig_of(*size)
    phi = rig.cage_coords.astype(np.float32)
    bound, rest = rig.rest_cage, rig.rest_skin.astype(np.float32)
    cages = [bound + 0.01 * np.sin(k + np.arange(bound.size)).reshape(bound.shape) for k in range(2)]
    steps = [(cage - bound).astype(np.float32) for cage in cages]
    ours, peer = np.empty_like(rest), np.empty_like(rest)
    count = [0, 0]

    def play() -> None:
        count[0] += 1
        rig.edit_rest_cage(cages[count[0] % 2])
        rig.rest_skin_into(ours)

    def blas() -> None:
        count[1] += 1
        np.matmul(phi, steps[count[1] % 2], out=peer)
        np.add(peer, rest, out=peer)

    play()
    blas()
    assert np.abs(ours - peer).max() <= 2e-6 * rig.size
    fast, slow = least([play, blas], 2000 if len(rest) < 10_000 else 300)
    print(f"{len(rest):7d} by {len(bound):2d}   {fast:8.4f}   {slow:8.4f}   {slow / fast:5.1f}")


def main() -> None:
    print("rest skin       ours, ms  numpy, ms   times")
    for size in SIZES:
        scenario(size)


if __name__ == "__main__":
    main()
