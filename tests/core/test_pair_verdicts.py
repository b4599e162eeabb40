# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pairs are believed, and what few of them leave open: a real photograph, and OpenCV's pixels as the truth."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.camera.model import pinhole, project_with_derivatives
from rockfall.core.camera.resection.adjustment import adjusted, without_each
from rockfall.core.camera.resection.problem import Problem, basis_of
from rockfall.core.camera.resection.resect import Resection, resect
from rockfall.core.exchange.cameras import read_pairs
from rockfall.core.workflow.alignment import AlignmentOptions, align

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

from benchmarks.pairs import SIZE, slope_case, solved, tallied

PHOTOGRAPH = Path(__file__).parent.parent / "data" / "engabreen" / "pairs.csv"
STOOD = np.array([446722.0, 7396671.0, 770.0])
"""As it was published, in whole metres."""


def photograph(**how: object) -> Resection:
    return align(read_pairs(PHOTOGRAPH), AlignmentOptions((4272, 2848), **how)).found


def off(found: Resection) -> float:
    return float(np.linalg.norm(found.camera.shift.to_survey(found.camera.position) - STOOD))


def test_a_good_pair_that_decides_the_camera_is_asked_about_and_kept() -> None:
    """All 28 points were surveyed. Without the nearest, 27, the camera stands half as far off again."""
    pairs = read_pairs(PHOTOGRAPH)
    options = AlignmentOptions((4272, 2848), free=("f", "k1"))
    found = align(pairs, options).found
    assert found.used.all()
    assert "27" in found.asked
    (said,) = [remark for remark in found.remarks if remark.about == "pair 27"]
    assert said.text.startswith(
        "Look at pair 27 again: the camera hangs on it, which would stand 1.6 m away without it"
    )
    assert said.severity == "warning"
    without = align(replace(pairs, used=pairs.name != "27"), options).found
    assert off(found) < 0.8
    assert off(without) > 1.5 * off(found)
    away = found.camera.shift.to_survey(found.camera.position) - STOOD
    assert (np.abs(away) < 1.96 * np.sqrt(np.diagonal(found.covariance)[3:6])).all()


def test_no_pair_of_28_is_all_there_is() -> None:
    """Weights of pairs that fit badly once made the camera rest on one pair, and be known not at all without it."""
    assert not any("not at all" in remark.text for remark in photograph().remarks)


def test_a_wrong_pair_of_the_photograph_is_still_left_out() -> None:
    pairs = read_pairs(PHOTOGRAPH)
    pixel = pairs.pixel.copy()
    pixel[15] += [60.0, -45.0]
    found = align(replace(pairs, pixel=pixel), AlignmentOptions((4272, 2848), free=("f", "k1"))).found
    assert found.wrong == ("16",)


def test_a_pair_against_the_others_is_what_they_predict_without_it() -> None:
    """Against least squares without each pair in turn; some weigh less than others (Huber)."""
    case = slope_case(4, 12)
    pixels = case.pixels.copy()
    pixels[3] += [6.0, 0.0]
    start = replace(solved(replace(case, pixels=pixels), robust=False).camera)
    problem = Problem(pixels, case.points, np.ones(12), np.zeros(12), basis_of(start, ("f",)))
    used = np.ones(12, dtype=bool)
    full = adjusted(start, problem, used)
    assert full is not None
    assert full.weight.min() < 0.9
    deletion = without_each(full)
    for i in range(12):
        others = used.copy()
        others[i] = False
        alone = adjusted(start, problem, others)
        assert alone is not None
        np.testing.assert_allclose(deletion.residual[i], alone.residual[i], rtol=0.25, atol=0.6)
        moved = alone.camera.position - full.camera.position
        scale = np.sqrt(np.linalg.eigvalsh(deletion.spread[i, 3:6, 3:6])[-1])
        np.testing.assert_allclose(deletion.moved[i, 3:6], moved, atol=0.25 * scale)


@pytest.mark.parametrize("known", [True, False], ids=["focal length known", "focal length free"])
def test_good_pairs_are_kept_and_wrong_ones_left_out_or_asked_about(known: bool) -> None:
    """12 cases each of 6, 8, 12 and 28 pairs with 0, 1 or 2 that are 15 to 80 px off."""
    for n, most_missed in ((6, 0.25), (8, 0.2), (12, 0.05), (28, 0.0)):
        for wrong in (0, 1) if n == 6 else (0, 1, 2):
            tally = tallied((slope_case(300 + i, n, wrong=wrong) for i in range(12)), focal_known=known)
            assert tally.missed <= most_missed * 12 * max(wrong, 1)
            assert tally.lost <= (0 if not wrong else 2)
            assert not wrong or tally.found > 0.6 * 12 * wrong
            assert wrong or tally.falsely_asked <= 2


