# SPDX-License-Identifier: GPL-3.0-or-later
"""Design sheets: characteristic values and partial factors by hand, tables of factors, the page and its warnings."""

import json
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.partial_factors import open_factors, read_factors, shipped_names
from rockfall.core.exchange.project import read_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.design import KNOWN_TO, Factor, PartialFactors, design_values
from rockfall.core.hazard.screens import Screen, ScreenHits, hits_at
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.parameter_draws import ParameterDraws
from rockfall.core.simulation.release import Releases, make_releases
from rockfall.core.simulation.trees import random_trees
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.design_page import provenance, tables_of, write_design
from rockfall.core.workflow.design_sheet import DesignSheet, design_sheet, evidence_of
from rockfall.core.workflow.enough import in_chance_order
from rockfall.core.workflow.opening import open_project
from scipy.stats import binomtest

DEMO = Path(__file__).parents[2] / "assets" / "demo" / "project.toml"
LINE = np.array([[30.0, -90.0], [30.0, 90.0]])
NONE = PartialFactors("none", "", 0.95, 0.0, ())


def some_hits(n: int = 1000) -> ScreenHits:
    """Hits whose energy, speed and height are 1/n … 1 times 50 kJ, 20 m/s and 4 m, of blocks of 0.4 m radius."""
    part, zero = np.arange(1, n + 1) / n, np.zeros(n)
    return ScreenHits(
        zero.astype(np.int16), np.arange(1, n + 1), zero, np.zeros((n, 3)), np.column_stack([20 * part, zero, zero]),
        zero, 4 * part, np.full(n, 0.4), zero, 45e3 * part, 5e3 * part, zero.astype(np.int8), np.ones(n, np.bool_),
        np.arange(n),
    )  # fmt: skip


def test_characteristic_values_are_the_quantiles_and_factors_multiply_them() -> None:
    factors = PartialFactors(
        "ours", "", 0.95, 0.3,
        (Factor("a", "speed", 1.1), Factor("b", "mass", 1.2), Factor("c", "energy", 1.3), Factor("d", "height", 1.5),
         Factor("e", "height", 1.1), Factor("f", "capacity", 2.0)),
    )  # fmt: skip
    values = design_values(Screen("net", LINE), some_hits(), factors, 4000)
    assert values.energy_j.value == pytest.approx(0.95 * 50e3, rel=1e-3)
    assert values.speed_mps.value == pytest.approx(19.0, rel=1e-3)
    assert values.height_m.value == pytest.approx(3.8, rel=1e-3)
    upper = 0.964  # the 964th of the 1000: 963 is the 97.5 % value of how many are below the 95 % value
    assert values.design_speed_mps == pytest.approx(20 * upper * 1.1)
    assert values.design_energy_j == pytest.approx(upper * 50e3 * 1.2 * 1.1**2 * 1.3)
    assert values.translation_j.value == pytest.approx(0.95 * 45e3, rel=1e-3)
    assert values.needed_energy_j == pytest.approx(2 * values.design_energy_j)
    assert values.design_height_m == pytest.approx(4 * upper * 1.65)
    assert values.needed_height_m == pytest.approx(4 * upper * 1.65 + 0.4), "the radius is more than the clearance"
    assert (values.blocks, values.reach, values.hits) == (4000, 1000, 1000)
    assert (values.level, values.level_kj) == (1, 250.0)
    assert values.energy_j.low < values.energy_j.value < values.energy_j.high


def test_intervals_hold_the_true_quantile_in_95_of_100_draws() -> None:
    rng, held = np.random.default_rng(1), 0
    for _ in range(400):
        hits = some_hits(300)
        hits.kinetic_j[:], hits.rotational_j[:] = rng.exponential(1e4, 300), 0.0
        energy = design_values(Screen("net", LINE), hits, NONE, 300).energy_j
        held += energy.low <= 1e4 * np.log(20) <= energy.high
    assert 0.92 < held / 400 < 0.99


