"""Make the manual's pictures from the present add-on: a real Blender window, acts of a person, cut to what matters.

    python docs/make_pictures/make_pictures.py            all of them
    python docs/make_pictures/make_pictures.py panels keys    those of some acts, see `window_pictures.ACTS`

BLENDER= names the windowed Blender, as for `make test-window`. The pictures land in docs/pictures.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(ROOT / "tests/window"))
import run

PICTURES = ROOT / "docs/pictures"
OUT = ROOT / "build/pictures"
WIDTH, HEIGHT = 1400, 900
LARGEST = 200_000  # bytes
PARTS = ("_before", "_without")  # of a picture that shows two


def main() -> None:
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    environment = dict(
        os.environ,
        BLENDER_USER_RESOURCES=tempfile.mkdtemp(prefix="cage_rig_pictures_"),
        CAGE_RIG_PICTURES=",".join(sys.argv[1:]),
        WINDOW_BLENDER_SIZE=f"{WIDTH}x{HEIGHT}",
        WINDOW_BLENDER_SECONDS="1200",
    )
    command = run.command(HERE / "window_pictures.py", OUT)
    if "--factory-startup" in command:
        command[1:1] = ["--window-geometry", "0", "0", str(WIDTH), str(HEIGHT)]
    with (OUT / "log.txt").open("w") as log:
        subprocess.run(command, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False)
    result = OUT / "result.json"
    failures = (
        [check["detail"] for check in json.loads(result.read_text()) if not check["ok"]] if result.exists() else []
    )
    PICTURES.mkdir(exist_ok=True)
    made = sorted((OUT / "cut").glob("*.jpg"))
    for picture in made:
        size = picture.stat().st_size
        print(f"{picture.name}: {size / 1000:.0f} kB{' TOO LARGE' if size > LARGEST else ''}")
        if not picture.stem.endswith(PARTS):
            shutil.copy(picture, PICTURES)
    if failures or not made:
        sys.exit("\n".join(failures) or f"No picture was made; see {OUT / 'log.txt'}")


if __name__ == "__main__":
    main()
