"""The zip's whole life in a process of its own: nothing of it stays behind, and the process ends cleanly."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def test_installed_used_disabled_removed_and_installed_again(tmp_path: Path) -> None:
    root = HERE.parent.parent
    done = subprocess.run(
        [sys.executable, str(HERE / "installed_script.py"), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (root, root / "tools", HERE)))},
        capture_output=True,
        text=True,
        check=False,
    )
    said = done.stdout + done.stderr
    assert "WRONG" not in said and "Traceback" not in said and "Not freed memory" not in said, said
    assert "\nDONE" in said and done.returncode == 0, said
