# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.joining import join, moved
from rockfall.core.terrain.orientation import block_scale_normals
from rockfall.core.terrain.raycast import cast_rays
from rockfall.core.terrain.surface import Surface

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 500.0, "EPSG:2056")


@pytest.fixture(scope="module")
def whole() -> Surface:
    """A rough slope of 60 × 40 half-metre cells."""
    x, y = np.meshgrid(np.arange(61) * 0.5, np.arange(41) * 0.5)
    z = 0.7 * x + np.random.default_rng(3).normal(0, 0.05, x.shape)
    i = np.arange(x.size, dtype=np.int32).reshape(x.shape)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return Surface(np.stack([x, y, z], -1).reshape(-1, 3), faces, SHIFT, "whole")


def part(whole: Surface, which: np.ndarray, name: str) -> Surface:
    faces = whole.faces[which]
    used, number = np.unique(faces, return_inverse=True)
    return Surface(whole.vertices[used], number.reshape(-1, 3).astype(np.int32), whole.shift, name)


@pytest.fixture(scope="module")
def tiles(whole: Surface) -> list[Surface]:
    """Three strips; the third in single precision and another shift, as Blender gives it back."""
    x = whole.vertices[whole.faces].mean(axis=1)[:, 0]
    strips = [part(whole, which, name) for which, name in ((x < 11, "a"), ((x > 11) & (x < 20), "b"), (x > 20, "c"))]
    other = moved(strips[2], GlobalShift(2_599_900.0, 1_200_100.0, 400.0))
    rounded = other.vertices.astype(np.float32).astype(np.float64)
    return [*strips[:2], Surface(rounded, other.faces, other.shift, "c")]


def test_joined_tiles_are_the_whole(whole, tiles):
    joined = join(tiles)
    assert joined.name == "a, b, c"
    assert joined.shift == SHIFT
    assert len(joined.vertices) == len(whole.vertices)
    assert len(joined.faces) == len(whole.faces)
    assert (joined.neighbours == -1).sum() == (whole.neighbours == -1).sum(), "only the outer border is left"
    shared = sum(len(tile.vertices) for tile in tiles) - len(whole.vertices)
    assert f"Their borders share {shared:,} points, which are one each." in joined.summary
    points = np.random.default_rng(0).uniform([1, 1], [29, 19], (500, 2))
    points[:100, 0] = np.random.default_rng(1).uniform(10.5, 11.5, 100)  # around a seam
    above = np.column_stack([points, np.full(500, 100.0)])
    ours, exact = cast_rays(joined, above, (0, 0, -1)), cast_rays(whole, above, (0, 0, -1))
    np.testing.assert_allclose(ours.distance, exact.distance, atol=2e-4)
    normals = block_scale_normals(joined, exact.point, 1.5).normal
    np.testing.assert_allclose(normals, block_scale_normals(whole, exact.point, 1.5).normal, atol=2e-4)


def test_a_seam_that_is_not_sewn_would_show(whole, tiles):
    """The check above can fail: the tiles beside each other, not sewn, give other normals at the seam."""
    first, second = tiles[:2]
    loose = Surface(
        np.concatenate([first.vertices, second.vertices]),
        np.concatenate([first.faces, second.faces + np.int32(len(first.vertices))]),
        SHIFT,
        "loose",
    )
    seam = np.array([[11.0, 10.0, 7.7]])
    away = block_scale_normals(loose, seam, 1.5).normal - block_scale_normals(whole, seam, 1.5).normal
    assert np.abs(away).max() > 1e-3


def test_one_tile_is_itself_and_none_is_refused(whole):
    assert join([whole]) is whole
    with pytest.raises(InputError, match="no terrain"):
        join([])


def test_tiles_apart_are_not_sewn(whole):
    far = Surface(whole.vertices + np.array([0, 20.002, 0]), whole.faces, SHIFT, "far")
    joined = join([whole, far])
    assert len(joined.vertices) == 2 * len(whole.vertices)


def test_the_same_tile_twice_keeps_two_sheets_that_answer_rays(whole):
    joined = join([whole, whole])
    hit = cast_rays(joined, [[7.3, 8.1, 50.0]], (0, 0, -1))
    assert hit.distance == pytest.approx(cast_rays(whole, [[7.3, 8.1, 50.0]], (0, 0, -1)).distance)


def test_survey_coordinates_stay(whole):
    other = moved(whole, GlobalShift(2_500_000.0, 0.0, 0.0))
    np.testing.assert_allclose(
        other.shift.to_survey(other.vertices), whole.shift.to_survey(whole.vertices), atol=1e-9, rtol=0
    )
    assert moved(whole, SHIFT) is whole
