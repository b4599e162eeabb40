# SPDX-License-Identifier: GPL-3.0-or-later
"""The header of a tool is drawn over the view, where words without a button have no ground."""

from types import SimpleNamespace

import bpy


class Header:
    """A layout that keeps what is drawn: a label, or a property whose name Blender would write beside its field."""

    def __init__(self) -> None:
        self.bare, self.said = [], []

    def label(self, text: str = "", **options: object) -> None:
        self.bare.append(text)

    def prop(self, owner: object, name: str, text: str | None = None, toggle: int = -1, **options: object) -> None:
        of = owner.bl_rna.properties[name]
        said = of.name if text is None else text
        beside = of.type in ("ENUM", "STRING") or (of.type == "BOOLEAN" and toggle != 1)
        (self.bare if beside and said else self.said).append(said)

    def prop_menu_enum(self, owner: object, name: str, text: str = "", **options: object) -> None:
        self.said.append(text)


def test_every_word_of_a_tools_header_is_within_a_button(scene: bpy.types.Scene, part) -> None:
    scene.rockfall_picking.kind, scene.rockfall_picking.aim = "pass", "CONTACT"
    overlay = SimpleNamespace(show_overlays=False, bl_rna=bpy.types.View3DOverlay.bl_rna)
    context = SimpleNamespace(scene=scene, space_data=SimpleNamespace(overlay=overlay))
    said = {}
    for step in ("picking", "alignment", "spin"):
        for tool in part(f"rockfall_addon.steps.{step}.operators").TOOLS:
            header = Header()
            tool.draw_settings(context, header, None)
            assert header.bare == [], tool.bl_label
            said[step] = header.said
    assert "Click on: Ground" in said["picking"]
    assert [text for text in said["picking"] if text.startswith("Kind: ")] == ["Kind: Block here"]
    assert "Loupe" in said["spin"]
