# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals of R_N, R_T, R and the angles, against draws of the whole reconstruction over ground that is known."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.exchange.impact_fields import field_of
from rockfall.core.exchange.selection import joined, rows_of
from rockfall.core.exchange.tables import read_impacts, write_impacts
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.impact import apparent
from rockfall.core.reconstruction.intervals import (
    DRAWS_FILE,
    DRAWS_LOG2,
    JUDGED,
    ImpactErrors,
    impact_intervals,
    impact_sigmas,
    undetermined,
)
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.orientation import block_scale_normals, normals_beside
from rockfall.core.terrain.surface import Surface
from scipy.stats import qmc

TIME = np.array([0.0, 0.9, 1.7])
POSITION = np.array([(0, 0, 0), (6, 0.5, -6.5), (13.0, 2.2, -13)])
NORMAL = np.array([np.sin(0.7), 0.0, np.cos(0.7)])


def fall(sigma_time, sigma_position, copies=1, rng=None):
    """Impacts of copies of a fall, their picks off by what is stated where there is a generator."""
    times, places = np.tile(TIME, copies), np.tile(POSITION, (copies, 1))
    if rng is not None:
        times = times + sigma_time * rng.normal(size=times.size)
        places = places + sigma_position * rng.normal(size=places.shape)
    return reconstruct(
        make_picks(
            np.repeat(np.arange(copies), 3).astype(str), times, places, normal=np.tile(NORMAL, (times.size, 1)),
            sigma_time_s=np.full(times.size, sigma_time), sigma_position_m=np.full(times.size, sigma_position),
        )
    ).impacts  # fmt: skip


def test_intervals_are_those_of_many_reconstructions():
    one, many = fall(0.01, 0.1), fall(0.01, 0.1, 3000, np.random.default_rng(3))
    for name in ("rn", "rt", "r", "theta1", "theta_dev"):
        low, high = np.nanquantile(getattr(many, name)[1::3], (0.025, 0.975))
        np.testing.assert_allclose(one.intervals[name][1], (low, high), atol=0.12 * (high - low), err_msg=name)


def test_they_hold_as_often_as_they_say():
    many = fall(0.01, 0.1, 1000, np.random.default_rng(5))
    truth = fall(0.0, 0.0)
    for name in ("rn", "rt", "r", "theta1", "theta_dev"):
        ends, value = many.intervals[name][1::3], getattr(truth, name)[1]
        assert 0.93 < np.mean((ends[:, 0] <= value) & (value <= ends[:, 1])) < 0.97, name


def grid(step, heights):
    n = len(heights)
    x, y = np.meshgrid(np.arange(n) * step, np.arange(n) * step, indexing="ij")
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + 1], 1)]
    )
    return Surface(np.stack([x, y, heights], axis=-1).reshape(-1, 3), faces.astype(np.int32), GlobalShift(), "grid")


@pytest.mark.parametrize("noise", [0.01, 0.04])
def test_the_tilt_of_a_plane_through_noisy_points_is_known(noise):
    surface = grid(0.2, noise * np.random.default_rng(1).normal(size=(120, 120)))
    place = np.stack(np.meshgrid(np.arange(2, 22, 1.5), np.arange(2, 22, 1.5)), axis=-1).reshape(-1, 2)
    found = block_scale_normals(surface, np.column_stack([place, np.zeros(len(place))]), 0.7)
    off = np.degrees(np.arccos(found.normal[:, 2]))
    assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(np.mean(found.tilt_deg**2)), rel=0.15)
    assert (found.tilt_deg < found.spread_deg / 2).all()


def test_a_smooth_curve_is_no_noise():
    x = np.arange(120) * 0.2
    noisy = 0.02 * np.random.default_rng(2).normal(size=(120, 120))
    wave = np.add.outer(0.15 * np.sin(2 * np.pi * x / 5), 0 * x)
    place = np.column_stack([np.arange(4, 20, 0.9), np.full(18, 12.0), np.zeros(18)])
    bent, flat, both = (
        block_scale_normals(grid(0.2, heights), place, 0.7).tilt_deg for heights in (wave, noisy, wave + noisy)
    )
    assert bent.max() < 0.15 * np.median(flat)
    assert np.median(both) == pytest.approx(np.median(flat), rel=0.1)


def test_normals_beside_known_ones_are_those_of_the_places_themselves():
    rng = np.random.default_rng(5)
    rough = grid(0.2, 0.03 * rng.normal(size=(60, 60)))
    place = np.column_stack([rng.uniform(3, 9, (50, 2)), np.zeros(50)])
    beside = place + np.array([0.05, -0.03, 0.0])
    found = normals_beside(rough, beside, 0.8, block_scale_normals(rough, place, 0.8).normal)
    np.testing.assert_allclose(found, block_scale_normals(rough, beside, 0.8).normal, atol=1e-9)


