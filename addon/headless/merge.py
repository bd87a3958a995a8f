# SPDX-License-Identifier: GPL-3.0-or-later
"""Join point caches of consecutive frame ranges: for every name the same bytes as of one bake over all frames."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..bake import pc2
from .run import Answer, Refusal, Voice, folder

NAME = "merge"
HELP = "point caches of consecutive ranges into one"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "parts",
        type=Path,
        nargs="+",
        metavar="PART",
        help=".pc2 files in any order, or folders that have them in or below",
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="the folder for the joined files, which keep their names"
    )


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    parts: dict[str, list[Path]] = {}
    for part in given.parts:
        for path in sorted(part.rglob("*.pc2")) if part.is_dir() else [part]:
            if not path.name.endswith(".partial.pc2"):  # what a bake has left that was killed
                parts.setdefault(path.name, []).append(path)
    if not parts:
        raise Refusal(f"there is no point cache (.pc2) in {', '.join(map(str, given.parts))}")
    merged = []
    try:
        plans = {name: pc2.plan(paths) for name, paths in parts.items()}
        out = folder(given.out)
        for name, plan in plans.items():
            header = pc2.join(out / name, plan)
            merged.append({"file": str(out / name), "parts": len(parts[name]), **vars(header)})
            voice.say(f"{out / name}: frames {header.start:g} to {header.last:g} of {len(parts[name])} part(s)")
    except (pc2.Pc2Error, OSError) as error:
        raise Refusal(str(error)) from error
    return Answer(ok=True, merged=merged)
