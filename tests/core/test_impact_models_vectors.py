# SPDX-License-Identifier: GPL-3.0-or-later
"""Impact models against numbers that were computed independently from the published equations."""

import csv
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.impact_models.dorren_2015 import penetration_depth
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.registry import FORMULAS, MODELS
from rockfall.core.reconstruction.impact import apparent

with (Path(__file__).parent.parent / "data" / "impact_model_vectors.csv").open(encoding="utf-8") as stream:
    VECTORS = list(csv.DictReader(stream))

DIP = np.radians(40)
UP = (0.0, 0.0, 1.0)
INCIDENT = {
    "A": (UP, (8.0, 0.0, -6.0), (0.0, 0.0, 0.0)),
    "B": (UP, (8.0, 0.0, -6.0), (0.0, 40.0, 0.0)),
    "C": ((np.sin(DIP), 0.0, np.cos(DIP)), (7.0, 0.0, -9.0), (0.0, 30.0, 0.0)),
    "E": (UP, (12.0, 0.0, -0.5), (0.0, 60.0, 0.0)),
}


def rough(height, shape="sphere"):
    return {"rn": 0.43, "rg70": height, "rg20": height, "rg10": height, "block_shape": shape}


CASES = {
    "azimi_velocity": ("azimi_desvarreux_1977", {}),
    "azimi_energy": ("azimi_desvarreux_1977", {"definition": "energy"}),
    "crsp": ("pfeiffer_bowen_1989", {}),
    "rocfall_rotational_off": ("stevens_1998", {"rotational": "off"}),
    "rockyfor3d_moh_0": ("dorren_2015", rough(0.0)),
    "rockyfor3d_moh_5": ("dorren_2015", rough(0.05)),
    "rockyfor3d_moh_5_rectangular": ("dorren_2015", rough(0.05, "rectangular")),
    "rockyfor3d_moh_5_turned_20": ("dorren_2015", rough(0.05)),
    "noel": ("noel_2017", {}),
    "noel_other_exponents": ("noel_2017", {"rn_exponent": -1.2, "rt": 0.85}),
    "wyllie_cube": ("wyllie_2014", {}),
    "wyllie_sphere": ("wyllie_2014", {"inertia": "sphere"}),
}
DRAWS = {"rockyfor3d_moh_5_turned_20": [np.nan] * 4 + [0.1, 20 / 22.5, 0.9]}


def incident(name, mass=60.0):
    n, v, w = (np.array([each]) for each in INCIDENT[name])
    return Incident(v, n, w, np.array([0.175]), np.array([mass]))


@pytest.mark.parametrize("vector", VECTORS, ids=lambda row: f"{row['case']}-{row['incident']}")
def test_vector(vector):
    name, parameters = CASES[vector["case"]]
    model, state = MODELS[name], incident(vector["incident"])
    draws = np.array([DRAWS[vector["case"]]]) if vector["case"] in DRAWS else None
    out = model.rebound(state, parameters, draws=draws)
    seen = apparent(state.velocity, out.velocity, state.normal)
    computed = [*out.velocity[0], *out.angular_velocity[0], seen.rn[0], seen.rt[0], seen.r[0]]
    computed.append(np.degrees(seen.theta_dev[0]))
    np.testing.assert_allclose(computed, [float(cell) for cell in list(vector.values())[2:]], rtol=1e-6, atol=1e-6)


def test_every_case_has_vectors():
    assert {row["case"] for row in VECTORS} == set(CASES)


@pytest.mark.parametrize("name", INCIDENT)
def test_rocfall_without_chance_is_crsp(name):
    crsp, rocfall = (MODELS[model].rebound(incident(name)) for model in ("pfeiffer_bowen_1989", "stevens_1998"))
    np.testing.assert_allclose(rocfall.velocity, crsp.velocity, rtol=1e-14)
    np.testing.assert_allclose(rocfall.angular_velocity, crsp.angular_velocity, rtol=1e-14)


def test_noel_transfer_by_energy():
    """R_N = 2 asks for more than v_T2 has to give: exactly 20 % of its energy becomes normal."""
    state = incident("E")
    out = MODELS["noel_2017"].rebound(state, {"rn_limit": 10.0, "transfer_basis": "energy"})
    restituted = 0.69 * (0.6 * 12 + 0.4 * 0.175 * 60)
    np.testing.assert_allclose(out.velocity[0, 0], np.sqrt(0.8) * restituted, rtol=1e-12)
    np.testing.assert_allclose(out.velocity[0, 2], np.sqrt(0.25 + 0.2 * restituted**2), rtol=1e-12)


def test_noel_gives_no_more_velocity_than_its_share():
    out = MODELS["noel_2017"].rebound(incident("E"), {"rn_limit": 10.0})
    restituted = 0.69 * (0.6 * 12 + 0.4 * 0.175 * 60)
    np.testing.assert_allclose(out.velocity[0, 0], 0.8 * restituted, rtol=1e-12)


