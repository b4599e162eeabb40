# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar of the graphs: sets of parameters, values for kinds of ground, fits, impacts of other sites."""

from pathlib import Path

import bpy
import numpy as np
import pytest

MODEL = "azimi_desvarreux_1977"
TRUTH = {"rn": 0.62, "rt": 0.41}


@pytest.fixture
def scene(part, tmp_path: Path) -> bpy.types.Scene:
    """Runs on a plain whose every impact gives back what `TRUTH` says."""
    corners = np.array([[-50.0, -50, 0], [150, -50, 0], [150, 150, 0], [-50, 150, 0]])
    faces, shift = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), part("core.georeference").GlobalShift()
    plain = part("core.terrain.surface").Surface(corners, faces, shift, "plain", ())
    part("rockfall_addon.scene.terrain.terrain").add_terrain(
        bpy.context.scene, plain, part("core.terrain.shading").shade(plain)
    )
    rows, rng = ["trajectory,time_s,x_m,y_m,z_m,kind"], np.random.default_rng(4)
    for run in range(5):
        place, time = np.array([0.0, 20.0 * run, 0.0]), 10.0 * run
        velocity = np.array([rng.uniform(4, 9), 0.0, rng.uniform(4, 9)])
        kinds = ["release", *["impact"] * 4]
        for kind in kinds:
            x, y, z = place.tolist()
            rows.append(f"run {run},{float(time)!r},{x!r},{y!r},{z!r},{kind}")
            duration = 2 * velocity[2] / 9.81
            place, time = place + velocity * [duration, duration, 0.0], time + duration
            velocity = velocity * [TRUTH["rt"], TRUTH["rt"], TRUTH["rn"]]
    path = tmp_path / "picks.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    scene = bpy.context.scene
    scene.rockfall_comparison.models = {MODEL}
    scene.rockfall_comparison.fitted = MODEL
    return scene


@pytest.fixture
def models(part):
    return part("rockfall_addon.scene.models.models")


@pytest.fixture
def comparison_of(part):
    return part("rockfall_addon.scene.models.comparison").comparison_of


def impacts_table(folder: Path, part, comparison, name: str, site: str) -> Path:
    path = folder / name
    impacts = comparison.impacts
    from dataclasses import replace

    part("core.exchange.tables").write_impacts(replace(impacts, site=np.full(len(impacts), site)), path)
    return path


def test_what_is_typed_reaches_the_core_as_the_number_that_was_meant(scene, models) -> None:
    scene.rockfall_parameters.noel_2017.rt = 0.35
    scene.rockfall_parameters.noel_2017.rn_exponent = -1.2
    assert models.parameters_of(scene) == {"noel_2017": {"rt": 0.35, "rn_exponent": -1.2}}
    models.keep_parameters(scene, {"noel_2017": {"rt": 1 / 3}})
    assert scene.rockfall_parameters.noel_2017.rt == pytest.approx(1 / 3, abs=1e-7)
    assert models.parameters_of(scene)["noel_2017"]["rt"] == 1 / 3


def test_both_sets_are_saved_and_do_not_touch_each_other(scene, models, tmp_path: Path) -> None:
    scene.rockfall_parameters.noel_2017.rt = 0.4
    scene.rockfall_other_parameters.noel_2017.rt = 0.8
    scene.rockfall_other_parameters.dorren_2015.soil_type = "2"
    scene.rockfall_comparison.sets = "BOTH"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"), load_ui=False)
    scene = bpy.context.scene
    assert models.parameters_of(scene) == {"noel_2017": {"rt": 0.4}}
    assert models.parameters_of(scene, "B") == {"noel_2017": {"rt": 0.8}, "dorren_2015": {"soil_type": "2"}}
    assert scene.rockfall_other_parameters.dorren_2015.rn == pytest.approx(0.28)
    assert scene.rockfall_comparison.sets == "BOTH"


def test_sets_are_copied_and_swapped(scene, models) -> None:
    scene.rockfall_parameters.noel_2017.rt = 0.4
    assert bpy.ops.rockfall.copy_parameters(way="A_TO_B") == {"FINISHED"}
    assert models.parameters_of(scene, "B") == {"noel_2017": {"rt": 0.4}}
    scene.rockfall_parameters.noel_2017.rt = 0.5
    assert models.parameters_of(scene, "B") == {"noel_2017": {"rt": 0.4}}
    bpy.ops.rockfall.copy_parameters(way="SWAP")
    assert models.parameters_of(scene) == {"noel_2017": {"rt": 0.4}}
    assert models.parameters_of(scene, "B") == {"noel_2017": {"rt": 0.5}}
    bpy.ops.rockfall.copy_parameters(way="B_TO_A")
    assert models.parameters_of(scene) == models.parameters_of(scene, "B") == {"noel_2017": {"rt": 0.5}}


