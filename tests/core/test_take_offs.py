# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts whose contact is no point: where and when the block lands, and where and when it takes off."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.motion_graphs import SPEED, motion_courses
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.errors import InputError
from rockfall.core.exchange.tables import read_impacts, read_picks, write_impacts, write_picks
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.reconstruction.track_residuals import track_residuals
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.measured_releases import from_impacts, from_reconstruction, start_times
from rockfall.core.terrain.surface import Surface
from scipy.interpolate import CubicHermiteSpline

G = np.array([0.0, 0.0, -9.81])
DIP = np.radians(30)
DOWN, OUT = np.array([np.cos(DIP), 0, -np.sin(DIP)]), np.array([np.sin(DIP), 0, np.cos(DIP)])
SLIDES, LASTS_S = 1.0, 0.08
SURFACE = Surface(
    np.array([80 * a * DOWN + [0, 80 * b, 0] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "plane",
)


def fall(flights=3, slides=SLIDES, lasts_s=LASTS_S):
    """A block that lands, slides along the slope and leaves it, again and again: the places where it touches the
    slope and leaves it, and the velocities there, from the parabola alone."""
    place, time, kind, incident, restituted = [np.zeros(3)], [2.0], ["release"], [], [4 * DOWN + 3 * OUT]
    for _ in range(flights):
        start, velocity = place[-1], restituted[-1]
        duration = -2 * (velocity @ OUT) / (G @ OUT)
        incident.append(velocity + G * duration)
        place += [start + velocity * duration + G * duration**2 / 2]
        place += [place[-1] + slides * DOWN]
        time += [time[-1] + duration, time[-1] + duration + lasts_s]
        kind += ["impact", "takeoff"]
        restituted.append(0.8 * (incident[-1] @ DOWN) * DOWN - 0.6 * (incident[-1] @ OUT) * OUT)
    return np.array(place[:-1]), np.array(time[:-1]), kind[:-1], np.array(incident), np.array(restituted[1:])


def picks_of(place, time, kind, **more):
    return make_picks(["a"] * len(time), time, place, kind=kind, **more)


def test_velocities_are_exact_with_the_take_off_and_not_without():
    place, time, kind, incident, restituted = fall()
    impacts = reconstruct(picks_of(place, time, kind), surface=SURFACE).impacts
    assert impacts.flag_text() == ["", "", "last"]
    np.testing.assert_allclose(impacts.v1, incident, rtol=1e-9)
    np.testing.assert_allclose(impacts.v2[:2], restituted[:2], rtol=1e-9)
    np.testing.assert_allclose(impacts.rn[:2], 0.6, rtol=1e-6)
    np.testing.assert_allclose(impacts.position, place[[1, 3, 5]])
    landings = np.isin(kind, ("release", "impact"))
    point = reconstruct(picks_of(place[landings], time[landings], np.array(kind)[landings]), surface=SURFACE).impacts
    off = np.linalg.norm(point.v2[:2] - restituted[:2], axis=1)
    assert (off > 0.3).all()


def test_deviations_are_the_scatter_of_picks_with_errors():
    """v2 does not share the error of the landing; v1 does not that of the take-off."""
    place, time, kind, _, _ = fall()
    rng, v1, v2 = np.random.default_rng(4), [], []
    for _ in range(3000):
        moved, later = place + 0.05 * rng.normal(size=place.shape), time + 0.004 * rng.normal(size=time.size)
        impacts = reconstruct(picks_of(moved, later, kind)).impacts
        v1.append(impacts.v1[1])
        v2.append(impacts.v2[1])
    given = reconstruct(
        picks_of(place, time, kind, sigma_position_m=[0.05] * len(time), sigma_time_s=[0.004] * len(time))
    ).impacts
    np.testing.assert_allclose(given.sigma["v1"][1], np.std(v1, axis=0), rtol=0.06)
    np.testing.assert_allclose(given.sigma["v2"][1], np.std(v2, axis=0), rtol=0.06)


def test_blocks_that_are_released_as_measured_start_at_the_take_off():
    place, time, kind, _, restituted = fall()
    made = reconstruct(picks_of(place[1:], time[1:], kind[1:]), surface=SURFACE)  # the release was not seen
    releases = from_reconstruction(make_ground(SURFACE), made)
    radius = releases.radius_m[0]
    np.testing.assert_allclose(releases.position[0], place[2] + radius * OUT, atol=1e-6)
    np.testing.assert_allclose(releases.velocity[0], restituted[0], rtol=1e-9)
    assert start_times(made) == {"a": time[2]}
    after = from_impacts(make_ground(SURFACE), made.impacts)
    np.testing.assert_allclose(after.position, place[[2, 4]] + after.radius_m[:, None] * OUT, atol=1e-6)
    wrong = replace(made.impacts, extra={**made.impacts.extra, "x2_m": np.array(["far"] * 3)})
    with pytest.raises(InputError, match="The place of a take-off is no number"):
        from_impacts(make_ground(SURFACE), wrong)


def test_graphs_over_time_know_when_a_block_leaves_an_impact():
    place, time, kind, _, restituted = fall()
    (course,) = motion_courses(reconstruct(picks_of(place, time, kind), surface=SURFACE))
    np.testing.assert_array_equal(course.leaves_s, [time[2], time[4], time[5]])
    np.testing.assert_allclose(course.at(SPEED, course.leaves_s[0]), np.linalg.norm(restituted[0]), rtol=1e-9)


def test_a_discarded_take_off_leaves_a_gap_and_a_shattered_one_ends_the_run():
    place, time, kind, _, _ = fall()
    ok = ["ok"] * len(time)
    without = reconstruct(picks_of(place, time, kind, status=["ok", "ok", "discarded", *ok[3:]])).impacts
    assert set(without.flag_text()[0].split(";")) == {"last", "gap"}
    cut = reconstruct(picks_of(place, time, kind, status=["ok", "ok", "shattered", *ok[3:]])).impacts
    assert "last" in cut.flag_text()[0]


@pytest.mark.parametrize(
    ("kind", "problem"),
    [
        (["takeoff", "impact", "impact"], "The take-off at 0.000 s does not follow an impact"),
        (["release", "takeoff", "impact"], "The take-off at 1.000 s does not follow an impact"),
        (["impact", "takeoff", "takeoff"], "The take-off at 2.000 s does not follow an impact"),
    ],
)
def test_a_take_off_without_its_impact_is_refused(kind, problem):
    with pytest.raises(InputError, match=problem):
        picks_of(np.arange(9.0).reshape(3, 3), np.arange(3.0), kind)


HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,x2_m,y2_m,z2_m,time2_s,note\n"


def test_both_forms_of_the_table_are_the_same_picks(tmp_path):
    place, time, kind, _, _ = fall()
    place, time = place.tolist(), time.tolist()
    rows = [f"a,{time[0]!r},{','.join(map(repr, place[0]))},release,,,,,from above"]
    for i in (1, 3):
        end = f"{','.join(map(repr, place[i + 1]))},{time[i + 1]!r}"
        rows.append(f"a,{time[i]!r},{','.join(map(repr, place[i]))},impact,{end},")
    rows.append(f"a,{time[5]!r},{','.join(map(repr, place[5]))},impact,,,,,")
    (tmp_path / "beside.csv").write_text(HEADER + "\n".join(rows) + "\n")
    beside = read_picks(tmp_path / "beside.csv")
    write_picks(beside, tmp_path / "rows.csv")
    again = read_picks(tmp_path / "rows.csv")
    for picks in (beside, again):
        assert picks.kind.tolist() == kind
        np.testing.assert_allclose(picks.position, place, atol=1e-9)
        np.testing.assert_allclose(picks.time_s, time, atol=1e-9)
    assert beside.extra["note"].tolist() == ["from above", "", "", "", "", ""]
    assert "x2_m" not in (tmp_path / "rows.csv").read_text()


def test_the_table_of_impacts_says_where_and_when_blocks_take_off(tmp_path):
    place, time, kind, _, _ = fall()
    write_impacts(reconstruct(picks_of(place, time, kind), surface=SURFACE).impacts, tmp_path / "impacts.csv")
    with (tmp_path / "impacts.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row, i in zip(rows[:2], (2, 4), strict=True):
        assert [float(row[name]) for name in ("x2_m", "y2_m", "z2_m", "time2_s")] == [*place[i], time[i]]
    assert (rows[2]["x2_m"], rows[2]["time2_s"]) == ("", "")
    again = read_impacts(tmp_path / "impacts.csv")
    assert again.extra["time2_s"].tolist() == [row["time2_s"] for row in rows]
    points = np.isin(kind, ("release", "impact"))
    at_once = picks_of(place[points], time[points], np.array(kind)[points])
    assert "x2_m" not in reconstruct(at_once, surface=SURFACE).impacts.extra


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("a,1,0,0,0,impact,1,,0,1.1,", "Only a part of the take-off's place is given"),
        ("a,1,0,0,0,impact,1,0,0,,", "The take-off has a place and no time"),
        ("a,1,0,0,0,impact,1,0,0,0.9,", "The block takes off before it lands, or at once"),
        ("a,1,0,0,0,pass,1,0,0,1.1,", "A take-off belongs to an impact"),
        ("a,1,0,0,0,impact,1,0,0,2.5,", "The times are not sorted: 2.0 s comes after 2.5 s"),
    ],
)
def test_bad_columns_are_refused_with_their_row(tmp_path, row, problem):
    table = tmp_path / "picks.csv"
    table.write_text(HEADER + f"a,0,0,0,9,impact,,,,,\n{row}\na,2,3,0,0,impact,,,,,\n")
    with pytest.raises(InputError, match=problem) as caught:
        read_picks(table)
    assert caught.value.row in (3, 4)


def test_a_take_off_has_the_deviations_of_its_own_or_those_of_its_impact(tmp_path):
    table = tmp_path / "picks.csv"
    names = "trajectory,time_ms,x_ft,y_ft,z_ft,sigma_time_s,sigma_position_m,x2_ft,y2_ft,z2_ft,time2_ms,sigma_time2_s\n"
    table.write_text(
        names + "a,0,0,0,10,0.01,0.1,,,,,\na,1000,0,0,0,0.01,0.2,10,0,0,1080,0.03\na,2000,9,0,0,0.01,0.1,,,,,\n"
    )
    picks = read_picks(table)
    assert picks.kind.tolist() == ["impact", "impact", "takeoff", "impact"]
    np.testing.assert_allclose(picks.time_s, [0, 1, 1.08, 2])
    np.testing.assert_allclose(picks.position[2] - picks.position[1], [3.048, 0, 0])
    assert (picks.sigma_time_s[2], picks.sigma_position_m[2]) == (0.03, 0.2)
    text = table.read_text()
    table.write_text(text.replace(",1080,", ",,").replace(",10,0,0,,", ",,,,,"))
    with pytest.raises(InputError, match="The take-off has a standard deviation and no time") as caught:
        read_picks(table)
    assert caught.value.row == 3


def test_refinement_finds_landings_and_take_offs():
    """From picks that are a decimetre and a frame off, with the pixels of a block that slides and leaves."""
    place, time, kind, incident, restituted = fall()
    block = Block(0.6, 0.6, 0.6)
    centre = place + block.radius_m * OUT
    camera = look_at(3840, 2160, (10.0, -70, 5), (10, 0, -8), focal_px=6500.0)
    rng = np.random.default_rng(2)
    seen_s = np.arange(time[0] + 0.004, time[-1], 1 / 60)
    velocity = np.empty((len(time), 3))  # after the release, then before and after the contacts in turn
    velocity[0], velocity[1::2], velocity[2::2] = 4 * DOWN + 3 * OUT, incident, restituted[:2]
    at = CubicHermiteSpline(time, centre, velocity)(seen_s)  # parabolas in flight, braked and turned in contact
    pixel = project(camera, at) + 0.5 * rng.normal(size=(seen_s.size, 2))
    seen = PixelObservations(
        np.zeros(seen_s.size, dtype=np.intp), np.full(seen_s.size, "a"), seen_s, pixel, np.full(seen_s.size, 0.5)
    )
    off = place + 0.1 * rng.normal(size=(len(time), 2)) @ np.stack([DOWN, [0, 1, 0]])
    marked = np.round(time * 60) / 60
    picks = picks_of(off, marked, kind)
    views = (View("side", fixed(camera)),)
    found = refine(picks, views, seen, surface=SURFACE, block=block, sigma_terrain_m=0.02, sigma_aim=0.0)
    impacts = found.reconstruction.impacts
    assert found.picks.kind.tolist() == kind
    for velocity, truth, rows in ((impacts.v1, incident, slice(3)), (impacts.v2, restituted, slice(2))):
        speeds = np.linalg.norm(truth[rows], axis=1)
        sigma = impacts.sigma["v1" if velocity is impacts.v1 else "v2"][rows]
        assert (np.abs(velocity[rows] - truth[rows]) < 3.5 * sigma).all()
        assert (sigma[:, [0, 2]] < 0.25).all()  # the camera looks along y
        np.testing.assert_allclose(np.linalg.norm(velocity[rows], axis=1), speeds, rtol=0.02)
    leaves = found.picks.time_s[[2, 4]]
    np.testing.assert_allclose(leaves, time[[2, 4]], atol=0.01)
    off_px = track_residuals(found.reconstruction, SURFACE, found.views, seen)
    assert np.nanmax(np.abs(off_px)) < 5  # and not those of the contact, of 0.1 m
    landed = sum(((seen_s > marked[i]) & (seen_s < marked[i + 1])).sum() for i in (1, 3))
    assert any(f"{landed} pixels between landings and take-offs" in remark.text for remark in found.remarks)
    assert {row.about for row in found.what_if} >= {"terrain", "diameter"}
