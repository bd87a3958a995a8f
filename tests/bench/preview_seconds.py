"""Seconds from the press of Generate Cage to its sections, in Blender: preview_seconds.py FILE.glb, one line of JSON.

    python tools/with_extension.py tests/bench/preview_seconds.py FILE.glb

All that the operator does before the first picture: skins, weights and bones are read, the core looks at them, places
nodes and traces sections. Then one node is moved, as by the mouse.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
from bl_ext.user_default.cage_rig import caging, reading

from blend_fixtures import uncaged

spent: dict[str, float] = {}


@contextmanager
def timed(name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    spent[name] = time.perf_counter() - start


def main() -> None:
    skins, armature = uncaged.imported(Path(sys.argv[1]))()
    options = caging.Options()
    with timed("read"):
        reading.read(bpy.context, armature, skins)
    with timed("opened"):
        found = caging.open_character(bpy.context, armature, skins, options)
    with timed("sections"):
        editing = caging.edit(found, options, None)
    spent["preview"] = spent["opened"] + spent["sections"]
    editing.grab(len(editing.places) // 2)
    place = editing.places[len(editing.places) // 2]
    with timed("first_move"):  # nodes that were placed become the artist's own
        editing.drag(place._replace(along=1.01 * place.along))
    with timed("moved"):
        editing.drag(place._replace(along=1.02 * place.along))
    with timed("again"):
        caging.edit(caging.open_character(bpy.context, armature, skins, options), options, None)
    print(json.dumps(spent))


main()
