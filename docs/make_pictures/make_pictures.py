"""Make pictures from the present add-on: a real Blender window, acts of a person, cut to what matters.

    python docs/make_pictures/make_pictures.py                  the manual's, all of them
    python docs/make_pictures/make_pictures.py panels keys      those of some acts, see `window_pictures.ACTS`
    python docs/make_pictures/make_pictures.py listing [ACT…]   screenshots for the extension site, see `listing_window`

BLENDER= names the windowed Blender, as for `make test-window`. The pictures land in docs/pictures or docs/listing.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(ROOT / "tests/window"))
import run

OUT = ROOT / "build/pictures"
PARTS = ("_before", "_without")  # of a picture that shows two


@dataclass(frozen=True)
class Book:
    """Pictures that are taken together: by which script, for which folder."""

    script: str
    folder: Path
    size: tuple[int, int]  # of the window
    largest: int  # bytes of a picture


MANUAL = Book("window_pictures.py", ROOT / "docs/pictures", (1400, 900), 200_000)
LISTING = Book("listing_window.py", ROOT / "docs/listing", (1920, 1080), 500_000)


def main() -> None:
    acts = sys.argv[1:]
    book = LISTING if acts[:1] == ["listing"] else MANUAL
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    failures = take(book, acts[1:] if book is LISTING else acts)
    book.folder.mkdir(exist_ok=True)
    made = sorted((OUT / "cut").glob("*.jpg"))
    for picture in made:
        size = picture.stat().st_size
        print(f"{picture.name}: {size / 1000:.0f} kB{' TOO LARGE' if size > book.largest else ''}")
        if not picture.stem.endswith(PARTS):
            shutil.copy(picture, book.folder)
    if failures or not made:
        sys.exit("\n".join(failures) or f"No picture was made; see {OUT / 'log.txt'}")


def take(book: Book, acts: list[str]) -> list[str]:
    """Run the book's script in a window; returns what went wrong."""
    width, height = book.size
    environment = dict(
        os.environ,
        BLENDER_USER_RESOURCES=tempfile.mkdtemp(prefix="cage_rig_pictures_"),
        CAGE_RIG_PICTURES=",".join(acts),
        WINDOW_BLENDER_SIZE=f"{width}x{height}",
        WINDOW_BLENDER_SECONDS="1200",
    )
    command = run.command(HERE / book.script, OUT)
    if "--factory-startup" in command:
        command[1:1] = ["--window-geometry", "0", "0", str(width), str(height)]
    with (OUT / "log.txt").open("w") as log:
        subprocess.run(command, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False)
    result = OUT / "result.json"
    if not result.exists():
        return []
    return [check["detail"] for check in json.loads(result.read_text()) if not check["ok"]]


if __name__ == "__main__":
    main()
