# SPDX-License-Identifier: GPL-3.0-or-later
"""Remarks and what is stored of them."""

import pytest
from rockfall.core.remarks import Remark, from_text, to_text


@pytest.mark.parametrize(
    "remarks",
    [(), (Remark("± 3 ms\nin two lines.", "note", "clock"),), (Remark("One."), Remark("[Two].", "problem", "T06"))],
)
def test_remarks_come_back_as_they_were_stored(remarks: tuple[Remark, ...]) -> None:
    assert from_text(to_text(remarks)) == remarks


def test_lines_of_version_0_1_0_are_remarks() -> None:
    assert from_text("") == ()
    assert from_text("The terrain is gone.\nSo is the camera.", "warning") == (
        Remark("The terrain is gone.", "warning"),
        Remark("So is the camera.", "warning"),
    )
