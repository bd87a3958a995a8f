"""Make the sample characters in the oldest Blender that the extension serves, so that every one opens them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import test_matrix

ROOT = Path(__file__).parent.parent


def main() -> None:
    oldest = test_matrix.TARGETS[0]
    python = test_matrix.environment(oldest)
    if python is None:
        sys.exit(f"build_samples: no Python {oldest.python} with bpy {oldest.bpy}, which the samples are made in")
    command = [str(python), "tools/with_extension.py", "blend_fixtures/make_samples.py", "build/samples"]
    subprocess.run(command, cwd=ROOT, check=True, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})


if __name__ == "__main__":
    main()