def test_the_same_run_again_and_again_is_no_sample() -> None:
    hits = some_hits(500)
    hits.kinetic_j[:], hits.rotational_j[:] = np.repeat([1e4, 2e4], 250), 0.0
    values = design_values(Screen("net", LINE), hits, NONE, 500)
    assert values.different == 2
    assert not values.is_sample
    assert not values.is_known


def test_a_barrier_is_enough_or_it_is_said_why_not() -> None:
    """The 95 % values are 47.5 kJ and 3.8 m, their upper ends 48.2 kJ and 3.856 m; the height has 0.4 m above it."""
    for height, capacity, faults in ((4.3, 50e3, 0), (4.23, 50e3, 1), (4.3, 48e3, 1), (1.0, 1e3, 2)):
        values = design_values(Screen("net", LINE, height, capacity), some_hits(), NONE, 1000)
        assert values.verdict == ("not_enough" if faults else "enough"), "of the upper end, which is known to 1.4 %"
        assert len(values.faults) == faults
    assert design_values(Screen("road", LINE), some_hits(), NONE, 1000).verdict is None


def test_ten_hits_are_no_evidence_and_it_is_said_how_many_blocks_would_be() -> None:
    values = design_values(Screen("net", LINE, 5.0, 100e3), some_hits(10), NONE, 15)
    assert values.verdict == "not_known"
    assert values.level is None
    assert not values.faults
    assert all(np.isnan([values.design_energy_j, values.needed_energy_j, values.needed_height_m]))
    assert values.more is not None
    least = binomtest(10, 15).proportion_ci(0.9, method="exact").low
    assert values.more.blocks == np.ceil((72 - 10) / least), "of 15 blocks 10 come, it may be 42 % of all"
    # what even the lower end asks for is missing: that is known without an upper one
    assert design_values(Screen("net", LINE, 5.0, 1e3), some_hits(10), NONE, 15).verdict == "not_enough"


def test_a_verdict_that_is_near_takes_more_blocks_until_it_is_known() -> None:
    """150 hits: the energy is 47.5 kJ with an interval that is wider than 5 % of it."""
    hits = some_hits(150)
    hits.kinetic_j[:] = 45e3 * np.linspace(0, 1, 150) ** 3
    values = design_values(Screen("net", LINE, 9.0, 45e3), hits, NONE, 300)
    assert values.energy_j.low < 45e3 < values.energy_j.high
    assert values.energy_j.known_to > KNOWN_TO
    assert values.verdict == "not_known"
    assert values.more is not None
    assert 0 < values.more.blocks < 20_000


def test_blocks_of_few_places_are_worth_few_and_more_of_them_do_not_tell() -> None:
    """Ten places, each with hits that are alike: a thousand hits are no more than ten."""
    rng, hits = np.random.default_rng(5), some_hits(1000)
    hits.place[:] = np.repeat(np.arange(10), 100)
    hits.kinetic_j[:], hits.rotational_j[:] = np.repeat(rng.permutation(10) * 5e3, 100) + rng.uniform(0, 9, 1000), 0.0
    values = design_values(Screen("net", LINE, 9.0, 1e6), hits, NONE, 1500, released_from=15)
    assert values.energy_j.effective < 15
    assert values.verdict == "not_known"
    assert values.more is not None
    assert values.more.elsewhere
    hits.place[:] = np.arange(1000)
    assert design_values(Screen("net", LINE, 9.0, 1e6), hits, NONE, 1500).verdict == "enough"


def test_a_block_that_passes_again_is_one_observation_with_its_greatest_values() -> None:
    hits = some_hits(200)
    hits.number[:] = np.repeat(np.arange(1, 101), 2)
    values = design_values(Screen("net", LINE), hits, NONE, 400)
    assert (values.reach, values.hits, values.energy_j.count) == (100, 200, 100)
    assert values.energy_j.value == pytest.approx(np.quantile(50e3 * np.arange(2, 201, 2) / 200, 0.95))


