# SPDX-License-Identifier: GPL-3.0-or-later
"""Back-analysis in the scene: what is found is kept, drawn from, exported, and known to be old when it is."""

import csv
import json
import re
from pathlib import Path

import bpy
import numpy as np
import pytest

MODEL = "pfeiffer_bowen_1989"
KEY = "rockfall_back_analysis"
DEMO = Path(__file__).parents[2] / "assets" / "demo"


def ask_little(scene):
    settings = scene.rockfall_back_analysis
    settings.model, settings.sets, settings.rounds = MODEL, 150, 1
    settings.priors = "rn = 0.2..0.6; friction = normal:0.5,0.1"
    return settings


@pytest.fixture
def scene(part, monkeypatch):
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    monkeypatch.setattr(part("core.workflow.back_analysis"), "CHECKED", 30)
    monkeypatch.setattr(part("core.workflow.back_analysis"), "TRUTHS", 20)
    ask_little(bpy.context.scene)
    bpy.context.scene.rockfall_simulation.models = {MODEL, "noel_2017"}
    bpy.context.scene.rockfall_simulation.number = 2
    return bpy.context.scene


def analysed(scene) -> dict:
    assert bpy.ops.rockfall.back_analyse() == {"FINISHED"}
    return json.loads(scene[KEY])


def draw_panel(part) -> list[str]:
    """Texts of the panel's result, as a stand-in for a layout is told."""
    kept = part("rockfall_addon.scene.posterior").kept_of(bpy.context.scene)
    return [] if kept is None else [row.name for row in kept.rows]


def test_what_fits_is_kept_with_its_intervals_and_how_good_it_is(part, scene) -> None:
    kept = analysed(scene)
    assert kept["model"] == MODEL
    assert kept["names"] == ["rn", "rt", "friction"]
    values, weight = np.array(kept["values"]), np.array(kept["weight"])
    assert weight.sum() == pytest.approx(1.0)
    assert ((values[:, 0] >= 0.2) & (values[:, 0] <= 0.6)).all(), "within what was thought possible"
    for column, (name, _, median, low, high, prior, _, left) in enumerate(kept["rows"]):
        assert low < median < high, name
        order = np.argsort(values[:, column])
        below = weight[order][values[order, column] < low].sum()
        assert below == pytest.approx(0.025, abs=0.02), name
        assert prior
        assert re.fullmatch(r"\d+ % left, (lower part|middle part|upper part|all over it)", left)
    assert "normal, 0.5 ± 0.1" in kept["rows"][2][5]
    assert "15 observed runs" in kept["said"]
    assert "held out" in json.dumps(kept["remarks"])
    assert "with CRSP (Pfeiffer & Bowen 1989) as it was set" in json.dumps(kept["remarks"])
    assert draw_panel(part) == kept["names"]
    again = analysed(scene)
    assert again["values"] == kept["values"], "the same seed"


def test_the_observed_runs_alone_stand_beside_the_verdict(part, scene) -> None:
    """As on the command line: no verdict without them, and without a statement the record is asked for."""
    said = {one["about"]: one["text"] for one in analysed(scene)["remarks"]}
    assert "the other observed runs alone" in said["fit"].lower()
    assert "It is not stated whether all falls were recorded" in said["completeness"]


def test_what_is_stated_of_the_record_goes_into_the_question_and_the_project(part, scene, tmp_path: Path) -> None:
    analysis = part("rockfall_addon.scene.back_analysis")
    settings = scene.rockfall_back_analysis
    assert analysis.ask(scene).completeness.text == ""
    for chosen, falls, text in (("COMPLETE", 0, "complete"), ("UNKNOWN", 0, "unknown"), ("LONGEST", 0, "longest"),
                                ("LONGEST", 60, "longest:60")):  # fmt: skip
        settings.completeness, settings.falls = chosen, falls
        assert analysis.ask(scene).completeness.text == text
    with pytest.raises(RuntimeError, match="not seen to its stop"):
        bpy.ops.rockfall.back_analyse()
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path)) == {"FINISHED"}
    assert 'completeness = "longest:60"' in (tmp_path / "project.toml").read_text(encoding="utf-8")
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "project.toml")) == {"FINISHED"}
    settings = bpy.context.scene.rockfall_back_analysis
    assert (settings.completeness, settings.falls) == ("LONGEST", 60)


