"""Runs in the peer's own environment: `nested-cages` on one skin, and the measures of any cage, by libigl.

    python nested_cages_peer.py cage GIVEN.npz FOUND.npz ENERGY SECONDS    the peer's cage, or none in so much time
    python nested_cages_peer.py decimate GIVEN.npz FOUND.npz               a rough cage: the skin with `count` triangles
    python nested_cages_peer.py measure GIVEN.npz                          one line of JSON on any cage

GIVEN holds `skin`, `faces` and for `cage` either `count` of triangles wanted or a coarse mesh `vertices`, `triangles`
that the peer inflates; for `measure` the cage as `vertices`, `triangles`.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np

try:
    import resource
except ImportError:  # Windows
    resource = None

SAMPLES = 4000


def cage(given: dict[str, np.ndarray], found: str, energy: str) -> None:
    import nested_cages

    skin, faces = np.asfortranarray(given["skin"]), np.asfortranarray(given["faces"].astype(np.int32))
    options: dict[str, object] = {"num_faces": [int(given["count"])]}
    if "vertices" in given:
        coarse = np.asfortranarray(given["vertices"]), np.asfortranarray(given["triangles"].astype(np.int32))
        options["input_decimations"] = [coarse]
    start, begun = time.perf_counter(), time.process_time()
    made = nested_cages.nested_cages(skin, faces, energy_final=energy, quad_order=1, **options)[0]
    np.savez(
        found,
        vertices=np.array(made[0]),
        triangles=np.array(made[1]),
        seconds=time.perf_counter() - start,
        processor=time.process_time() - begun,
    )


def decimate(given: dict[str, np.ndarray], found: str) -> None:
    """By quadric errors, as both are given it."""
    import igl

    skin, faces = np.asfortranarray(given["skin"]), np.asfortranarray(given["faces"].astype(np.int32))
    vertices, triangles, *_ = igl.qslim(skin, faces, int(given["count"]), True)
    np.savez(found, vertices=np.array(vertices), triangles=np.array(triangles).astype(np.int64))


def measure(given: dict[str, np.ndarray]) -> dict[str, float]:
    """Volume ratio, mean distance to the skin relative to its diagonal, and what must be none."""
    import igl
    import igl.predicates

    skin, faces = np.ascontiguousarray(given["skin"]), np.ascontiguousarray(given["faces"].astype(np.int64))
    vertices = np.ascontiguousarray(given["vertices"])
    triangles = np.ascontiguousarray(given["triangles"].astype(np.int64))
    corners = vertices[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    random = np.random.default_rng(0)
    face = random.choice(len(triangles), SAMPLES, p=areas / areas.sum())
    places = np.einsum("ij,ijk->ik", random.dirichlet([1, 1, 1], SAMPLES), corners[face])
    squares, _, _ = igl.point_mesh_squared_distance(np.ascontiguousarray(places), skin, faces)
    winding = igl.winding_number(vertices, triangles, skin)
    return {
        "volume": _volume(vertices, triangles) / _volume(skin, faces),
        "distance": float(np.sqrt(squares).mean() / np.linalg.norm(np.ptp(skin, axis=0))),
        "outside": int((np.abs(winding - 1) > 1e-6).sum()),
        "crossing": len(igl.predicates.find_intersections(vertices, triangles, skin, faces, False)[1]),
        "folded": len(igl.predicates.find_self_intersections(vertices, triangles, False)[1]),
        "triangles": len(triangles),
    }


def _volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def give_up_after(seconds: int) -> None:
    """Of the processor, where the system can: it ends the process then."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))


def main() -> None:
    with np.load(sys.argv[2]) as file:
        given = {name: file[name] for name in file.files}
    if sys.argv[1] == "cage":
        give_up_after(int(sys.argv[5]))
        cage(given, sys.argv[3], sys.argv[4])
    elif sys.argv[1] == "decimate":
        decimate(given, sys.argv[3])
    else:
        print(json.dumps(measure(given)))


if __name__ == "__main__":
    main()