def test_the_paper_s_outliers_at_grazing_incidence():
    """Noël et al. 2018: R_N = 24.4, 8.1 and 5.1 at 0.3°, 1.1° and 4.3°; the two angle laws there."""
    angle, speed = np.radians([0.3, 1.1, 4.3]), np.array([19.0, 16.0, 11.0])
    v = speed[:, None] * np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    state = Incident(v, np.tile(UP, (3, 1)), np.zeros((3, 3)), np.full(3, 0.175), np.full(3, 60.0))
    wyllie = MODELS["wyllie_2014"].rebound(state).velocity[:, 2] / -v[:, 2]
    np.testing.assert_allclose(wyllie, [67.4, 17.7, 4.34], rtol=2e-3)
    noel = MODELS["noel_2017"].rebound(state, {"transfer": 1.0}).velocity[:, 2] / -v[:, 2]
    np.testing.assert_allclose(noel, 2.0, rtol=1e-12)


def test_wyllie_stays_finite_at_grazing_incidence():
    """v_N2/|v1| = R_N sin θ1 at 0.3°, 5°, 45° and 90°."""
    angle = np.radians([0.3, 5, 45, 90])
    v = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    state = Incident(v, np.tile(UP, (4, 1)), np.zeros((4, 3)), np.full(4, 0.175), np.full(4, 60.0))
    np.testing.assert_allclose(
        MODELS["wyllie_2014"].rebound(state).velocity[:, 2], [0.353, 0.324, 0.273, 0.189], atol=6e-4
    )


@pytest.mark.parametrize(("rn", "depth"), [(0.23, 0.1687), (0.28, 0.0913), (0.33, 0.0535), (0.34, 0.0)])
def test_penetration(rn, depth):
    """A sphere of 0.35 m and 2600 kg/m³ at 10 m/s."""
    mass = 2600 * np.pi / 6 * 0.35**3
    assert penetration_depth(rn, 10.0, 0.175, mass) == pytest.approx(depth, abs=6e-5)


def test_deep_penetration_is_that_of_the_logarithm():
    """Pichler et al. 2005 by hand: R_n = 0.23, d = 1 m, 2600 kg; x = 2N/π·ln[(1 + I/N)/(1 + kπ/4N)] + k."""
    hard, sharp, k = 55e9 * 0.23**7, 2600 / (1.2 * (1200 * np.log(0.23) + 3300)), 1.207
    edge = np.sqrt(k * np.pi / 4 * hard / 2600)  # the speed [m/s] at which the depth is k diameters
    assert penetration_depth(0.23, edge, 0.5, 2600.0) == pytest.approx(k, rel=1e-12)
    for speed in (1.001 * edge, 3 * edge):
        ratio = (1 + 2600 * speed**2 / hard / sharp) / (1 + k * np.pi / 4 / sharp)
        depth = 2 * sharp / np.pi * np.log(ratio) + k
        assert penetration_depth(0.23, speed, 0.5, 2600.0) == pytest.approx(depth, rel=1e-12)
        assert depth > k


def test_noel_without_scatter_is_its_mean():
    """A standard deviation of zero is allowed, and then chance has no part."""
    still = {"rn_exponent_sd": 0, "rt_sd": 0}
    for name in INCIDENT:
        mean, drawn = (
            MODELS["noel_2017"].rebound(incident(name), still, rng) for rng in (None, np.random.default_rng(1))
        )
        np.testing.assert_array_equal(drawn.velocity, mean.velocity)


def test_a_block_that_does_not_approach_has_no_impact():
    state = Incident(
        np.array([[1.0, 0, 1], [1, 0, 0], [np.nan, 0, -1]]),
        np.tile(UP, (3, 1)),
        np.zeros((3, 3)),
        np.full(3, 0.2),
        np.full(3, 50.0),
    )
    for name in FORMULAS:
        model = MODELS[name]
        assert np.isnan(model.rebound(state).velocity).all()


@pytest.mark.parametrize("name", FORMULAS)
def test_the_plain_function_is_the_compiled_one(name):
    """Same numbers without numba, with and without chance: what is compiled is the function as written."""
    model = MODELS[name]
    numbers = model.numbers()
    rng = np.random.default_rng(4)
    for which in INCIDENT:
        for draws in (np.full((1, model.draws), np.nan), rng.random((1, model.draws))):
            out = model.rebound(incident(which), draws=draws)
            n, v, w = INCIDENT[which]
            named = model.parameter_type(*numbers.tolist()), model.draw_type(*draws[0].tolist())
            plain = model.function(v, n, w, 0.175, 60.0, *named)
            np.testing.assert_allclose(out.velocity[0], plain[0], rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(out.angular_velocity[0], plain[1], rtol=1e-12, atol=1e-12)