def test_blocks_draw_from_it_when_they_are_told_to(part, scene) -> None:
    setup, posterior = part("rockfall_addon.scene.simulation_setup"), part("rockfall_addon.scene.posterior")
    kept = analysed(scene)
    assert setup.plan(scene).scenario.draws == {}
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert not setup.is_stale(scene)
    before = setup.plan(scene).scenario
    scene.rockfall_back_analysis.draw = True
    assert setup.is_stale(scene), "other blocks would fall now"
    drawn = setup.plan(scene).scenario.draws
    assert list(drawn) == [MODEL]
    np.testing.assert_array_equal(drawn[MODEL].values, kept["values"])
    assert {one.model: one.draws is not None for one in setup.plan(scene).scenario.settings} == {
        MODEL: True,
        "noel_2017": False,
    }
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert any("Each block drew its" in str(remark) for remark in setup.remarks(scene))
    assert not setup.is_stale(scene)
    scene.rockfall_simulation.models = {"noel_2017"}
    assert posterior.in_use(scene, {"noel_2017"}) is None
    assert before.draws == {}


def test_it_goes_with_the_project_and_comes_back(part, scene, tmp_path: Path) -> None:
    kept = analysed(scene)
    scene.rockfall_back_analysis.draw = True
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path)) == {"FINISHED"}
    text = (tmp_path / "posterior.csv").read_text()
    assert text.splitlines()[0].split(",")[:2] == ["model", "weight"]
    rows = np.array([line.split(",")[1:] for line in text.splitlines()[1:]], dtype=float)
    np.testing.assert_array_equal(rows[:, 1:], kept["values"])
    project = part("core.exchange.project").read_project(tmp_path / "project.toml")
    scenario, inputs = part("core.workflow.scenarios").open_simulation(project, tmp_path / "project.toml")
    np.testing.assert_array_equal(scenario.draws[MODEL].values, kept["values"])
    assert inputs["posterior"] == tmp_path / "posterior.csv"
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "project.toml")) == {"FINISHED"}
    scene = bpy.context.scene
    found = part("rockfall_addon.scene.posterior").kept_of(scene)
    np.testing.assert_array_equal(found.draws.values, kept["values"])
    assert scene.rockfall_back_analysis.draw
    assert [row.median for row in found.rows] == pytest.approx([row[2] for row in kept["rows"]], rel=0.02)
    assert not part("rockfall_addon.scene.back_analysis").is_stale(scene, found), "nobody knows what it was of"


def test_it_is_old_when_the_picks_have_changed(part, scene) -> None:
    analysis, posterior = part("rockfall_addon.scene.back_analysis"), part("rockfall_addon.scene.posterior")
    analysed(scene)
    assert not analysis.is_stale(scene, posterior.kept_of(scene))
    scene.rockfall_back_analysis.names = f"{MODEL}.rn"
    scene.rockfall_back_analysis.model = "stevens_1998"
    assert not analysis.is_stale(scene, posterior.kept_of(scene)), "another question changes no answer"
    scene.rockfall_simulation.rolling = "coulomb"
    assert analysis.is_stale(scene, posterior.kept_of(scene))
    scene.rockfall_simulation.rolling = "azzoni_1995"
    pick = next(obj for obj in scene.objects if obj.get("rockfall_role") == "pick")
    pick.location.x += 0.3
    part("rockfall_addon.scene.sync").recompute(scene)
    assert analysis.is_stale(scene, posterior.kept_of(scene))


