# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects, collections and scenes from another .blend: appended ones get ids of their own and stay together, linked
ones are not written to.
"""

import importlib.util
import os
from pathlib import Path

import bpy
import pytest
from video_scene import DATA


@pytest.fixture
def other(part, tmp_path: Path) -> Path:
    """Another .blend, of three runs; the open scene holds the same ones, with the same ids."""
    spec = importlib.util.spec_from_file_location("random_walk", Path(__file__).with_name("random_walk.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.write_project(tmp_path)
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "project.toml")) == {"FINISHED"}
    bpy.context.scene.rockfall_picking.trajectory = "A"
    own = part("rockfall_addon.scene.picks.own_blocks")
    own.give(bpy.context.scene, "A", part("core.reconstruction.block").Block(0.9, 0.8, 0.7, 2500.0))
    part("rockfall_addon.scene.footage.sync").sync(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "other.blend"), copy=True)
    own.take(bpy.context.scene, "A")
    part("rockfall_addon.scene.footage.sync").sync(bpy.context.scene)
    return tmp_path / "other.blend"


def folder_of(other: Path, kind: str) -> str:
    return str(other / kind) + os.sep


def of_role(role: str, name: str | None = None) -> list[bpy.types.Object]:
    found = [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == role]
    return [obj for obj in found if name is None or obj["rockfall_trajectory"] == name]


def said(part) -> str:
    return " ".join(remark.text for remark in part("rockfall_addon.scene.problems").remarks(bpy.context.scene))


def state(obj: bpy.types.Object) -> dict:
    keep = ("rockfall_trajectory", "rockfall_time_s", "rockfall_position_m", "rockfall_kind")
    return {key: getattr(obj[key], "to_list", lambda key=key: obj[key])() for key in keep}


def test_an_appended_run_is_a_run_of_its_own(part, other: Path) -> None:
    before = {obj["rockfall_id"]: state(obj) for obj in of_role("pick")}
    bpy.ops.wm.append(directory=folder_of(other, "Collection"), filename="A")
    ids = [obj["rockfall_id"] for obj in of_role("pick")]
    assert len(ids) == len(set(ids)) == len(before) + 6
    assert {identifier: state(obj) for obj in of_role("pick") if (identifier := obj["rockfall_id"]) in before} == before
    new = of_role("pick", "A (2)")
    assert len(new) == 6
    (block,), (flights,) = of_role("block", "A (2)"), of_role("flights", "A (2)")
    assert flights["rockfall_mass_kg"] == pytest.approx(2500 * 0.9 * 0.8 * 0.7 * 3.14159265 / 6)
    states = part("rockfall_addon.scene.picks.block_keys").states_of(block)
    assert set(states) == {obj["rockfall_id"] for obj in new}, "the keys are those of its own picks"
    assert "went wrong" not in said(part)


def test_appended_picks_join_the_run_of_their_name(part, other: Path) -> None:
    """As when a pick is taken back from an older file."""
    scene = bpy.context.scene
    gone = sorted(of_role("pick", "A"), key=lambda obj: obj["rockfall_time_s"])[2]
    name, was = gone.name, state(gone)
    bpy.data.objects.remove(gone)
    part("rockfall_addon.scene.footage.sync").sync(scene)
    bpy.ops.wm.append(directory=folder_of(other, "Object"), filename=name)
    assert len(of_role("pick", "A")) == 6
    assert was in [state(obj) for obj in of_role("pick", "A")]


def test_what_is_linked_is_not_written_to(part, other: Path, tmp_path: Path) -> None:
    before = sorted(map(str, map(state, of_role("pick"))))
    bpy.ops.wm.link(directory=folder_of(other, "Collection"), filename="A", instance_collections=False)
    linked = [obj for obj in bpy.data.objects if obj.library is not None]
    assert any(obj.get("rockfall_role") == "pick" for obj in linked)
    held = {obj.name: {key: str(value) for key, value in obj.items()} for obj in linked}
    sync, picks = part("rockfall_addon.scene.footage.sync"), part("rockfall_addon.scene.picks.picks")
    sync.sync(bpy.context.scene, again=True)
    assert sorted(map(str, map(state, picks.objects_of(bpy.context.scene)))) == before
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "walk.blend"))
    assert {obj.name: {key: str(value) for key, value in obj.items()} for obj in linked} == held
    assert "are linked from other.blend, and not used" in said(part)
    bpy.context.view_layer.objects.active = next(obj for obj in linked if obj.get("rockfall_role") == "pick")
    assert part("rockfall_addon.scene.picks.impact_rows").selected(bpy.context) is None


def test_a_linked_scene_is_left_alone(part, other: Path) -> None:
    with bpy.data.libraries.load(str(other), link=True) as (_, wanted):
        wanted.scenes = ["Scene"]
    (scene,) = [each for each in bpy.data.scenes if each.library is not None]
    before = {key: str(value) for key, value in scene.items()}
    done = part("rockfall_addon.scene.footage.sync").sync(scene, again=True)
    assert not done.rebuilt
    bpy.context.window.scene = scene
    with pytest.raises(RuntimeError, match="linked from another file"):
        bpy.ops.rockfall.reconstruct()
    assert {key: str(value) for key, value in scene.items()} == before


def test_a_scene_of_its_own_stays_as_it_was(part, other: Path) -> None:
    """Two scenes with the same ids, frame rates and units of their own."""
    before = sorted(map(str, map(state, of_role("pick"))))
    bpy.context.scene.render.fps, bpy.context.scene.unit_settings.scale_length = 25, 0.01
    bpy.ops.wm.append(directory=folder_of(other, "Scene"), filename="Scene")
    (new,) = [each for each in bpy.data.scenes if each != bpy.context.scene]
    new.render.fps = 60
    for scene in bpy.data.scenes:
        part("rockfall_addon.scene.footage.sync").sync(scene, again=True)
    for scene in bpy.data.scenes:
        found = sorted(str(state(obj)) for obj in scene.objects if obj.get("rockfall_role") == "pick")
        assert found == before
        for obj in (one for one in scene.objects if one.get("rockfall_role") == "pick"):
            frames = obj["rockfall_key_frame"] / scene.render.fps
            offset = part("rockfall_addon.scene.footage.timing").kept_offsets(scene)[obj["rockfall_trajectory"]]
            assert frames + offset == pytest.approx(obj["rockfall_time_s"], abs=1e-4)
    assert "counts one unit as one metre" in said(part)


def test_appended_clicks_know_their_own_video(part, tmp_path: Path) -> None:
    """A camera that comes a second time gets another id; the picks that come with it follow."""
    scene = bpy.context.scene
    camera = part("rockfall_addon.scene.footage.new_videos").add_video(scene, DATA / "constant.mp4")
    pick = part("rockfall_addon.scene.picks.picks").add_pick(scene, "A", 1.0, (1.0, 2.0, 3.0))
    pick["rockfall_seen"] = {"position": list(pick["rockfall_position_m"]), camera["rockfall_id"]: {"frame": 3}}
    file = tmp_path / "other.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)
    names = [camera.name, pick.name]
    bpy.ops.wm.append(directory=folder_of(file, "Object"), filename=names[0], files=[{"name": name} for name in names])
    (second,) = [obj for obj in of_role("camera") if obj != camera]
    (other_pick,) = [obj for obj in of_role("pick") if obj != pick]
    assert second["rockfall_id"] != camera["rockfall_id"]
    assert set(other_pick["rockfall_seen"].keys()) == {"position", second["rockfall_id"]}
    assert set(pick["rockfall_seen"].keys()) == {"position", camera["rockfall_id"]}


def test_an_empty_scene_takes_the_origin_of_what_comes(part, other: Path) -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.append(directory=folder_of(other, "Collection"), filename="B")
    assert list(bpy.context.scene["rockfall_shift_m"]) == [2_600_000.0, 1_200_000.0, 1_500.0]
    assert max(abs(value) for obj in of_role("pick") for value in obj.location) < 200


def test_new_runs_do_not_go_into_a_linked_collection(part, other: Path, tmp_path: Path) -> None:
    """A linked folder of our name is not ours: Blender refuses to put anything into it."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.link(directory=folder_of(other, "Collection"), filename="Rockfall", instance_collections=False)
    assert bpy.ops.rockfall.import_picks(filepath=str(tmp_path / "picks.csv")) == {"FINISHED"}
    assert len([obj for obj in of_role("pick") if obj.library is None]) == 18
    assert "went wrong" not in said(part)