def test_the_shipped_tables_can_be_read_and_say_their_sources() -> None:
    assert {"none", "uni_11211_4_back_analysis", "uni_11211_4_literature", "onr_24810"} == set(shipped_names())
    for name in shipped_names():
        assert all(factor.source and factor.meaning for factor in open_factors(name).factors)
    measured, literature = (open_factors(f"uni_11211_4_{which}") for which in ("back_analysis", "literature"))
    # a back-analysis is worth 1.02/1.10 in the speed, and its square in the energy
    assert literature.product("speed") / measured.product("speed") == pytest.approx(1.10 / 1.02)
    for name, edition in (("uni_11211_4_back_analysis", "UNI 11211-4:2018"), ("onr_24810", "ONR 24810:2021")):
        assert edition in open_factors(name).title
    unverified = [(one.symbol, one.value) for one in literature.unverified("energy", "capacity")]
    assert unverified == [("γ_R", 1.2), ("γ_E", 1.2)]
    assert not literature.unverified("speed", "mass", "height")
    with pytest.raises(InputError, match="γ_E,kin of ONR 24810:2021 has no value"):
        open_factors("onr_24810").product("energy")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[factor]]\nsymbol = "a"\non = "sped"\nvalue = 1.1', "sped"),
        ('[[factor]]\nsymbol = "a"\nvalue = 1.1', "on is missing"),
        ('[[factor]]\nsymbol = "a"\non = "speed"\nvalue = -1.1', "value"),
        ("share = 1.5", "share"),
        ("shares = 0.95", "shares"),
    ],
)
def test_a_wrong_table_of_factors_is_refused(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says):
        read_factors(tmp_path / "own.toml")


def test_a_table_that_is_not_there_names_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean uni_11211_4_literature"):
        open_factors("uni_11211_4_litterature")


@pytest.fixture(scope="module")
def ground() -> Ground:
    x, y = (values.ravel() for values in np.meshgrid(np.linspace(-20, 150, 60), np.linspace(-90, 90, 50)))
    z = -0.8 * np.clip(x, -20, 60) - 0.2 * np.clip(x - 60, 0, None) + 0.3 * np.sin(x / 3) * np.cos(y / 4)
    i = np.arange(50 * 60).reshape(50, 60)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1)
    faces = corners.reshape(-1, 3).astype(np.int32)
    return make_ground(Surface(np.column_stack([x, y, z]), faces, GlobalShift(), "slope"))


@pytest.fixture(scope="module")
def releases() -> Releases:
    rng = np.random.default_rng(7)
    places = np.column_stack([rng.uniform(-10, 0, 400), rng.uniform(-60, 60, 400), np.full(400, 12.0)])
    return make_releases(places, diameter_m=rng.uniform(0.3, 0.6, 400))


@pytest.fixture(scope="module")
def sheet(ground: Ground, releases: Releases) -> DesignSheet:
    screens = (Screen("net", LINE, 1.0, 4e3), Screen("road", LINE + np.array([25.0, 0.0])))
    return design_sheet(ground, releases, [Settings("noel_2017", seed=3)], screens, NONE, title="A & B <slope>")


def test_what_comes_behind_a_barrier_is_what_it_does_not_hold(sheet: DesignSheet) -> None:
    model = sheet.models[0]
    net, road = model.tally.figures(with_barriers=True)
    assert model.values["road"].hits == road.hits < model.tally.figures()[1].hits
    assert model.values["net"].hits == net.hits


def test_bad_news_comes_first(sheet: DesignSheet) -> None:
    assert sheet.remarks[0].severity == "problem"
    assert "net is not enough" in sheet.remarks[0].text
    assert any("taken on trust" in remark.text for remark in sheet.remarks), "nothing was measured here"


