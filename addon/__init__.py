# SPDX-License-Identifier: GPL-3.0-or-later
"""Cage Rig: a deformation cage and an armature on one character, coupled live."""

from __future__ import annotations

from . import handlers, headless, operators, props, translations, ui

MODULES = (translations, props, operators, ui, handlers, headless)


def register() -> None:
    for module in MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(MODULES):
        module.unregister()
