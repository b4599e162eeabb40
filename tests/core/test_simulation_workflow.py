# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenarios: several models from the same releases, a cancel that keeps what is finished, and what is said of it."""

from functools import partial

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.memory import available_bytes
from rockfall.core.progress import CancelledError
from rockfall.core.simulation import engine, memory
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.simulation.zones import Zones
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.simulation import Scenario, ground_of, remarks_of, run_models, run_scenario

MODELS = {"noel_2017": {}, "azimi_desvarreux_1977": {"rn": 0.3}}


def sheet(slope: float = -0.6, bump: float = 0.2) -> Surface:
    line = np.arange(0.0, 81.0, 2.0)
    x, y = np.meshgrid(line, line)
    z = slope * np.minimum(x, 50) + bump * np.sin(x) * np.cos(y)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "sheet")


def drops(ground: Ground, number: int = 200) -> Releases:
    places = np.column_stack([np.full(number, 6.0), np.linspace(20, 60, number), np.full(number, 1.0)])
    return make_releases(places, diameter_m=0.4)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return Scenario(sheet(), drops, MODELS, seed=7)


def test_a_scenario_is_each_of_its_models_alone(scenario: Scenario) -> None:
    together = run_scenario(scenario)
    ground = make_ground(scenario.terrain)
    for simulation, (name, parameters) in zip(together, MODELS.items(), strict=True):
        alone = simulate(ground, drops(ground), Settings(name, parameters, seed=7))
        np.testing.assert_array_equal(simulation.position, alone.position)
        np.testing.assert_array_equal(simulation.records.time_s, alone.records.time_s)


def test_zones_of_a_scenario_reach_their_models() -> None:
    flat = sheet(0.0, 0.0)
    beyond = (flat.vertices[flat.faces].mean(axis=1)[:, 1] > 40).astype(np.int32)
    zones = Zones(("rock", "soil"), beyond, {"soil": {"azimi_desvarreux_1977": {"rn": 0.2}}}, {"soil": 0.9})
    places = np.array([[40.0, 20.0, 5.0], [40.0, 60.0, 5.0]])
    models = {"azimi_desvarreux_1977": {"rn": 0.5, "rt": 1.0}, "noel_2017": {}}
    scenario = Scenario(flat, lambda ground: make_releases(places), models, zones=zones)
    first, other = scenario.settings
    assert first.zones == {"soil": {"rn": 0.2}}
    assert other.zones == {"soil": {}} or other.zones == {}
    assert first.zone_friction == {"soil": 0.9}
    records = run_scenario(scenario)[0].records
    for run, rn in ((0, 0.5), (1, 0.2)):
        hit = np.flatnonzero((records.run == run) & (records.what == 1))[0]
        assert -records.v2[hit, 2] / records.v1[hit, 2] == pytest.approx(rn, rel=1e-9)


def stop(text: str, done: int = 0, total: int = 0, *, after: int) -> None:
    assert total == 400
    if done >= after:
        raise CancelledError


def test_a_cancel_keeps_finished_models_and_finished_runs_and_says_so(scenario: Scenario) -> None:
    ground = ground_of(scenario)
    releases = drops(ground)
    whole = run_models(ground, releases, scenario.settings)
    cut = run_models(ground, releases, scenario.settings, threads=1, progress=partial(stop, after=264))
    n = len(cut[1])
    assert len(cut[0]) == 200
    assert 64 <= n < 200
    np.testing.assert_array_equal(cut[1].position, whole[1].position[:n])
    remark = remarks_of(cut, list(MODELS))[0]
    assert (remark.severity, remark.about) == ("warning", "cancelled")
    assert remark.text == f"Stopped by you: {n} of 200 blocks with Azimi & Desvarreux 1977 are finished and kept."
    first = run_models(ground, releases, scenario.settings, threads=1, progress=partial(stop, after=64))
    assert remarks_of(first, list(MODELS))[0].text == (
        f"Stopped by you: {len(first[0])} of 200 blocks with Noël et al. 2017 are finished and kept; "
        "not begun: Azimi & Desvarreux 1977."
    )
    between = run_models(ground, releases, scenario.settings, threads=1, progress=partial(stop, after=200))
    assert remarks_of(between, list(MODELS))[0].text == "Stopped by you: not begun: Azimi & Desvarreux 1977."
    assert not any(remark.about == "cancelled" for remark in remarks_of(whole, list(MODELS)))
    with pytest.raises(CancelledError):
        run_models(ground, releases, scenario.settings, progress=partial(stop, after=0))