def test_values_for_a_ground_and_back_to_the_defaults(scene, models) -> None:
    rocky = scene.rockfall_parameters.dorren_2015
    rocky.rn = 0.9
    rocky.rg20 = 0.3
    assert bpy.ops.rockfall.use_ground(model="dorren_2015", ground="1") == {"FINISHED"}
    assert models.parameters_of(scene) == {"dorren_2015": {"soil_type": "1", "rg20": 0.3}}
    assert rocky.rn == pytest.approx(0.23)
    bpy.ops.rockfall.use_ground(model="pfeiffer_bowen_1989", which="B", ground="0")
    assert models.parameters_of(scene, "B") == {"pfeiffer_bowen_1989": {"rn": 0.29, "rt": 0.815}}
    assert "pfeiffer_bowen_1989" not in models.parameters_of(scene)
    bpy.ops.rockfall.reset_parameter(model="dorren_2015", parameter="rg20")
    assert models.parameters_of(scene) == {"dorren_2015": {"soil_type": "1"}}
    bpy.ops.rockfall.reset_parameter(model="dorren_2015")
    assert models.parameters_of(scene) == {}


def test_the_models_blocks_follow_the_scenes_set_only(scene, models) -> None:
    bpy.ops.rockfall.show_models(models={MODEL})

    def speeds() -> list[float]:
        curve = next(obj for obj in scene.objects if obj.get("rockfall_role") == "twin_flights")
        return [value.value for value in curve.data.attributes["speed_mps"].data]

    before = speeds()
    scene.rockfall_other_parameters.azimi_desvarreux_1977.rt = 0.2
    assert speeds() == before
    scene.rockfall_parameters.azimi_desvarreux_1977.rt = 0.2
    assert speeds() != before
    scene.rockfall_parameters.azimi_desvarreux_1977.rt = 0.85
    assert speeds() == before


def test_graphs_have_the_colours_of_the_blocks_that_are_shown(scene, part, comparison_of) -> None:
    model_colours = part("core.analysis.colouring").model_colours
    own = part("core.impact_models.registry").find_model(MODEL).colour
    assert comparison_of(scene).in_view == ()
    assert model_colours([MODEL])[MODEL] != own
    bpy.ops.rockfall.show_models(models={MODEL})
    assert comparison_of(scene).in_view == (MODEL,)
    assert model_colours([MODEL], with_blocks=True)[MODEL] == own


def test_models_with_blocks_are_in_the_graphs_and_have_the_same_first_spin(scene, part, comparison_of) -> None:
    bpy.ops.rockfall.show_models(models={"wyllie_2014"})
    assert comparison_of(scene).models == (MODEL, "wyllie_2014")

    def starts() -> np.ndarray:
        curve = next(obj for obj in scene.objects if obj.get("rockfall_role") == "twin_flights")
        return np.array([vertex.co for vertex in curve.data.vertices])

    rolling = starts()
    scene.rockfall_comparison.spin = "zero"
    without = starts()
    assert rolling.shape != without.shape or not np.allclose(rolling, without)
    bpy.ops.rockfall.show_models(models={"wyllie_2014"})
    assert np.allclose(starts(), without)


def test_blocks_after_a_slider_are_those_of_showing_them_anew(scene, part) -> None:
    bpy.ops.rockfall.show_models(models={MODEL, "noel_2017"})

    def motion() -> dict[tuple, list]:
        found = {}
        for obj in scene.objects:
            if obj.get("rockfall_role") != "twin":
                continue
            bag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
            curves = {
                (curve.data_path, curve.array_index): [tuple(point.co) for point in curve.keyframe_points]
                for curve in bag.fcurves
            }
            if len(curves["hide_render", 0]) > 1:  # a spare block is hidden all the time
                found[obj["rockfall_model"], obj["rockfall_trajectory"], obj["rockfall_lane"]] = curves
        return found

    for value in (0.1, 0.95, 0.5):
        scene.rockfall_parameters.azimi_desvarreux_1977.rn = value
    slid = motion()
    bpy.ops.rockfall.remove_models()
    bpy.ops.rockfall.show_models(models={MODEL, "noel_2017"})
    assert motion() == slid


