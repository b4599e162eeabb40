# SPDX-License-Identifier: GPL-3.0-or-later
"""The models' blocks fly their parabolas at every frame, are hidden between them, and leave nothing behind."""

from pathlib import Path

import bpy
import numpy as np
import pytest

HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,status\n"
TIMES = (10.0, 10.7312, 11.90017, 12.4)
X = (0.0, 4.1, 11.3, 13.9)
SLOPE = 0.7
MODELS = ("noel_2017", "wyllie_2014")


@pytest.fixture
def scene(part, tmp_path: Path) -> bpy.types.Scene:
    """An inclined plane and two runs over it, the second 3 m beside and 30 s later."""
    scene = bpy.context.scene
    side = np.linspace(-30.0, 60.0, 31)
    x, y = (values.ravel() for values in np.meshgrid(side, side, indexing="ij"))
    corner = (np.arange(30)[:, None] * 31 + np.arange(30)).ravel()
    ring = np.column_stack([corner, corner + 31, corner + 32, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    shift = part("core.georeference").GlobalShift()
    vertices = np.column_stack([x, y, -SLOPE * x])
    surface = part("core.terrain.surface").Surface(vertices, faces, shift, "plane", ())
    part("rockfall_addon.scene.terrain.terrain").add_terrain(
        scene, surface, part("core.terrain.shading").shade(surface)
    )
    rows = [
        f"{name},{time + later!r},{x!r},{aside!r},{-SLOPE * x!r},{kind},ok"
        for name, later, aside in (("A", 0.0, 0.0), ("B", 30.0, 3.0))
        for time, x, kind in zip(TIMES, X, ("release", "impact", "impact", "impact"), strict=True)
    ]
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    return scene


@pytest.fixture
def shown(scene: bpy.types.Scene) -> bpy.types.Scene:
    assert bpy.ops.rockfall.show_models(models=set(MODELS)) == {"FINISHED"}
    return scene


def of_role(scene: bpy.types.Scene, role: str) -> list[bpy.types.Object]:
    return [obj for obj in scene.objects if obj.get("rockfall_role") == role]


def expected(part, scene: bpy.types.Scene):
    models = part("rockfall_addon.scene.models.models")
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(scene)
    return models.find_predictions(scene, result, MODELS)


def check_motion(part, scene: bpy.types.Scene) -> None:
    """Every flight of every twin is flown, by a block of its own that is hidden when it does not fly."""
    twins = expected(part, scene)
    linger = part("rockfall_addon.scene.models.model_blocks").LINGER_S
    rate = scene.render.fps / scene.render.fps_base
    begin = twins.time_s - np.where(twins.trajectory == "A", TIMES[0], TIMES[0] + 30.0 - scene.rockfall.stagger_s)
    end = begin + twins.duration_s
    blocks, seen = of_role(scene, "twin"), 0
    for frame in range(int(5 * rate)):
        scene.frame_set(frame)
        now = frame / rate
        for model in MODELS:
            for name in "AB":
                own = (twins.model == model) & (twins.trajectory == name)
                flying = np.flatnonzero(own & (begin + 1e-3 < now) & (now < end - 1e-3))
                where, _ = twins.launches.states(flying, now - begin[flying])
                visible = [
                    block
                    for block in blocks
                    if (block["rockfall_model"], block["rockfall_trajectory"]) == (model, name)
                    and not block.hide_render
                ]
                assert all(not block.hide_viewport for block in visible)
                places = np.array([block.matrix_world.translation for block in visible]).reshape(-1, 3)
                for place in where:
                    assert np.linalg.norm(places - place, axis=1).min() < 1e-4
                    seen += 1
                if not (own & (begin - 1e-3 < now) & (now < end + linger + 1e-3)).any():
                    assert not visible
    assert seen > rate


def test_blocks_fly_the_parabolas_and_hide_between_them(shown: bpy.types.Scene, part) -> None:
    check_motion(part, shown)


def test_they_follow_the_frame_rate(shown: bpy.types.Scene, part) -> None:
    shown.render.fps, shown.render.fps_base = 30000, 1001.0
    check_motion(part, shown)


def test_one_block_for_each_run_and_model_unless_flights_overlap(shown: bpy.types.Scene, part) -> None:
    twins = expected(part, shown)
    for model in MODELS:
        count = 0
        for name in "AB":
            own = np.flatnonzero((twins.model == model) & (twins.trajectory == name) & (twins.duration_s > 0))
            ends = twins.time_s[own] + twins.duration_s[own]
            together = [int(((twins.time_s[own] <= t) & (t < ends)).sum()) for t in twins.time_s[own]]
            count += max(together)
        assert len([b for b in of_role(shown, "twin") if b["rockfall_model"] == model]) == count
    assert len(of_role(shown, "twin_flights")) == len(MODELS)


def test_curves_land_on_the_terrain_in_the_models_colour(shown: bpy.types.Scene, part) -> None:
    colours = part("core.colours")
    curves = of_role(shown, "twin_flights")
    assert {obj["rockfall_model"] for obj in curves} == set(MODELS)
    for obj in curves:
        heights = [vertex.co.z + SLOPE * vertex.co.x for vertex in obj.data.vertices]
        assert min(heights) > -1e-3
        ends = [v.index for v in obj.data.vertices if abs(v.co.z + SLOPE * v.co.x) < 1e-3]
        assert len(ends) >= 4
        own = part("core.impact_models.registry").find_model(obj["rockfall_model"]).colour
        colour = colours.srgb_to_linear(np.array(own))
        np.testing.assert_allclose(obj.data.attributes["speed_colour"].data[0].color[:3], colour, atol=1e-6)
    white = colours.srgb_to_linear(np.array(colours.MEASURED_COLOUR))
    measured = of_role(shown, "flights")
    assert {obj["rockfall_trajectory"] for obj in measured} == {"A", "B"}
    for obj in measured:
        np.testing.assert_allclose(obj.data.attributes["speed_colour"].data[0].color[:3], white, atol=1e-6)


def names() -> set[str]:
    kinds = (bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.collections)
    return {f"{type(each).__name__} {each.name}" for kind in kinds for each in kind}


def test_removal_leaves_nothing(scene: bpy.types.Scene) -> None:
    def colours() -> list[tuple[float, ...]]:
        data = of_role(scene, "flights")[0].data.attributes["speed_colour"].data
        return [tuple(each.color) for each in data]

    before, painted = names(), colours()
    bpy.ops.rockfall.show_models(models=set(MODELS))
    assert names() > before
    assert colours() != painted
    assert bpy.ops.rockfall.remove_models() == {"FINISHED"}
    assert names() == before
    assert colours() == painted
    assert "rockfall_twin_models" not in scene


def test_showing_others_replaces_them_and_none_removes_them(shown: bpy.types.Scene) -> None:
    bpy.ops.rockfall.show_models(models={"dorren_2015"})
    assert {obj["rockfall_model"] for obj in of_role(shown, "twin")} == {"dorren_2015"}
    bpy.ops.rockfall.show_models(models=set())
    assert not of_role(shown, "twin")


def test_they_follow_a_moved_pick_and_a_changed_setting(shown: bpy.types.Scene, part) -> None:
    shown.rockfall.stagger_s = 1.25
    check_motion(part, shown)
    shown.rockfall.block_scale = 3.0
    scales = [obj.scale.x for obj in of_role(shown, "twin")]
    assert len(scales) >= 4
    assert scales == pytest.approx([3 * 0.35 / 2] * len(scales), rel=1e-5)
    shown.rockfall.use_drag = True
    shown.rockfall.block_scale = 1.0
    check_motion(part, shown)


def test_parameters_of_a_file_are_used_and_kept(scene: bpy.types.Scene, part, tmp_path: Path) -> None:
    own = {"azimi_desvarreux_1977": {"rn": 0.9, "rt": 0.4}}
    part("core.exchange.parameters").write_parameters(own, tmp_path / "parameters.toml")
    assert bpy.ops.rockfall.load_parameters(filepath=str(tmp_path / "parameters.toml")) == {"FINISHED"}
    assert bpy.ops.rockfall.show_models(models={"azimi_desvarreux_1977"}) == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"), load_ui=False)
    scene = bpy.context.scene
    models = part("rockfall_addon.scene.models.models")
    assert models.parameters_of(scene) == own
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(scene)
    twins = models.find_predictions(scene, result, models.shown_models(scene))
    impacts = result.impacts
    normal = np.sum(impacts.v1 * impacts.normal, axis=1)[:, None] * impacts.normal
    rebound = -0.9 * normal + 0.4 * (impacts.v1 - normal)
    of_row = {key: i for i, key in enumerate(zip(impacts.trajectory.tolist(), impacts.impact.tolist(), strict=True))}
    rows = [of_row[key] for key in zip(twins.trajectory.tolist(), twins.impact.tolist(), strict=True)]
    _, velocity = twins.launches.states(np.arange(len(rows)), np.zeros(len(rows)))
    np.testing.assert_allclose(velocity, rebound[rows], atol=1e-9)


def test_bad_parameters_are_told(scene: bpy.types.Scene, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("[models.noel_2017]\nrtt = 1.0\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"bad\.toml.*rtt"):
        bpy.ops.rockfall.load_parameters(filepath=str(tmp_path / "bad.toml"))


def test_without_terrain_there_are_none(scene: bpy.types.Scene) -> None:
    for obj in of_role(scene, "terrain"):
        bpy.data.objects.remove(obj)
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.rockfall.show_models(models=set(MODELS))


def test_a_film_says_whose_blocks_they_are(shown: bpy.types.Scene, part) -> None:
    preset = part("core.exchange.project").RenderPreset("tiny", width=64, height=36, fps=25.0, engine="cycles")
    film = part("rockfall_addon.steps.film.dressing")
    film.set_up_film(shown, preset, "cycles")
    captions = {obj.name for obj in of_role(shown, "film")}
    assert {"Film source measured", "Film source Noël et al. 2017", "Film source Wyllie 2014"} <= captions
    assert "Film legend" not in captions
    film.remove_film(shown)
    assert len(of_role(shown, "twin_flights")) == 2
    assert not of_role(shown, "film")


def test_the_models_colours_are_in_a_rendered_film(shown: bpy.types.Scene, part, tmp_path: Path) -> None:
    preset = part("core.exchange.project").RenderPreset("tiny", width=192, height=108, fps=25.0, engine="cycles")
    part("rockfall_addon.steps.film.dressing").set_up_film(shown, preset, "cycles")
    render = part("rockfall_addon.steps.film.render")
    done: list[tuple[str, int, int]] = []
    render.render_film(shown, tmp_path / "film.mp4", (60, 61), lambda *count: done.append(count))
    assert done[:2] == [("Rendering", 1, 2), ("Rendering", 2, 2)]
    shown.frame_set(60)
    render.render_picture(shown, tmp_path / "still.png")
    image = bpy.data.images.load(str(tmp_path / "still.png"))
    pixels = np.array(image.pixels[:]).reshape(108, 192, 4)[:, 24:, :3]  # right of the legend's swatches
    find_model = part("core.impact_models.registry").find_model
    for colour in (part("core.colours").MEASURED_COLOUR, *(find_model(name).colour for name in MODELS)):
        assert (np.abs(pixels - colour).max(axis=2) < 0.15).sum() >= 2, colour


def test_over_the_footage_measured_paths_are_white_beside_models(shown: bpy.types.Scene, part) -> None:
    view, white = part("rockfall_addon.view.footage_view"), part("core.colours").MEASURED_COLOUR
    path = view.path_of(shown, "A")
    assert path.edged
    above = ~np.all(path.colour == view.BELOW, axis=1)
    assert above.any()
    np.testing.assert_array_equal(path.colour[above], np.tile(white, (above.sum(), 1)))
    assert bpy.ops.rockfall.remove_models() == {"FINISHED"}
    path = view.path_of(shown, "A")
    assert not path.edged
    assert (np.ptp(path.colour, axis=0) > 0.05).any(), "by speed"
