# SPDX-License-Identifier: GPL-3.0-or-later
"""To shape keys, one a frame, keyed so that each frame shows its own: plays everywhere, FBX and glTF included.

Relative keys, because those formats know no others (as with Blender's NewTek MDD import). Between two frames the mesh
goes in a straight line.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..adapters import shape_keys
from .drafts import Draft, draft
from .keys import Keys
from .live import Skin, Steps, playing, posed_skins, refuse_unready, skins_of, times


@dataclass(frozen=True)
class KeyedShapes:
    """What was baked: copies of the skins, and how many shape keys each has."""

    collection: bpy.types.Collection
    skins: list[bpy.types.Object]
    count: int

    @property
    def summary(self) -> str:
        """One sentence for the artist."""
        return f"Baked {self.count} shape keys a skin: '{self.collection.name}'"


def steps(cage: bpy.types.Object, frame_start: int, frame_end: int, *, step: int) -> Steps[KeyedShapes]:
    """See `to_shape_keys`."""
    refuse_unready(cage)
    at = times(frame_start, frame_end, step=step)
    with draft() as made:
        copies = [_copy(made, skin) for skin in skins_of(cage)]
        with playing(cage, at[0]) as go:
            for index, time in enumerate(at):
                for obj, points in zip(copies, posed_skins(cage, go(time)), strict=True):
                    block = obj.shape_key_add(name=f"Frame {time:g}", from_mix=False)
                    block.value = 0.0
                    shape_keys.write_key(block, points)
                yield (index + 1) / len(at)
        for obj in copies:
            _key(made, obj, at)
        return KeyedShapes(made.finish(f"{cage.name} Shape Keys"), copies, len(at))


def _copy(made: Draft, skin: Skin) -> bpy.types.Object:
    obj, _ = made.copy_skin(skin, f"{skin.obj.name} Shape Keys")
    obj.shape_key_clear()  # the baked points have them
    obj.shape_key_add(name="Basis", from_mix=False)
    return obj


def _key(made: Draft, obj: bpy.types.Object, at: list[float]) -> None:
    """Value 1 at a key's own frame, 0 at its neighbours'."""
    blocks = obj.data.shape_keys
    keys = Keys(blocks, obj.name, made)
    for index, block in enumerate(blocks.key_blocks[1:]):
        first, last = max(index - 1, 0), min(index + 2, len(at))
        path = f'key_blocks["{bpy.utils.escape_identifier(block.name)}"].value'
        keys.add(path, 0, at[first:last], [float(k == index) for k in range(first, last)])
