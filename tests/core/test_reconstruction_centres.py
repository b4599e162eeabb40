# SPDX-License-Identifier: GPL-3.0-or-later
"""Flights of the block's centre, against the demo's exact contacts."""

from pathlib import Path

import numpy as np
import pytest
import rockfall
from rockfall.core.errors import InputError
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import Picks, make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

TRUTH = Path(rockfall.__file__).parent / "assets" / "demo" / "truth.csv"


def exact() -> tuple[Picks, dict[str, Block], np.ndarray, np.ndarray]:
    """Picks at the true contact points with the normal of the touch, blocks, true v1, and where it can be compared."""
    table = read_table(TRUTH, ("trajectory",), ())
    names = np.array(table.text("trajectory"))
    centre = table.vectors(("x_m", "y_m", "z_m"), required=True)
    contact = table.vectors(("contact_x_m", "contact_y_m", "contact_z_m"), required=True)
    v1 = table.vectors(("v1x_mps", "v1y_mps", "v1z_mps"), required=True)
    contacts, diameter = table.numbers("contacts"), table.numbers("diameter_m")
    status = np.array(table.text("status"))
    normal = (centre - contact) / (diameter / 2)[:, None]
    picks = make_picks(names, table.numbers("time_s"), contact - contact.mean(axis=0), status=status, normal=normal)
    single = np.r_[False, (contacts[:-1] == 1) & (names[1:] == names[:-1])]  # the flight starts at the pick itself
    return picks, {name: Block(d, d, d) for name, d in zip(names, diameter, strict=True)}, v1, single


def test_centre_flights_of_exact_contacts_are_exact() -> None:
    picks, blocks, truth, single = exact()
    assert single.sum() > 40
    through = {ends: reconstruct(picks, block=blocks, flights=ends).impacts.v1 for ends in ("contacts", "centres")}
    error = {ends: np.linalg.norm(v1 - truth, axis=1)[single] for ends, v1 in through.items()}
    assert error["centres"].max() < 2e-3
    assert np.median(error["contacts"]) > 0.02  # what joining contact points costs


def test_the_table_keeps_the_contact_points() -> None:
    picks, blocks, _, _ = exact()
    result = reconstruct(picks, block=blocks, flights="centres")
    np.testing.assert_array_equal(result.impacts.position, picks.position[picks.kind == "impact"])
    start = result.flights.start_position[0] - picks.position[result.flights.first_pick[0]]
    assert np.linalg.norm(start) == pytest.approx(blocks["B01"].radius_m, abs=1e-6)


def test_a_pick_without_normal_is_named() -> None:
    picks = make_picks(["A"] * 2, [0.0, 1.0], [[0, 0, 0], [5, 0, -5]], normal=[[0, 0, 1], [np.nan] * 3], row=[2, 3])
    with pytest.raises(InputError, match=r"row 3, trajectory A: The block's centre cannot be told"):
        reconstruct(picks, flights="centres")
