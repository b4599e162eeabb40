# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs that were written another way than they are read: no camera is given, and the reason is."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.pairs import Pairs
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.workflow.alignment import AlignmentOptions, align

SIZE = (1600, 1500)
COUNT = 14


def marks(seed=5):
    """Pairs of a slope, to half a pixel."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-18, 18, COUNT), rng.uniform(-15, 15, COUNT)
    point = np.stack([x, y, -0.6 * x + rng.normal(size=COUNT)], axis=1)
    camera = look_at(*SIZE, (60.0, -30.0, 15.0), (0, 0, 0), focal_px=1900.0)
    pixel = project(camera, point) + 0.5 * rng.normal(size=(COUNT, 2))
    name = np.array([f"T{i:02d}" for i in range(COUNT)])
    unknown = np.full(COUNT, np.nan)
    used = np.ones(COUNT, dtype=np.bool_)
    return Pairs(pixel, point, name, np.full(COUNT, -1), unknown, unknown, used, GlobalShift())


def refused(pairs):
    with pytest.raises(InputError) as caught:
        align(pairs, AlignmentOptions(size=SIZE))
    return str(caught.value)


def test_good_pairs_give_their_camera():
    found = align(marks(), AlignmentOptions(size=SIZE)).found
    assert np.linalg.norm(found.camera.position - [60, -30, 15]) < 1
    assert found.rmse_px < 1


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (lambda q, p: (np.stack([q[:, 0], SIZE[1] - q[:, 1]], axis=1), p), "v_px counted from the bottom"),
        (lambda q, p: (q[:, ::-1], p), "u_px and v_px exchanged"),
        (lambda q, p: (q, p[:, [1, 0, 2]]), "x and y exchanged"),
        (lambda q, p: (q, p[:, [0, 2, 1]]), "y and z exchanged"),
        (lambda q, p: (q, p * [1, 1, -1]), "heights, not depths"),
        (lambda q, p: (np.stack([SIZE[0] - q[:, 0], q[:, 1]], axis=1), p), "not mirrored"),
    ],
)
def test_what_was_exchanged_is_named(written, said):
    pairs = marks()
    pixel, point = written(pairs.pixel, pairs.point)
    assert said in refused(replace(pairs, pixel=pixel, point=point))


def test_pairs_of_other_marks_are_refused_with_the_worst_of_them():
    pairs = marks()
    told = refused(replace(pairs, point=np.random.default_rng(8).permutation(pairs.point)))
    assert "No camera fits the 14 pairs" in told
    assert "root mean square" in told
    assert "same marks" in told


def test_one_wrong_pair_is_left_out_as_ever():
    pairs = marks()
    pixel = pairs.pixel.copy()
    pixel[4] += [300, -200]
    aligned = align(replace(pairs, pixel=pixel), AlignmentOptions(size=SIZE))
    assert aligned.found.wrong == ("T04",)
