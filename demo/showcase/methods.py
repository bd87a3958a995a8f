"""The arm of [CTL*20] Figure 2 under every skinning method: at rest, its elbow bent, then reshaped with the cage."""

from __future__ import annotations

from dataclasses import dataclass

from blend_fixtures.arm import LONG
from blend_fixtures.build import RigObjects, build_arm

from . import acting, coupling
from .elbow import Elbow, measure_elbow
from .figures import Figure, freeze

BEND = 90.0


@dataclass(frozen=True)
class MethodRow:
    """One method: its name in the panel; the arm at rest, bent, and bent and reshaped, each with its cage."""

    name: str
    figures: tuple[Figure, Figure, Figure]
    elbow: Elbow


def bound_arm() -> RigObjects:
    """The arm, bound."""
    rig = build_arm()
    coupling.bind(rig)
    return rig


def method_row(rig: RigObjects, identifier: str, name: str) -> MethodRow:
    """The arm under one method of `coupling.methods`; the rig is left at rest."""
    coupling.use_method(rig, identifier)
    rest = _frozen("Rest", rig)
    bend(rig, BEND)
    bent, elbow = _frozen(f"Elbow at {BEND:.0f}°", rig), measure_elbow(rig)
    acting.set_key(rig, LONG, 1.0)
    reshaped = _frozen("Reshaped with the cage", rig)
    acting.clear_keys(rig)
    bend(rig, 0.0)
    coupling.require_live(rig)
    return MethodRow(name, (rest, bent, reshaped), elbow)


def bend(rig: RigObjects, angle: float) -> None:
    """Let the upper arm hang down by `angle` degrees and lift the forearm as much."""
    acting.turn_up(rig, "upper_arm", -angle)
    acting.turn_up(rig, "forearm", angle)


def _frozen(title: str, rig: RigObjects) -> Figure:
    return freeze(title, rig.skins, cage=coupling.posed_cage(rig))
