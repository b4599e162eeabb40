# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are written: what is in them, and names that are none."""

import cv2
import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.footage.pair_picture import COMPUTED, LEFT_OUT, MARKED, draw_pairs
from rockfall.core.opencv import write_picture


def test_a_picture_comes_back_from_its_file(tmp_path):
    picture = np.random.default_rng(0).integers(0, 255, (20, 30, 3), dtype=np.uint8)
    path = tmp_path / "Blöcke – 石.png"
    write_picture(path, picture)
    np.testing.assert_array_equal(cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_COLOR), picture)


@pytest.mark.parametrize("name", ["picture.xyz", "picture", "picture.mp4"])
def test_a_name_that_is_none_of_a_picture(tmp_path, name, capfd):
    with pytest.raises(InputError) as refused:
        write_picture(tmp_path / name, np.zeros((4, 4, 3), np.uint8))
    assert str(refused.value) == f"{tmp_path / name}: This is no name of a picture. Write it as .png."
    assert not (tmp_path / name).exists()
    assert capfd.readouterr().err == ""


def test_pairs_are_drawn_where_they_are():
    """A ring around each mark, a cross where the camera sees the point, red where the pair was left out."""
    marked, computed = np.array([[300.5, 200.5], [900.5, 500.5]]), np.array([[330.5, 240.5], [np.nan, np.nan]])
    picture = draw_pairs(np.zeros((720, 1280, 3), np.uint8), marked, computed, ["", ""], np.array([True, False]))
    assert picture[200, 309].tolist() == list(MARKED)
    assert picture[240, 330].tolist() == list(COMPUTED)
    assert picture[500, 909].tolist() == list(LEFT_OUT)
    assert picture[200, 300].tolist() == [0, 0, 0]
    rows, columns = np.nonzero((picture == COMPUTED).all(axis=2))
    assert (rows.mean(), columns.mean()) == pytest.approx((240, 330), abs=0.1)
