# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the picks' objects: the numbers that tables, cards and graphs count, whatever is inserted or deleted."""

import csv
from pathlib import Path

import bpy
from two_runs import ground, picks_of, update


def names(scene: bpy.types.Scene) -> list[str]:
    return [obj.name for obj in picks_of(scene, "A")]


RUN = ["A release 1", "A impact 1", "A impact 2", "A impact 3", "A stop 1"]


def test_the_name_of_an_impact_has_its_number_in_the_tables(scene, part, tmp_path: Path) -> None:
    picks_of(scene, "A")[1].rockfall_pick.kind = "pass"
    update()
    assert names(scene) == ["A release 1", "A pass 1", "A impact 1", "A impact 2", "A stop 1"]
    bpy.ops.rockfall.export_tables(directory=str(tmp_path))
    with (tmp_path / "impacts.csv").open(encoding="utf-8") as file:
        counted = {(row["trajectory"], round(float(row["time_s"]), 3)): row["impact"] for row in csv.DictReader(file)}
    words = part("rockfall_addon.view.impact_words")
    for run in ("A", "B"):
        for pick in (one for one in picks_of(scene, run) if one["rockfall_kind"] == "impact"):
            number = counted[run, round(pick["rockfall_time_s"], 3)]
            assert pick.name == f"{run} impact {number}"
            assert words.title(pick).startswith(f"{run}, impact {number},")


def test_names_follow_insertion_and_deletion_and_time(scene, part) -> None:
    assert names(scene) == RUN
    early = part("rockfall_addon.scene.picks.picks").add_pick(scene, "A", 10.3, (2.0, 0.0, ground(2.0)))
    update()
    assert names(scene) == [*RUN[:2], "A impact 2", "A impact 3", "A impact 4", "A stop 1"]
    assert early.name == "A impact 1"
    early.rockfall_pick.time_s = "12.1"
    update()
    assert early.name == "A impact 3"
    bpy.data.objects.remove(early)
    update()
    assert names(scene) == RUN


def test_names_go_back_and_forth_with_undo(scene, part) -> None:
    bpy.ops.ed.undo_push(message="before")
    part("rockfall_addon.scene.picks.picks").add_pick(scene, "A", 10.3, (2.0, 0.0, ground(2.0)))
    bpy.ops.ed.undo_push(message="a pick")  # stored before its trajectory follows
    update()
    bpy.data.objects.remove(picks_of(scene, "A")[3])
    update()
    bpy.ops.ed.undo_push(message="gone")
    for _ in range(2):
        for step, wanted in ((bpy.ops.ed.undo, 4), (bpy.ops.ed.undo, 3), (bpy.ops.ed.redo, 4), (bpy.ops.ed.redo, 3)):
            step()
            update()
            impacts = [name for name in names(bpy.context.scene) if "impact" in name]
            assert impacts == [f"A impact {number}" for number in range(1, wanted + 1)]


def test_a_copy_is_an_impact_of_its_own(scene, part) -> None:
    original = picks_of(scene, "A")[2]
    copy = original.copy()
    copy.animation_data_clear()
    copy["rockfall_time_s"] = 11.0
    original.users_collection[0].objects.link(copy)
    update()
    assert (copy.name, original.name) == ("A impact 2", "A impact 3")


def test_names_that_a_person_gave_stay(scene, part) -> None:
    picks_of(scene, "A")[2].name = "the long jump"
    picks_of(scene, "A")[1].rockfall_pick.kind = "contact"
    update()
    assert names(scene) == ["A release 1", "A contact 1", "the long jump", "A impact 2", "A stop 1"]


def test_a_name_longer_than_blenders_is_cut_once(part) -> None:
    follow = part("rockfall_addon.scene.picks.pick_names").follow
    picks = [bpy.data.objects.new("x 01 impact", None) for _ in range(2)]
    for number, pick in enumerate(picks):
        pick["rockfall_trajectory"], pick["rockfall_kind"], pick["rockfall_time_s"] = "ä" * 300, "impact", number
    assert follow(picks)
    assert [pick.name for pick in picks] == [f"{'ä' * 100} impact {number}" for number in (1, 2)]
    assert not follow(picks)


def test_two_scenes_do_not_take_names_from_one_another(scene, part) -> None:
    other = scene.copy()
    for obj in picks_of(scene, "A"):
        twin = obj.copy()
        other.collection.objects.link(twin)
    follow = part("rockfall_addon.scene.picks.pick_names").follow
    twins = [obj for obj in other.collection.objects if obj.get("rockfall_role") == "pick"]
    assert not follow(twins)
    assert not follow(picks_of(scene, "A"))
    assert names(scene) == RUN


def test_files_of_0_1_0_are_named_when_they_are_opened(part, numbers) -> None:
    file = Path(__file__).resolve().parents[1] / "data" / "saved_by_0.1.0.blend"
    bpy.ops.wm.open_mainfile(filepath=str(file))
    for pick in (o for o in bpy.context.scene.objects if o.get("rockfall_role") == "pick"):
        if (kept := numbers(pick)) is not None:
            assert pick.name == f"{pick['rockfall_trajectory']} impact {kept['number']:.0f}"
