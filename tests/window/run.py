"""Run the window tests: real windows, simulated mouse and keys, a screenshot after every act.

BLENDER= names the Blender to run (a windowed build with a display), or a wrapper command that ends in "run" and
takes the script and its arguments. Screenshots and a result file land in build/window/.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
OUT = ROOT / "build/window"


def command(script: Path, out: Path) -> list[str]:
    wrapper = ROOT.parent / "shared/tools/window-blender"
    blender = os.environ.get("BLENDER") or (f"{wrapper} run" if wrapper.exists() else shutil.which("blender"))
    if not blender:
        sys.exit("No windowed Blender: install one, or name it as BLENDER=/path/to/blender")
    words = shlex.split(blender)
    if words[-1] == "run":
        return [*words, str(script), str(out)]
    return [*words, "--factory-startup", "--enable-event-simulate", "--python", str(script), "--", str(out)]


def run(script: Path) -> bool:
    """Run one script; it must leave `result.json` with no failures."""
    out = OUT / script.stem
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    environment = dict(os.environ, BLENDER_USER_RESOURCES=tempfile.mkdtemp(prefix="cage_rig_window_"))
    with (out / "log.txt").open("w") as log:
        subprocess.run(command(script, out), cwd=ROOT, env=environment, stdout=log, stderr=log, check=False)
    result = out / "result.json"
    if not result.exists():
        print(f"{script.stem}: no result; see {out / 'log.txt'}")
        return False
    checks = json.loads(result.read_text())
    for check in checks:
        print(f"{script.stem}: {'ok  ' if check['ok'] else 'FAIL'} {check['what']}  {check['detail']}")
    return bool(checks) and all(check["ok"] for check in checks)


def main() -> None:
    wanted = sys.argv[1:]
    scripts = [path for path in sorted(HERE.glob("window_*.py")) if not wanted or path.stem in wanted]
    passed = [run(script) for script in scripts]
    print(f"{sum(passed)} passed, {len(passed) - sum(passed)} failed")
    sys.exit(0 if scripts and all(passed) else 1)


if __name__ == "__main__":
    main()
