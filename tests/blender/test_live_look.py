# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn of flights and picks: colours, ticks, beads, doubt; the models' blocks follow."""

import colorsys
import itertools
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from two_runs import RATE, SLOPE, check_shown, picks_of, places, trail, update, values


def test_a_marker_lies_on_the_terrain(slope: bpy.types.Scene) -> None:
    normal = np.array([SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1.0)
    for pick in picks_of(slope, "A")[1:4]:
        up = np.array(pick.rotation_quaternion.to_matrix())[:, 2]
        np.testing.assert_allclose(up, normal, atol=1e-5)


def test_doubt_of_flights(slope: bpy.types.Scene, numbers) -> None:
    """The relative deviation of the speed at either end, where 20 % are the top; 1 beside a doubtful pick."""
    picks, mesh = picks_of(slope, "B"), trail(slope, "B").data
    doubt, at = values(mesh, "doubt"), places(mesh)
    ends = [np.array(pick["rockfall_position_m"]) for pick in picks]
    found = [doubt[(at[:, 0] > a[0] + 1e-3) & (at[:, 0] < b[0] - 1e-3)] for a, b in itertools.pairwise(ends)]
    assert all(np.ptp(one) == 0 for one in found), "one value for each flight"

    def relative(pick: bpy.types.Object, side: int) -> float:
        result = numbers(pick)
        speed = np.linalg.norm(result["incident_mps" if side == 1 else "restituted_mps"])
        return result[f"sigma_speed{side}"] / speed / 0.2

    first, second = picks[1:3]
    expected = [relative(first, 1), max(relative(first, 2), relative(second, 1)), 1.0, 1.0]
    np.testing.assert_allclose([one[0] for one in found], np.minimum(expected, 1.0), rtol=1e-5)
    assert 0.0 < expected[0] < 1.0


def test_below_the_terrain_is_red_and_frames_are_ticks(slope: bpy.types.Scene, part) -> None:
    assert not values(trail(slope, "A").data, "below_terrain").any()
    pick = picks_of(slope, "A")[2]
    pick.rockfall_pick.kind = "pass"
    pick.location.z -= 3.0
    update()
    mesh = trail(slope, "A").data
    below = values(mesh, "below_terrain")
    shown = places(mesh)
    deep = shown[:, 2] - (50.0 - SLOPE * shown[:, 0])
    np.testing.assert_array_equal(below, deep < -0.2 * 0.175)
    assert below.any()
    colours = np.empty(4 * len(shown), dtype=np.float32)
    mesh.attributes["speed_colour"].data.foreach_get("color", colours)
    np.testing.assert_allclose(colours.reshape(-1, 4)[below], [[1, 0, 0, 1]] * int(below.sum()))
    ticks = values(mesh, "display_time_s")[values(mesh, "tick")] * RATE
    assert len(ticks) > 50
    np.testing.assert_allclose(ticks, np.round(ticks), atol=1e-3)


def test_beads_are_geometry(scene: bpy.types.Scene) -> None:
    def corners() -> int:
        tube = trail(scene, "A").evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        assert tube.attributes.active_color_name == "speed_colour", "else the 3-D view shows them white"
        return len(tube.vertices)

    bare = corners()
    scene.rockfall.show_ticks = True
    ticks = int(values(trail(scene, "A").data, "tick").sum())
    assert corners() == bare + 12 * ticks
    scene.rockfall.show_ticks = False
    assert corners() == bare


@pytest.mark.parametrize("by", ["SPEED", "ENERGY", "DOUBT"])
def test_colours(scene: bpy.types.Scene, part, by: str) -> None:
    scene.rockfall.colour_by = by
    mesh = trail(scene, "B").data
    colours = np.empty(4 * len(mesh.vertices), dtype=np.float32)
    mesh.attributes["speed_colour"].data.foreach_get("color", colours)
    speed = values(mesh, "speed_mps")
    if by == "SPEED":
        part_of = speed / scene.rockfall.speed_top_mps
    elif by == "ENERGY":
        part_of = 0.5 * trail(scene, "B")["rockfall_mass_kg"] * speed**2 / 1000 / scene.rockfall.energy_top_kj
    else:
        part_of = values(mesh, "doubt")
        time = values(mesh, "display_time_s")
        start = picks_of(scene, "B")[2]["rockfall_key_frame"] / RATE
        assert (part_of[time > start + 1e-3] == 1.0).all(), "beside the doubtful impact"
        assert (part_of[time < start - 0.5] < 1.0).all()
    core = part("core.colours")
    expected = core.srgb_to_linear(core.scale_colours(part_of, 0.0, 1.0))
    np.testing.assert_allclose(colours.reshape(-1, 4)[:, :3], expected, atol=1e-4)


def test_flights_join_centres(slope: bpy.types.Scene, part) -> None:
    slope.rockfall.flights_join = "centres"
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(slope)
    assert result.ends == "centres"
    pick = picks_of(slope, "A")[1]
    frame = pick["rockfall_key_frame"]
    slope.frame_set(int(frame), subframe=frame % 1)
    block = next(o for o in slope.objects if o.get("rockfall_role") == "block" and o["rockfall_trajectory"] == "A")
    slope.rockfall.block_scale = 1.0
    update()
    normal = np.array([SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1.0)
    expected = np.array(pick["rockfall_position_m"]) + 0.175 * normal
    np.testing.assert_allclose(block.matrix_world.translation, expected, atol=1e-3)


def test_twins_follow_an_edit(slope: bpy.types.Scene, part) -> None:
    assert bpy.ops.rockfall.show_models(models={"noel_2017"}) == {"FINISHED"}

    def landing() -> list[float]:
        obj = next(o for o in slope.objects if o.get("rockfall_role") == "twin_flights")
        return list(obj.data.vertices[-1].co)

    before = landing()
    picks_of(slope, "B")[3].location.x += 0.7
    update()
    assert landing() != before
    check_shown(slope, part)


def is_red(colour) -> bool:
    """Whether a person calls a colour red."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*colour[:3])
    return saturation > 0.5 and 0.2 < lightness < 0.9 and min(hue, 1 - hue) < 27 / 360


def test_nothing_but_what_passes_below_the_terrain_is_red(part, monkeypatch) -> None:
    assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    scene, view = bpy.context.scene, part("rockfall_addon.view.footage_view")
    picks, camera = (
        part("rockfall_addon.scene.picks.picks"),
        part("rockfall_addon.scene.footage.videos").cameras(scene)[0],
    )
    click = SimpleNamespace(ellipse=np.eye(3)[:2])
    monkeypatch.setattr(part("rockfall_addon.scene.footage.clicks"), "of", lambda _: {"video": click})
    monkeypatch.setattr(part("rockfall_addon.scene.footage.clicks"), "epipolar", lambda *_: None)
    chosen, found = picks.objects_of(scene)[0], part("rockfall_addon.view.drawn").Drawing()
    view._add_active(found, scene, camera, part("rockfall_addon.scene.footage.pictures").posed(camera, 2.0), chosen)
    colours = [tuple(line.colour.reshape(-1, 4)[0]) for line in found.lines]
    solid = part("rockfall_addon.steps.picking.overlay")._solid(scene, chosen)
    assert (len(colours), len(solid)) >= (2, 1), "the ellipse of the click is drawn in both views"
    marking, pairs = part("rockfall_addon.steps.alignment.overlay"), part("rockfall_addon.scene.footage.pairs")
    colours += [colour for _, colour in solid]
    colours += [marking.WRONG, *map(marking.palette, range(pairs.COLOURS)), *picks.MARKER_COLOURS.values()]
    colours += [model.colour for model in part("core.impact_models.registry").MODELS.values()]
    assert [colour for colour in colours if is_red(colour)] == []
    assert is_red(view.BELOW)