@pytest.fixture
def seen(part, scene, tmp_path: Path) -> tuple[Path, Path]:
    """Blocks that fell down the demo's slope with known parameters: their releases, their stops."""
    release = next(line.split(",") for line in (DEMO / "picks.csv").read_text().splitlines() if ",release," in line)
    x, y = float(release[2]), float(release[3])
    table, stops = tmp_path / "releases.csv", tmp_path / "stops.csv"
    rows = [f"b{i},{x + 0.3 * i:.3f},{y:.3f}" for i in range(6)]
    table.write_text("\n".join(["release,x_m,y_m", *rows]) + "\n")
    fall = ["simulate", str(table), "--terrain", str(DEMO / "terrain.ply"), "--model", MODEL, "--friction", "0.4"]
    assert (
        part("core.cli").main([*fall, "--set", f"{MODEL}.rn=0.35", "--seed", "5", "--out", str(tmp_path / "runs")]) == 0
    )
    with (tmp_path / "runs" / "runs.csv").open() as file:
        ends = [
            f"{run['release']},{run['x_m']},{run['y_m']}" for run in csv.DictReader(file) if run["end"] == "stopped"
        ]
    stops.write_text("\n".join(["release,x_m,y_m", *ends]) + "\n")
    return table, stops


def test_stops_of_a_table_say_the_same_as_on_the_command_line(part, scene, seen, tmp_path: Path) -> None:
    analysis, posterior = part("rockfall_addon.scene.back_analysis"), part("rockfall_addon.scene.posterior")
    table, stops = seen
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.import_terrain(filepath=str(DEMO / "terrain.ply")) == {"FINISHED"}
    scene = bpy.context.scene
    settings = ask_little(scene)
    settings.source, settings.releases, settings.stops = {"STOPS"}, str(table), str(stops)
    kept = analysed(scene)
    n = len(stops.read_text().splitlines()) - 1
    assert n >= 4
    assert f"{n} observed runs" in kept["said"]
    asked = ["back-analyse", str(table), "--stops", str(stops), "--terrain", str(DEMO / "terrain.ply"),
             "--model", MODEL,
             "--fit", "rn", "rt", "friction", "--prior", "rn=0.2..0.6", "friction=normal:0.5,0.1", "--sets", "150",
             "--rounds", "1", "--tables-only", "--out", str(tmp_path / "out")]  # fmt: skip
    assert part("core.cli").main(asked) == 0
    told = json.loads((tmp_path / "out" / "back_analysis.json").read_text())
    assert len(told["observed_runs"]) == n
    for row, one in zip(kept["rows"], told["estimates"], strict=True):
        # Blender's vertices are in single precision: runs differ, what they say hardly.
        assert row[:1] == [one["name"]]
        assert row[2] == pytest.approx(one["median"], abs=0.4 * (one["high"] - one["low"]))
        assert row[5] == one["prior"]
    settings.source = {"SCENE"}
    assert not analysis.is_stale(scene, posterior.kept_of(scene)), "another question changes no answer"
    lines = stops.read_text().splitlines()
    stops.write_text("\n".join(lines[:-1]) + "\n")
    assert analysis.is_stale(scene, posterior.kept_of(scene))


def test_picks_of_a_table(part, scene) -> None:
    del scene["rockfall_blocks"]  # a table says nothing of the blocks
    of_scene = analysed(scene)
    for obj in [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]:
        bpy.data.objects.remove(obj)
    settings = scene.rockfall_back_analysis
    assert not bpy.ops.rockfall.back_analyse.poll()
    settings.source, settings.picks = {"PICKS"}, str(DEMO / "picks.csv")
    assert "15 observed runs" in of_scene["said"]
    assert analysed(scene)["values"] == of_scene["values"]


@pytest.mark.parametrize(
    ("source", "rows", "told"),
    [
        ("PICKS", "trajectory,time_s,x_m,y_m,z_m,kind\nA,0,1e300,0,0,release\n", "1e"),
        ("PICKS", "hello\n", r"bad\.csv"),
        ("STOPS", "release,x_m,y_m\nb9,0,0\n", "There is no release 'b9'"),
    ],
)
def test_bad_tables_are_named(scene, seen, tmp_path: Path, source: str, rows: str, told: str) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text(rows)
    settings = scene.rockfall_back_analysis
    settings.source, settings.picks, settings.releases, settings.stops = {source}, str(bad), str(seen[0]), str(bad)
    with pytest.raises(RuntimeError, match=told):
        bpy.ops.rockfall.back_analyse()
    settings.picks = settings.stops = str(tmp_path / "gone.csv")
    with pytest.raises(RuntimeError, match=r"gone\.csv"):
        bpy.ops.rockfall.back_analyse()
    settings.picks = settings.stops = ""
    with pytest.raises(RuntimeError, match="Choose the table"):
        bpy.ops.rockfall.back_analyse()
    assert KEY not in scene


