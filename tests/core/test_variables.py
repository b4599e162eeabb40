# SPDX-License-Identifier: GPL-3.0-or-later
"""Variables of the graphs: energies that add up, the slope of a plane, scars of a table's own columns."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.variables import APPARENT, known_variables, measured_values, model_values
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

SLOPE_DEG = 35.0
SPHERE = Block(0.4, 0.4, 0.4, 2600.0)


@pytest.fixture(scope="module")
def impacts():
    """Impacts of a sphere on a plane of 35°, with measured spin and scars, the second of unknown depth."""
    rng = np.random.default_rng(11)
    step = rng.uniform(0.4, 0.9, 9)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(9, 3)) * 0.2, axis=0)
    slope = np.radians(SLOPE_DEG)
    normal = np.tile([np.sin(slope), 0.0, np.cos(slope)], (9, 1))
    picks = make_picks(
        ["A"] * 9, np.cumsum(step), position, normal=normal, angular_velocity=rng.normal(size=(9, 3)) * 20
    )
    found = reconstruct(picks, block=SPHERE).impacts
    return replace(found, extra={"scar_depth_m": np.array(["0.13", "", "?", *["0.2"] * 6])})


def test_energies_add_up_and_follow_from_mass_and_spin(impacts) -> None:
    row = np.arange(len(impacts))
    value = {name: measured_values(impacts, row, name) for name in known_variables(impacts)}
    mass = 2600 * np.pi / 6 * 0.4**3
    known = np.isfinite(value["kinetic1_j"])
    assert known.sum() == 8
    np.testing.assert_allclose(value["kinetic_n1_j"] + value["kinetic_t1_j"], value["kinetic1_j"])
    np.testing.assert_allclose(value["kinetic_n2_j"] + value["kinetic_t2_j"], value["kinetic2_j"])
    np.testing.assert_allclose(value["kinetic1_j"][known], 0.5 * mass * value["v1_mps"][known] ** 2)
    np.testing.assert_allclose(value["rotational1_j"], 0.5 * 0.4 * mass * 0.2**2 * value["omega1_radps"] ** 2)
    np.testing.assert_allclose(value["slope_deg"], SLOPE_DEG)


def test_only_what_the_table_has_is_offered(impacts) -> None:
    known = known_variables(impacts)
    assert "scar_depth_m" in known
    assert not {"scar_length_m", "bounce_height_m", "normal_spread_deg"} & set(known)
    np.testing.assert_array_equal(
        measured_values(impacts, np.array([0, 1, 2, 3]), "scar_depth_m"), [0.13, np.nan, np.nan, 0.2]
    )
    bare = replace(impacts, mass_kg=np.full(9, np.nan), v1=np.full((9, 3), np.nan), rn=np.full(9, np.nan))
    assert set(APPARENT) <= set(known_variables(bare))
    assert "kinetic_n1_j" not in known_variables(bare)


def test_energies_of_a_model(impacts) -> None:
    predictions = compare(impacts, ["wyllie_2014"], spin="table")
    at = predictions.row
    found = {
        name: model_values(impacts, predictions, 0, 0, name)
        for name in ("kinetic_n2_j", "kinetic_t2_j", "kinetic2_j", "rotational2_j", "kinetic_n1_j")
    }
    np.testing.assert_allclose(found["kinetic_n2_j"] + found["kinetic_t2_j"], found["kinetic2_j"])
    np.testing.assert_array_equal(found["kinetic_n1_j"], measured_values(impacts, at, "kinetic_n1_j"))
    spin = np.linalg.norm(predictions.omega2[0, 0], axis=1)
    inertia = 0.4 * impacts.mass_kg[at] * 0.2**2
    np.testing.assert_allclose(found["rotational2_j"], 0.5 * inertia * spin**2)
