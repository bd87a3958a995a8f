"""Writes the sample characters, bound, acting and with cage keys: python tools/build_samples.py

Each .blend holds one collection, which the extension appends where a sample is asked for.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy

from blend_fixtures.build import RigObjects, build_biped, build_character
from blend_fixtures.octopus import octopus
from blend_fixtures.octopus_swim import add_swim
from blend_fixtures.walk import add_walk


@dataclass(frozen=True)
class Sample:
    """A character, its action, and the shapes of its cage at some frames (None: as it was bound)."""

    name: str
    build: Callable[[], RigObjects]
    act: Callable[[bpy.types.Object], bpy.types.Action]
    cage_keys: dict[int, str | None]


SAMPLES = (
    Sample("Biped", build_biped, add_walk, {1: None, 17: "Fat", 33: None, 49: None}),
    Sample(
        "Octopus", lambda: build_character(octopus()), add_swim, {1: None, 13: "Puffed", 25: None, 37: "Long", 49: None}
    ),
)


def make(sample: Sample, path: Path) -> None:
    """Build, bind, act, key, and save."""
    import bl_ext.user_default.cage_rig.keying as keying
    import bl_ext.user_default.cage_rig.lifecycle as lifecycle

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    context = bpy.context
    rig = sample.build()
    blocks = rig.cage.data.shape_keys.key_blocks
    shapes = {block.name: [point.co.copy() for point in block.data] for block in blocks[1:]}
    rig.cage.shape_key_clear()
    lifecycle.bind(context, rig.cage, rig.armature, rig.skins)
    sample.act(rig.armature)
    bound = [vertex.co.copy() for vertex in rig.cage.data.vertices]
    for frame, shape in sample.cage_keys.items():
        context.scene.frame_set(frame)
        if shape is None:
            keying.key_envelope(context, rig.cage)
            continue
        keying.key(context, rig.cage)
        block = rig.cage.active_shape_key
        for point, place in zip(block.data, shapes[shape], strict=True):
            point.co = place
        rig.cage.data.update_tag()
        context.view_layer.update()
    context.scene.frame_set(1)
    _collect(sample.name)
    if len(bound) != len(rig.cage.data.vertices) or rig.cage.cage_rig.state != "LIVE":
        sys.exit(f"make_samples: {sample.name} is not live: {rig.cage.cage_rig.message}")
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)


def _collect(name: str) -> None:
    """Everything of the scene in one collection of this name, marked as an asset."""
    scene = bpy.context.scene
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    for obj in list(scene.objects):
        for other in obj.users_collection:
            other.objects.unlink(obj)
        collection.objects.link(obj)
    collection.asset_mark()


def main() -> None:
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for sample in SAMPLES:
        path = folder / f"{sample.name.lower()}.blend"
        make(sample, path)
        print(f"{path}  {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
