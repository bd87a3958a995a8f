# SPDX-License-Identifier: GPL-3.0-or-later
"""How a cage is generated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Options:
    """Lengths are shares of the character's size, its bounding box's diagonal."""

    placement: str = "AUTOMATIC"  # of bending nodes where none are given; or "JOINTS"
    corners: int = 4  # of a section, 3 to 8
    triangles: bool = False  # instead of quads
    clearance: float = 3e-4  # the least gap between skin and cage
    tightness: float = 1.0  # how strongly the cage is pressed to the skin at last; 0: not
    detail: float = 0.0  # limbs thinner than this get no branch of the cage
    symmetry: bool = True  # a symmetric character gets a symmetric cage
    hull: bool = False  # cage the repaired hull of the skins; always done where they are several closed parts

    def core(self) -> dict[str, Any]:
        """As the core takes them: in the precision that a file keeps, so that a cage comes out alike again."""
        return {
            "placement": self.placement.lower(),
            "corners": self.corners,
            "triangles": self.triangles,
            "clearance": _single(self.clearance),
            "tightness": _single(self.tightness),
            "detail": _single(self.detail),
            "asymmetric": not self.symmetry,
        }


def _single(value: float) -> float:
    return float(np.float32(value))
