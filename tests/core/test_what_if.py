# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit says would change if an input were otherwise, against fits with that input."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.footage_tables import write_what_if
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.node_motion import join_nodes, places_at
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.reconstruction.refinement.what_if import LIFT, STATED, WhatIf, gravest
from rockfall.core.terrain.surface import Surface
from rockfall.core.vectors import norm, unit

DIP = np.radians(35)
DOWN, OUT = np.array([np.cos(DIP), 0, -np.sin(DIP)]), np.array([np.sin(DIP), 0, np.cos(DIP)])
SURFACE = Surface(
    np.array([60 * a * DOWN + [0, 60 * b, 0] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "plane",
)
BLOCK = Block()
TIME = np.array([2.013, 2.609, 3.317, 3.921, 4.602])
PLACE = np.outer([-16.0, -11, -4.5, 3, 12], DOWN) + np.outer([0, 0.4, -0.3, 0.5, 1], [0, 1, 0])
SIDE, ABOVE = np.array([76.0, 91, 36]), np.array([113.0, -41, 36])


def view(name, place, moved=(0, 0, 0), **more):
    camera = look_at(3840, 2160, place, (0, 0, 0), focal_px=6500.0)
    return View(name, fixed(replace(camera, position=camera.position + moved)), **more)


ONE, TWO = (view("left", SIDE),), (view("left", SIDE), view("right", ABOVE))


def push_of_spin(per_metre, displacement, duration):
    """Of a ball that turns forward, about the horizontal axis at right angles to its way: down and across it."""
    way = displacement / duration[:, None]
    axis = unit(np.stack([-way[:, 1], way[:, 0], 0 * way[:, 0]], axis=1))
    return LIFT * per_metre * norm(way)[:, None] ** 2 * unit(np.cross(axis, way))


def pixels(views, spin_per_metre=0.0):
    """What the views see of flights between the contacts, with noise of half a pixel; the true speeds (5, 2)."""
    rng, rows = np.random.default_rng(3), []
    centre, duration = PLACE + BLOCK.radius_m * OUT, np.diff(TIME)
    motion = join_nodes(centre[:-1], centre[1:], TIME[:-1], TIME[1:], np.full(4, 9.81), np.zeros(4))
    push = push_of_spin(spin_per_metre, np.diff(centre, axis=0), duration)
    for number, one in enumerate(views):
        time = np.arange(TIME[0] + 0.01 + 0.004 * number, TIME[-1], 1 / 30)
        flight = np.searchsorted(TIME, time, side="right") - 1
        since = time - TIME[flight]
        bent = push[flight] * (since * (since - duration[flight]) / 2)[:, None]
        seen = project(one.path.reference, places_at(motion, flight, time).position + bent)
        rows.append((np.full(time.size, number), time, seen + 0.5 * rng.normal(size=seen.shape)))
    which, time, pixel = (np.concatenate(column) for column in zip(*rows, strict=True))
    off = push * duration[:, None] / 2
    none = [np.nan]
    true = np.stack([np.r_[none, norm(motion.end_velocity + off)], np.r_[norm(motion.start_velocity - off), none]], 1)
    return PixelObservations(which, np.full(which.size, "a"), time, pixel, np.full(which.size, 0.5)), true


def refined(views, seen, **more):
    rng = np.random.default_rng(1)
    place = PLACE + 0.1 * rng.normal(size=(5, 2)) @ np.stack([DOWN, [0, 1, 0]])
    picks = make_picks(["a"] * 5, TIME + 0.02 * rng.uniform(-1, 1, 5), place)
    options = {"surface": SURFACE, "block": BLOCK, "sigma_terrain_m": 0.02, "loss": "linear", **more}
    return refine(picks, views, seen, **options)


def speeds(result):
    impacts = result.reconstruction.impacts
    return np.stack([norm(impacts.v1), norm(impacts.v2)], axis=1)


def check(said, before, after):
    """Medians and largest changes, to a tenth of the largest."""
    percent = (100 * (after / before - 1)).ravel()
    percent = percent[np.isfinite(percent)]
    r = (after[:, 1] / after[:, 0] - before[:, 1] / before[:, 0])[1:-1]
    for found, true in (((said.speed_percent, said.most_speed_percent), percent), ((said.r, said.most_r), r)):
        most = true[np.abs(true).argmax()]
        assert found == pytest.approx([np.median(true), most], abs=0.1 * abs(most))


def moved_views(views, by):
    return tuple(
        replace(one, path=fixed(replace(one.path.reference, position=one.path.reference.position + by)))
        for one in views[:1]
    ) + tuple(views[1:])


LARGER = replace(BLOCK, d1=1.2 * BLOCK.d1, d2=1.2 * BLOCK.d2, d3=1.2 * BLOCK.d3)
RAISED = replace(SURFACE, vertices=SURFACE.vertices + 0.02 * OUT)
SLOW = 0.02 / 2160


@pytest.mark.parametrize("views", [ONE, TWO], ids=["one view", "two views"])
def test_the_changes_are_those_of_fits_with_the_other_input(views):
    seen, _ = pixels(views)
    found = refined(views, seen)
    said = {row.change: row for row in found.what_if}
    before = speeds(found)
    for change, other in (
        ("Camera of left 0.3 m higher", refined(moved_views(views, [0, 0, 0.3]), seen)),
        ("Terrain 2 cm higher", refined(views, seen, surface=RAISED)),
        ("Rolling shutter 20 ms slower", refined([replace(one, row_time_s=SLOW) for one in views], seen)),
        ("Block 20 % larger", refined(views, seen, block=LARGER)),
        ("With air drag", refined(views, seen, drag=Drag())),
    ):
        check(said[change], before, speeds(other))


def test_what_spin_would_change_is_what_it_hides_where_blocks_spin():
    ball = replace(BLOCK, density=60.0)
    per_metre = replace(Drag(), coefficient=1.0).per_metre(ball)
    seen, true = pixels(TWO, per_metre)
    found = refined(TWO, seen, block=ball)
    said = {row.about: row for row in found.what_if}["spin"]
    hidden = 100 * (true / speeds(found) - 1)
    most = float(np.nanmax(np.abs(hidden)))
    assert most > 2
    assert (said.speed_percent, said.most_speed_percent) == pytest.approx((np.nanmedian(hidden), most), abs=0.1 * most)


def test_drag_that_matters_is_advised():
    light = replace(BLOCK, density=100.0)
    seen, _ = pixels(TWO)

    def said(block, drag=None):
        return [one for one in refined(TWO, seen, block=block, drag=drag).remarks if one.about == "drag"]

    (advice,) = said(light)
    assert "Air drag is left out" in advice.text
    assert said(replace(BLOCK, density=20000.0)) == said(light, Drag()) == []


def test_drag_that_is_on_is_taken_off_and_drag_that_is_fitted_is_no_question():
    seen, _ = pixels(ONE)
    assert "Without air drag" in {row.change for row in refined(ONE, seen, drag=Drag()).what_if}
    assert "drag" not in {row.about for row in refined(ONE, seen, free=["drag"]).what_if}


def test_the_gravest_of_each_kind_over_all_trajectories(tmp_path):
    rows = [
        WhatIf(STATED, "Deviation as stated", "a", 0.5, 0.9, 0.01, 0.02),
        WhatIf("camera of left", "higher", "a", 0.1, -0.2, 0.0, 0.001),
        WhatIf("camera of left", "nearer", "a", 0.3, 0.4, 0.0, -0.003),
        WhatIf("camera of left", "higher", "b", 0.2, -0.9, 0.0, 0.002),
        WhatIf("camera of left", "nearer", "b", 0.1, 0.3, np.nan, np.nan),
    ]
    stated, camera = gravest(rows)
    assert stated.cells == ("Deviation as stated", "0.50 %", "0.90 %", "0.0100", "0.0200")
    assert camera.cells == ("higher", "+0.15 %", "−0.90 %", "+0.0000", "+0.0020")
    nothing = WhatIf("terrain", "higher", "a", -0.001, 0.001, -1e-6, 1e-6)
    assert nothing.cells == ("higher", "+0.00 %", "+0.00 %", "+0.0000", "+0.0000")
    write_what_if(rows, tmp_path / "what_if.csv")
    table = read_table(tmp_path / "what_if.csv", ("about", "change", "trajectory"), ())
    assert table.text("trajectory") == ["a", "a", "a", "b", "b"]
    assert table.numbers("most_speed_percent") == pytest.approx([0.9, -0.2, 0.4, -0.9, 0.3])
    assert np.isnan(table.numbers("r")[4])