@pytest.mark.parametrize("lens_error", [False, True], ids=["lens as assumed", "lens of its own"])
@pytest.mark.parametrize("known", [True, False], ids=["focal length known", "focal length free"])
def test_intervals_of_the_position_hold_for_few_pairs_and_many(known: bool, lens_error: bool) -> None:
    """93 % or more of 95 % intervals: of 14 cases each with 4 to 28 pairs, none wrong (binomial, 1 %: 87 % of 84)."""
    inside, together = [], []
    for n in (4, 5, 6, 8, 12, 28) if known else (5, 6, 8, 12, 28):
        tally = tallied((slope_case(500 + i, n, lens_error=lens_error) for i in range(14)), focal_known=known)
        inside += tally.inside
        together += tally.together
    assert np.mean(inside) >= 0.93
    assert np.mean(together) >= 0.9


def test_the_camera_of_pairs_of_which_one_was_left_out_may_be_another_one() -> None:
    """The choice is part of what is not known: of six pairs and one wrong, the intervals hold whichever was chosen."""
    tally = tallied(slope_case(700 + i, 6, wrong=1) for i in range(25))
    assert np.mean(tally.together) >= 0.84  # binomial, 1 %, of 25
    assert np.mean(tally.inside) >= 0.9


def test_clicks_of_twice_the_stated_error_do_not_narrow_intervals_of_few_pairs() -> None:
    tally = tallied(slope_case(900 + i, n, sigma_px=2.0) for n in (5, 6) for i in range(20))
    assert np.mean(tally.inside) >= 0.87


def test_small_residuals_of_few_pairs_are_taken_for_chance() -> None:
    """Five pairs that fit to a tenth of a pixel are known no better than their clicks were stated."""
    case = slope_case(11, 5, sigma_px=0.1)
    found = solved(case)
    assert found.rmse_px < 0.3
    least = np.linalg.inv(_normal(found, case.points))[3:6, 3:6]
    assert np.linalg.eigvalsh(found.covariance[3:6, 3:6] - 1.3**2 * least).min() > 0


def _normal(found: Resection, points: np.ndarray) -> np.ndarray:
    seen = project_with_derivatives(found.camera, points)
    focal = seen.d_intrinsics[:, :, :1] + seen.d_intrinsics[:, :, 1:2]
    slopes = np.concatenate([seen.d_rotation, seen.d_position, focal], axis=2).reshape(-1, 7)
    return slopes.T @ slopes


def test_a_lens_that_was_calibrated_is_not_doubted() -> None:
    """Of the same pairs the position is known better where the lens's centre and distortion are known."""
    case = slope_case(5, 12)
    calibrated = replace(pinhole(*SIZE, case.focal), cx=SIZE[0] / 2 + 0.5, cy=SIZE[1] / 2 + 0.5, k1=1e-6)
    sigma = [
        np.sqrt(np.trace(resect(case.pixels, case.points, *SIZE, free=(), camera=camera).covariance[3:6, 3:6]))
        for camera in (pinhole(*SIZE, case.focal), calibrated)
    ]
    assert sigma[0] > 1.15 * sigma[1]
    assert not resect(case.pixels, case.points, *SIZE, free=(), camera=calibrated).by_lens.any()


@pytest.mark.parametrize("lens_error", [False, True])
def test_what_is_seen_elsewhere_is_as_uncertain_as_the_whole_camera(lens_error: bool) -> None:
    """Points that were no pairs: their pixels lie in 95 % ellipses of pose and lens together, not of the pose alone."""
    held, whole = [], []
    for n in (5, 6, 8, 12):
        for seed in range(12):
            case = slope_case(1300 + seed, n + 8, sigma_px=1e-6, lens_error=lens_error)
            clicked = case.pixels[:n] + np.random.default_rng(seed).normal(size=(n, 2))
            found = solved(replace(case, pixels=np.clip(clicked, 1, np.array(SIZE) - 1), points=case.points[:n]))
            if found is None or found.whole is None:
                continue
            seen = project_with_derivatives(found.camera, case.points[n:])
            gap = seen.pixel - case.pixels[n:]
            pose = np.concatenate([seen.d_rotation, seen.d_position], axis=2)
            both = np.concatenate([pose, seen.d_intrinsics], axis=2)
            for slopes, covariance, inside in (
                (pose, found.pose_covariance_given_lens, held),
                (both, found.whole, whole),
            ):
                spread = slopes @ covariance @ np.swapaxes(slopes, 1, 2) + 1e-6 * np.eye(2)
                inside += (np.einsum("ni,nij,nj->n", gap, np.linalg.inv(spread), gap) < 5.99).tolist()
    assert np.nanmean(whole) > 0.93
    assert np.nanmean(held) < 0.92
