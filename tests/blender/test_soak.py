"""A short soak; `make soak` is the long one."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
import soak
from scene import rest, set_mesh


@pytest.mark.parametrize("seed", [7])
def test_random_events_end_where_a_fresh_bind_does(seed: int, tmp_path: Path) -> None:
    soaked = soak.Soak(seed, tmp_path)
    assert soaked.run(150) == []
    assert set(soaked.met) == set(soak.EVENTS)


def test_a_soak_sees_a_rig_that_is_not_what_it_should_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soaked = soak.Soak(1, tmp_path)
    assert soaked.compare() == []
    rig = soaked.rig(0)
    handlers = list(bpy.app.handlers.depsgraph_update_post)
    bpy.app.handlers.depsgraph_update_post.clear()  # nobody follows this edit
    try:
        set_mesh(rig.cage, rest(rig.cage) * np.float32(1.2))
        (fault,) = soaked.compare()
    finally:
        bpy.app.handlers.depsgraph_update_post.extend(handlers)
    assert "0 Bar is off by" in fault
