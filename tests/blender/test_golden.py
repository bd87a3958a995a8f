"""Recorded points of rigs of our own, held by the command line's `compare`: no version of anything may move them.

`python tools/with_extension.py tests/blender/test_golden.py` records them anew, after a change that is meant to.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from baked import keyed_rig
from scene import Rig

GOLDEN = Path(__file__).parent.parent / "golden"
# A rig of `rigs.RIGS`, its method, and what of it is recorded.
CASES = {
    "keyed_locations": "LBS",
    "scaled_bones": "LBS",
    "eight_influences": "LBS",
    "unapplied_transforms": "DQS",
    "two_skins_and_a_hidden_bone_collection": "COR",
}
FRAMES = "6-8"


def headless() -> ModuleType:
    import bl_ext.user_default.cage_rig.headless as module

    return module


def saved(name: str, folder: Path) -> Path:
    """A file with the rig, its action and its cage keys."""
    rig: Rig = keyed_rig(name)
    rig.settings.method = CASES[name]
    path = folder / f"{name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.mark.parametrize("name", CASES)
def test_a_rig_moves_as_it_was_recorded(name: str, tmp_path: Path) -> None:
    answer = tmp_path / "answer.json"
    code = headless().main(
        ["compare", str(saved(name, tmp_path)), str(GOLDEN / f"{name}.npz"), "--json", str(answer), "--quiet"]
    )
    assert code == 0, json.loads(answer.read_text())
    with np.load(GOLDEN / f"{name}.npz") as arrays:
        tracks = [arrays[key] for key in arrays.files if key.startswith("track_")]
    assert len(tracks) == len(json.loads(answer.read_text())["tracks"]) >= 3
    assert all(np.ptp(track, axis=0).max() > 1e-3 for track in tracks), "it moves"


def record() -> None:
    for name in CASES:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with tempfile.TemporaryDirectory() as folder:
            path = saved(name, Path(folder))
            code = headless().main(["compare", str(path), str(GOLDEN / f"{name}.npz"), "--record", "--frames", FRAMES])
        if code:
            sys.exit(code)


if __name__ == "__main__":
    record()
