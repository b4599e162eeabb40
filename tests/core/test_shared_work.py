# SPDX-License-Identifier: GPL-3.0-or-later
"""What workers on one machine share comes out of its file as it went in, and one's own changes stay one's own."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core.workflow.shared_work import read_shared, write_shared


def test_what_is_shared_is_the_same_and_can_be_written_to(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    one = {
        "words": "a text", "single": rng.random(7).astype(np.float32), "large": rng.random((1000, 3)),
        "none": np.empty((0, 3)), "whole": np.arange(5, dtype=np.int8),
    }  # fmt: skip
    write_shared(one, tmp_path / "work")
    first, second = read_shared(tmp_path / "work"), read_shared(tmp_path / "work")
    for name, value in one.items():
        np.testing.assert_array_equal(first[name], value)
        if isinstance(value, np.ndarray):
            assert first[name].dtype == value.dtype
            assert first[name].flags.writeable
            assert first[name].ctypes.data % 64 == 0 or not value.size
    first["large"][:] = -1
    np.testing.assert_array_equal(second["large"], one["large"])
    np.testing.assert_array_equal(read_shared(tmp_path / "work")["large"], one["large"])


def test_without_arrays(tmp_path: Path) -> None:
    write_shared(("nothing", 3), tmp_path / "work")
    assert read_shared(tmp_path / "work") == ("nothing", 3)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no disk that is always full")
def test_a_full_disk_is_an_error_of_the_system() -> None:
    with pytest.raises(OSError, match="No space"):
        write_shared(np.zeros(1_000_000), Path("/dev/full"))