def test_calibration_finds_the_truth_and_proposes_it(scene, models, comparison_of) -> None:
    scene.rockfall_other_parameters.noel_2017.rt = 0.8
    assert bpy.ops.rockfall.calibrate() == {"FINISHED"}
    own = models.parameters_of(scene, "B")[MODEL]
    assert own == {name: pytest.approx(value, abs=2e-3) for name, value in TRUTH.items()}
    assert models.parameters_of(scene) == {}
    assert set(comparison_of(scene).predictions) == {"A", "B"}
    assert bpy.ops.rockfall.apply_fit() == {"FINISHED"}
    assert models.parameters_of(scene)[MODEL] == own
    assert models.parameters_of(scene, "B") == {"noel_2017": {"rt": 0.8}}
    assert set(comparison_of(scene).predictions) == {"A"}
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.rockfall.apply_fit()


def test_a_fit_that_is_discarded_leaves_nothing(scene, models) -> None:
    scene.rockfall_other_parameters.noel_2017.rt = 0.8
    settings = scene.rockfall_comparison
    before = set(settings.models), settings.sets, models.parameters_of(scene), models.parameters_of(scene, "B")
    bpy.ops.rockfall.choose_fitted(model=MODEL, parameter="rn")
    bpy.ops.rockfall.calibrate()
    assert list(models.parameters_of(scene, "B")[MODEL]) == ["rt"]
    bpy.ops.rockfall.discard_fit()
    assert before == (
        set(settings.models), settings.sets, models.parameters_of(scene), models.parameters_of(scene, "B"),
    )  # fmt: skip
    assert "rockfall_fit" not in scene


def test_a_fit_says_that_picks_have_changed_since(scene, part) -> None:
    proposal_of = part("rockfall_addon.scene.models.fit").proposal_of
    bpy.ops.rockfall.calibrate()
    assert not proposal_of(scene).stale
    pick = next(obj for obj in scene.objects if obj.get("rockfall_kind") == "impact")
    pick["rockfall_time_s"] += 0.01
    part("rockfall_addon.scene.footage.sync").sync(scene)
    assert "have changed since" in proposal_of(scene).stale


def test_equivalent_parameters_of_two_constant_models(scene, models) -> None:
    """RocFall without its scaling, rotation and scatter is the model of Azimi & Desvarreux."""
    scene.rockfall_parameters.azimi_desvarreux_1977.rn = 0.5
    scene.rockfall_parameters.azimi_desvarreux_1977.rt = 0.7
    rocfall = scene.rockfall_parameters.stevens_1998
    rocfall.scale_rn_by_velocity = rocfall.rotational = "off"
    rocfall.rn_sd = rocfall.rt_sd = 0.0
    scene.rockfall_comparison.fitted, scene.rockfall_comparison.imitated = "stevens_1998", MODEL
    assert bpy.ops.rockfall.find_equivalent() == {"FINISHED"}
    found = models.parameters_of(scene, "B")["stevens_1998"]
    assert (found["rn"], found["rt"]) == (pytest.approx(0.5, abs=2e-3), pytest.approx(0.7, abs=2e-3))
    scene.rockfall_comparison.imitated = "stevens_1998"
    with pytest.raises(RuntimeError, match="like itself"):
        bpy.ops.rockfall.find_equivalent()


def test_scores_are_those_of_rockfall_compare(scene, part, comparison_of) -> None:
    scene.rockfall_comparison.models = {MODEL, "noel_2017", "wyllie_2014"}
    found = comparison_of(scene)
    compared = part("core.analysis.comparison").compare(found.impacts, sorted(found.models), replicates=6)
    wanted = {(s.model, s.quantity): s for s in part("core.analysis.scores").scores(found.impacts, compared)}
    for quantity in ("rn", "vt2_mps", "theta_dev_deg"):
        scene.rockfall_comparison.quantity = quantity
        for measure in ("rmse", "energy_distance"):
            scene.rockfall_comparison.measure = measure
            rows = part("rockfall_addon.scene.models.comparison_scores").ranking(scene, comparison_of(scene))
            values = [getattr(row.score, measure) for row in rows]
            assert values == sorted(values)
            assert len(rows) == 3
            for row in rows:
                one = wanted[row.model, quantity]
                assert (row.score.bias, row.score.rmse) == (pytest.approx(one.bias), pytest.approx(one.rmse))
                rmse_of = part("rockfall_addon.scene.models.comparison_scores").rmse_of
                assert rmse_of(comparison_of(scene), "A", row.model, quantity) == pytest.approx(one.rmse)
                assert getattr(row.score, measure) == pytest.approx(getattr(one, measure), abs=1e-9)