def test_blocks_that_were_cut_off_are_said_first(scenario: Scenario) -> None:
    ground = ground_of(scenario)
    simulation = run_models(ground, drops(ground), [Settings("noel_2017", most_impacts=1)])
    first, *others = remarks_of(simulation)
    second = next(one for one in others if one.about == "noel_2017")
    assert first.severity == "warning"
    assert "200 of 200 blocks with Noël et al. 2017 were cut off at the limit" in first.text
    assert "200 blocks with Noël et al. 2017, 200 impacts: 200 were cut off" in second.text


def test_blocks_that_stay_where_they_are_released_are_said() -> None:
    ground = make_ground(sheet())
    xy = np.array([[10.0, 10.0], [20.0, 20.0], [30.0, 30.0]])
    place = np.column_stack([xy, placed_on(ground, xy, np.full(3, 0.5))[:, 2]])
    settings = [Settings("noel_2017", rolling="coulomb", friction=2.0)]
    still = make_releases(place, diameter_m=0.5)
    first, *_ = remarks_of(run_models(ground, still, settings))
    assert first.severity == "warning"
    assert first.text.startswith("3 of 3 blocks with Noël et al. 2017 stopped within their own diameter")
    one = make_releases(place, velocity=np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]]), diameter_m=0.5)
    said = [remark for remark in remarks_of(run_models(ground, one, settings)) if "own diameter" in remark.text]
    assert [remark.text[:6] for remark in said] == ["1 of 3"]
    assert said[0].severity == "note"


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ([], "no model"),
        ([Settings("noel_2017"), Settings("noel_2017")], "noel_2017 is given twice"),
        ([Settings("noel_2017"), Settings("noel_2018")], "no impact model 'noel_2018'"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_falls(settings, problem: str) -> None:
    ground = make_ground(sheet())
    with pytest.raises(InputError, match=problem):
        run_models(ground, drops(ground), settings, progress=partial(stop, after=-1))


def test_runs_computed_in_parts_are_those_computed_together(scenario: Scenario) -> None:
    ground = ground_of(scenario)
    releases = drops(ground)
    settings = Settings("stevens_1998", seed=5)
    whole = simulate(ground, releases, settings)
    for start, stop, threads in ((0, 50, 1), (50, 100, 2), (100, 200, 7)):
        part = simulate(ground, releases.take(slice(start, stop)), settings, first_run=start, threads=threads)
        cut = whole.part(start, stop)
        assert part.number.tolist() == cut.number.tolist() == list(range(start + 1, stop + 1))
        for name in ("end", "time_s", "length_m", "v_max_mps", "impacts", "position"):
            np.testing.assert_array_equal(getattr(part, name), getattr(cut, name))
        for name in ("run", "what", "time_s", "position", "v2", "omega2", "v1", "omega1", "normal", "face"):
            np.testing.assert_array_equal(getattr(part.records, name), getattr(cut.records, name))


def test_memory_that_is_not_there_is_said_with_what_is_needed(
    scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "available_bytes", lambda: 3_000_000_000)
    memory.check_blocks(3_000_000)
    with pytest.raises(InputError, match=r"4000000 blocks .* need 4.0 GB .* 3.0 GB are there"):
        memory.check_blocks(4_000_000)
    ground = ground_of(scenario)
    monkeypatch.setattr(engine, "ENOUGH", 64)
    monkeypatch.setattr(engine, "available_bytes", lambda: 1_000_000)
    done = []
    with pytest.raises(InputError, match="The motion of 2000 blocks does not fit into the memory"):
        simulate(ground, drops(ground, 2000), scenario.settings[0], threads=1, progress=lambda *told: done.append(told))
    assert len(done) < 10
    whole = simulate(ground, drops(ground, 500), scenario.settings[0], record="ends")
    assert len(whole) == 500
    kept = sum(getattr(whole.records, name).nbytes for name in whole.records.__dataclass_fields__)
    assert 2 * 64 < kept / len(whole.records) < memory.RECORD_BYTES


def test_the_memory_that_is_there_is_known() -> None:
    assert 1e8 < available_bytes() < 1e14
