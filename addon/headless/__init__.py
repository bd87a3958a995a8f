# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: checks, bakes, regressions and cages of files, without a window.

    blender --command cage_rig check walk.blend
    blender --command cage_rig bake walk.blend --to usd --frames 1-48 --out baked
    blender --command cage_rig compare walk.blend walk.golden.npz
    blender --command cage_rig generate-cage hero.blend --out hero_caged.blend
    blender --command cage_rig fit-cage hero.blend --cage Rough --out hero_caged.blend

Where Blender is the bpy module: `python -m cage_rig …`, from the folder that the extension was installed into.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy

from . import baking, check, compare, fit, generate, merge
from .run import ANSWER_NO, FINE, REFUSED, Refusal, Voice

NAME = "cage_rig"
EPILOG = f"""exit codes:
  {FINE}  done; what was checked or compared is in order
  {ANSWER_NO}  done, and the answer is no: a rig is paused or beyond a limit, a frame differs
  {REFUSED}  not done: arguments, files or rigs do not allow it; the reason is on the standard error
"""


def parser() -> argparse.ArgumentParser:
    """All arguments."""
    top = argparse.ArgumentParser(
        prog=f"blender --command {NAME}",
        description="Check, bake and compare rigs of Cage Rig, and generate or fit cages, without a window.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = top.add_subparsers(metavar="COMMAND", required=True)
    for module in (check, baking, compare, merge, generate, fit):
        one = commands.add_parser(
            module.NAME,
            help=module.HELP,
            description=module.__doc__,
            epilog=EPILOG,
            formatter_class=top.formatter_class,
        )
        module.add_arguments(one)
        one.add_argument("--json", metavar="FILE", help="also write the answer to FILE as JSON; '-': standard output")
        one.add_argument("--quiet", action="store_true", help="tell no progress")
        one.set_defaults(run=module.run)
    return top


def main(arguments: Sequence[str]) -> int:
    """Carry out one command line; returns the exit code."""
    try:
        given = parser().parse_args(arguments)
    except SystemExit as end:  # argparse has said why; 0 after --help
        return end.code if isinstance(end.code, int) else REFUSED
    voice = Voice(None if given.json is None else Path(given.json), quiet=given.quiet)
    try:
        return voice.finish(given.run(given, voice))
    except Refusal as refusal:
        print(f"cage_rig: {refusal}", file=sys.stderr)
        return REFUSED


_commands: list[object] = []


def register() -> None:
    _commands.append(bpy.utils.register_cli_command(NAME, main))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