def test_the_normal_changes_with_the_place():
    x = np.arange(60) * 0.2
    bowl = grid(0.2, np.add.outer(0.05 * (x - 6) ** 2, 0 * x))
    made = [
        reconstruct(make_picks(["a"] * 3, TIME, [(6, 6, 0)] * 3, sigma_position_m=[sigma] * 3), surface=bowl)
        for sigma in (0.01, 0.3)
    ]
    picks = made[1].picks
    from rockfall.core.reconstruction.placement import pick_normals

    change = pick_normals(picks, bowl, np.full(3, 0.5), 0.8, np.ones(3, np.bool_)).by_place[0]
    np.testing.assert_allclose(change @ [1.0, 0.0, 0.0], [-0.1, 0.0, 0.0], atol=0.01)
    np.testing.assert_allclose(change @ [0.0, 1.0, 0.0], 0.0, atol=0.01)


def errors(tilt):
    return ImpactErrors(np.zeros((1, 9, 9)), np.zeros((1, 3, 3)), np.array([tilt]))


def test_a_grazing_impact_has_a_skew_interval():
    v1, v2, normal = np.array([[8.0, 0, -1.0]]), np.array([[6.0, 0, 1.5]]), np.array([[0.0, 0, 1.0]])
    ends = impact_intervals(apparent(v1, v2, normal), v1, v2, normal, errors(np.radians(0.5)))
    assert not undetermined("rn", ends["rn"])[0]
    assert ends["rn"][0] == pytest.approx(1.5 * np.array([1 - 0.11, 1 + 0.13]), abs=0.06)


def test_the_last_bit_changes_nothing():
    """Equal deviations have no axes of their own: another processor's library gives others, turned in any way."""
    v1, v2, normal = np.array([[3.0, 0.5, -4.0]]), np.array([[2.0, 0.2, 1.2]]), np.array([[0.0, 0.0, 1.0]])
    known = errors(0.05)
    noise = np.random.default_rng(2).normal(size=(20, 9, 9)) * 1e-16
    ends, sigmas = [], []
    for bits in (0 * noise[0], *noise):
        one = replace(known, covariance=0.04 * (np.eye(9) + bits + bits.T)[None])
        ends.append(list(impact_intervals(apparent(v1, v2, normal), v1, v2, normal, one).values()))
        sigmas.append(impact_sigmas(apparent(v1, v2, normal), v1, v2, normal, np.ones(1), one)["rn"])
    np.testing.assert_allclose(ends[1:], [ends[0]] * 20, rtol=1e-9)
    np.testing.assert_allclose(sigmas[1:], [sigmas[0]] * 20, rtol=1e-9)


def test_tables_keep_them(tmp_path):
    impacts = fall(0.01, 0.1, 2)
    wide = {name: ends.copy() for name, ends in impacts.intervals.items()}
    wide["rn"][1, 1] = np.inf
    impacts = replace(impacts, intervals=wide)
    write_impacts(impacts, tmp_path / "impacts.csv")
    again = read_impacts(tmp_path / "impacts.csv")
    assert set(again.intervals) == set(JUDGED)
    for name in JUDGED:
        np.testing.assert_allclose(again.intervals[name], impacts.intervals[name], rtol=1e-12)
    bare = replace(impacts, intervals={})
    both = joined([rows_of(impacts, np.array([1])), bare]).intervals["rn"]
    assert both[0].tolist() == impacts.intervals["rn"][1].tolist()
    assert np.isnan(both[1:]).all()
    assert field_of("theta1_deg_low").unit == "°"
    assert "no limit" in field_of("rn_high").description


def test_the_draws_are_points_of_scipys_sobol_sequence():
    points = np.load(DRAWS_FILE)
    sequence = qmc.Sobol(13, rng=np.random.default_rng(0)).random_base2(DRAWS_LOG2)[:, :11]
    assert points.shape == (512, 11)
    np.testing.assert_array_equal(points / 2.0**32, sequence)


def test_a_reconstruction_loads_no_statistics(tmp_path):
    """They take longer to load than everything else."""
    code = "import sys; from rockfall.core.cli import main; assert main(sys.argv[1:]) == 0; "
    code += "assert 'scipy.special' in sys.modules and 'scipy.stats' not in sys.modules"
    picks = tmp_path / "picks.csv"
    picks.write_text(
        "trajectory,time_s,x_m,y_m,z_m,nx,ny,nz,sigma_time_s,sigma_position_m\n"
        "A,0,0,0,0,0,0,1,0.01,0.1\nA,1,5,0,-6,0,0,1,0.01,0.1\nA,2,9,0,-12,0,0,1,0.01,0.1\n"
    )
    arguments = ["reconstruct", str(picks), "--out", str(tmp_path / "out")]
    subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True)
    assert np.isfinite(read_impacts(tmp_path / "out" / "impacts.csv").intervals["rn"][1]).all()
