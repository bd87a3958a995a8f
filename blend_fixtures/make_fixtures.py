"""Writes every fixture as a .blend, from code, unbound: python blend_fixtures/make_fixtures.py --out DIR (a Python
with bpy).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import bpy

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from blend_fixtures import build, corrections, octopus, rigs, small

FIXTURES: dict[str, Callable[[], build.RigObjects]] = {
    "biped": build.build_biped,
    "bar": build.build_bar,
    "arm": build.build_arm,
    "octopus": lambda: build.build_character(octopus.octopus()),
    "simple_bar": lambda: build.build_character(small.simple_bar()),
    "two_skins": lambda: build.build_character(small.two_skins()),
    "two_roots": lambda: build.build_character(small.two_roots()),
    **corrections.CORRECTIONS,
    **{name: partial(rigs.build_rig, name) for name in rigs.RIGS},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the .blend files")
    folder = parser.parse_args().out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in FIXTURES.items():
        start = time.perf_counter()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        rig = make()
        path = folder / f"{name}.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
        vertices = sum(len(skin.data.vertices) for skin in rig.skins)
        print(
            f"{path.name}: {len(rig.skins)} skins, {vertices} vertices, {len(rig.armature.data.bones)} bones, "
            f"cage of {len(rig.cage.data.vertices)}, {time.perf_counter() - start:.1f} s"
        )


if __name__ == "__main__":
    main()
