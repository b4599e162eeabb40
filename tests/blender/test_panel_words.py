# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels say of a selected impact, and that ⚠ never stands without its reason."""

import itertools
from pathlib import Path
from types import SimpleNamespace

import blf
import bpy
import pytest
from two_runs import picks_of

FOOTAGE = Path(__file__).resolve().parents[2] / "assets" / "demo" / "footage" / "footage.mp4"


class Layout:
    """Stands in for a Blender layout, which exists only while a window is drawn: keeps what is written, by icon."""

    def __init__(self, written: list[tuple[str, str]]) -> None:
        self.written = written

    def label(self, *, text: str = "", icon: str = "NONE", **_: object) -> None:
        self.written.append((icon, text))

    def prop(self, owner: bpy.types.bpy_struct, name: str, *, text: str | None = None, **_: object) -> None:
        self.written.append(("", owner.bl_rna.properties[name].name if text is None else text))

    def operator(self, *_: object, **__: object) -> SimpleNamespace:
        return SimpleNamespace()

    def __getattr__(self, name: str) -> object:
        return lambda *_, **__: self


def preferences(scale: float) -> SimpleNamespace:
    return SimpleNamespace(system=SimpleNamespace(ui_scale=scale), ui_styles=bpy.context.preferences.ui_styles)


def in_sidebar() -> SimpleNamespace:
    """A context as a panel gets it; without a window Blender has no region and no interface scale."""
    return SimpleNamespace(
        scene=bpy.context.scene, object=bpy.context.object, view_layer=bpy.context.view_layer,
        region=SimpleNamespace(width=2000), preferences=preferences(1.0),
    )  # fmt: skip


@pytest.fixture
def draw(part):
    def draw(name: str) -> list[tuple[str, str]]:
        """What a panel writes, as (icon, text)."""
        panel, written = getattr(bpy.types, name), []
        plain = type(name, (), {key: value for key, value in vars(panel).items() if not key.startswith("bl_")})()
        plain.layout = Layout(written)
        panel.draw(plain, in_sidebar())
        return written

    return draw


def select(pick: bpy.types.Object) -> None:
    bpy.context.view_layer.objects.active = pick


def test_the_selected_impact_is_before_the_steps_and_there_while_one_is_selected(scene, part) -> None:
    panel, shared = bpy.types.ROCKFALL_PT_impact, part("rockfall_addon.view.panel").RockfallPanel
    order = {one.__name__: one.bl_order for one in part("rockfall_addon.steps").classes() if issubclass(one, shared)}
    assert sorted(order, key=order.get)[:2] == ["ROCKFALL_PT_start", "ROCKFALL_PT_impact"]
    assert 0 <= order["ROCKFALL_PT_start"] < panel.bl_order < shared.bl_order, "Blender takes no negative ones"
    select(None)
    assert not panel.poll(bpy.context)
    select(picks_of(scene, "A")[1])
    assert panel.poll(bpy.context)
    select(scene.objects["A block"])
    assert not panel.poll(bpy.context)


def test_the_selected_impact_and_the_table_say_why(scene, draw) -> None:
    select(scene.objects["B impact 3"])
    written = draw("ROCKFALL_PT_impact")
    assert ("NONE", "B, impact 3") in written
    assert ("ERROR", "Marked as doubtful") in written
    assert any(text.endswith(" kJ") for _, text in written)
    bpy.types.ROCKFALL_PT_impact_table.draw_table(Layout(written := []), in_sidebar(), 300.0)
    assert ("ERROR", "B impact 3: Marked as doubtful") in written


def test_a_standard_deviation_has_a_digit_that_is_not_zero_where_two_more_suffice(part) -> None:
    measured = part("rockfall_addon.view.impact_words").measured
    nan = float("nan")
    found = [measured(*each) for each in ((19.6249, 0.0217, 1), (4.96, 0.32, 1), (2.13, 1e-9, 2), (0.5, nan, 2))]
    assert found == ["19.62 ± 0.02", "5.0 ± 0.3", "2.1300 ± 0.0000", "0.50"]
    assert measured(nan, 0.1, 2) == ""


