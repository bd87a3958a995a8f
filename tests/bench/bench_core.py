"""The core from Python beside numpy and libigl, in one process: `--quick` checks the answers of small sizes alone."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]
import cage_rig_core as core
from rows import Row, keep, least
from tube import tube

from blend_fixtures.parts import Character

try:
    import igl
except ImportError:  # no wheel for this platform: its columns stay empty
    igl = None

QUICK = "--quick" in sys.argv
FREE = 7  # cages that no few shapes make up
# Vertices, bones and cage vertices of the rigs in [CTL*20] Table 1.
PRODUCTS = ((2_089, 24, 80), (7_512, 64, 86), (41_425, 19, 68), (120_066, 98, 44))


def rig_of(character: Character, **settings: object) -> core.CoupledRig:
    """The character bound."""
    skin, cage = character.skins[0], character.cage
    faces = np.asarray(skin.faces)
    parents = np.arange(len(character.bones)) - 1
    return core.CoupledRig(
        skin.vertices, (faces.ravel(), np.full(len(faces), 3)), skin.weights,
        np.array([bone.head for bone in character.bones]), parents, cage.vertices,
        (np.concatenate([np.asarray(face) for face in cage.faces]), np.full(len(cage.faces), 3)), **settings,
    )  # fmt: skip


def poses(character: Character) -> list[np.ndarray]:
    """Two poses in which every bone is bent against its parent, `#J by 4 by 4` each."""
    found = []
    for angle in (0.03, -0.02):
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        pose = [np.eye(4)]
        for bone in character.bones[1:]:
            local = turn.copy()
            local[:3, 3] = bone.head - turn[:3, :3] @ bone.head
            pose.append(pose[-1] @ local)
        found.append(np.array(pose))
    return found


def product(vertices: int, bones: int, cage: int) -> Row:
    """M = M0 + Φ(C − C0) into an array. Joints and transforms, which follow a cage too, are in the whole frames."""
    rig = rig_of(tube(vertices, bones, cage))
    phi, bound, rest = rig.cage_coords.astype(np.float32), rig.rest_cage, rig.rest_skin.astype(np.float32)
    # Of more shapes than are kept, for between few keys Φ is not read.
    random = np.random.default_rng(1)
    cages = [bound + 0.01 * random.standard_normal(bound.shape) for _ in range(FREE)]
    steps = [(cage - bound).astype(np.float32) for cage in cages]
    ours, peer, number = np.empty_like(rest), np.empty_like(rest), [0]
    flat = phi.ravel()

    def move() -> None:
        number[0] = (number[0] + 1) % FREE
        rig.edit_rest_cage(cages[number[0]])

    def blas() -> None:
        np.matmul(phi, steps[number[0]], out=peer)
        np.add(peer, rest, out=peer)

    move()
    rig.rest_skin_into(ours)
    blas()
    assert np.abs(ours - peer).max() <= 2e-6 * rig.size
    acts = (lambda: rig.rest_skin_into(ours)), blas, (lambda: flat @ flat)
    fast, slow, read = least(*acts, rounds=2 if QUICK else 40, turn=5, before=move)
    assert rig.work["rest_shape_passes"] == 0, "all of Φ is read"
    name = f"rest skin: {len(rest):,} vertices, cage of {len(bound)}"
    why = "every frame in which the cage moves; bound by reading Φ from memory on the largest"
    return Row(name, why, fast, slow, "numpy float32, one BLAS product and an addition", min(read / fast, 1.0))


def skinning(vertices: int, bones: int) -> Row | None:
    """Linear blend skinning of a still cage, against libigl's matrix."""
    if igl is None:
        return None
    character = tube(vertices, bones, 44)
    rig, skin = rig_of(character), character.skins[0]
    matrix = igl.lbs_matrix(skin.vertices, skin.weights)
    both, out, count = poses(character), np.empty((len(skin.vertices), 3), np.float32), [0]
    stacked = [np.ascontiguousarray(pose[:, :3].transpose(0, 2, 1).reshape(-1, 3)) for pose in both]

    def ours() -> None:
        count[0] += 1
        rig.pose(both[count[0] % 2])
        rig.posed_skin_into(out)

    ours()
    assert np.abs(matrix @ stacked[count[0] % 2] - out).max() <= 1e-5 * rig.size
    fast, slow = least(ours, lambda: matrix @ stacked[0], rounds=2 if QUICK else 20)
    name = f"skinning: {len(out):,} vertices, {bones} bones"
    return Row(name, "every frame in which bones move alone", fast, slow, "libigl lbs_matrix, times the transforms")


