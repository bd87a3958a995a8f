"""Render the pictures of the extension's listing: python tools/with_extension.py docs/make_pictures/listing_renders.py

Icon and pictures land in docs/listing; the pictures that the manual has already are fitted to the listing's shape.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "demo")]

from showcase import acting, coupling
from showcase.figures import Figure, freeze
from showcase.placing import Slot, extent, fitting_scale, place
from showcase.sheet import GREY, compose
from showcase.studio import Quality, Studio

from blend_fixtures.build import build_biped

OUT = ROOT / "docs/listing"
WIDTH, HEIGHT = 16.0, 9.0  # units; 1920 by 1080 pixels
PICTURE = Quality(scale=1.2, samples=6)
ICON = Quality(scale=4.0, samples=8)  # of 2.56 units: 1024 pixels, brought down to 256
TURN = -32.0


def main() -> None:
    OUT.mkdir(exist_ok=True)
    wanted = sys.argv[1:] or list(PICTURES)
    for name in wanted:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        PICTURES[name]()
        print(OUT / name, flush=True)


def icon() -> None:
    """The character's head in its cage, on a round of light."""
    figure = biped_states()[0]
    studio = Studio("Icon", width=2.56, height=2.56)
    turn = Matrix.Rotation(np.radians(-24.0), 4, "Z")
    low, high = extent(figure, turn)
    height = float((high - low)[2])
    scale = 2.45 / (0.40 * height)
    floor = -1.24 - 0.60 * scale * height
    place(studio, figure, turn, slot=Slot(0.0, floor), scale=scale, line=2.6)
    studio.add_floor(height=studio.on_plane(0.0, floor).z)
    pixels = rendered(studio, ICON)
    side = 256
    fine = pixels.reshape(side, 4, side, 4, 3).mean(axis=(1, 3))
    y, x = (np.mgrid[:side, :side] + 0.5) / side - 0.5
    backdrop = np.array([0.80, 0.90, 1.0]) - 0.30 * np.clip(np.hypot(x, y), 0.0, 0.7)[..., None]
    save(OUT / "icon.png", fine * backdrop)


def featured() -> None:
    """Rest, posed, fattened: the product in one look."""
    figures = biped_states()
    studio = titled("Cage Rig", "A cage and an armature on one character.  Edit either: the other follows, live.")
    row(studio, figures, TURN)
    save(OUT / "featured.jpg", compose([rendered(studio, PICTURE)], []))


def fitted(name: str, rows: tuple[float, float] = (0.0, 1.0)) -> None:
    """A picture of the manual, or a part of its height, on a backdrop of the listing's shape."""
    image = bpy.data.images.load(str(ROOT / f"docs/{name}.jpg"))
    whole = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(whole)
    whole = whole.reshape(image.size[1], image.size[0], 4)[::-1]
    part = whole[round(rows[0] * len(whole)) : round(rows[1] * len(whole))]
    scale = min(1920 / part.shape[1], 1080 / len(part))
    cut = bpy.data.images.new("Cut", part.shape[1], len(part))
    cut.pixels.foreach_set(np.ascontiguousarray(part[::-1]).ravel())
    cut.scale(round(part.shape[1] * scale), round(len(part) * scale))
    width, height = cut.size
    small = np.empty(4 * width * height, np.float32)
    cut.pixels.foreach_get(small)
    canvas = np.tile(np.float32([0.93, 0.94, 0.955]), (1080, 1920, 1))
    top, left = (1080 - height) // 2, (1920 - width) // 2
    canvas[top : top + height, left : left + width] = small.reshape(height, width, 4)[::-1, :, :3]
    save(OUT / f"{name}.jpg", canvas)


def biped_states() -> list[Figure]:
    """At rest, in a step of its walk, and fattened in it."""
    acting.set_frames()
    rig = build_biped()
    coupling.bind(rig)
    bpy.context.scene.frame_set(8)
    acting.clear_keys(rig)
    acting.show_rest(rig, True)
    figures = [freeze("At rest", rig.skins, cage=rig.cage)]
    acting.show_rest(rig, False)
    figures.append(freeze("Posed by its bones", rig.skins, cage=coupling.posed_cage(rig)))
    acting.set_key(rig, acting.FAT, 1.0)
    figures.append(freeze("…and fattened with the cage", rig.skins, cage=coupling.posed_cage(rig)))
    return figures


def titled(title: str, subtitle: str) -> Studio:
    """An empty studio of the listing's shape under a title."""
    studio = Studio(title, width=WIDTH, height=HEIGHT)
    studio.add_label(title, x=-7.4, y=3.72, size=0.72, align="LEFT")
    studio.add_label(subtitle, x=-7.4, y=2.98, size=0.30, color=GREY, align="LEFT")
    return studio


def row(studio: Studio, figures: list[Figure], degrees: float) -> None:
    """Figures side by side on one floor, each over its title."""
    turn = Matrix.Rotation(np.radians(degrees), 4, "Z")
    width = WIDTH / len(figures)
    scale = min(fitting_scale(figure, turn, width=width - 0.5, height=5.6) for figure in figures)
    floor = -3.55
    for index, figure in enumerate(figures):
        x = (index + 0.5 - 0.5 * len(figures)) * width
        place(studio, figure, turn, slot=Slot(x, floor), scale=scale)
        studio.add_label(figure.title, x=x, y=-4.08, size=0.34)
    studio.add_floor(height=studio.on_plane(0.0, floor).z)


def rendered(studio: Studio, quality: Quality) -> np.ndarray:
    pixels = studio.render(OUT / "scratch.png", quality)
    bpy.data.scenes.remove(studio.scene)
    return pixels


def save(path: Path, pixels: np.ndarray) -> None:
    """Write display values, top row first, as PNG or JPEG."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(path.stem, width, height)
    opaque = np.concatenate([np.clip(pixels, 0.0, 1.0), np.ones((height, width, 1))], axis=2)
    image.pixels.foreach_set(np.ascontiguousarray(opaque[::-1], np.float32).ravel())
    image.file_format, image.filepath_raw = "PNG" if path.suffix == ".png" else "JPEG", str(path)
    image.save(quality=90)
    bpy.data.images.remove(image)


PICTURES: dict[str, Callable[[], None]] = {
    "icon": icon,
    "featured": featured,
    "demo": lambda: fitted("demo"),
    "methods": lambda: fitted("methods"),
    "keys": lambda: fitted("keys", (0.065, 0.53)),
}

if __name__ == "__main__":
    main()
