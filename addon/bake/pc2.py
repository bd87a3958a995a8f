# SPDX-License-Identifier: GPL-3.0-or-later
"""The PC2 point cache format: a header of 32 bytes, then every sample's points as little-endian float32.

Header: "POINTCACHE2" and a zero byte, int32 version 1, int32 points, float32 first frame, float32 frames a sample,
int32 samples.
"""

from __future__ import annotations

import shutil
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..adapters.positions import Points

SIGNATURE = b"POINTCACHE2\0"
HEADER = struct.Struct("<12siiffi")


def write_header(file: BinaryIO, *, points: int, start: float, rate: float, samples: int) -> None:
    """Begin a file of `samples` samples, `rate` frames apart, the first at frame `start`."""
    file.write(HEADER.pack(SIGNATURE, 1, points, start, rate, samples))


def write_sample(file: BinaryIO, points: Points) -> None:
    """Append the next sample, `#M by 3`."""
    file.write(np.ascontiguousarray(points, "<f4").tobytes())


@dataclass(frozen=True)
class Header:
    """What a file holds."""

    points: int
    start: float
    rate: float
    samples: int

    @property
    def last(self) -> float:
        """The frame of the last sample."""
        return self.start + (self.samples - 1) * self.rate


class Pc2Error(Exception):
    """A file is no whole point cache, or does not fit to another; the message is a sentence."""


def read_header(path: Path) -> Header:
    """What the file holds; raises `Pc2Error` where it is no whole point cache."""
    with path.open("rb") as file:
        head = file.read(HEADER.size)
    if len(head) < HEADER.size or not head.startswith(SIGNATURE):
        raise Pc2Error(f"'{path}' is no point cache (PC2)")
    found = Header(*HEADER.unpack(head)[2:])
    wanted = HEADER.size + 12 * found.points * found.samples
    if path.stat().st_size != wanted:
        raise Pc2Error(f"'{path}' has {path.stat().st_size} bytes of {wanted}; bake it again")
    return found


@dataclass(frozen=True)
class Plan:
    """What a joined file is to hold, and of each part the samples to leave out because an earlier part has them."""

    header: Header
    parts: list[tuple[Path, int]]


def plan(parts: Sequence[Path]) -> Plan:
    """How files of consecutive frames, in any order, become what one bake over all would have written.

    Raises `Pc2Error` where frames are missing between them, or they are of different skins.
    """
    found = sorted(((read_header(part), part) for part in parts), key=lambda pair: pair[0].start)
    first, last = found[0][0], found[0][0].start - found[0][0].rate
    taken: list[tuple[Path, int]] = []
    for header, part in found:
        if (header.points, header.rate) != (first.points, first.rate):
            raise Pc2Error(f"'{part}' has other points or another rate than '{found[0][1]}'")
        known = round((last - header.start) / header.rate) + 1
        if known < 0:
            raise Pc2Error(
                f"the frames from {last + header.rate:g} to {header.start:g} are in no file, before '{part}'"
            )
        taken.append((part, min(known, header.samples)))
        last = max(last, header.last)
    samples = round((last - first.start) / first.rate) + 1
    return Plan(Header(first.points, first.start, first.rate, samples), taken)


def join(out: Path, plan: Plan) -> Header:
    """Write the joined file, as a whole or not at all; returns what it holds."""
    made = plan.header
    draft = out.with_name(f"{out.stem}.partial.pc2")
    try:
        with draft.open("wb") as file:
            write_header(file, points=made.points, start=made.start, rate=made.rate, samples=made.samples)
            for part, known in plan.parts:
                with part.open("rb") as source:
                    source.seek(HEADER.size + 12 * made.points * known)
                    shutil.copyfileobj(source, file)
        draft.replace(out)
    finally:
        draft.unlink(missing_ok=True)
    return made
