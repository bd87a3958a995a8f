"""Run a script in the bpy module with the extension installed: with_extension.py SCRIPT [ARGUMENT ...]"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import extension


def main() -> None:
    script = Path(sys.argv[1]).resolve()
    sys.argv = sys.argv[1:]
    sys.path[:0] = [str(script.parent), str(script.parent.parent), str(extension.ROOT)]
    extension.isolate()
    extension.install()
    runpy.run_path(str(script), run_name="__main__")


if __name__ == "__main__":
    main()
