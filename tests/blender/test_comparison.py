# SPDX-License-Identifier: GPL-3.0-or-later
"""What the graphs show: the scene's impacts, what the models make of them, impacts of other sites."""

from pathlib import Path

import bpy
import numpy as np
import pytest

HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,status\n"
TIMES = (10.0, 10.7312, 11.90017, 12.4)
X = (0.0, 4.1, 11.3, 13.9)
SLOPE = 0.7
TWO = {"noel_2017", "wyllie_2014"}


@pytest.fixture
def scene(part, tmp_path: Path) -> bpy.types.Scene:
    """An inclined plane and two runs over it, the second 3 m beside."""
    scene = bpy.context.scene
    side = np.linspace(-30.0, 60.0, 31)
    x, y = (values.ravel() for values in np.meshgrid(side, side, indexing="ij"))
    corner = (np.arange(30)[:, None] * 31 + np.arange(30)).ravel()
    ring = np.column_stack([corner, corner + 31, corner + 32, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    shift = part("core.georeference").GlobalShift()
    surface = part("core.terrain.surface").Surface(np.column_stack([x, y, -SLOPE * x]), faces, shift, "plane", ())
    part("rockfall_addon.scene.terrain.terrain").add_terrain(
        scene, surface, part("core.terrain.shading").shade(surface)
    )
    import_picks(tmp_path, [("A", 0.0, 0.0), ("B", 30.0, 3.0)])
    scene.rockfall_comparison.models = TWO
    return scene


def import_picks(folder: Path, runs: list[tuple[str, float, float]]) -> None:
    rows = [
        f"{name},{time + later!r},{x!r},{aside!r},{-SLOPE * x!r},{kind},ok"
        for name, later, aside in runs
        for time, x, kind in zip(TIMES, X, ("release", "impact", "impact", "impact"), strict=True)
    ]
    path = folder / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}


@pytest.fixture
def comparison_of(part):
    return part("rockfall_addon.scene.models.comparison").comparison_of


def picks(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]


def expected(part, comparison, parameters: dict, *, replicates: int = 6, seed: int = 0):
    compare = part("core.analysis.comparison").compare
    return compare(comparison.impacts, sorted(TWO), parameters, replicates=replicates, seed=seed)


def check_values(part, comparison, parameters: dict, which: str = "A", **options: int) -> None:
    wanted = expected(part, comparison, parameters, **options)
    assert list(comparison.predictions[which]) == sorted(TWO)
    for i, model in enumerate(sorted(TWO)):
        found = comparison.predictions[which][model]
        assert found.models == (model,)
        assert np.array_equal(found.v2[0], wanted.v2[i])
        assert np.array_equal(found.row, wanted.row)


def test_models_meet_the_scenes_impacts_as_rockfall_compare_has_them(scene, part, comparison_of) -> None:
    found = comparison_of(scene)
    assert len(found.impacts) == 6
    assert found.impacts.trajectory.tolist() == ["A"] * 3 + ["B"] * 3
    assert not found.problems
    check_values(part, found, {})


def test_each_row_leads_back_to_its_pick(scene, part, comparison_of) -> None:
    found, with_id = comparison_of(scene), part("rockfall_addon.scene.picks.picks").with_id
    for row, identifier in enumerate(found.pick):
        obj = with_id(scene, identifier)
        assert obj["rockfall_trajectory"] == found.impacts.trajectory[row]
        assert obj["rockfall_time_s"] == found.impacts.time_s[row]


def test_nothing_is_computed_again_until_something_changes(scene, part, comparison_of) -> None:
    first = comparison_of(scene)
    assert comparison_of(scene) is first
    scene.rockfall_parameters.noel_2017.rt = 0.5
    second = comparison_of(scene)
    assert second.version != first.version
    assert second.measured is first.measured
    assert second.predictions["A"]["wyllie_2014"] is first.predictions["A"]["wyllie_2014"]
    check_values(part, second, {"noel_2017": {"rt": 0.5}})
    scene.rockfall_comparison.seed = 3
    check_values(part, comparison_of(scene), {"noel_2017": {"rt": 0.5}}, seed=3)
    scene.rockfall_comparison.replicates = 2
    check_values(part, comparison_of(scene), {"noel_2017": {"rt": 0.5}}, seed=3, replicates=2)


def test_draws_stay_while_a_parameter_moves(scene, comparison_of) -> None:
    def relative() -> np.ndarray:
        values = comparison_of(scene).predictions["A"]["noel_2017"]
        return values.vt2[0] / values.vt2[0, :1]

    scene.rockfall_comparison.models = {"noel_2017"}
    scene.rockfall_parameters.noel_2017.rt_sd = 0.1
    scene.rockfall_parameters.noel_2017.rt = 0.40
    before = np.argsort(relative()[:, 0])
    for value in (0.41, 0.42, 0.45):
        scene.rockfall_parameters.noel_2017.rt = value
        assert np.argsort(relative()[:, 0]).tolist() == before.tolist()


def test_it_follows_a_moved_pick_and_a_setting(scene, part, comparison_of) -> None:
    first = comparison_of(scene)
    pick = next(obj for obj in picks(scene) if obj["rockfall_time_s"] == TIMES[1])
    pick.location.x += 0.5
    pick.location.z -= 0.5 * SLOPE
    part("rockfall_addon.scene.footage.sync").sync(scene)
    second = comparison_of(scene)
    assert second.version != first.version
    row = second.pick.index(pick["rockfall_id"])
    assert np.linalg.norm(second.impacts.v1[row] - first.impacts.v1[row]) > 0.3
    check_values(part, second, {})
    scene.rockfall.block_diameter_m = 1.0
    third = comparison_of(scene)
    assert third.impacts.diameter_m == pytest.approx([1.0] * 6)
    check_values(part, third, {})


def test_a_trajectory_with_a_problem_leaves_the_others(scene, part, comparison_of) -> None:
    scene.objects["B impact 1"]["rockfall_time_s"] = scene.objects["B impact 2"]["rockfall_time_s"]
    part("rockfall_addon.scene.footage.sync").sync(scene)
    found = comparison_of(scene)
    assert set(found.impacts.trajectory.tolist()) == {"A"}
    assert len(found.problems) == 1
    assert "trajectory B" in found.problems[0]
    assert len(found.predictions["A"]) == 2


def test_without_picks_there_is_nothing(part, comparison_of) -> None:
    found = comparison_of(bpy.context.scene)
    assert found.impacts is None
    assert found.predictions == {"A": {}}
    assert not found.problems
    assert found.pick == ()


def test_one_impact_alone(part, comparison_of, tmp_path: Path) -> None:
    path = tmp_path / "one.csv"
    path.write_text(HEADER + "A,1.0,0,0,10,release,ok\nA,2.0,5,0,5,impact,ok\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    found = comparison_of(bpy.context.scene)
    assert len(found.impacts) == 1
    assert found.predictions == {"A": {}}
    assert "No impact can be compared" in found.problems[0]


def test_all_impacts_flagged(scene, part, comparison_of) -> None:
    for obj in picks(scene):
        obj["rockfall_status"] = "discarded"
    part("rockfall_addon.scene.footage.sync").sync(scene)
    found = comparison_of(scene)
    assert found.predictions == {"A": {}}
    assert found.problems


def test_a_model_that_cannot_be_asked_says_why(scene, comparison_of) -> None:
    scene.rockfall_comparison.models = {"noel_2017", "observed"}
    found = comparison_of(scene)
    assert list(found.predictions["A"]) == ["noel_2017"]
    assert any("Only" in text and "measured impacts" in text for text in found.problems)


def test_parameters_out_of_range_are_told(scene, part, comparison_of) -> None:
    scene["rockfall_model_parameters"] = '{"noel_2017": {"rt": 7.0}}'
    found = comparison_of(scene)
    assert list(found.predictions["A"]) == ["wyllie_2014"]
    assert "noel_2017.rt is 7, outside its range" in found.problems[0]


def test_the_second_set_beside_the_first(scene, part, comparison_of) -> None:
    models = part("rockfall_addon.scene.models.models")
    models.keep_parameters(scene, {"noel_2017": {"rt": 1 / 3}}, "B")
    assert list(comparison_of(scene).predictions) == ["A"]
    scene.rockfall_comparison.sets = "BOTH"
    found = comparison_of(scene)
    check_values(part, found, {}, "A")
    check_values(part, found, {"noel_2017": {"rt": 1 / 3}}, "B")
    scene.rockfall_comparison.sets = "B"
    assert list(comparison_of(scene).predictions) == ["B"]


def test_what_a_point_of_a_model_is(scene, comparison_of) -> None:
    settings = scene.rockfall_comparison
    for points, runs in (("MEAN", (0,)), ("DRAW", (1,)), ("ALL", (1, 2, 3, 4, 5, 6))):
        settings.points = points
        assert comparison_of(scene).runs == runs
    settings.replicates = 0
    assert comparison_of(scene).runs == (0,)


def test_both_sets_of_parameters_go_out_and_come_in(scene, part, tmp_path: Path) -> None:
    models = part("rockfall_addon.scene.models.models")
    import_picks(tmp_path, [(name, 30.0 * i, 3.0 * i) for i, name in enumerate("ABCD")])
    scene.rockfall_parameters.noel_2017.rt = 0.5
    scene.rockfall_other_parameters.noel_2017.rt = 0.7
    scene.rockfall_comparison.fitted = "wyllie_2014"
    sets = {which: models.parameters_of(scene, which) for which in "AB"}
    assert sets == {"A": {"noel_2017": {"rt": 0.5}}, "B": {"noel_2017": {"rt": 0.7}}}
    fit, store = part("rockfall_addon.scene.models.fit"), part("rockfall_addon.scene.storage.store")
    question = fit.ask(scene)
    fit.keep(
        scene,
        question,
        part("core.analysis.calibration").calibrate(
            question.impacts, question.model, question.names, question.fixed, question.options
        ),
    )
    assert models.parameters_of(scene, "B") != sets["B"], "it shows what was fitted"
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    scene = bpy.context.scene
    scene[store.FIT] = "of another project"
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "out" / "project.toml")) == {"FINISHED"}
    scene = bpy.context.scene
    assert {which: models.parameters_of(scene, which) for which in "AB"} == sets
    assert store.FIT not in scene


