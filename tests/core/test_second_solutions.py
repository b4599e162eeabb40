# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera that looks along a furrowed slope: marks on the wrong rib, and motions that it cannot tell apart."""

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.node_motion import join_nodes, places_at
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.reconstruction.refinement.setup import prepare, set_up
from rockfall.core.reconstruction.refinement.solver import solve
from rockfall.core.terrain.raycast import cast_rays, closest_points
from rockfall.core.terrain.surface import Surface

BLOCK = Block()
RADIUS = BLOCK.radius_m
RIB_M, APART_M = 0.5, 6.0
TIME = np.array([1.0, 1.7, 2.5, 3.2, 4.0])


def furrowed():
    """A slope of 35° whose ribs run down it, 6 m apart and 1 m high."""
    x, y = np.meshgrid(np.arange(-25, 25, 0.5), np.arange(-18, 18, 0.25), indexing="ij")
    z = -np.tan(np.radians(35)) * x + RIB_M * np.cos(2 * np.pi * y / APART_M)
    rows, columns = x.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    upper = np.stack([corner, corner + columns, corner + columns + 1], axis=1)
    lower = np.stack([corner, corner + columns + 1, corner + 1], axis=1)
    faces = np.concatenate([upper, lower]).astype(np.int32)
    return Surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, GlobalShift(), "ribs")


SURFACE = furrowed()
EXACT = {"sigma_aim": 0.0, "sigma_datum": 0.0}


@pytest.fixture(scope="module")
def centre():
    """Of the block at its contacts, on the middle rib."""
    above = np.stack([np.linspace(-14, 14, 5), [0.1, -0.2, 0.0, 0.2, -0.1], np.full(5, 40.0)], axis=1)
    ground = cast_rays(SURFACE, above, (0, 0, -1)).point
    places = ground + np.array([0, 0, RADIUS])
    for _ in range(20):
        closest = closest_points(SURFACE, places)
        away = places - closest.point
        places += away * (RADIUS / np.linalg.norm(away, axis=1) - 1)[:, None]
    return places


def filmed(centre, *, sigma_px, rate_hz, seed=0):
    """Noisy pixels of the motion, from the side, and marks one rib farther away than the block was."""
    rng = np.random.default_rng(seed)
    camera = look_at(3840, 2160, (0.0, -90.0, 30.0), (0, 0, 0), focal_px=6000.0)
    motion = join_nodes(centre[:-1], centre[1:], TIME[:-1], TIME[1:], np.full(4, 9.81), np.zeros(4))
    time = np.arange(TIME[0] + 0.01, TIME[-1], 1 / rate_hz)
    where = places_at(motion, np.searchsorted(TIME, time) - 1, time).position
    pixel = project(camera, where) + sigma_px * rng.normal(size=(time.size, 2))
    seen = PixelObservations(
        np.zeros(time.size, dtype=np.intp), np.full(time.size, "a"), time, pixel, np.full(time.size, sigma_px)
    )
    ray = centre - camera.position
    marks = closest_points(SURFACE, centre + APART_M * ray / np.linalg.norm(ray, axis=1)[:, None]).point
    return (
        View("side", fixed(camera), pose_covariance=1e-12 * np.eye(6)),
        seen,
        make_picks(["a"] * 5, TIME, marks, sigma_time_s=np.full(5, 0.01)),
        motion,
    )


def test_marks_on_another_rib_do_not_keep_the_motion_there(centre):
    view, seen, picks, motion = filmed(centre, sigma_px=1.0, rate_hz=60.0)
    setup = set_up(prepare(picks, SURFACE, BLOCK, None, None, 0.02), (view,), seen, ["a"], 9.81, frozenset())
    held_there = solve(setup.problem, setup.state, "huber")
    assert np.linalg.norm(held_there.state.centre - centre, axis=1)[1:-1].max() > 2
    found = refine(picks, [view], seen, surface=SURFACE, block=BLOCK, sigma_terrain_m=0.02, **EXACT)
    speed = np.linalg.norm(found.reconstruction.flights.start_velocity, axis=1)
    np.testing.assert_allclose(speed, np.linalg.norm(motion.start_velocity, axis=1), rtol=0.01)
    assert not any("other solution" in remark.text for remark in found.remarks)


def test_motions_that_cannot_be_told_apart_are_said_and_covered(centre):
    view, seen, picks, motion = filmed(centre, sigma_px=25.0, rate_hz=25.0)
    found = refine(picks, [view], seen, surface=SURFACE, block=BLOCK, sigma_terrain_m=0.02, **EXACT)
    (said,) = [remark for remark in found.remarks if "other solution" in remark.text]
    assert said.severity == "warning"
    assert said.about == "a"
    impacts = found.reconstruction.impacts
    off = np.abs(impacts.v1 - np.concatenate([[motion.start_velocity[0]], motion.end_velocity]))[1:]
    assert (off < 2.5 * impacts.sigma["v1"][1:]).all()
    assert impacts.sigma["v1"][1:, 1].max() > 1.0
