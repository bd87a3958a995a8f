"""Work that goes on beside the window: called from the search menu, left, or waited for."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import bpy
import driver
from scene import file_state

MODULE = "bl_ext.user_default.cage_rig"


def under_way() -> bool:
    return bool(sys.modules[f"{MODULE}.operators.waiting"]._open)


def call(words: str) -> Iterator[float | None]:
    """Call an operator by what it is called, and wait until its work is under way."""
    driver.key("F3")
    yield 0.7
    driver.type_text(words)
    yield 1.0
    driver.key("RET")
    for _ in range(100):
        yield 0.1
        if under_way():
            return


def call_and_leave(words: str, way_out: str) -> Iterator[float | None]:
    """Call it, look around meanwhile, and end it early: nothing has changed then."""
    before = file_state()
    yield from call(words)
    driver.check(f"'{words}' goes on beside the window", under_way())
    yield 0.4
    driver.screenshot(f"1_on_its_way_{way_out.lower()}")
    region = driver.view()[0].spaces.active.region_3d
    distance = region.view_distance
    driver.key("WHEELUPMOUSE")
    driver.key("X")
    yield 0.2
    driver.check("the view can be moved meanwhile", region.view_distance < distance)
    driver.check("it is still under way, and nothing is written yet", under_way() and file_state() == before)
    driver.key(way_out)
    yield 1.0
    driver.check(f"{way_out} ends it", not under_way())
    driver.check("and nothing has changed", file_state() == before)
    driver.check("the status bar is Blender's again", status_bar_is_blenders())
    driver.screenshot(f"2_left_{way_out.lower()}")


def status_bar_is_blenders() -> bool:
    header = bpy.types.STATUSBAR_HT_header
    return bool(header.draw == header._draw_orig)


def to_the_end(name: str, steps: tuple[int, ...]) -> Iterator[float | None]:
    """Wait for it, with pictures after so many tenths of a second."""
    for step in range(600):
        yield 0.1
        if step in steps:
            driver.screenshot(f"{name}_{step}")
        if not under_way():
            break
    yield 1.0
