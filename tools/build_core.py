"""Build the core's wheel: abi3, one for Blender 4.2 to 5.2, with an old glibc through zig on Linux."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for old in args.out.glob("cage_rig_core-*.whl"):
        old.unlink()
    command = [sys.executable, "-m", "maturin", "build", "--release", "--quiet", "--out", str(args.out)]
    command += ["--manifest-path", str(ROOT / "rust_core/cage_rig_py/Cargo.toml")]
    if sys.platform == "linux":
        command += ["--zig", "--compatibility", "manylinux_2_28"]
    # maturin looks for zig (the ziglang package) through the python3 on PATH
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(command, check=True, env={**os.environ, "PATH": path})
    for wheel in args.out.glob("cage_rig_core-*.whl"):
        print(f"{wheel}  {wheel.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
