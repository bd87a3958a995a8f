"""The Open Job Description template, run here by its own command line: chunks, one of them killed, merged."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from scene import Rig
from test_sync import key_the_bar

ROOT = Path(__file__).parent.parent.parent
TEMPLATE = ROOT / "farm/openjd/bake.yaml"
# Stands for Blender: runs its `--command cage_rig …` by the bpy module. The bake that `kill` names dies on its way.
BLENDER = """#!{python}
import os, pathlib, subprocess, sys
assert sys.argv[1:3] == ["--command", "cage_rig"], sys.argv
kill, environment = pathlib.Path({folder!r}, "kill"), dict(os.environ)
if kill.exists() and kill.read_text() in sys.argv:
    environment["PYTHONPATH"] = {folder!r}
command = [sys.executable, "-m", "cage_rig", *sys.argv[3:]]
sys.exit(subprocess.run(command, cwd={repository!r}, env=environment).returncode and 1)
"""
# Python runs this first where it finds it: the fourth sample is never written.
KILLED = """
import os, signal, sys
samples = []
def watch(frame, event, _):
    if event == "call" and frame.f_code.co_name == "write_sample":
        samples.append(frame)
        if len(samples) == 4:
            os.kill(os.getpid(), signal.SIGKILL)
sys.setprofile(watch)
"""


@pytest.fixture
def shot(bar: Rig, tmp_path: Path) -> Path:
    key_the_bar(bar)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 24
    path = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def blender(folder: Path) -> Path:
    """An executable that stands for Blender."""
    repository = next(r for r in bpy.context.preferences.extensions.repos if r.module == "user_default")
    made = folder / "blender"
    made.write_text(BLENDER.format(python=sys.executable, repository=repository.directory, folder=str(folder)))
    (folder / "sitecustomize.py").write_text(KILLED)
    made.chmod(0o755)
    return made


def openjd(shot: Path, out: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    given = {"BlendFile": shot, "Frames": "1-24", "ChunkSize": 8, "OutputDir": out, "Blender": blender(shot.parent)}
    job = [part for name, value in given.items() for part in ("-p", f"{name}={value}")]
    command = [sys.executable, "-m", "openjd", "run", str(TEMPLATE), *job, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ)


def test_the_template_is_valid() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "openjd", "check", str(TEMPLATE)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_chunks_one_killed_and_run_again_equal_one_bake_bit_for_bit(shot: Path, tmp_path: Path) -> None:
    import bl_ext.user_default.cage_rig.bake as bake

    (whole,) = bake.to_mesh_cache(bpy.data.objects["BarCage"], str(tmp_path / "whole.pc2"), result=False).files
    out, kill = tmp_path / "out", tmp_path / "kill"
    kill.write_text("9-16")
    first = openjd(shot, out, "--step", "Bake", "--no-run-dependencies")
    assert first.returncode != 0, first.stdout
    assert (out / "parts/1-8/BarCage.pc2").exists() and not (out / "parts/9-16/BarCage.pc2").exists()
    assert list((out / "parts/9-16").glob("*.partial.pc2")), "it was killed on its way"
    kill.unlink()
    rest = '[{"Frames": "9-16"}, {"Frames": "17-24"}]'
    for arguments in (["--step", "Bake", "--tasks", rest], ["--step", "Merge", "--no-run-dependencies"]):
        done = openjd(shot, out, *arguments)
        assert done.returncode == 0, done.stdout + done.stderr
    assert (out / "BarCage.pc2").read_bytes() == whole.read_bytes()


def test_a_whole_job_bakes_and_merges(shot: Path, tmp_path: Path) -> None:
    done = openjd(shot, tmp_path / "out", "--step", "Merge", "--run-dependencies")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "out/BarCage.pc2").stat().st_size == 32 + 24 * 12 * len(bpy.data.objects["Bar"].data.vertices)
    assert sorted(path.name for path in (tmp_path / "out/parts").iterdir()) == ["1-8", "17-24", "9-16"]
