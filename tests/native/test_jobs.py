"""Long work in threads: it tells its progress, stops when it is told to, and gives what the blocking call gives."""

import gc
import random
import subprocess
import sys
import threading

import cage_rig_core as core
import numpy as np
import pytest


@pytest.fixture(scope="module")
def large(square_tube):
    """Arguments whose bind takes a fair part of a second: a tube of 12,000 vertices under 20 bones."""
    rings, around, joints = 500, 24, 20
    ring, turn = np.divmod(np.arange(rings * around), around)
    x, angle = ring / rings * (joints - 1), turn * 2 * np.pi / around
    first = np.arange((rings - 1) * around)
    second = first - first % around + (first % around + 1) % around
    bones = np.clip(np.floor(x).astype(int) - 1, 0, joints - 4)[:, None] + np.arange(4)
    weights = np.exp(-((x[:, None] - bones) ** 2))
    cage, cage_faces = square_tube([(k, 1.2) for k in np.linspace(-0.5, joints - 0.5, 15)])
    return {
        "skin_vertices": np.stack([x, np.cos(angle), np.sin(angle)], 1),
        "skin_faces": (np.stack([first, second, second + around, first + around], 1).ravel(), np.full(len(first), 4)),
        "skin_weights": (np.arange(0, 4 * len(x) + 1, 4), bones.ravel(), weights.ravel()),
        "joints": np.stack([np.arange(joints), np.zeros(joints), np.zeros(joints)], 1).astype(float),
        "parents": np.arange(joints) - 1,
        "cage_vertices": cage,
        "cage_faces": cage_faces,
        "method": "cor",
    }


def lively(count, seed=1):
    """Transforms that turn and move every bone."""
    rng = np.random.default_rng(seed)
    transforms = np.tile(np.eye(4), (count, 1, 1))
    transforms[:, :3, :3] = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    transforms[:, :3, 3] = rng.normal(size=(count, 3))
    return transforms


def watch(job):
    """What is seen of a job until it is done."""
    seen = [(job.progress, job.stage)]
    while not job.wait(0.002):
        seen.append((job.progress, job.stage))
    return [*seen, (job.progress, job.stage)]


def test_progress_grows_to_the_end_through_named_stages(large):
    job = core.BindJob(**large)
    seen = watch(job)
    shares = [share for share, _ in seen]
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert len(set(shares)) > 10
    stages = list(dict.fromkeys(stage for _, stage in seen))
    assert stages[-1] == "centers of rotation" and len(stages) >= 3
    assert job.done and job.result().method == "cor"


@pytest.mark.parametrize("method", core.skinning_methods())
def test_a_job_gives_what_the_blocking_call_gives_to_the_last_bit(large, method):
    arguments = {**large, "method": method}
    job = core.BindJob(**arguments)
    blocking, found = core.CoupledRig(**arguments), job.result()
    assert found.report == blocking.report and found.work == blocking.work
    pose = lively(20)
    for rig in (blocking, found):
        rig.play(large["cage_vertices"] * 1.1, pose)
    for name in ("cage_coords", "joint_coords", "center_coords", "anchors", "posed_skin", "posed_cage"):
        np.testing.assert_array_equal(getattr(found, name), getattr(blocking, name), name)


def test_the_result_may_be_asked_for_twice_and_is_one_rig(large):
    job = core.BindJob(**{**large, "method": "lbs"})
    first, again = job.result(), job.result()
    first.pose(lively(20))
    np.testing.assert_array_equal(again.posed_skin, first.posed_skin)


def test_a_cancel_at_any_moment_leaves_nothing(large):
    chance = random.Random(4)
    cancelled = 0
    for _ in range(25):
        job, share = core.BindJob(**large), chance.random()
        while job.progress < share and not job.wait(0.001):
            pass
        was_done = job.done
        job.cancel()
        if was_done:
            assert job.result().method == "cor", "what is done stays done"
            continue
        try:
            job.result()
        except core.Cancelled as error:
            assert "cancelled" in str(error)
            with pytest.raises(core.Cancelled):
                job.result()
            assert job.done
            cancelled += 1
    assert cancelled > 5


def test_bad_arguments_are_refused_before_the_thread_begins(bar):
    with pytest.raises(core.ArrayError, match="skin_vertices"):
        core.BindJob(**{**bar, "skin_vertices": np.zeros((3, 2))})
    with pytest.raises(core.CageRigError, match="ragdoll"):
        core.BindJob(**bar, method="ragdoll")


def test_what_the_bind_refuses_the_result_raises(bar):
    job = core.BindJob(**{**bar, "cage_vertices": bar["cage_vertices"] + np.array([0, 99, 0])})
    for _ in range(2):
        with pytest.raises(core.SkinError, match="encloses no vertex"):
            job.result()
    assert job.progress < 1.0