def test_the_scene_and_tables_together_with_sections_of_ones_own(part, scene, seen, monkeypatch) -> None:
    analysis, posterior = part("rockfall_addon.scene.back_analysis"), part("rockfall_addon.scene.posterior")
    settings, asked = scene.rockfall_back_analysis, []
    real = part("core.workflow.back_analysis").back_analyse
    monkeypatch.setattr(analysis, "back_analyse", lambda *given, **how: asked.append(given) or real(*given, **how))
    settings.source, settings.releases, settings.stops = {"SCENE", "STOPS"}, str(seen[0]), str(seen[1])
    picks = [obj for obj in scene.objects if obj.get("rockfall_role") == "pick"]
    x, y, z = np.mean([obj.location for obj in picks], axis=0)
    ends = [np.array([x, y - 20, z]), np.array([x, y + 20, z])]
    screen = part("rockfall_addon.scene.screens").make(scene, ends, "Road")
    top = max(obj.location.z for obj in picks) + part("rockfall_addon.scene.georeference").read_shift(scene).z
    settings.contours, settings.drops, settings.at_screens = f"{top - 6:.1f}", "4, 8", True
    kept = analysed(scene)
    n = len(seen[1].read_text().splitlines()) - 1
    assert f"{15 + n} observed runs of this scene and releases.csv" in kept["said"]
    _, observed, _, _, _, sections = asked[0]
    assert len(observed.paths) == 15 + n
    assert [one.name for one in sections] == [
        f"{float(f'{top - 6:.1f}'):g} m",
        "4 m below the start",
        "8 m below the start",
        "Road",
    ]
    np.testing.assert_allclose(sections[3].line, [[x, y - 20], [x, y + 20]], atol=1e-3)
    settings.contours = ""
    assert not analysis.is_stale(scene, posterior.kept_of(scene)), "another question changes no answer"
    screen.data.vertices[0].co.x += 1.0
    assert analysis.is_stale(scene, posterior.kept_of(scene)), "the section is elsewhere now"


@pytest.mark.parametrize(
    ("contours", "drops", "told"),
    [("99999", "", "where there is no terrain"), ("", "-1", "A drop is -1 m"), ("high", "", "'high'")],
)
def test_bad_sections_are_named(scene, contours: str, drops: str, told: str) -> None:
    scene.rockfall_back_analysis.contours, scene.rockfall_back_analysis.drops = contours, drops
    with pytest.raises(RuntimeError, match=told):
        bpy.ops.rockfall.back_analyse()
    assert KEY not in scene


def test_medians_become_the_values(part, scene) -> None:
    kept = analysed(scene)
    scene.rockfall_back_analysis.draw = True
    assert bpy.ops.rockfall.use_medians() == {"FINISHED"}
    own = part("rockfall_addon.scene.models").parameters_of(scene)[MODEL]
    assert own["rn"] == pytest.approx(kept["rows"][0][2], rel=1e-3)
    assert scene.rockfall_simulation.friction == pytest.approx(kept["rows"][2][2], rel=1e-3)
    assert not scene.rockfall_back_analysis.draw
    assert bpy.ops.rockfall.remove_back_analysis() == {"FINISHED"}
    assert KEY not in scene
    assert not bpy.ops.rockfall.use_medians.poll()


