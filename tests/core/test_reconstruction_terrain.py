# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks on a terrain: normals, heights, and what lies off it."""

import numpy as np
import pytest
from rockfall.core.constants import GRAVITY_MPS2
from rockfall.core.errors import InputError
from rockfall.core.exchange.tables import read_impacts, write_impacts
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.sampling import sample_trajectories
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.surface import Surface

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 1000.0, "EPSG:2056")
DIP = np.radians(35)
DOWN, OUT = np.array([np.cos(DIP), 0, -np.sin(DIP)]), np.array([np.sin(DIP), 0, np.cos(DIP)])


def plane(half=60.0, step=2.0):
    """A plane that dips by 35° to the east, through the local origin."""
    n = round(2 * half / step) + 1
    along = np.linspace(-half, half, n)
    x, y = np.meshgrid(along, along, indexing="ij")
    vertices = np.stack([x, y, -np.tan(DIP) * x], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + n, corner + n + 1], axis=1),
            np.stack([corner, corner + n + 1, corner + 1], axis=1),
        ]
    )
    return Surface(vertices, faces.astype(np.int32), SHIFT, "plane.ply")


SURFACE = plane()


def picks_at(position, **more):
    n = len(position)
    return make_picks(["a"] * n, np.arange(n) * 0.9, position, shift=SHIFT, row=np.arange(2, n + 2), **more)


def bounces(n=4):
    return np.arange(n)[:, None] * 7 * DOWN - 15 * DOWN


def test_the_terrain_gives_the_normals():
    impacts = reconstruct(picks_at(bounces()), surface=SURFACE).impacts
    np.testing.assert_allclose(impacts.normal, np.tile(OUT, (4, 1)), atol=1e-9)
    assert (impacts.normal_radius_m > 0).all()
    inner = slice(1, 3)
    np.testing.assert_allclose(impacts.vn1[inner], -(impacts.v1[inner] @ OUT), atol=1e-9)
    speed = np.linalg.norm(impacts.v1[inner] + (impacts.vn1[inner, None]) * OUT, axis=1)
    np.testing.assert_allclose(impacts.vt1[inner], speed, atol=1e-9)


def test_a_normal_in_the_table_comes_first():
    normal = np.full((4, 3), np.nan)
    normal[1] = [0, 0, 2]
    impacts = reconstruct(picks_at(bounces(), normal=normal), surface=SURFACE, normal_radius_m=3.0).impacts
    np.testing.assert_array_equal(impacts.normal[1], [0, 0, 1])
    np.testing.assert_allclose(impacts.normal[2], OUT, atol=1e-9)
    np.testing.assert_array_equal(impacts.normal_radius_m, [3, np.nan, 3, 3])
    np.testing.assert_allclose(impacts.normal_spread, [0, np.nan, 0, 0], atol=1e-6)


