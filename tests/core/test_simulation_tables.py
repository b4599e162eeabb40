# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off a simulation: hits of structures, who holds a block, and the tables' numbers."""

import csv
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.exchange import simulation_parts
from rockfall.core.exchange.decimal_tables import Words, write_decimal_table
from rockfall.core.exchange.simulated_motion import write_simulated_impacts, write_simulated_trajectories
from rockfall.core.exchange.tables import read_impacts, write_impacts, write_trajectories
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.convergence import convergence
from rockfall.core.simulation.engine import ENDED, IMPACT, RELEASED, Records, Settings, Simulation, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.hits import hits_of
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.results import impacts_of, sample_runs
from rockfall.core.simulation.structures import structure_frame
from rockfall.core.terrain.surface import Surface

G = 9.81
LOCAL = GlobalShift()
AZIMI = "azimi_desvarreux_1977"


def plane(slope: float = 0.0) -> Surface:
    """120 m × 120 m, falling towards the east."""
    vertices = np.array([[x, y, -slope * x] for y in (0.0, 120.0) for x in (0.0, 120.0)])
    return Surface(vertices, np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane")


def wall(
    start: tuple[float, float], end: tuple[float, float], low: float, high: float, shift: GlobalShift = LOCAL
) -> Surface:
    """Upright, of panels that become narrower: nothing may depend on how it is divided."""
    parts = 5
    share = 1 - (1 - np.linspace(0, 1, parts + 1)) ** 2
    foot = np.array(start) + share[:, None] * (np.array(end) - np.array(start))
    vertices = np.concatenate([np.column_stack([foot, np.full(parts + 1, z)]) for z in (low, high)])
    i = np.arange(parts)
    faces = np.concatenate([np.stack([i, i + 1, i + parts + 2], 1), np.stack([i, i + parts + 2, i + parts + 1], 1)])
    return Surface(vertices, faces.astype(np.int32), shift, "wall")


@pytest.mark.parametrize(
    ("start", "end", "western"),
    [((50, 40), (80, 70), (50, 40)), ((80, 70), (50, 40), (50, 40)), ((60, 90), (60, 30), (60, 30))],
)
def test_places_along_a_wall_count_from_its_western_or_southern_end(start, end, western) -> None:
    ground = make_ground(plane(), {"wall": wall(start, end, -1.0, 3.0)})
    frame = structure_frame(ground, 0)
    length = np.hypot(end[0] - start[0], end[1] - start[1])
    other = end if western == start else start
    ends = np.array([[*western, 7.0], [*other, -2.0]])
    np.testing.assert_allclose(frame.along_m(ends), [0.0, length], atol=1e-9)
    np.testing.assert_allclose(frame.across_m(ends), 0.0, atol=1e-9)
    assert frame.across_m(np.array([[western[0] - 1.0, western[1] + 1.0, 0.0]]))[0] > 0


def test_hits_of_an_oblique_wall_are_where_the_parabola_meets_it() -> None:
    """Blocks thrown level at a wall at 45°, at right angles to it: place, height and speed in closed form."""
    ground = make_ground(plane(0.1), {"wall": wall((50, 40), (80, 70), -20.0, 10.0)})
    normal = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    along = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    radius, speed, away = 0.25, 30.0, 4.0
    places = np.array([1.0, 13.0, 40.0])
    foot = np.array([50.0, 40.0, 0.0]) + places[:, None] * along
    start = foot + away * normal + [0.0, 0.0, 3.0]
    releases = make_releases(start, velocity=np.tile(-speed * normal, (3, 1)), diameter_m=2 * radius)
    simulation = simulate(ground, releases, Settings(AZIMI, {"rn": 0.3, "rt": 0.8}))
    hits = hits_of(simulation)
    first = np.array([np.flatnonzero(simulation.records.run[hits.record] == run)[0] for run in range(3)])
    t = (away - radius) / speed
    np.testing.assert_allclose(simulation.records.time_s[hits.record[first]], t, atol=1e-6)
    np.testing.assert_allclose(hits.along_m[first], places, atol=1e-6)
    z = 3.0 - G / 2 * t**2
    np.testing.assert_allclose(hits.up_m[first], z + 0.1 * foot[:, 0], atol=1e-6)
    np.testing.assert_allclose(np.tan(hits.angle[first]), G * t / speed, rtol=1e-6)
    np.testing.assert_allclose(hits.kinetic_j[first], 0.5 * releases.mass_kg * (speed**2 + (G * t) ** 2), rtol=1e-9)
    assert not hits.passes.any()


def thrown_at(ground: Ground, heights: list[float]) -> Simulation:
    start = np.column_stack([np.full(len(heights), 50.0), np.full(len(heights), 60.0), heights])
    velocity = np.tile([25.0, 0.0, 0.0], (len(heights), 1))
    releases = make_releases(start, velocity=velocity, diameter_m=0.6)
    return simulate(ground, releases, Settings(AZIMI, {"rn": 0.3, "rt": 0.9}))


def test_a_block_passes_that_goes_on_beyond() -> None:
    """One against the middle of a wall of 2 m, one that clips its edge; the road is crossed by whoever hits it."""
    road = Surface(
        np.array([[70.0, 0, 0.05], [76, 0, 0.05], [76, 120, 0.05], [70, 120, 0.05]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        GlobalShift(),
        "road",
    )
    ground = make_ground(plane(), {"wall": wall((60, 20), (60, 100), 0.0, 2.0), "road": road})
    simulation = thrown_at(ground, [1.5, 2.95])
    hits = hits_of(simulation)
    run = simulation.records.run[hits.record]
    at_wall = hits.structure == 0
    assert set(run[at_wall].tolist()) == {0, 1}
    assert not hits.passes[at_wall & (run == 0)].any()
    assert hits.passes[at_wall & (run == 1)].all()
    assert simulation.position[0, 0] < 60 < simulation.position[1, 0]
    on_road = hits.structure == 1
    assert set(run[on_road].tolist()) == {1}
    assert hits.passes[on_road].all() == (simulation.position[1, 0] > 73.3)
    np.testing.assert_allclose(hits.up_m[on_road], 0.05, atol=1e-6)


@pytest.mark.parametrize(("end_x", "passes"), [(55.0, [True, False]), (60.2, [True, False]), (75.0, [True, True])])
def test_only_what_comes_after_a_hit_tells_whether_the_block_passes(end_x: float, passes: list[bool]) -> None:
    """Over the wall, from a rock beyond it back against its front, and to an end: written by hand."""
    ground = make_ground(plane(), {"wall": wall((60, 20), (60, 100), 0.0, 2.0)})
    made = thrown_at(ground, [5.0])
    panel = int(np.flatnonzero(ground.owner == 1)[0])
    x = np.array([50.0, 59.9, 65.0, 59.7, end_x])
    what = np.array([RELEASED, IMPACT, IMPACT, IMPACT, ENDED], np.int8)
    moving = np.tile([1.0, 0.0, -1.0], (5, 1))
    records = Records(
        run=np.zeros(5, np.intp),
        what=what,
        time_s=np.arange(5.0),
        position=np.column_stack([x, np.full(5, 60.0), np.full(5, 1.0)]),
        v2=moving,
        omega2=moving,
        v1=moving,
        omega1=moving,
        normal=np.tile([-1.0, 0.0, 0.0], (5, 1)),
        face=np.array([-1, panel, 0, panel, 0]),
    )
    hits = hits_of(replace(made, records=records))
    assert hits.record.tolist() == [1, 3]
    assert hits.passes.tolist() == passes
    np.testing.assert_allclose(hits.along_m, 40.0)
    np.testing.assert_allclose(hits.up_m, 1.0)
    np.testing.assert_allclose(np.degrees(hits.angle), 45.0)


def test_a_block_that_comes_to_rest_against_a_wall_is_held_by_it() -> None:
    """Down a slope of 45° into a wall, against which they lean; one rolls past its end and out of the terrain."""
    fence = wall((60, 20), (60, 100), -70.0, -55.0)
    ground = make_ground(plane(1.0), {"hut": wall((5, 5), (5, 8), -6.0, -4.0), "fence": fence})
    start = np.array([[40.0, 50, -39], [40.0, 80, -39], [40.0, 10, -39]])
    releases = make_releases(start, diameter_m=0.8)
    simulation = simulate(ground, releases, Settings(AZIMI, {"rn": 0.2, "rt": 0.8}))
    assert [simulation.ends[end] for end in simulation.end] == ["structure:fence", "structure:fence", "left_terrain"]
    assert simulation.at_rest.tolist() == [True, True, False]
    np.testing.assert_allclose(simulation.position[:2, 0], 60 - 0.4, atol=0.004 + 1e-6)
    beside = simulate(
        make_ground(plane(), {"fence": wall((60, 20), (60, 100), 0.0, 2.0)}),
        make_releases(np.array([[59.0, 60.0, 1.0]]), diameter_m=0.8),
        Settings(AZIMI),
    )
    assert [beside.ends[end] for end in beside.end] == ["stopped"]


def test_intervals_hold_what_they_are_for() -> None:
    """Of 2 000 samples of 200 exponential numbers, 95 % of the intervals contain the true 95 % quantile, ln 20."""
    rng = np.random.default_rng(3)
    found = [convergence(rng.exponential(size=200)) for _ in range(2000)]
    share = np.mean([one.q95_low <= np.log(20) <= one.q95_high for one in found])
    assert 0.945 < share < 0.985
    inside = np.mean([abs(one.mean - 1) < 1.96 * one.standard_error for one in found])
    assert 0.92 < inside < 0.97
    assert np.std([one.q95 for one in found]) == pytest.approx(np.sqrt(0.05 * 0.95 / 200) / 0.05, rel=0.1)
    few = convergence(np.array([1.0, 2.0, 3.0]))
    assert (few.mean, few.standard_error) == (2.0, pytest.approx(1 / np.sqrt(3)))
    assert np.isnan(few.q95_high)
    assert np.isnan(convergence(np.array([4.0])).standard_error)


def test_decimals_are_those_of_pythons_formatting(tmp_path: Path) -> None:
    """Each number is as near as its decimals allow; the text is Python's own where no tie is near."""
    rng = np.random.default_rng(1)
    drawn = rng.normal(size=2000) * 10.0 ** rng.integers(-8, 6, 2000)
    drawn[::50] = np.nan
    values = np.concatenate([drawn, [0.0, -0.0, -1e-9, 999.9999996]])
    columns = {"a": values, "b": values, "c": np.arange(values.size) - 3}
    columns["word"] = Words(np.arange(values.size) % 3, ("", "plain", 'with, "quotes"'))
    write_decimal_table(tmp_path / "table.csv", [lambda: columns], {"b": 9, "c": 0})
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == values.size
    for row, value, count in zip(rows, values.tolist(), range(-3, values.size), strict=False):
        for name, decimals in (("a", 6), ("b", 9)):
            if np.isnan(value):
                assert row[name] == ""
            else:
                assert abs(float(row[name]) - value) <= 0.5000001 * 10.0**-decimals + 2 * np.spacing(abs(value))
                assert len(row[name].partition(".")[2]) == decimals
        assert row["c"] == str(count)
        assert row["word"] == ("", "plain", 'with, "quotes"')[(count + 3) % 3]
    assert [row["a"] for row in rows[-4:]] == ["0.000000", "0.000000", "0.000000", "1000.000000"]


def test_a_number_with_too_many_digits_is_written_with_all_of_them(tmp_path: Path) -> None:
    columns = {"a": np.array([1e300, 123456789012345.6, np.nan]), "b": Words(np.array([0, 1, 0]), ("x", "y,z"))}
    write_decimal_table(tmp_path / "table.csv", [lambda: columns], {})
    text = (tmp_path / "table.csv").read_text(encoding="utf-8")
    assert text == 'a,b\n1e+300,x\n123456789012345.6,"y,z"\n,x\n'


def test_parts_are_written_in_order_and_an_empty_table_has_its_header(tmp_path: Path) -> None:
    parts = [lambda k=k: {"a": np.arange(1000.0 * k, 1000.0 * (k + 1))} for k in range(40)]
    write_decimal_table(tmp_path / "table.csv", parts, {"a": 0})
    text = (tmp_path / "table.csv").read_text(encoding="utf-8")
    assert text == "a\n" + "".join(f"{k}\n" for k in range(40_000))
    write_decimal_table(tmp_path / "empty.csv", [lambda: {"a": np.empty(0), "b": Words(np.empty(0, np.intp), ())}], {})
    assert (tmp_path / "empty.csv").read_text(encoding="utf-8") == "a,b\n"


def falls(number: int = 40) -> Simulation:
    """Blocks on the plane in survey coordinates, with and without a name, one with flights only."""
    shift = GlobalShift(2_600_000.0, 1_200_000.0, 500.0)
    terrain = Surface(plane(0.6).vertices, plane().faces, shift, "plane")
    ground = make_ground(terrain, {"a, b": wall((60, 20), (60, 100), -60.0, -35.0, shift)})
    start = np.column_stack([np.full(number, 20.0), np.linspace(30, 90, number), np.full(number, -10.0)])
    name = np.array(["", "cliff", 'le "dge'])[np.arange(number) % 3]
    return simulate(ground, make_releases(start, name=name, diameter_m=0.37), Settings("stevens_1998", seed=2))


def test_impacts_are_those_that_are_written_with_all_digits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_parts, "PART_ROWS", 50)
    simulation = falls()
    write_simulated_impacts([simulation], tmp_path / "quick.csv", "site")
    write_impacts(impacts_of(simulation, "site"), tmp_path / "whole.csv")
    with (tmp_path / "quick.csv").open(encoding="utf-8", newline="") as stream:
        header = next(csv.reader(stream))
    with (tmp_path / "whole.csv").open(encoding="utf-8", newline="") as stream:
        assert next(csv.reader(stream)) == header
    quick, whole = read_impacts(tmp_path / "quick.csv"), read_impacts(tmp_path / "whole.csv")
    assert len(quick) == simulation.impacts.sum() > 200
    for column in fields(quick):
        got, expected = getattr(quick, column.name), getattr(whole, column.name)
        if isinstance(got, np.ndarray) and got.dtype.kind == "f":
            atol = 0.51e-9 if column.name == "normal" else 0.51e-6
            scale = np.degrees(1) if column.name.startswith("theta") else 1.0
            np.testing.assert_allclose(scale * got, scale * expected, rtol=1e-15, atol=atol)
        elif isinstance(got, np.ndarray):
            assert got.tolist() == expected.tolist()
    assert {name: got.tolist() for name, got in quick.extra.items()} == {
        name: expected.tolist() for name, expected in whole.extra.items()
    }
    np.testing.assert_array_equal(quick.mass_kg, whole.mass_kg)
    for flag, marked in quick.flags.items():
        np.testing.assert_array_equal(marked, whole.flags[flag])


def test_trajectories_are_those_that_are_written_row_by_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_parts, "PART_ROWS", 300)
    simulation = falls(12)
    write_simulated_trajectories([simulation], tmp_path / "quick.csv")
    write_trajectories(sample_runs(simulation), tmp_path / "whole.csv")
    quick, whole = ((tmp_path / name).read_text(encoding="utf-8").splitlines() for name in ("quick.csv", "whole.csv"))
    assert len(quick) == len(whole) > 400
    for one, other in zip(csv.reader(quick), csv.reader(whole), strict=True):
        assert one[:3] == other[:3]
        assert one[-1] == ("seed" if one[0] == "source" else "2")
        if one[0] != "source":
            np.testing.assert_allclose(
                [float(cell or "nan") for cell in one[3:-1]], [float(cell or "nan") for cell in other[3:]], atol=1.01e-6
            )


def test_without_an_impact_the_table_has_its_header(tmp_path: Path) -> None:
    ground = make_ground(plane(0.6))
    start = np.array([[119.0, 60.0, 40.0]])
    away = simulate(ground, make_releases(start, velocity=np.array([[50.0, 0, 0]])), Settings(AZIMI))
    write_simulated_impacts([away], tmp_path / "impacts.csv")
    header = (tmp_path / "impacts.csv").read_text(encoding="utf-8")
    assert header.startswith("site,trajectory,impact,time_s")
    assert header.count("\n") == 1
