"""Broken input at every door: whatever the arrays hold, there is an error of ours or a finite result, never a panic."""

import cage_rig_core as core
import numpy as np
import pytest

SEEDS = range(100)
CASES = 12  # a seed
# Errors of ours, and those of Python for what is no array, and of numpy for what can't become one.
REFUSALS = (core.CageRigError, TypeError)


def one_entry(value):
    def change(random, array):
        made = array.astype(np.float64 if array.dtype.kind == "f" else np.int64)
        if made.size:
            made.reshape(-1)[random.integers(made.size)] = value
        return made

    return change


def repeat_a_row(random, array):
    made = array.copy()
    if len(made) > 1:
        made[random.integers(len(made))] = made[random.integers(len(made))]
    return made


CHANGES = [
    lambda random, array: one_entry(np.nan)(random, array * 1.0),
    lambda random, array: one_entry(np.inf)(random, array * 1.0),
    one_entry(-7),
    one_entry(10**15),
    lambda random, array: one_entry(1e200)(random, array * 1.0),
    lambda random, array: np.full(array.shape, np.nan),
    lambda random, array: array * 1e300,
    lambda random, array: array * 1e150,
    lambda random, array: array * 1e-200,
    lambda random, array: array + array.dtype.type(2**40),
    lambda random, array: np.zeros_like(array),
    lambda random, array: -array,
    repeat_a_row,
    lambda random, array: np.delete(array, random.integers(max(len(array), 1)), axis=0) if len(array) else array,
    lambda random, array: np.concatenate([array, array[:1]]),
    lambda random, array: np.repeat(array, 2, axis=0),
    lambda random, array: array[:0],
    lambda random, array: array[:1],
    lambda random, array: array.reshape(-1),
    lambda random, array: array.T,
    lambda random, array: array[None],
    lambda random, array: random.permutation(array.reshape(-1)).reshape(array.shape),
    lambda random, array: array + random.normal(size=array.shape) * 0.5,
    lambda random, array: array + 1j,
    lambda random, array: array.astype(np.float16),
    lambda random, array: array.astype(object),
    lambda random, array: np.broadcast_to(array[:1], array.shape),
    lambda random, array: ["no", "numbers"],
    lambda random, array: 3.0,
    lambda random, array: None,
    lambda random, array: {},
]


def broken(random, value):
    """`value` changed in one way; of a tuple of arrays, one of them."""
    if isinstance(value, tuple):
        which = random.integers(len(value))
        return tuple(broken(random, part) if k == which else part for k, part in enumerate(value))
    with np.errstate(all="ignore"):
        return CHANGES[random.integers(len(CHANGES))](random, np.asarray(value))


def results(rig):
    return {name: np.asarray(getattr(rig, name)) for name in ("posed_skin", "posed_cage", "joints", "transforms")}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_bind_of_broken_arrays_is_refused_or_finite(bar, bent, seed):
    random = np.random.default_rng(seed)
    bound = 0
    for _ in range(CASES):
        given = dict(bar)
        for name in random.choice(list(given), random.integers(1, 3), replace=False):
            given[name] = broken(random, given[name])
        for name, rows in (("cage_coords", 124), ("joint_coords", 2), ("center_coords", 124)):
            if random.random() < 0.1:
                given[name] = broken(random, random.random((rows, 16)))
        if random.random() < 0.1:
            given["anchors"] = broken(random, np.arange(16))
        try:
            rig = core.CoupledRig(**given, method=str(random.choice(core.skinning_methods())))
        except REFUSALS as error:
            assert len(str(error)) > 10, error
            continue
        bound += 1
        assert all(np.isfinite(array).all() for array in results(rig).values()), given
        try:
            rig.pose(bent)
        except REFUSALS:
            continue
        assert all(np.isfinite(array).all() for array in results(rig).values()), given
    assert bound < CASES, "something was refused"


@pytest.mark.parametrize("seed", SEEDS)
def test_edits_by_broken_arrays_are_refused_and_change_nothing(bar, bent, seed):
    random = np.random.default_rng(seed)
    rig = core.CoupledRig(**bar, method=str(random.choice(core.skinning_methods())))
    cage, mask, moved = bar["cage_vertices"], np.linspace(0, 1, 124), 0.1 * bar["skin_vertices"]
    edits = [
        lambda: rig.pose(broken(random, bent), broken(random, bar["joints"]) if random.random() < 0.3 else None),
        lambda: rig.edit_rest_cage(broken(random, cage)),
        lambda: rig.edit_posed_cage(broken(random, rig.posed_cage)),
        lambda: rig.play(broken(random, cage), broken(random, bent)),
        lambda: rig.offset_rest_skin(broken(random, moved)),
        lambda: rig.mask_skin(broken(random, mask)),
        lambda: rig.carry(broken(random, 0.1 * cage), broken(random, 0.1 * bar["joints"])),
        lambda: rig.set_method("lbs" if random.random() < 0.5 else "none"),
        lambda: rig.cage_influence(broken(random, np.arange(4))),
    ]
    for _ in range(4 * CASES):
        before = results(rig)
        try:
            edits[random.integers(len(edits))]()
        except (*REFUSALS, OverflowError):
            after = results(rig)
            assert all(np.array_equal(before[name], after[name]) for name in before)
        else:
            for name, array in results(rig).items():
                assert np.isfinite(array).all(), name
            if random.random() < 0.5:  # back to what is small, so that later edits are not refused for size alone
                rig.play(cage, bent)
                rig.offset_rest_skin(None)
                rig.mask_skin(None)
                rig.carry(None, None)


@pytest.mark.parametrize("seed", SEEDS)
def test_coordinates_at_broken_points_are_refused_or_finite(bar, seed):
    random = np.random.default_rng(seed)
    for _ in range(CASES):
        given = [bar["skin_vertices"], bar["cage_vertices"], bar["cage_faces"]]
        which = random.integers(3)
        given[which] = broken(random, given[which])
        try:
            found = core.mean_value_coordinates(*given)
        except REFUSALS:
            continue
        assert np.isfinite(found).all()