def test_coefficients_have_intervals_in_words(part, scene, draw, numbers) -> None:
    pick = scene.objects["B impact 2"]
    new = {"rn": 0.87, "interval_rn": (0.803, 0.964), "rt": 0.7, "interval_rt": (0.05, 3.0)}
    part("rockfall_addon.scene.picks.impact_numbers").keep(pick, numbers(pick) | new)
    assert "R_N 0.87 (0.80 to 0.96)   R_T undetermined" in part("rockfall_addon.view.impact_words").numbers(pick)
    select(pick)
    written = [text for _, text in draw("ROCKFALL_PT_impact")]
    assert {"0.87 (0.80 to 0.96)", "undetermined"} <= set(written)


def test_a_pick_that_is_no_impact_is_named_by_its_kind(scene, draw) -> None:
    select(scene.objects["A release 1"])
    assert ("NONE", "A, release") in draw("ROCKFALL_PT_impact")


def test_a_step_that_needs_attention_says_why(scene, draw) -> None:
    panel = bpy.types.ROCKFALL_PT_picks
    marks = {"ATTENTION": True, "READY": False}
    assert any(icon == "ERROR" for icon, _ in draw("ROCKFALL_PT_picks")) == marks[panel.step_state(bpy.context)]
    scene["rockfall_problem"] = '[{"text": "A note.", "severity": "note", "about": "A"}]'
    assert panel.step_state(bpy.context) == "READY", "a note needs no attention"
    time = repr(scene.objects["A impact 2"]["rockfall_time_s"])
    scene.objects["A impact 1"].rockfall_pick.time_s = time
    assert panel.step_state(bpy.context) == "ATTENTION"
    assert any(icon == "ERROR" and "trajectory A" in text for icon, text in draw("ROCKFALL_PT_picks"))


def test_the_block_panel_says_what_fell(scene, draw) -> None:
    select(scene.objects["B impact 1"])
    assert ("", "B has a block of its own") in draw("ROCKFALL_PT_block")
    assert ("NONE", "59.5 kg") in draw("ROCKFALL_PT_block")
    scene.rockfall_block.d1 = 1.5
    assert {("NONE", "255 kg"), ("NONE", "0.733 m")} <= set(draw("ROCKFALL_PT_block"))


@pytest.mark.parametrize(
    "name", ["ROCKFALL_PT_share", "ROCKFALL_PT_picks", "ROCKFALL_PT_terrain", "ROCKFALL_PT_videos"]
)
def test_nothing_is_ticked_before_it_is_done(name, draw) -> None:
    assert not [text for icon, text in draw(name) if icon == "CHECKMARK"]


def test_the_first_advice_is_the_terrain(draw) -> None:
    assert any("Import the terrain first" in text for _, text in draw("ROCKFALL_PT_picks"))


def test_with_a_video_alone_no_demo_is_offered(part) -> None:
    part("rockfall_addon.scene.footage.new_videos").add_video(bpy.context.scene, FOOTAGE)
    step = part("rockfall_addon.scene.next_step").next_step(bpy.context.scene)
    assert step.actions == ("rockfall.import_terrain", "rockfall.open_project")


def test_a_second_video_is_to_be_aligned_before_picking(part) -> None:
    scene, following = bpy.context.scene, part("rockfall_addon.scene.next_step")
    bpy.ops.rockfall.load_footage_demo()
    assert "rockfall.propose_impacts" in following.next_step(scene).actions
    first = part("rockfall_addon.scene.footage.videos").active_camera(scene)
    second = part("rockfall_addon.scene.footage.new_videos").add_video(scene, FOOTAGE)
    bpy.ops.rockfall.look_through(identifier=first["rockfall_id"])
    step = following.next_step(scene)
    assert (step.actions[0], step.video) == ("rockfall.look_through", second["rockfall_id"])
    assert second.name in step.sentence


