"""A hundred broken inputs: each ends in an error that says what is wrong, or in a valid cage.

Most of those that can be caged stop where the cage begins to grow, free of crossings.
"""

import cage_rig_core as core
import numpy as np
import pytest

KINDS = [
    "open",
    "flipped",
    "doubled",
    "crossing",
    "flat",
    "not finite",
    "skeleton outside",
    "single bone",
    "empty",
    "wrong index",
]
WHOLE = 2  # of each kind grow to the end
MUST_FAIL = {"open", "not finite", "skeleton outside", "empty", "wrong index"}


def broken(kind, seed, square_tube):
    """Skin, triangles, nodes and edges with one kind of fault."""
    random = np.random.default_rng(seed)
    skin, (corners, sizes) = square_tube([(float(i), 0.6 + 0.2 * random.random()) for i in range(11)])
    quads = corners.reshape(-1, 4)
    assert (sizes == 4).all()
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    nodes, edges = np.array([[1.0, 0, 0], [5, 0, 0], [9, 0, 0]]), np.array([[0, 1], [1, 2]])
    some = random.choice(len(faces), 1 + seed, replace=False)
    match kind:
        case "open":
            faces = np.delete(faces, some, axis=0)
        case "flipped":
            faces[some] = faces[some][:, ::-1]
        case "doubled":
            faces = np.concatenate([faces, faces[some]])
        case "crossing":
            skin = skin + random.normal(0, 0.05 * (1 + seed), skin.shape)
        case "flat":
            skin[faces[some][:, 0]] = skin[faces[some][:, 1]]
        case "not finite":
            target = skin if seed % 2 else nodes
            target[random.integers(len(target)), seed % 3] = [np.nan, np.inf][seed % 2]
        case "skeleton outside":
            nodes = nodes + random.normal(0, 1, 3) / 100 + [0, 3 + seed, 0]
        case "single bone":
            nodes, edges = np.array([[1.0 + seed * 0.4, 0, 0], [9.0 - seed * 0.4, 0.1, 0]]), np.array([[0, 1]])
        case "empty":
            empty = [skin[:0], faces[:0], nodes[:0], edges[:0]]
            whole = [skin, faces, nodes, edges]
            return [empty[k] if (seed + 1) >> k & 1 else whole[k] for k in range(4)]
        case "wrong index":
            target = faces if seed % 2 else edges
            target[random.integers(len(target)), 0] = [-1, 10_000][seed // 2 % 2]
    return skin, faces, nodes, edges


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", KINDS)
def test_a_broken_input_is_refused_by_name_or_caged(kind, seed, square_tube):
    given = broken(kind, seed, square_tube)

    def goes_on(stage, part):
        return seed < WHOLE or stage != "growing the cage"

    try:
        vertices, triangles, report = core.generate_cage(*given, options={"triangles": True}, progress=goes_on)
    except core.CageRigError as refused:
        if getattr(refused, "cancelled", False):
            assert kind not in MUST_FAIL
            return
        assert len(str(refused).split()) >= 4
        assert kind not in ("flipped", "doubled"), "that can be repaired"
        return
    assert kind not in MUST_FAIL
    assert report["clearance"] >= 1e-4
    assert len(triangles) == 2 * len(vertices) - 4 + 4 * report["genus"]
    assert not core.check_cage(vertices, triangles)["turned"]