def test_impacts_of_another_site_are_shown_kept_and_missed(scene, part, comparison_of, tmp_path: Path) -> None:
    path = impacts_table(tmp_path, part, comparison_of(scene), "other.csv", "Gully")
    assert bpy.ops.rockfall.add_database(filepath=str(path)) == {"FINISHED"}
    (table,) = comparison_of(scene).others
    assert table.sites == ("Gully",)
    assert len(table.impacts) == len(comparison_of(scene).impacts)
    first = comparison_of(scene)
    assert comparison_of(scene) is first
    scene.rockfall_comparison.databases[0].shown = False
    assert comparison_of(scene).others == ()
    scene.rockfall_comparison.databases[0].shown = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"), load_ui=False)
    scene = bpy.context.scene
    assert comparison_of(scene).others[0].sites == ("Gully",)
    elsewhere = tmp_path / "moved"
    elsewhere.mkdir()
    path.rename(elsewhere / "other.csv")
    part("rockfall_addon.scene.storage.databases").LOOK_AGAIN_S = 0.0
    (gone,) = comparison_of(scene).others
    assert gone.impacts is None
    assert "is not there" in gone.problem
    assert any("is not there" in text for text in comparison_of(scene).problems)
    assert bpy.ops.rockfall.remove_database() == {"FINISHED"}
    assert comparison_of(scene).others == ()


def test_a_table_that_has_changed_is_told(scene, part, comparison_of, tmp_path: Path) -> None:
    path = impacts_table(tmp_path, part, comparison_of(scene), "other.csv", "Gully")
    bpy.ops.rockfall.add_database(filepath=str(path))
    part("rockfall_addon.scene.storage.databases").LOOK_AGAIN_S = 0.0
    assert not comparison_of(scene).others[0].problem
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join(lines[:-2]) + "\n", encoding="utf-8")
    (table,) = comparison_of(scene).others
    assert "has changed since it was added" in table.problem
    assert len(table.impacts) == len(lines) - 3
    bpy.ops.rockfall.add_database(filepath=str(path))
    assert len(scene.rockfall_comparison.databases) == 1
    assert not comparison_of(scene).others[0].problem


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("trajectory,nx\nA,0\n", "columns ny, nz.* are missing"),
        ("", "empty"),
        ("trajectory,nx,ny,nz,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps\n", "no impacts|no rows"),
        ("trajectory,nx,ny,nz,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps\nA,0,0,1,x,0,-1,1,0,1\n", "number"),
    ],
)
def test_a_bad_table_is_refused_with_the_reason(scene, tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(RuntimeError, match=rf"(?i)bad\.csv.*({said})"):
        bpy.ops.rockfall.add_database(filepath=str(path))
    assert not len(scene.rockfall_comparison.databases)


def test_a_fit_can_take_the_impacts_of_other_sites(scene, part, comparison_of, tmp_path: Path) -> None:
    own = len(comparison_of(scene).measured.courses)
    bpy.ops.rockfall.add_database(
        filepath=str(impacts_table(tmp_path, part, comparison_of(scene), "other.csv", "Gully"))
    )
    proposal_of = part("rockfall_addon.scene.models.fit").proposal_of
    bpy.ops.rockfall.calibrate()
    alone = proposal_of(scene).impacts
    assert alone <= own
    scene.rockfall_comparison.fit_with_others = True
    bpy.ops.rockfall.calibrate()
    assert proposal_of(scene).impacts == 2 * alone


def test_saved_parameters_come_back(scene, models, tmp_path: Path) -> None:
    scene.rockfall_parameters.azimi_desvarreux_1977.rn = 0.123456
    path = tmp_path / "parameters.toml"
    assert bpy.ops.rockfall.save_parameters(filepath=str(path)) == {"FINISHED"}
    bpy.ops.rockfall.reset_parameter(model=MODEL)
    assert bpy.ops.rockfall.load_parameters(filepath=str(path)) == {"FINISHED"}
    assert models.parameters_of(scene)[MODEL]["rn"] == 0.123456


def test_without_impacts_nothing_is_fitted(part) -> None:
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.rockfall.calibrate()