def test_parameters_are_chosen_and_bad_laws_refused(part, scene) -> None:
    analysis = part("rockfall_addon.scene.back_analysis")
    assert analysis.fitted_names(scene, MODEL) == ("rn", "rt", "friction")
    assert bpy.ops.rockfall.choose_back_analysed(model=MODEL, parameter="rt") == {"FINISHED"}
    assert analysis.fitted_names(scene, MODEL) == ("rn", "friction")
    for law, told in (("rn", "no law"), ("rt = 0.2..0.6", "not fitted"), ("rn = 3..9", "no part of its range")):
        scene.rockfall_back_analysis.priors = law
        with pytest.raises(RuntimeError, match=told):
            bpy.ops.rockfall.back_analyse()
    assert KEY not in scene


@pytest.mark.parametrize(
    "change",
    [
        {"model": "newton"},
        {"values": [[0.1]]},
        {"weight": [-1.0]},
        {"rows": [["rn"]]},
        {"names": ["mass"]},
        {"observed": ["STOPS", "", 3, "", ""]},
    ],
)
def test_a_damaged_one_is_set_aside_and_named(part, scene, tmp_path: Path, change: dict) -> None:
    kept = {"model": MODEL, "names": ["rn"], "values": [[0.3], [0.4]], "weight": [0.5, 0.5], "rows": [], "said": "",
            "remarks": [], "print": ""}  # fmt: skip
    scene[KEY] = json.dumps(kept | change)
    scene.rockfall_back_analysis.draw = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"))
    scene = bpy.context.scene
    assert KEY not in scene
    said = [str(one) for one in part("rockfall_addon.scene.set_aside_words").grave(scene)]
    said += [str(one) for one in part("rockfall_addon.scene.problems").remarks(scene)] if not said else []
    assert any("analyse again" in sentence for sentence in said), said
    assert part("rockfall_addon.scene.simulation_setup").plan(scene).scenario.draws == {}


@pytest.mark.parametrize(
    "damage",
    [
        {"rows": [["rn", "", 0.3, None, 0.4, "", []]]},
        {"rows": [["rn", "", 0.3, 0.2, float("nan"), "", []]]},
        {"rows": [["rn", "", 0.3, 0.2, 0.4, 5, []]]},
        {"rows": [["rn", "", 0.3, 0.2, 0.4, "", [5]]]},
        {"rows": [["rn", "", 0.3, 0.2, 0.4, ""]]},
        {"remarks": 5},
        {"remarks": [{"said": "so"}]},
        {"observed": 5},
        {"observed": ["a", 5]},
        {"weight": [1e308, 1e308]},
        {"values": [[0.3], [float("nan")]]},
    ],
)
def test_what_is_kept_is_set_aside_where_it_cannot_be_shown(part, scene, damage) -> None:
    posterior, values = part("rockfall_addon.scene.posterior"), part("rockfall_addon.scene.stored_values")
    draws = part("core.simulation.parameter_draws").ParameterDraws(("rn",), np.array([[0.3], [0.35]]), np.ones(2))
    posterior.keep(scene, MODEL, draws)
    check, _ = values.OF_THE_SCENE[KEY]
    assert check(scene[KEY]) == ""
    assert posterior.kept_of(scene).rows[0].name == "rn"
    assert check(json.dumps(json.loads(scene[KEY]) | damage)) == "does not hold what it should"


def test_a_screen_that_is_no_line_any_more_stops_the_question_and_not_the_panel(part, scene) -> None:
    analysis, posterior = part("rockfall_addon.scene.back_analysis"), part("rockfall_addon.scene.posterior")
    middle = np.mean([obj.location for obj in scene.objects if obj.get("rockfall_role") == "pick"], axis=0)
    aside = np.array([0.0, 20.0, 0.0])
    line = [middle - aside, middle + aside]
    screen = part("rockfall_addon.scene.screens").make(scene, line, "Road")
    scene.rockfall_back_analysis.at_screens = True
    analysed(scene)
    assert not analysis.is_stale(scene, posterior.kept_of(scene))
    screen.data.clear_geometry()
    screen.data.from_pydata([(0.0, 0.0, 0.0)], [], [])
    assert analysis.is_stale(scene, posterior.kept_of(scene))
    assert "Road" in analysis.missing(scene)
    scene.rockfall_back_analysis.at_screens = False
    assert analysis.missing(scene) == ""
