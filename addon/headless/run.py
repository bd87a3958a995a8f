# SPDX-License-Identifier: GPL-3.0-or-later
"""What every command does: open a file, find its rigs and frames, tell progress, answer."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import bpy

from .. import registry

FINE, ANSWER_NO, REFUSED = 0, 1, 2


class Refusal(Exception):
    """The command can't be carried out; the message is a sentence. Nothing was written."""


class Answer(dict[str, Any]):
    """What a command has found, as it goes into the JSON; `ok` decides the exit code."""

    @property
    def code(self) -> int:
        return FINE if self["ok"] else ANSWER_NO


class Voice:
    """Tells progress on the standard error, lines for people on the standard output, and the answer as JSON."""

    def __init__(self, json_file: Path | None, *, quiet: bool) -> None:
        self._json = json_file
        self._quiet = quiet
        self._told = 0.0

    def say(self, line: str) -> None:
        """A line of the answer."""
        if self._json != Path("-"):
            print(line)

    def progress(self, share: float, what: str) -> None:
        """How far the work is, at most twice a second."""
        now = time.monotonic()
        if not self._quiet and (now - self._told >= 0.5 or share >= 1.0):
            self._told = now
            print(f"cage_rig: {what} {share:.0%}", file=sys.stderr, flush=True)

    def finish(self, answer: Answer) -> int:
        """Write the JSON, where it was asked for; returns the exit code."""
        if self._json is not None:
            text = json.dumps(answer, indent=2, allow_nan=False)
            if self._json == Path("-"):
                print(text)
            else:
                _write(self._json, text + "\n")
        return answer.code


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Refusal(f"'{path}' can't be written: {error.strerror or error}") from error


def open_file(path: Path) -> None:
    """Open a .blend as Blender does."""
    if not path.is_file():
        raise Refusal(f"there is no file '{path}'")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        raise Refusal(f"'{path}' can't be opened: {str(error).strip()}") from error


def rigs(name: str | None) -> list[bpy.types.Object]:
    """The rest cages of the open file's rigs, or the one of this name."""
    found = [cage for cage in registry.rigs() if any(cage.name in scene.objects for scene in bpy.data.scenes)]
    if name is not None:
        found = [cage for cage in found if cage.name == name]
    if not found:
        which = f"no cage '{name}' of a rig" if name is not None else "no rig"
        raise Refusal(f"there is {which} in '{bpy.data.filepath}'")
    return found


def frames(text: str | None) -> tuple[int, int]:
    """`1-48`, `-10--1` or `7` as first and last frame; the scene's where it is not given."""
    if text is None:
        scene = bpy.context.scene
        return scene.frame_start, scene.frame_end
    cut = text.find("-", 1)
    first, last = (text, text) if cut < 0 else (text[:cut], text[cut + 1 :])
    try:
        start, end = int(first), int(last)
    except ValueError:
        raise Refusal(f"'{text}' is no range of frames; write it as 1-48") from None
    if end < start:
        raise Refusal(f"there is no frame from {start} to {end}; let the range end where it starts, or after")
    return start, end


def folder(path: Path) -> Path:
    """A folder to write into, made where it is not there."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refusal(f"'{path}' can't be made a folder: {error.strerror or error}") from error
    return path