def test_a_moved_pick_has_its_own_trajectory_reconstructed_alone(
    scene, part, comparison_of, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, reconstruction = comparison_of(scene).impacts, part("rockfall_addon.scene.picks.reconstruction")
    asked, kept = [], reconstruction.reconstruct_scene

    def counted(scene, picks=None, surface=None):
        found = kept(scene, picks, surface)
        asked.append(set(found.picks.trajectory.tolist()))
        return found

    pick = next(obj for obj in picks(scene) if obj["rockfall_trajectory"] == "A" and obj["rockfall_time_s"] == TIMES[1])
    pick.location.x += 0.5
    pick.location.z -= 0.5 * SLOPE
    part("rockfall_addon.scene.footage.sync").sync(scene)
    monkeypatch.setattr(reconstruction, "reconstruct_scene", counted)
    second = comparison_of(scene).impacts
    assert asked == [{"A"}]
    whole = kept(scene).impacts
    for name in ("trajectory", "impact", "position", "v1", "v2", "rn", "theta_dev"):
        np.testing.assert_array_equal(getattr(second, name), getattr(whole, name))
    assert np.array_equal(second.v1[3:], first.v1[3:], equal_nan=True)
    assert not np.array_equal(second.v1[:3], first.v1[:3], equal_nan=True)
    for obj in [obj for obj in picks(scene) if obj["rockfall_trajectory"] == "A"]:
        bpy.data.objects.remove(obj)
    part("rockfall_addon.scene.footage.sync").sync(scene)
    assert comparison_of(scene).impacts.trajectory.tolist() == ["B"] * 3
    assert asked == [{"A"}]


def test_graphs_do_not_wait_for_a_model_that_is_being_prepared(scene, part, comparison_of) -> None:
    preparation = part("rockfall_addon.scene.picks.preparation")
    preparation.begin(["wyllie_2014", "stevens_1998"])
    try:
        first = comparison_of(scene)
        assert first.waiting == ("wyllie_2014",)
        assert list(first.predictions["A"]) == ["noel_2017"]
        preparation.done("wyllie_2014")
        second = comparison_of(scene)
        assert (second.waiting, set(second.predictions["A"])) == ((), TWO)
        assert second.predictions["A"]["noel_2017"] is first.predictions["A"]["noel_2017"]
    finally:
        preparation.end()
    assert preparation.pending(["stevens_1998"]) == ()
