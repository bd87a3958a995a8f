"""Acts as a person in a real Blender window: one act per timer call, so that Blender draws between them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

ROOT = Path(__file__).parent.parent.parent
OUT = Path(sys.argv[-1])
PAUSE = 0.12
_checks: list[dict[str, object]] = []


def install() -> None:
    """Install the built extension from its zip, as a person does."""
    archive = sorted((ROOT / "dist").glob("cage_rig-*.zip"))[0]
    bpy.ops.extensions.package_install_files(repo="user_default", filepath=str(archive), enable_on_install=True)


def check(what: str, ok: bool, detail: object = "") -> None:
    """Record one fact about what the person sees."""
    _checks.append({"what": what, "ok": bool(ok), "detail": str(detail)})


def perform(acts: Iterator[float | None]) -> None:
    """Run a generator of acts; each yields (seconds to wait, or None). Ends Blender after the last."""

    def step() -> float | None:
        try:
            return next(acts) or PAUSE
        except StopIteration:
            pass
        except Exception:
            check("the script ran to its end", False, traceback.format_exc())
            screenshot("failure")
        (OUT / "result.json").write_text(json.dumps(_checks))
        os._exit(0)

    bpy.app.timers.register(step, first_interval=3.0, persistent=True)


def screenshot(name: str) -> None:
    """A picture of the whole screen."""
    subprocess.run(["scrot", "-o", str(OUT / f"{name}.png")], check=False)


def window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def view() -> tuple[bpy.types.Area, bpy.types.Region]:
    area = max((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width)
    return area, next(region for region in area.regions if region.type == "WINDOW")


def key(kind: str, *, ctrl: bool = False, shift: bool = False, at: tuple[int, int] | None = None) -> None:
    """Press and release a key with the mouse at a place of the window."""
    x, y = at or centre()
    for value in ("PRESS", "RELEASE"):
        window().event_simulate(type=kind, value=value, x=x, y=y, ctrl=ctrl, shift=shift)


def move(at: tuple[int, int]) -> None:
    window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=at[0], y=at[1])


def click(at: tuple[int, int]) -> None:
    move(at)
    for value in ("PRESS", "RELEASE"):
        window().event_simulate(type="LEFTMOUSE", value=value, x=at[0], y=at[1])


LETTERS = {" ": "SPACE"}


def type_text(text: str) -> None:
    for letter in text:
        x, y = centre()
        kind = LETTERS.get(letter, letter.upper())
        window().event_simulate(type=kind, value="PRESS", x=x, y=y, unicode=letter)
        window().event_simulate(type=kind, value="RELEASE", x=x, y=y)


def centre() -> tuple[int, int]:
    _, region = view()
    return region.x + region.width // 2, region.y + region.height // 2


def on_screen(point: Vector) -> tuple[int, int]:
    """Window coordinates of a point of the world."""
    area, region = view()
    place = location_3d_to_region_2d(region, area.spaces.active.region_3d, point)
    return int(region.x + place.x), int(region.y + place.y)


def look_from_front(objects: list[bpy.types.Object]) -> None:
    """Front view, orthographic, of these objects; the sidebar open on our tab."""
    area, region = view()
    with bpy.context.temp_override(window=window(), area=area, region=region):
        for obj in bpy.context.view_layer.objects:
            obj.select_set(obj in objects)
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
    area.spaces.active.region_3d.view_perspective = "ORTHO"
    area.spaces.active.show_region_ui = True
    area.spaces.active.shading.type = "SOLID"


def show_tab() -> None:
    """Open the sidebar on the Cage Rig tab."""
    area, _ = view()
    for region in area.regions:
        if region.type == "UI":
            region.active_panel_category = "Cage Rig"
            region.tag_redraw()
