# SPDX-License-Identifier: GPL-3.0-or-later
"""The PC2 point cache format: a header of 32 bytes, then every sample's points as little-endian float32.

Header: "POINTCACHE2" and a zero byte, int32 version 1, int32 points, float32 first frame, float32 frames a sample,
int32 samples.
"""

from __future__ import annotations

import struct
from typing import BinaryIO

import numpy as np

from ..adapters.positions import Points

SIGNATURE = b"POINTCACHE2\0"


def write_header(file: BinaryIO, *, points: int, start: float, rate: float, samples: int) -> None:
    """Begin a file of `samples` samples, `rate` frames apart, the first at frame `start`."""
    file.write(struct.pack("<12siiffi", SIGNATURE, 1, points, start, rate, samples))


def write_sample(file: BinaryIO, points: Points) -> None:
    """Append the next sample, `#M by 3`."""
    file.write(np.ascontiguousarray(points, "<f4").tobytes())
