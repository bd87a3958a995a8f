"""Centers of rotation that take long: chosen in a panel they are prepared while the rig goes on as it was."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import addon_utils
import bpy
import extension
import numpy as np
import pytest
from scene import Rig, bend, bound_bar, fat_key, file_state, fresh, rest, select, shown, update

PANEL = SimpleNamespace(area=SimpleNamespace(type="VIEW_3D"))


class Held:
    """A job of the core that seems to be under way until it is let go."""

    def __init__(self, job: object) -> None:
        self.job, self.done, self.progress = job, False, 0.25

    def wait(self, _seconds: float) -> bool:
        return self.done

    def let_go(self) -> None:
        self.job.wait()
        self.done, self.progress = True, 1.0

    def result(self) -> None:
        self.job.result()


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Held]]:
    """As with a window, and every method takes as long as the test wants: the jobs that have begun."""
    from bl_ext.user_default.cage_rig import choosing, session

    jobs: list[Held] = []
    begin = session.Session.start_method

    def start(found: object, name: str) -> Held:
        jobs.append(Held(begin(found, name)))
        return jobs[-1]

    monkeypatch.setattr(choosing, "can_wait", lambda: True)
    monkeypatch.setattr(session.Session, "start_method", start)
    yield jobs
    choosing.forget()


@pytest.fixture
def choosing() -> ModuleType:
    from bl_ext.user_default.cage_rig import choosing

    return choosing


def choose(rig: Rig, method: str) -> None:
    """What the panel does: the setting, and the mark of its button."""
    from bl_ext.user_default.cage_rig import choosing

    choosing.chosen(rig.cage, PANEL)
    rig.settings.method = method
    choosing.chosen(rig.cage, PANEL)
    update()


def at_once(rig: Rig, method: str) -> bytes:
    rig.settings.method = method
    update()
    return shown(rig.skin).tobytes()


def reference(method: str) -> bytes:
    """What a bent and fattened bar is that has always had the method."""
    rig = bound_bar()
    rig.settings.method = method
    update()
    fat_key(rig)
    bend(rig, 1.1)
    return shown(rig.skin).tobytes()


def shaped_bar() -> Rig:
    rig = bound_bar()
    fat_key(rig)
    bend(rig, 1.1)
    return rig


def test_the_rig_goes_on_until_it_is_ready_and_is_then_what_it_would_be_at_once(
    choosing: ModuleType, held: list[Held]
) -> None:
    wanted = {method: reference(method) for method in ("LBS", "DQS", "COR")}
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    held.clear()
    rig = shaped_bar()
    choose(rig, "DQS")
    held[-1].let_go()
    choosing._look()
    update()
    assert shown(rig.skin).tobytes() == wanted["DQS"]
    choose(rig, "COR")
    assert choosing.progress(rig.cage) == (0.25, "DQS")
    assert rig.settings.method == "COR" and shown(rig.skin).tobytes() == wanted["DQS"]
    bend(rig, 0.3)
    assert shown(rig.skin).tobytes() != wanted["DQS"], "it follows the pose"
    bend(rig, 1.1)
    assert len(held) == 2 and choosing._look() == choosing.INTERVAL
    held[-1].let_go()
    assert shown(rig.skin).tobytes() == wanted["DQS"]
    assert choosing._look() is None, "nothing more to look at"
    update()
    assert shown(rig.skin).tobytes() == wanted["COR"]
    assert choosing.progress(rig.cage) is None and rig.settings.state == "LIVE"
    bend(rig, 1.1)
    assert len(held) == 2
    assert np.abs(shown(rig.skin) - fresh(rig)[0]).max() < 1e-6


def test_cancel_puts_the_setting_back(choosing: ModuleType, held: list[Held]) -> None:
    rig = shaped_bar()
    before, shape = file_state(), shown(rig.skin).tobytes()
    choose(rig, "COR")
    select([rig.cage], rig.cage)
    assert bpy.ops.cage_rig.cancel_method() == {"FINISHED"}
    update()
    assert rig.settings.method == "LBS" and choosing.progress(rig.cage) is None
    assert file_state() == before and shown(rig.skin).tobytes() == shape
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.cage_rig.cancel_method()
    held[0].let_go()
    assert choosing._look() is None
    update()
    assert shown(rig.skin).tobytes() == shape, "what was cancelled does not come later"


def test_another_choice_replaces_the_one_that_is_prepared(choosing: ModuleType, held: list[Held]) -> None:
    rig = shaped_bar()
    shape = shown(rig.skin).tobytes()
    choose(rig, "COR")
    choose(rig, "LBS")
    assert choosing.progress(rig.cage) is None and shown(rig.skin).tobytes() == shape
    assert len(held) == 1


def test_scripts_and_renders_wait_for_it(choosing: ModuleType, held: list[Held]) -> None:
    wanted = reference("COR")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = shaped_bar()
    assert at_once(rig, "COR") == wanted and not held
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = shaped_bar()
    from bl_ext.user_default.cage_rig import sync

    choose(rig, "COR")
    assert shown(rig.skin).tobytes() != wanted and len(held) == 1
    sync.rendering(True)
    try:  # a frame of a render: in its own depsgraph, or none that the viewport shows
        choosing.use(rig.cage, sync.session_of(rig.cage), "cor", later=False)
    finally:
        sync.rendering(False)
    assert choosing.progress(rig.cage) is None
    rig.cage.update_tag()
    update()
    assert shown(rig.skin).tobytes() == wanted and len(held) == 1, "the work that had begun was waited for"


def test_a_file_saved_meanwhile_opens_with_the_chosen_method(
    choosing: ModuleType, held: list[Held], tmp_path: Path
) -> None:
    wanted = reference("COR")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = shaped_bar()
    choose(rig, "COR")
    path = str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert choosing.progress(rig.cage) is not None, "a save does not disturb it"
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not bpy.app.timers.is_registered(choosing._look)
    found = bpy.data.objects["BarCage"]
    assert choosing.progress(found) is None
    assert found.cage_rig.method == "COR" and found.cage_rig.state == "LIVE"
    points = np.frombuffer(wanted, np.float32).reshape(-1, 3)
    assert np.abs(shown(bpy.data.objects["Bar"]) - points).max() < 1e-6


def test_undo_and_redo_meanwhile(choosing: ModuleType, held: list[Held]) -> None:
    bpy.ops.ed.undo_push(message="start")
    rig = shaped_bar()
    bpy.ops.ed.undo_push(message="shaped")
    shape = shown(rig.skin).copy()
    choose(rig, "COR")
    bpy.ops.ed.undo_push(message="method")
    bpy.ops.ed.undo()
    cage, skin = bpy.data.objects["BarCage"], bpy.data.objects["Bar"]
    update()
    assert cage.cage_rig.method == "LBS" and choosing.progress(cage) is None
    assert np.abs(shown(skin) - shape).max() < 1e-6
    bpy.ops.ed.redo()
    cage, skin = bpy.data.objects["BarCage"], bpy.data.objects["Bar"]
    update()
    assert cage.cage_rig.method == "COR" and choosing.progress(cage) is not None, "it is prepared again"
    assert np.abs(shown(skin) - shape).max() < 1e-6
    held[-1].let_go()
    choosing._look()
    update()
    assert choosing.progress(cage) is None and np.abs(shown(skin) - shape).max() > 1e-3


def test_a_rig_that_is_unbound_rebound_or_deleted_meanwhile(choosing: ModuleType, held: list[Held]) -> None:
    rig = shaped_bar()
    choose(rig, "COR")
    select([rig.cage], rig.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    update()
    assert choosing.progress(rig.cage) is None, "the rebind has computed it"
    assert np.abs(shown(rig.skin) - fresh(rig)[0]).max() < 1e-6
    for act in (bpy.ops.cage_rig.unbind, bpy.ops.object.delete):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        rig = shaped_bar()
        choose(rig, "COR")
        select([rig.cage], rig.cage)
        assert act() == {"FINISHED"}
        assert choosing._look() is None
        update()
        assert not choosing._choices
        held[-1].let_go()


def test_a_paused_rig_takes_it_when_it_runs_again(choosing: ModuleType, held: list[Held]) -> None:
    rig = shaped_bar()
    choose(rig, "COR")
    rig.armature.data.bones["upper"].bbone_segments = 3
    update()
    assert rig.settings.state == "PAUSED"
    held[-1].let_go()
    assert choosing._look() is None, "asked once, and not again and again"
    update()
    rig.armature.data.bones["upper"].bbone_segments = 1
    rig.cage.update_tag()
    update()
    assert rig.settings.state == "LIVE" and choosing.progress(rig.cage) is None
    assert np.abs(shown(rig.skin) - fresh(rig)[0]).max() < 1e-6


def test_the_add_on_may_go_meanwhile(choosing: ModuleType, held: list[Held]) -> None:
    rig = shaped_bar()
    choose(rig, "COR")
    assert bpy.app.timers.is_registered(choosing._look)
    look = choosing._look
    addon_utils.disable(extension.MODULE)
    try:
        assert not bpy.app.timers.is_registered(look) and not choosing._choices
    finally:
        addon_utils.enable(extension.MODULE)
    update()
    cage = bpy.data.objects["BarCage"]
    assert cage.cage_rig.method == "COR" and len(rest(cage)) > 0
