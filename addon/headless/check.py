# SPDX-License-Identifier: GPL-3.0-or-later
"""Check every rig of .blend files: whether it runs at every frame, what its bind found, how exact and fast it is."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .. import binding, sync
from ..session import Session
from .run import Answer, Voice, frames, open_file, rigs

NAME = "check"
HELP = "state, bind report, residuals and timings of every rig"

# What a rig may miss by, relative to its size, before the check says no.
LIMITS = {"coordinate_error": 1e-6, "joint_error": 1e-6, "shown_error": 1e-5, "edit_error": 1e-5}
TIMED = 24  # frames at most, evenly over the range


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help=".blend files")
    parser.add_argument("--rig", metavar="NAME", help="only the rig of this rest cage")
    parser.add_argument("--frames", metavar="A-B", help=f"the range to look at, {TIMED} frames of it; the scene's")


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    files = []
    for path in given.files:
        open_file(path)
        files.append({"file": str(path), "rigs": _check_file(given, path, voice)})
    return Answer(ok=all(rig["ok"] for file in files for rig in file["rigs"]), limits=LIMITS, files=files)


def _check_file(given: argparse.Namespace, path: Path, voice: Voice) -> list[dict[str, Any]]:
    cages = rigs(given.rig)
    start, end = frames(given.frames)
    times = np.unique(np.linspace(start, end, min(TIMED, end - start + 1)).round().astype(int)).tolist()
    paused: dict[str, tuple[int, str]] = {}
    seconds = []
    for done, frame in enumerate(times):
        begun = time.perf_counter()
        bpy.context.scene.frame_set(frame)
        bpy.context.evaluated_depsgraph_get()
        seconds.append(time.perf_counter() - begun)
        for cage in cages:
            if cage.cage_rig.state != "LIVE":
                paused.setdefault(cage.name, (frame, cage.cage_rig.message))
        voice.progress((done + 1) / len(times), f"{path.name}: playing")
    found: list[dict[str, Any]] = []
    fresh: dict[bpy.types.Object, Session] = {}
    for cage in cages:
        rig = _check_rig(cage, paused.get(cage.name), fresh)
        rig["frame_ms"] = 1e3 * float(np.median(seconds))  # of the whole scene
        found.append(rig)
        voice.say(_line(path, rig))
    return found


def _check_rig(
    cage: bpy.types.Object, paused: tuple[int, str] | None, fresh: dict[bpy.types.Object, Session]
) -> dict[str, Any]:
    settings = cage.cage_rig
    rig: dict[str, Any] = {
        "rig": cage.name,
        "state": "LIVE" if paused is None else "PAUSED",
        "message": "" if paused is None else paused[1],
        "paused_at": None if paused is None else paused[0],
        "method": settings.method,
        "skins": {skin.object.name: len(skin.object.data.vertices) for skin in settings.skins if skin.object},
        "cage_vertices": len(cage.data.vertices),
        "joints": len(settings.joints),
        "beyond": [],
        "ok": paused is None,
    }
    if paused is not None:
        return rig
    begun = time.perf_counter()
    session = fresh[cage] = Session(binding.read(cage))
    rig["bind_seconds"] = time.perf_counter() - begun
    report = session.report
    rig["report"] = {name: _plain(value) for name, value in report.items()}
    rig["residuals"] = {
        "coordinate_error": report["coordinate_error_max"] / session.size,
        "joint_error": report["joint_error_max"] / session.size,
        "shown_error": _repeat(cage, sync.session_of(cage), session, fresh),
        "edit_error": _edit(session),
    }
    rig["beyond"] = [name for name, limit in LIMITS.items() if not rig["residuals"][name] <= limit]
    rig["ok"] = not rig["beyond"]
    return rig


def _repeat(cage: bpy.types.Object, live: Session, session: Session, fresh: dict[bpy.types.Object, Session]) -> float:
    """How far the skins are that the running session shows from those of a fresh bind in the same state."""
    lower = cage.cage_rig.input
    if lower is not None:
        if lower not in fresh:
            fresh[lower] = sync.session_of(lower)
        session.stand_on(binding.below(cage, fresh[lower]))
    session.offset_skins(live.offsets)
    session.mask_skins(live.masks)
    session.play(live.rig.rest_cage.astype(np.float32), live.rig.transforms, live.rig.joints)
    worst = 0.0
    for index in range(len(session.snapshot.skins)):
        worst = max(worst, float(np.abs(session.posed_skin(index) - live.posed_skin(index)).max()))
    return worst / session.size


def _edit(session: Session) -> float:
    """How far the posed cage ends from where it is dragged: every other vertex by a hundredth of the size."""
    wanted = session.posed_cage().astype(np.float64)
    wanted[::2, 2] += 0.01 * session.size
    session.edit_posed_cage(wanted.astype(np.float32))
    return float(np.abs(session.posed_cage() - wanted).max()) / session.size


def _plain(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _line(path: Path, rig: dict[str, Any]) -> str:
    head = f"{path.name}: {rig['rig']}: "
    if rig["state"] != "LIVE":
        return f"{head}PAUSED at frame {rig['paused_at']}: {rig['message']}"
    residuals = ", ".join(f"{name.replace('_', ' ')} {value:.1e}" for name, value in rig["residuals"].items())
    verdict = "live" if rig["ok"] else f"BEYOND ITS LIMIT: {', '.join(rig['beyond'])}"
    vertices = sum(rig["skins"].values())
    return (
        f"{head}{verdict}; {vertices} vertices, {rig['cage_vertices']} of the cage, {rig['joints']} joints, "
        f"{rig['method']}; {residuals}; bind {rig['bind_seconds']:.2f} s, frame {rig['frame_ms']:.1f} ms"
    )
