# SPDX-License-Identifier: GPL-3.0-or-later
"""The random parts of the impact models follow their published laws."""

import numpy as np
import pytest
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.machinery.chance import normal, normal_quantile, truncated_normal, uniform
from rockfall.core.impact_models.pfeiffer_bowen_1989 import rough_normal
from rockfall.core.impact_models.registry import FORMULAS, MODELS
from rockfall.core.reconstruction.impact import apparent
from scipy import stats

N = 20_000


def same_impacts(speed=8.0, angle_deg=45.0, n=N):
    angle = np.radians(angle_deg)
    v = np.tile([speed * np.cos(angle), 0, -speed * np.sin(angle)], (n, 1))
    return Incident(v, np.tile([0, 0, 1.0], (n, 1)), np.zeros((n, 3)), np.full(n, 0.175), np.full(n, 60.0))


def drawn(name, parameters=None, seed=1, **state):
    incident = same_impacts(**state)
    out = MODELS[name].rebound(incident, parameters, np.random.default_rng(seed))
    return apparent(incident.velocity, out.velocity, incident.normal), out


def test_quantiles_of_the_normal_law():
    u = np.r_[1e-300, 1e-20, 1e-9, np.linspace(1e-4, 1 - 1e-4, 999), 1 - 1e-9]
    computed = [normal_quantile(each) for each in u]
    expected = stats.norm.ppf(np.maximum(u, 2.0**-53))
    np.testing.assert_allclose(computed, expected, rtol=1e-13, atol=1e-14)
    assert np.isfinite([normal_quantile(0.0), normal_quantile(1.0)]).all()


def test_quantiles_of_the_truncated_law():
    u = np.linspace(0.01, 0.99, 99)
    computed = [truncated_normal(each, 0.9, 0.1, 0.6, 1.0) for each in u]
    np.testing.assert_allclose(computed, stats.truncnorm.ppf(u, -3, 1, 0.9, 0.1), rtol=1e-12)


def test_nan_is_the_mean():
    nan = float("nan")
    assert (uniform(nan, 2.0, 4.0), normal(nan, 5.0, 1.0), truncated_normal(nan, 0.9, 0.1, 0.0, 1.0)) == (3, 5, 0.9)


def test_noel_exponent_and_tangential_factor():
    values, _ = drawn("noel_2017")
    exponent = np.log10((values.rn - 0.08) / 10) / np.log10(41)
    assert stats.kstest(exponent, stats.norm(-1.08, 0.15 * (1 - 0.45)).cdf).pvalue > 0.01
    factor = values.rt / 0.6
    assert np.mean(factor > 1 - 1e-9) == pytest.approx(stats.norm(0.69, 0.13).sf(1), abs=0.002)
    assert factor.mean() == pytest.approx(0.69, abs=0.004)
    assert np.median(factor) == pytest.approx(0.69, abs=0.004)
    assert factor.std() == pytest.approx(0.13, abs=0.004)
    assert abs(np.corrcoef(exponent, factor)[0, 1]) < 0.03


def test_rocfall_coefficients():
    values, _ = drawn("stevens_1998", {"rotational": "off", "scale_rn_by_velocity": "off"})
    for coefficient, mean in ((values.rn, 0.35), (values.rt, 0.85)):
        law = stats.truncnorm(-3, 3, mean, 0.04)
        assert stats.kstest(coefficient, law.cdf).pvalue > 0.01
        assert np.abs(coefficient - mean).max() <= 0.12 + 1e-12
    assert abs(np.corrcoef(values.rn, values.rt)[0, 1]) < 0.03


def test_rockyfor3d_normal_coefficient_and_obstacles():
    values, _ = drawn("dorren_2015", {"deviation": "off"})
    rn = values.rn * (1 + (values.vn1 / 9) ** 2)
    assert stats.kstest(rn, stats.uniform(0.9 * 0.43, 0.2 * 0.43).cdf).pvalue > 0.01
    slowed = values.rt**2 * (1 + 2 / 3)
    for height, share in ((0.0, 0.7), (0.05, 0.2), (0.10, 0.1)):
        here = np.isclose(slowed, 1 / (1 + height / 0.175))
        assert here.mean() == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize(
    ("speed", "shares"), [(8.0, (0.72, 0.24, 0.04)), (12.0, (0.77, 0.19, 0.04)), (16.0, (0.85, 0.14, 0.01))]
)
def test_rockyfor3d_deviation(speed, shares):
    _, out = drawn("dorren_2015", speed=speed)
    angle = np.degrees(np.arctan2(out.velocity[:, 1], out.velocity[:, 0]))
    limits = (0.0, 22.5, 45.0, 55.0)
    assert np.abs(angle).max() < 55
    assert np.mean(angle > 0) == pytest.approx(0.5, abs=0.015)
    for low, high, share in zip(limits[:-1], limits[1:], shares, strict=True):
        inside = np.abs(angle)[(np.abs(angle) >= low) & (np.abs(angle) < high)]
        assert inside.size / N == pytest.approx(share, abs=0.01)
        assert stats.kstest(inside, stats.uniform(low, high - low).cdf).pvalue > 0.01


