# SPDX-License-Identifier: GPL-3.0-or-later
"""What a reconstruction refuses, word for word."""

import numpy as np
import pytest
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import Picks, make_picks
from rockfall.core.reconstruction.sampling import sample_trajectories
from rockfall.core.reconstruction.trajectory import reconstruct

PLACES = np.array([(0.0, 0, 0), (3, 0, -2), (6, 0, -4)])


def run(**columns: object) -> Picks:
    return make_picks(["a"] * 3, **({"time_s": [0, 1, 2], "position": PLACES} | columns))


@pytest.mark.parametrize("name", ["d1", "d2", "d3", "density"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_blocks_that_cannot_be(name: str, value: float) -> None:
    with pytest.raises(RockfallError) as caught:
        Block(**{name: value})
    assert str(caught.value) == f"The block's {name} must be a positive number, not {value}."


def test_a_shape_that_does_not_exist() -> None:
    with pytest.raises(RockfallError) as caught:
        Block(shape="sphere")
    assert str(caught.value) == "Unknown block shape 'sphere': use one of ellipsoid, box."


def test_a_trajectory_without_a_block() -> None:
    with pytest.raises(RockfallError) as caught:
        reconstruct(run(), block={"b": Block(), "c": Block()})
    assert str(caught.value) == "No block is given for trajectory a. Blocks are given for: b, c."


@pytest.mark.parametrize("value", [0.0, -0.1, np.nan, np.inf])
def test_steps_in_time_are_positive(value: float) -> None:
    with pytest.raises(RockfallError) as caught:
        sample_trajectories(reconstruct(run()), value)
    assert str(caught.value) == f"The time step must be a positive number [s], not {value}."


@pytest.mark.parametrize("value", [-9.81, np.nan, np.inf])
def test_gravity_is_a_number_of_zero_or_more(value: float) -> None:
    with pytest.raises(RockfallError) as caught:
        reconstruct(run(), gravity_mps2=value)
    assert str(caught.value) == f"Gravity must be a number of zero or more [m/s²], not {value}."
    assert (reconstruct(run(), gravity_mps2=0.0).flights.start_velocity == PLACES[1]).all()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_the_radius_of_normals_is_positive(value: float) -> None:
    with pytest.raises(RockfallError) as caught:
        reconstruct(run(), normal_radius_m=value)
    assert str(caught.value) == f"The normal's radius must be a positive number [m], not {value}."


NOT_FINITE = "The time or the position is not a finite number. Give time_s, x_m, y_m and z_m."
NO_DEVIATION = "is not a standard deviation. Give a number of zero or more, or nothing."
KINDS = "Use one of impact, release, pass, contact, stop, takeoff."


@pytest.mark.parametrize(
    ("columns", "row", "message"),
    [
        ({"time_s": [0, np.nan, 2]}, 3, NOT_FINITE),
        ({"time_s": [0, 1, np.inf]}, 4, NOT_FINITE),
        ({"position": np.where(PLACES == 6, np.nan, PLACES)}, 4, NOT_FINITE),
        ({"kind": ["release", "imapct", "stop"]}, 3, f"Unknown kind 'imapct'. Did you mean impact? {KINDS}"),
        ({"kind": ["release", "xyz", "stop"]}, 3, f"Unknown kind 'xyz'. {KINDS}"),
        (
            {"status": ["ok", "ok", "gone"]},
            4,
            "Unknown status 'gone'. Use one of ok, doubtful, shattered, discarded.",
        ),
        (
            {"normal": [(0, 0, 1), (np.nan, 0, 1), (0, 0, 1)]},
            3,
            "Only a part of the terrain normal is given. Give nx, ny and nz, or none of them.",
        ),
        (
            {"normal": [(0, 0, 0), (0, 0, 1), (0, 0, 1)]},
            2,
            "The terrain normal has length zero. Leave nx, ny, nz empty to take the terrain's.",
        ),
        ({"sigma_time_s": [0, -1e-3, 0]}, 3, f"sigma_time_s {NO_DEVIATION}"),
        ({"sigma_position_m": [0, 0, np.inf]}, 4, f"sigma_position_m {NO_DEVIATION}"),
        (
            {"time_s": [0, 1, 1]},
            4,
            "Two picks at one time, 1.0 s (the other one is in row 3). Remove one of them, or correct its time.",
        ),
        (
            {"time_s": [0, 2, 1.5]},
            4,
            "The times are not sorted: 1.5 s comes after 2.0 s in row 3. "
            "Put the rows of a trajectory in time order, or correct the time.",
        ),
        (
            {"kind": ["impact", "release", "impact"]},
            3,
            "A release in the middle of a run: the block is already moving. "
            "Give the new run its own trajectory name, or end the run before with a stop.",
        ),
    ],
)
def test_picks_that_cannot_be(columns: dict[str, object], row: int, message: str) -> None:
    with pytest.raises(InputError) as caught:
        run(row=[2, 3, 4], source="picks.csv", **columns)
    assert str(caught.value) == f"picks.csv, row {row}, trajectory a: {message}"


def test_picks_without_a_table_have_no_rows() -> None:
    """A scene's picks are refused by their trajectory alone."""
    with pytest.raises(InputError) as caught:
        run(time_s=[0, 1, 1])
    assert str(caught.value) == ("trajectory a: Two picks at one time, 1.0 s. Remove one of them, or correct its time.")
    with pytest.raises(InputError) as caught:
        run(time_s=[0, 1, 0.5])
    assert str(caught.value) == (
        "trajectory a: The times are not sorted: 0.5 s comes after 1.0 s. "
        "Put the rows of a trajectory in time order, or correct the time."
    )
    with pytest.raises(InputError) as caught:
        make_picks(["a", "", "b"], [0, 1, 2], PLACES, row=[2, 3, 4])
    assert str(caught.value) == (
        "row 3, trajectory : The trajectory has no name. Name the block's run in the column trajectory."
    )