def test_arguments_may_be_changed_once_the_job_has_begun(bar):
    arguments = {**bar, "skin_vertices": bar["skin_vertices"].copy()}
    job = core.BindJob(**arguments)
    arguments["skin_vertices"][:] = np.nan
    np.testing.assert_array_equal(job.result().posed_skin, core.CoupledRig(**bar).posed_skin)


def test_a_panic_in_a_job_is_an_exception():
    job = core.BindJob._panic_for_tests()
    for _ in range(2):
        with pytest.raises(core.PanicException, match="asked to by a test"):
            job.result()


def test_many_jobs_at_once(bar, large):
    wanted = core.CoupledRig(**bar).cage_coords
    jobs = [core.BindJob(**bar) for _ in range(40)]
    doomed = [core.BindJob(**large) for _ in range(4)]
    for job in doomed:
        job.cancel()
    for job in jobs:
        np.testing.assert_array_equal(job.result().cage_coords, wanted)
    for job in doomed:
        with pytest.raises(core.Cancelled):
            job.result()


def test_the_gil_is_free_while_a_result_is_waited_for(large):
    job, ticks = core.BindJob(**large), []
    thread = threading.Thread(target=job.result)
    thread.start()
    while thread.is_alive():
        ticks.append(1)
    assert len(ticks) > 100


def test_a_method_that_needs_nothing_is_ready_at_once(bar):
    rig = core.CoupledRig(**bar)
    job = rig.start_method("dqs")
    assert job.done and job.progress == 1.0 and job.method == "dqs"
    assert rig.method == "lbs"
    job.result()
    assert rig.method == "dqs"
    with pytest.raises(core.CageRigError, match="ragdoll"):
        rig.start_method("ragdoll")


def test_a_rig_goes_on_with_its_method_until_the_job_is_asked_for(large):
    rig, at_once = (core.CoupledRig(**{**large, "method": "dqs"}) for _ in range(2))
    job = rig.start_method("cor")
    for seed in range(5):
        rig.pose(lively(20, seed))
        rig.edit_rest_cage(large["cage_vertices"] * (1 + 0.01 * seed))
        at_once.play(rig.rest_cage, lively(20, seed))
        np.testing.assert_array_equal(rig.posed_skin, at_once.posed_skin)
    assert watch(job)[-1] == (1.0, "centers of rotation")
    assert rig.method == "dqs"
    np.testing.assert_array_equal(rig.posed_skin, at_once.posed_skin)
    job.result()
    at_once.set_method("cor")
    assert rig.method == "cor"
    np.testing.assert_array_equal(rig.posed_skin, at_once.posed_skin)
    np.testing.assert_array_equal(rig.center_coords, at_once.center_coords)
    assert rig.work["center_integrations"] == 1


def test_a_cancelled_change_of_method_leaves_the_rig_as_it_was(large):
    rig = core.CoupledRig(**{**large, "method": "lbs"})
    before, work = rig.posed_skin, rig.work
    job = rig.start_method("cor")
    job.cancel()
    with pytest.raises(core.Cancelled):
        job.result()
    assert rig.method == "lbs" and rig.center_coords is None and rig.work == work
    np.testing.assert_array_equal(rig.posed_skin, before)
    rig.set_method("cor")
    assert rig.center_coords is not None


def test_a_job_outlives_its_rig_and_a_rig_its_job(large):
    job = core.CoupledRig(**{**large, "method": "lbs"}).start_method("cor")
    gc.collect()
    job.result()
    rig = core.CoupledRig(**{**large, "method": "lbs"})
    rig.start_method("cor")  # dropped, so cancelled
    gc.collect()
    assert rig.method == "lbs"
    rig.set_method("cor")
    assert rig.work["center_integrations"] == 1


ENDS = {
    "while it runs": "job = core.BindJob(**arguments); assert not job.done",
    "at once after": "core.BindJob(**arguments)",
    "in a cycle that nobody collects": "cycle = [core.BindJob(**arguments)]; cycle.append(cycle)",
}


@pytest.mark.parametrize("how", ENDS)
def test_a_process_may_end_while_a_job_runs(large, how, tmp_path):
    """Neither a crash nor a wait for the end of the work."""
    path = tmp_path / "arguments.npy"
    indptr, _, data = large["skin_weights"]
    alike = (indptr, np.tile(np.arange(4), len(indptr) - 1), data)  # every vertex sees every triangle: minutes
    long = {**large, "skin_weights": alike, "options": {"center_bins": 0}}
    np.save(path, np.array([long], object), allow_pickle=True)
    script = f"import numpy as np, cage_rig_core as core; arguments = np.load({str(path)!r}, allow_pickle=True)[0]; "
    done = subprocess.run([sys.executable, "-c", script + ENDS[how]], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
