"""The panel in another language, in a real window: Blender looks its words up in our table, or has its own."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent.parent)]
import driver

from blend_fixtures.build import build_bar


def acts() -> Iterator[float | None]:
    driver.install()
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    import bl_ext.user_default.cage_rig.lifecycle as lifecycle
    import bl_ext.user_default.cage_rig.translations as translations

    rig = build_bar()
    lifecycle.bind(bpy.context, rig.cage, rig.armature, rig.skins)
    bpy.context.view_layer.objects.active = rig.cage
    view = bpy.context.preferences.view
    for language in translations.LANGUAGES:
        view.language = language
        view.use_translate_interface = True
        driver.look_from_front(rig.skins)
        yield 1.5
        driver.show_tab()
        yield 1.0
        driver.screenshot(language)
        wrong = [
            english
            for (context, english), words in translations.table()[language].items()
            if words != english and bpy.app.translations.pgettext_iface(english, context) == english
        ]
        driver.check(f"all words are in {language}", not wrong, wrong)
    translations.unregister()
    driver.check("they go with the add-on", bpy.app.translations.pgettext_iface("Refit Joints") == "Refit Joints")
    translations.register()


driver.perform(acts())