def bind(vertices: int, bones: int, cage: int) -> list[Row]:
    """A whole bind; libigl makes weights of as many handles on the skin, by a solve where ours have a formula."""
    character = tube(vertices, bones, cage)
    start = time.perf_counter()
    rig = rig_of(character)
    whole = 1e3 * (time.perf_counter() - start)
    skin = character.skins[0]
    assert np.abs(rig.cage_coords @ rig.rest_cage - skin.vertices).max() <= 1e-12 * rig.size
    start = time.perf_counter()
    core.mean_value_coordinates(skin.vertices, character.cage.vertices, _corners(character))
    coordinates = 1e3 * (time.perf_counter() - start)
    slow = None
    if igl is not None:
        handles = np.array([np.linalg.norm(skin.vertices - c, axis=1).argmin() for c in character.cage.vertices])
        handles = np.unique(handles)
        start = time.perf_counter()
        weights = igl.harmonic(skin.vertices, np.asarray(skin.faces, np.int64), handles, np.eye(len(handles)), 1)
        slow = 1e3 * (time.perf_counter() - start)
        assert np.abs(np.asarray(weights)[handles] - np.eye(len(handles))).max() < 1e-9
    size = f"{len(skin.vertices):,} vertices, cage of {len(character.cage.vertices)}"
    return [
        Row(f"bind, all of it: {size}, {bones} bones", "the size of a rig in [CTL*20] Table 1", whole),
        Row(f"coordinates alone: {size}", "most of a bind", coordinates, slow, "libigl harmonic, as many handles"),
    ]


def bounded_biharmonic() -> Row | None:
    """Weights of four handles in the volume, libigl's other way to them: a small size, because it optimises."""
    if igl is None or QUICK or not hasattr(igl, "bbw"):
        return None
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 12)] * 3, indexing="ij"), -1).reshape(-1, 3)
    a = np.arange(12**3).reshape(12, 12, 12)
    cube = [a[i : 11 + i, j : 11 + j, k : 11 + k].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    paths = ((0, 1, 3, 7), (0, 1, 7, 5), (0, 5, 7, 4), (0, 3, 2, 7), (0, 4, 7, 6), (0, 6, 7, 2))
    tetrahedra = np.concatenate([np.stack([cube[k] for k in path], -1) for path in paths])
    handles = np.array([0, 11, 12 * 11, 12**3 - 1])
    start = time.perf_counter()
    try:
        igl.bbw(grid, tetrahedra, handles, np.eye(4))
    except Exception as error:  # its interface changes between versions: no row is better than a wrong one
        print(f"libigl bbw is left out: {error}")
        return None
    slow = 1e3 * (time.perf_counter() - start)
    box = np.array([(x, y, z) for x in (-1.1, 1.1) for y in (-1.1, 1.1) for z in (-1.1, 1.1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    (fast,) = least(lambda: core.mean_value_coordinates(grid, box, (np.ravel(quads), np.full(6, 4))))
    name = f"coordinates alone: {len(grid):,} points in a box"
    return Row(name, "weights in a volume, which libigl optimises", fast, slow, "libigl bbw, four handles")


def _corners(character: Character) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate([np.asarray(f) for f in character.cage.faces]), np.full(len(character.cage.faces), 3)


def main() -> None:
    sizes = ((2_089, 24, 44),) if QUICK else PRODUCTS
    rows: list[Row | None] = [product(*size) for size in sizes]
    rows += [skinning(*size) for size in (((2_089, 24),) if QUICK else ((7_512, 64), (41_425, 19)))]
    for size in sizes:
        rows += bind(*size)
    rows.append(bounded_biharmonic())
    keep("core-quick" if QUICK else "core", [row for row in rows if row is not None])


if __name__ == "__main__":
    main()
