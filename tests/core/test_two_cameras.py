# SPDX-License-Identifier: GPL-3.0-or-later
"""A table tennis ball in two cameras, against what is known: the table's height, the ball's radius, gravity."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.camera.resection.resect import resect
from rockfall.core.exchange.cameras import read_pairs
from rockfall.core.reconstruction.refinement.refine import Refinement

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

from comparisons.two_cameras import (
    CAMERAS,
    EXAMPLE,
    Table,
    bounces,
    fit,
    gravity,
    load,
    miss_distances,
    of_view,
    predicted,
)

RUNS = ("run_0068", "run_0259", "run_0750", "run_0993", "run_1172", "run_1204", "run_1234")
"""Before and after the frame that camera 2 doubled."""
RADIUS_M = 0.02
SLIP_S = 900 / 30


@pytest.fixture(scope="module")
def table() -> Table:
    return load(RUNS)


@pytest.fixture(scope="module")
def both(table: Table) -> Refinement:
    return fit(table, CAMERAS)


def test_the_cameras_come_from_the_pairs() -> None:
    measured = ((1242.0, (1.7, -2.6, 1.5), 2.5), (1255.0, (1.6, 4.4, 1.6), 2.8))  # by another program
    files = [video.camera for video in load().footage.videos]
    for entry, (focal, position, rmse) in zip(files, measured, strict=True):
        number = 1 if focal == 1242.0 else 2
        pairs = read_pairs(EXAMPLE / f"pairs_{number}.csv")
        found = resect(pairs.pixel, pairs.point, 1280, 720, sigma_px=pairs.sigma_px, shift=pairs.shift)
        camera = entry.path.reference
        assert found.camera.fx == pytest.approx(camera.fx, rel=1e-6)
        assert found.camera.position == pytest.approx(camera.position, abs=1e-4)
        assert camera.fx == pytest.approx(focal, abs=1.5)
        assert camera.position == pytest.approx(position, abs=0.06)
        assert entry.rmse_px == pytest.approx(rmse, abs=0.1)


def test_both_cameras_agree_on_one_motion(both: Refinement) -> None:
    assert both.rmse_px < 2.0
    offset, drift = both.unknowns["offset_s camera 2"], both.unknowns["drift camera 2"]
    assert offset[0] == pytest.approx(-0.0071, abs=0.0015)
    assert drift[0] == pytest.approx(7.5e-4, abs=1e-4)
    assert offset[1] < 0.0015 > drift[1]


def test_the_doubled_frame_is_found(table: Table, both: Refinement) -> None:
    """Camera 2 shows a frame twice between two runs: counted by frames, all later ones are one too late."""
    seen = table.seen
    late = (seen.view == 1) & (seen.time_s > SLIP_S)
    assert late.any()
    counted = replace(seen, time_s=seen.time_s + late / 30)
    given = fit(table, ("clock",), views=both.views)
    assert given.rmse_px < 1.1 * both.rmse_px
    assert all(view.clock.gaps == () for view in (*both.views, *given.views))
    mended = fit(table, ("clock",), views=both.views, seen=counted)
    assert mended.rmse_px < 1.1 * both.rmse_px
    ((at, lost),) = mended.views[1].clock.gaps
    last, first = seen.time_s[(seen.view == 1) & ~late].max(), counted.time_s[late].min()
    assert last - 1e-6 < at < first
    assert lost == pytest.approx(-1 / 30, abs=0.004)
    assert any("1 frame too many is there" in remark.text for remark in mended.remarks)


def test_the_ball_bounces_a_radius_above_the_table(both: Refinement) -> None:
    """Without the table: where two flights meet, seen by the cameras as they came from six points each."""
    everything = load()
    views = [replace(view, clock=better.clock) for view, better in zip(everything.views, both.views, strict=True)]
    height = bounces(fit(everything, views=views, on_table=False))[:, 2]
    assert height.size == 50
    assert np.median(height) == pytest.approx(RADIUS_M, abs=0.003)
    assert (np.abs(height - RADIUS_M) < 0.02).mean() > 0.9


def test_rays_meet(table: Table, both: Refinement) -> None:
    miss = miss_distances(table, both.views)
    assert miss.size > 100
    assert np.median(miss) < 0.002


def test_camera_1_alone_tells_what_camera_2_sees(table: Table, both: Refinement) -> None:
    views = [replace(view, clock=better.clock) for view, better in zip(table.views, both.views, strict=True)]
    alone = fit(table, views=views, seen=of_view(table.seen, 0))
    assert np.nanmedian(np.hypot(*alone.residual_px.T)) < 1.5
    error = np.hypot(*predicted(table, alone, views).T)
    assert np.median(error) < 10
    off = np.hypot(*(bounces(alone) - bounces(fit(table, views=views)))[:, :2].T)
    assert np.median(off) < 0.02


def test_gravity_is_found(table: Table, both: Refinement) -> None:
    """To 5 %: spin, which is not in the model, changes a single run by up to 15 %."""
    found = fit(table, (*CAMERAS, "gravity"))
    value, sigma = gravity(found)
    assert value == pytest.approx(9.81, rel=0.05)
    assert sigma < 0.1
    assert found.rmse_px < 1.05 * both.rmse_px


def test_without_drag_it_does_not_fit(table: Table, both: Refinement) -> None:
    assert fit(table, ("clock",), views=both.views, drag=False).rmse_px > 1.5 * both.rmse_px


def test_the_table_gives_back_most_of_the_speed(both: Refinement) -> None:
    """ITTF: a ball dropped from 0.30 m shall rebound about 0.23 m, R_N 0.876 at 2.4 m/s."""
    assert np.median(both.reconstruction.impacts.rn) == pytest.approx(0.90, abs=0.04)