def test_a_track_after_the_last_pick_is_said_until_it_stopped_there(part) -> None:
    scene, following = bpy.context.scene, part("rockfall_addon.scene.next_step")
    bpy.ops.rockfall.load_footage_demo()
    bpy.ops.rockfall.propose_impacts()
    store = part("rockfall_addon.scene.storage.store")
    picks = sorted(store.with_role(scene, store.PICK_ROLE), key=lambda pick: pick[store.TIME])
    assert "is tracked until" in following.next_step(scene).sentence, "it moves on by 1.5 m after its last impact"
    picks[-1][store.KIND] = "stop"
    assert following.next_step(scene).sentence.startswith("Look at each pick")


def test_a_camera_from_a_file_is_not_asked_for_pairs_and_not_called_a_tripod(part, draw) -> None:
    assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    written = " ".join(text for _, text in draw("ROCKFALL_PT_alignment"))
    assert "comes from a file" in written
    assert "Click a place" not in written
    moving = " ".join(text for _, text in draw("ROCKFALL_PT_alignment_motion"))
    assert "a pose for each frame" in moving
    assert "One pose" not in moving


@pytest.mark.parametrize("scale", [1.0, 2.0])
@pytest.mark.parametrize("words", ["ill till it fills", "WWWWW MMMMMM WWWW"], ids=["narrow", "wide"])
def test_text_fills_the_width_of_a_panel_and_is_nowhere_cut_off(part, words, scale) -> None:
    panel, written, width = part("rockfall_addon.view.panel"), [], 300 * scale
    context = SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences(scale))
    panel.paragraph(context, Layout(written), " ".join([words] * 12), "INFO")
    lines = [text for _, text in written]
    assert " ".join(lines) == " ".join([words] * 12)
    blf.size(0, bpy.context.preferences.ui_styles[0].widget.points * scale)
    for line, later in itertools.pairwise(lines):
        assert blf.dimensions(0, line)[0] < width - 82 * scale, "what stays free beside an icon, in a real window"
        assert blf.dimensions(0, f"{line} {later.split()[0]}")[0] > width - 100 * scale, "the next word had room"


def test_two_videos_that_are_aligned_are_to_be_synchronised_now(part) -> None:
    assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    scene, wording = bpy.context.scene, part("rockfall_addon.steps.videos.wording")
    first = part("rockfall_addon.scene.footage.videos").cameras(scene)[0]
    assert bpy.ops.rockfall.add_video(filepath=str(FOOTAGE)) == {"FINISHED"}
    second = part("rockfall_addon.scene.footage.videos").active_camera(scene)
    assert "Once both are aligned, do so." in wording.warnings(scene, second)[0].text
    paths = part("rockfall_addon.scene.footage.camera_paths")
    paths.set_camera_path(scene, second, paths.camera_path(first))
    assert "Mark one event in both, and synchronise them." in wording.warnings(scene, second)[0].text


def test_the_card_of_a_lone_impact_has_no_question_marks(scene, part, numbers) -> None:
    words = part("rockfall_addon.view.impact_words")
    pick = picks_of(scene, "A")[1]
    assert {line[0] for line in words.numbers(pick)} >= {"v", "E"}
    unknown = ("incident_mps", "restituted_mps", "kinetic1_j", "kinetic2_j", "rn", "rt")
    rest = {name: value for name, value in numbers(pick).items() if name not in unknown}
    part("rockfall_addon.scene.picks.impact_numbers").keep(pick, rest)
    assert words.numbers(pick) == []


def test_one_point_is_not_several(part) -> None:
    said = part("rockfall_addon.steps.picking.tracking").said_of
    assert said("B10", 8, 1).startswith("8 impacts are proposed for B10, and a point in flight where")
    assert said("B10", 1, 2).startswith("One impact is proposed for B10, and 2 points in flight where")
    assert said("B10", 3, 0).startswith("3 impacts are proposed for B10. Look at each")