def test_rockyfor3d_deviation_towards_the_dip():
    """A block that crosses a slope dipping to +x is turned towards +x, whichever way it crosses."""
    n = np.tile([np.sin(0.6), 0, np.cos(0.6)], (2, 1))
    incident = Incident(np.array([[0, 9.0, -3], [0, -9.0, -3]]), n, np.zeros((2, 3)), np.ones(2), np.ones(2))
    model, draws = MODELS["dorren_2015"], np.full((2, 7), 0.5)
    still = model.rebound(incident, {"deviation": "off"}, draws=draws).velocity
    turned = model.rebound(incident, {"deviation_side": "downslope"}, draws=draws).velocity
    angle = np.degrees(np.arctan2(turned[:, 1], turned[:, 0]) - np.arctan2(still[:, 1], still[:, 0]))
    first = 22.5 * 0.5
    np.testing.assert_allclose(angle, [-first, first], rtol=1e-9)


def test_rockyfor3d_cone_keeps_the_angle():
    parameters = {"deviation_axis": "cone", "rn_spread": 0.0, "rg20": 0.0, "rg10": 0.0}
    values, out = drawn("dorren_2015", parameters, n=2000)
    still, _ = drawn("dorren_2015", parameters | {"deviation": "off"}, n=2000)
    np.testing.assert_allclose(values.r, still.r, rtol=1e-12)
    assert np.mean(out.velocity[:, 1] > 0) == pytest.approx(0.5, abs=0.05)
    assert values.escape.std() > 0.5


def test_rockyfor3d_spread_of_rt():
    """±10 % on R_t, at most 1."""
    rough = {f"rg{share}": 0.05 for share in (70, 20, 10)} | {"deviation": "off", "rt_spread": 0.1}
    values, _ = drawn("dorren_2015", rough)
    ratio = values.rt**2 * (1 + 2 / 3) * (1 + 0.05 / 0.175)
    assert stats.kstest(ratio, stats.uniform(0.9, 0.2).cdf).pvalue > 0.01
    values, _ = drawn("dorren_2015", rough | {f"rg{share}": 0.0 for share in (70, 20, 10)})
    assert values.rt.max() == pytest.approx(np.sqrt(0.6), rel=1e-12)


def test_crsp_roughness_leans_the_normal_against_the_motion_and_sideways():
    n, v = (0.0, 0.0, 1.0), (8.0, 0.0, -6.0)
    np.testing.assert_allclose(
        rough_normal(v, n, 0.2, 1.0, 1.0), [-np.sin(0.2), 0, np.cos(0.2)], rtol=1e-12, atol=1e-15
    )
    for side in (-1.0, 1.0):
        leaned = rough_normal(v, n, 0.2, 0.0, side)
        np.testing.assert_allclose(leaned, [0, -side * np.sin(0.2), np.cos(0.2)], rtol=1e-12, atol=1e-15)


def test_crsp_roughness_scatters_to_both_sides_and_brakes():
    rough, out = drawn("pfeiffer_bowen_1989", {"roughness": 0.05})
    smooth, _ = drawn("pfeiffer_bowen_1989", n=1)
    across = np.arctan2(out.velocity[:, 1], out.velocity[:, 0])
    assert np.mean(across > 0) == pytest.approx(0.5, abs=0.015)
    assert np.abs(across).max() > 0.1
    assert rough.rt.mean() < smooth.rt[0]


@pytest.mark.parametrize("name", FORMULAS)
def test_same_seed_same_result(name):
    one, other, third = (drawn(name, seed=seed, n=500)[1] for seed in (7, 7, 8))
    np.testing.assert_array_equal(one.velocity, other.velocity)
    assert np.array_equal(one.velocity, third.velocity) == (name not in ("dorren_2015", "noel_2017", "stevens_1998"))
