# SPDX-License-Identifier: GPL-3.0-or-later
"""What is stated of cameras, terrain and marks: tested against the pixels, and what they would not show.

The truth is a sphere that bounces on waves, which the program is given with or without errors.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.footage_tables import write_reliability
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.reconstruction.refinement.reliability import worst
from rockfall.core.reconstruction.refinement.setup import prepare, set_up
from rockfall.core.terrain.surface import Surface

BLOCK = Block()
TIME = np.array([1.0, 1.62, 2.31, 2.9, 3.66, 4.2])
PLAN = np.array([[-13.0, 0.2], [-9.1, 0.5], [-4.2, -0.1], [0.4, 0.6], [6.9, 0.1], [11.8, 0.9]])
POSE = np.diag([1e-4, 1e-4, 1e-4, 0.03, 0.03, 0.03]) ** 2
PLACES = np.array([[76.0, 91, 36], [113.0, -41, 36]])


def height(plan):
    """Of a slope of 35° with waves of 9 and 5 m."""
    x, y = plan[..., 0], plan[..., 1]
    return -np.tan(np.radians(35)) * x + 0.3 * np.sin(0.7 * x + 0.3 * y) + 0.1 * np.sin(1.2 * y - 0.4 * x)


def terrain(error=lambda plan: 0.0):
    """The slope on a grid of 0.25 m, with an error of its height."""
    x, y = np.arange(-18, 18, 0.25), np.arange(-6, 6, 0.25)
    plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    corner = (np.arange(x.size - 1)[:, None] * y.size + np.arange(y.size - 1)).ravel()
    one = np.stack([corner, corner + y.size, corner + y.size + 1], axis=1)
    other = np.stack([corner, corner + y.size + 1, corner + 1], axis=1)
    vertices = np.column_stack([plan, height(plan) + error(plan)])
    return Surface(vertices, np.concatenate([one, other]).astype(np.int32), GlobalShift(), "waves")


def contacts():
    """Places of the contacts, and of the centre a radius off them along the normal of the formula."""
    slope = [(height(PLAN + step) - height(PLAN - step)) / 2e-4 for step in ([1e-4, 0], [0, 1e-4])]
    normal = np.column_stack([-slope[0], -slope[1], np.ones(len(PLAN))])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    place = np.column_stack([PLAN, height(PLAN)])
    return place, place + BLOCK.radius_m * normal


def flown(time):
    """Places of the centre, and the velocities at the start of the flights."""
    _, centre = contacts()
    lasts = np.diff(TIME)[:, None]
    gravity = np.array([0, 0, -9.81])
    start = np.diff(centre, axis=0) / lasts - gravity * lasts / 2
    flight = np.clip(np.searchsorted(TIME, time, side="right") - 1, 0, len(TIME) - 2)
    since = (time - TIME[flight])[:, None]
    return centre[flight] + start[flight] * since + gravity * since**2 / 2, start


def filmed(count, seed=0):
    """The true views and what they see, with noise of a pixel."""
    rng, rows, views = np.random.default_rng(seed), [], []
    for number, place in enumerate(PLACES[:count]):
        camera = look_at(3840, 2160, place, (0, 0, 0), focal_px=9000.0)
        views.append(View(f"view {number + 1}", fixed(camera), pose_covariance=POSE))
        time = np.arange(TIME[0] + 0.005 + 0.004 * number, TIME[-1], 1 / 30)
        pixel = project(camera, flown(time)[0]) + rng.normal(size=(time.size, 2))
        rows.append((np.full(time.size, number), time, pixel))
    which, time, pixel = (np.concatenate(column) for column in zip(*rows, strict=True))
    return tuple(views), PixelObservations(which, np.full(which.size, "a"), time, pixel, np.full(which.size, 1.0))


def raised(view, metres):
    camera = replace(view.path.reference, position=view.path.reference.position + np.array([0, 0, metres]))
    return replace(view, path=fixed(camera))


def refined(views, pixels, *, surface=None, seed=5, sigma_m=None, **more):
    rng = np.random.default_rng(seed)
    place, _ = contacts()
    picks = make_picks(
        ["a"] * len(TIME),
        TIME + 0.01 * rng.normal(size=len(TIME)),
        place + 0.05 * rng.normal(size=place.shape),
        sigma_time_s=np.full(len(TIME), 0.01),
        sigma_position_m=None if sigma_m is None else np.full(len(TIME), sigma_m),
    )
    options = {"surface": surface or exact(), "block": BLOCK, "sigma_terrain_m": 0.02, "free": ("camera",), **more}
    return refine(picks, views, pixels, **options)


@cache
def exact():
    return terrain()


def speeds(result):
    impacts = result.reconstruction.impacts
    return np.concatenate([np.linalg.norm(impacts.v1[1:], axis=1), np.linalg.norm(impacts.v2[:-1], axis=1)])


def speed_sigmas(result):
    """Of the same, in percent."""
    impacts, found = result.reconstruction.impacts, []
    for velocity, energy, own in ((impacts.v1, "kinetic1_j", slice(1, None)), (impacts.v2, "kinetic2_j", slice(-1))):
        square = (velocity[own] ** 2).sum(axis=1)
        found.append(100 * impacts.sigma[energy][own] / (impacts.mass_kg[own] * square))
    return np.concatenate(found)


def contradicted(result):
    return {row.about for row in result.statements if row.rejected}


@pytest.mark.parametrize("count", [1, 2])
def test_what_is_true_is_not_contradicted(count):
    for seed in range(3):
        result = refined(*filmed(count, seed), seed=seed)
        assert contradicted(result) == set()
        assert not any(remark.severity == "warning" for remark in result.remarks)


def test_a_camera_that_the_other_one_contradicts_is_named():
    views, pixels = filmed(2)
    result = refined((raised(views[0], 0.5), views[1]), pixels)
    said = [remark for remark in result.remarks if remark.about.startswith("camera of")]
    assert [remark.severity for remark in said] == ["warning"]
    lower = next(row for row in result.statements if row.error == "Camera of view 1 higher")
    assert lower.rejected
    assert lower.found == pytest.approx(-0.5, abs=3 * lower.sigma)
    assert "lower by 0." in said[0].text or "view 2" in said[0].text


def test_a_view_alone_says_what_it_cannot_tell_and_allows_for_it():
    views, pixels = filmed(1)
    high = (raised(views[0], 0.3),)
    believed, doubted = (refined(high, pixels, sigma_datum=sigma) for sigma in (0.0, 0.0012))
    assert contradicted(doubted) == set()
    assert np.median(speed_sigmas(doubted) / speed_sigmas(believed)) > 1.2
    higher = next(row for row in doubted.statements if row.error == "Camera of view 1 higher")
    assert higher.noticed > 0.3


@pytest.mark.parametrize("error", ["Terrain higher", "Camera of view 1 higher", "Camera of view 2 nearer"])
def test_what_an_unnoticed_error_does_is_what_a_fit_with_it_shows(error):
    views, pixels = filmed(2)
    base = refined(views, pixels, loss="linear")
    row = next(one for one in base.statements if one.error == error)
    by = 0.25 * row.noticed
    surface, moved = exact(), list(views)
    if error == "Terrain higher":
        surface = terrain(lambda plan: by)
    elif error.endswith("higher"):
        moved[0] = raised(views[0], by)
    else:
        camera = views[1].path.reference
        ahead = camera.rotation[2] * [1, 1, 0] / np.linalg.norm(camera.rotation[2, :2])
        moved[1] = replace(views[1], path=fixed(replace(camera, position=camera.position + by * ahead)))
    other = refined(tuple(moved), pixels, surface=surface, loss="linear")
    percent = 100 * np.abs(speeds(other) / speeds(base) - 1)
    assert np.median(percent) == pytest.approx(0.25 * row.speed_percent, rel=0.35, abs=0.01)
    assert percent.max() == pytest.approx(0.25 * row.most_speed_percent, rel=0.35, abs=0.02)


def test_errors_of_the_size_that_is_noticed_are_noticed():
    found = []
    for seed in range(8):
        views, pixels = filmed(2, seed)
        row = next(one for one in refined(views, pixels).statements if one.error == "Camera of view 1 higher")
        again = refined((raised(views[0], 1.3 * row.noticed), views[1]), pixels)
        found.append(next(one for one in again.statements if one.error == row.error).rejected)
    assert sum(found) >= 6


def test_a_terrain_that_two_views_contradict_is_named_with_its_size():
    surface = terrain(lambda plan: 0.25 * np.sin(1.1 * plan[:, 0] + 0.9 * plan[:, 1]))
    result = refined(*filmed(2), surface=surface)
    said = [remark.text for remark in result.remarks if remark.about == "terrain"]
    assert any("is off by about" in text for text in said)
    wide, narrow = (one.reconstruction.impacts.intervals["rn"][1:-1] for one in (result, refined(*filmed(2))))
    assert np.median(np.ptp(wide, axis=1)) > 2 * np.median(np.ptp(narrow, axis=1))


def test_marks_are_less_certain_along_a_ray_that_grazes():
    """A mark is off in the picture: where its ray, off by as much, meets the plane, is how far it is off there."""
    plane = Surface(
        np.array([[-90.0, -90, 0], [90, -90, 0], [90, 90, 0], [-90, 90, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        GlobalShift(),
        "plane",
    )
    eye, place, sigma = np.array([0.0, -100.0, 20.0]), np.array([[0.0, 0, 0], [3, 0, 0], [6, 0, 0]]), 0.1
    view = View("flat", fixed(look_at(3840, 2160, eye, (3, 0, 0), focal_px=9000.0)), pose_covariance=POSE)
    picks = make_picks(["a"] * 3, [1.0, 1.5, 2.0], place, sigma_position_m=np.full(3, sigma))
    time = np.linspace(1.05, 1.95, 20)
    pixels = PixelObservations(np.zeros(20, int), np.full(20, "a"), time, np.full((20, 2), 1000.0), np.ones(20))
    ground = prepare(picks, plane, BLOCK, None, None, 0.02)
    white = set_up(ground, (view,), pixels, ["a"], 9.81, frozenset()).problem.centre_whitening[1]
    centre = place[1] + [0, 0, BLOCK.radius_m]
    ray = centre - eye
    above = np.cross(np.cross(ray, [0, 0, 1]), ray)
    start = eye + sigma * above / np.linalg.norm(above)
    hit = start + ray * (centre[2] - start[2]) / ray[2]
    assert np.linalg.norm(white @ (hit - centre)) == pytest.approx(1, rel=1e-3)
    side = np.cross(ray, [0, 0, 1])
    assert np.linalg.norm(white @ (sigma * side / np.linalg.norm(side))) == pytest.approx(1)


def test_the_worst_of_each_kind_is_listed_and_all_are_written(tmp_path):
    result = refined(*filmed(2))
    rows = worst(result.statements)
    assert [row.about for row in rows] == ["camera of view 1", "camera of view 2", "terrain", "contact", "time"]
    for row in rows:
        assert row.most_speed_percent == max(x.most_speed_percent for x in result.statements if x.about == row.about)
    write_reliability(result.statements, tmp_path / "reliability.csv")
    table = read_table(tmp_path / "reliability.csv", ("about", "error", "trajectory"), ())
    np.testing.assert_allclose(table.numbers("noticed"), [row.noticed for row in result.statements])