def test_the_page_the_pdf_and_the_numbers_say_the_same(sheet: DesignSheet, tmp_path: Path) -> None:
    (tmp_path / "slope.ply").write_bytes(b"slope")
    written = write_design(sheet, tmp_path, {"terrain": tmp_path / "slope.ply"})
    assert written == ["design.html", "design.pdf", "design.json"]
    html = (tmp_path / "design.html").read_text(encoding="utf-8")
    assert "A &amp; B &lt;slope&gt;" in html
    assert html.count("<img ") == 4  # plan, profile, two screens
    assert "http://" not in html
    assert "https://" not in html
    found = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))
    net = found["models"]["noel_2017"]["net"]
    assert f"<td>{net['needed_energy_j'] / 1000:.3g}</td>" in html
    assert net["verdict"] == "not_enough"
    assert found["models"]["noel_2017"]["road"]["verdict"] is None, "no barrier stands there"
    assert '<li class="not_enough">net is not enough' in html
    assert 'class="enough"' not in html
    assert "fb1acd44962209a65826621210c03c0a72e392169f52c2f208efbf3f272f09a2" in html
    assert (tmp_path / "design.pdf").read_bytes().startswith(b"%PDF")


def test_a_sheet_that_counts_on_trees_says_so(ground: Ground, releases: Releases, tmp_path: Path) -> None:
    forest = random_trees(ground.terrain, 100.0, 0.3, 0.1, seed=2)
    settings = Settings("noel_2017", seed=3, trees=forest)
    found = design_sheet(ground, releases, [settings], [Screen("road", LINE)], NONE)
    assert any(f"count on {len(forest)} trees" in remark.text for remark in found.remarks)
    write_design(found, tmp_path, {})
    said = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))["provenance"]["Trees"]
    assert said.startswith(f"{len(forest)}. Energy: Dorren and Berger (2006)")


def test_it_ends_when_the_values_are_known(ground: Ground, releases: Releases, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rockfall.core.workflow.enough.KNOWN_TO", 10.0)
    monkeypatch.setattr("rockfall.core.workflow.hazard.ROUND", 100)
    found = design_sheet(
        ground, releases, [Settings("noel_2017", seed=3)], [Screen("net", LINE)], NONE, until_known=True
    )
    assert 100 <= found.models[0].counted.blocks < 400


def test_a_page_with_too_few_hits_has_no_green_no_class_and_no_design_value(
    ground: Ground, releases: Releases, tmp_path: Path
) -> None:
    strong = Screen("net", LINE, 50.0, 1e9)
    few = design_sheet(ground, releases.take(slice(0, 30)), [Settings("noel_2017", seed=3)], [strong], NONE)
    write_design(few, tmp_path, {}, pdf=False, drawn=False)
    html = (tmp_path / "design.html").read_text(encoding="utf-8")
    assert '<li class="not_known">Whether net is enough is not known yet' in html
    assert 'class="enough"' not in html
    assert "MEL" not in html.partition("</tbody>")[0]
    found = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))["models"]["noel_2017"]["net"]
    assert (found["verdict"], found["level"], found["needed_energy_j"]) == ("not_known", None, None)
    assert found["more_blocks"] > 30
    many = design_sheet(ground, releases, [Settings("noel_2017", seed=3)], [strong], NONE)
    write_design(many, tmp_path, {}, pdf=False, drawn=False)
    html = (tmp_path / "design.html").read_text(encoding="utf-8")
    first = html[html.index('<li class="enough">') :]
    assert first.index("of 400 blocks come to net") < first.index("net is enough"), "the evidence before the good news"


def test_factors_that_are_not_verified_stand_beside_each_number(ground: Ground, releases: Releases) -> None:
    factors = open_factors("uni_11211_4_literature")
    sheet = design_sheet(ground, releases, [Settings("noel_2017", seed=3)], [Screen("net", LINE, 9.0, 1e6)], factors)
    table = next(tables_of(sheet))
    cells = dict(zip(table.head, table.rows[0], strict=True))
    assert [cells[name].endswith("‡") for name in ("design [kJ]", "needed [kJ]", "class")] == [True] * 3
    assert "‡: with factors that are not verified against the standard, γ_R = 1.2, γ_E = 1.2" in table.note
    assert any("γ_R = 1.2, γ_E = 1.2, together × 1.44" in remark.text for remark in sheet.remarks)