def test_the_normals_spread_is_in_the_table(tmp_path):
    """Long roofs of 10° to either side of the level: every face is 10° off the plane through them."""
    rise = 0.1 * np.tan(np.radians(10.0))
    x, y = (values.ravel() for values in np.meshgrid(np.arange(-40, 41) * 0.1, np.arange(-4.0, 4.1), indexing="ij"))
    z = np.where(np.round(x / 0.1) % 2 == 0, 0.0, rise)
    corner = (np.arange(80)[:, None] * 9 + np.arange(8)).ravel()
    ring = np.column_stack([corner, corner + 9, corner + 10, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    roofs = Surface(np.column_stack([x, y, z]), faces, SHIFT, "roofs")
    position = np.array([[-1.0, 0, rise], [0.0, 0, 0], [1.0, 0, rise]])
    impacts = reconstruct(picks_at(position), surface=roofs, normal_radius_m=1.0).impacts
    np.testing.assert_allclose(np.degrees(impacts.normal_spread), 10.0, atol=0.3)
    write_impacts(impacts, tmp_path / "impacts.csv")
    np.testing.assert_allclose(read_impacts(tmp_path / "impacts.csv").normal_spread, impacts.normal_spread, rtol=1e-12)


def test_bounce_heights_above_a_plane():
    result = reconstruct(picks_at(bounces()), surface=SURFACE)
    height = GRAVITY_MPS2 * 0.9**2 / 8
    np.testing.assert_allclose(result.impacts.bounce_height_m[:3], height, rtol=1e-3)
    np.testing.assert_allclose(result.impacts.chord_height_m[:3], height * np.cos(DIP), rtol=1e-9)
    assert not result.impacts.flags["below_terrain"].any()
    samples = sample_trajectories(result, 0.05, SURFACE)
    assert np.nanmax(samples.height_m) == pytest.approx(height, rel=0.01)
    np.testing.assert_allclose(samples.height_m[0], 0, atol=1e-9)


def test_a_flight_under_the_terrain_is_flagged_at_both_its_ends():
    position = bounces(5)
    position[2] -= 0.5 * OUT
    block = Block(0.6, 0.6, 0.6)
    flags = reconstruct(picks_at(position), surface=SURFACE, block=block).impacts.flags["below_terrain"]
    assert flags.tolist() == [False, True, True, True, False]
    larger = Block(2.0, 2.0, 2.0)
    assert not reconstruct(picks_at(position), surface=SURFACE, block=larger).impacts.flags["below_terrain"].any()


def test_picks_of_another_shift_come_into_the_terrains_frame():
    other = GlobalShift(2_600_100.0, 1_199_900.0, 0.0)
    near = picks_at(bounces())
    moved = near.in_shift(other)
    result = reconstruct(moved, surface=SURFACE)
    np.testing.assert_allclose(result.picks.position, near.position, atol=1e-6)
    assert result.impacts.shift == SHIFT


def test_a_pick_a_little_off_is_mentioned():
    position = bounces()
    position[2] += 2.0 * OUT
    (remark,) = reconstruct(picks_at(position), surface=SURFACE).remarks
    assert remark.severity == "warning"
    assert "row 4" in remark.text
    assert "2.0 m off the terrain" in remark.text


@pytest.mark.parametrize("offset", [(0, 0, 50.0), (0, 0, -50.0), (0, 120.0, 0)])
def test_a_pick_far_off_the_terrain_is_an_error_with_its_row(offset):
    position = bounces()
    position[2] += offset
    with pytest.raises(InputError, match="m from the terrain") as caught:
        reconstruct(picks_at(position), surface=SURFACE)
    assert caught.value.row == 4
    assert caught.value.trajectory == "a"


def test_a_far_pick_may_be_a_pass_or_discarded():
    position = bounces()
    position[2] += (0, 0, 50.0)
    kind = ["impact", "impact", "pass", "impact"]
    assert len(reconstruct(picks_at(position, kind=kind), surface=SURFACE).flights) == 2
    status = ["ok", "ok", "discarded", "ok"]
    assert len(reconstruct(picks_at(position, status=status), surface=SURFACE).flights) == 1


@pytest.mark.parametrize(
    ("change", "advice"),
    [
        (lambda survey: survey[:, [1, 0, 2]], "Swap the columns x_m and y_m"),
        (lambda survey: survey - SHIFT.vector, "add the terrain's shift"),
        (lambda survey: survey / 0.3048, "feet"),
        (lambda survey: survey * 1000, "millimetres"),
        (lambda survey: np.add(survey, [300.0, 0, 0]), "neighbours"),
        (lambda survey: survey - np.array([2_000_000.0, 1_000_000, 0]), "same coordinate reference system"),
    ],
)
def test_other_coordinates_are_recognised(change, advice):
    survey = change(SHIFT.to_survey(bounces()))
    picks = make_picks(["a"] * 4, np.arange(4), survey, source="picks.csv")
    with pytest.raises(InputError, match="different coordinate systems") as caught:
        reconstruct(picks, surface=SURFACE)
    assert advice in str(caught.value)
    assert "picks x" in str(caught.value)
    assert "terrain x 2599940.0…2600060.0 m" in str(caught.value)