@pytest.mark.parametrize("until_known", [False, True])
def test_each_drawn_path_is_the_counted_run_of_its_number(
    ground: Ground, releases: Releases, until_known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rockfall.core.workflow.design_sheet.DRAWN", 40)
    monkeypatch.setattr("rockfall.core.workflow.enough.KNOWN_TO", 10.0)
    monkeypatch.setattr("rockfall.core.workflow.hazard.ROUND", 150)
    settings = Settings("noel_2017", seed=3)
    sheet = design_sheet(ground, releases, [settings], [Screen("net", LINE)], NONE, until_known=until_known)
    model = sheet.models[0]
    fallen = in_chance_order(releases, 3) if until_known else releases
    every = simulate(ground, fallen.take(slice(0, model.counted.blocks)), settings)
    assert len(model.drawn) == 40
    assert (model.counted.blocks < 400) is until_known
    own = every.place_of(model.drawn.number)
    for name in ("position", "time_s", "length_m", "v_max_mps", "end", "impacts"):
        np.testing.assert_array_equal(getattr(model.drawn, name), getattr(every, name)[own], err_msg=name)
    rows = [np.flatnonzero(every.records.run == run) for run in own]
    np.testing.assert_array_equal(model.drawn.records.position, every.records.position[np.concatenate(rows)])
    hits, ours = model.tally.hits, hits_at(model.drawn, sheet.screens)
    counted = {(number, time) for number, time in zip(hits.number.tolist(), hits.time_s.tolist(), strict=True)}
    assert {(number, time) for number, time in zip(ours.number.tolist(), ours.time_s.tolist(), strict=True)} <= counted


def test_a_screen_that_no_block_comes_to_is_refused(ground: Ground, releases: Releases) -> None:
    above = Screen("above", np.array([[-15.0, -80.0], [-15.0, 80.0]]))
    with pytest.raises(InputError, match="None of 400 blocks"):
        design_sheet(ground, releases, [Settings("noel_2017")], [above], NONE)


def test_a_sheet_tells_what_its_blocks_drew_and_what_was_thought_before(
    ground: Ground, releases: Releases, tmp_path: Path
) -> None:
    values = np.column_stack([np.linspace(0.2, 0.4, 41), np.linspace(0.5, 0.7, 41)])
    for before, told in ((("even in 0…1: 20 % left, lower part",) * 2, "20 % left"), ((), "not known")):
        draws = ParameterDraws(("rn", "friction"), values, np.ones(41), before=before)
        made = design_sheet(ground, releases, [Settings("stevens_1998", draws=draws)], [Screen("road", LINE)], NONE)
        table = next(one for one in tables_of(made) if one.title.startswith("Parameters"))
        assert [row[1:3] for row in table.rows] == [("rn", "0.3"), ("friction", "0.6")]
        ends = [float(end) for row in table.rows for end in row[3].split(" to ")]
        assert ends == pytest.approx([0.205, 0.395, 0.505, 0.695], abs=0.003)
        assert all(told in row[4] for row in table.rows)
        facts = provenance(made, {})
        said = next(text for name, text in facts.items() if name.startswith("Parameters"))
        assert "rn = drawn by each block" in said
        assert "rt = 0.85" in said
        assert "drawn by each block" in facts["Rolling, friction"]


def test_the_evidence_is_of_the_parameters_that_blocks_drew() -> None:
    """As of a model that was set to the mean of the draws, and not to its defaults."""
    _, measured = open_project(read_project(DEMO))
    draws = ParameterDraws(("rn", "friction"), np.array([[0.5, 0.3], [0.7, 0.9]]), np.array([1.0, 3.0]))
    drawn, same, default = (
        evidence_of(measured.impacts, settings, holdout=False)
        for settings in (
            Settings("stevens_1998", draws=draws), Settings("stevens_1998", {"rn": 0.65}), Settings("stevens_1998"),
        )
    )  # fmt: skip
    assert drawn is not None
    assert same is not None
    assert default is not None
    rmse = [[score.rmse for score in one.scores] for one in (drawn, same, default)]
    assert rmse[0] == pytest.approx(rmse[1])
    assert rmse[0] != pytest.approx(rmse[2], rel=0.01)
