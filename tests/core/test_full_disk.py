# SPDX-License-Identifier: GPL-3.0-or-later
"""On a disk that is full, whatever Blender says of it, the message says that, and the old file is as it was."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.film.composed.solids import solid
from rockfall.core.film.job import FilmJob
from rockfall.core.film.maker import make_file
from rockfall.core.film.room import watched_room
from rockfall.core.georeference import GlobalShift
from rockfall.core.output import output_file
from rockfall.core.outreach.animation import Animation
from rockfall.core.outreach.animator import write_animation
from rockfall.core.progress import silent

BYTES = 3_000_000
FILL = """
import json, sys
file = {file}
try:
    open(file, "wb").write(bytes(9_000_000))
except OSError:
    pass
"""
SAYS = "print('rockfall error Blender could not write it: the stage is not writable.')"
REMOVES = "import os, time; time.sleep(0.7); os.remove(file)\n"
ENDS = {"says another thing": SAYS, "crashes": "sys.exit(6)", "says nothing": "", "removes it": REMOVES + SAYS}


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Path]:
    """A disk of 3 MB."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={BYTES}", "tmpfs", str(place)]
    if sys.platform != "linux" or os.geteuid() or subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("a small disk can be made by root on Linux alone")
    yield place
    subprocess.run(["umount", "-l", str(place)], check=True)


def animation() -> Animation:
    one = np.ones((1, 2, 3))
    return Animation(
        25.0, ("A",), ("",), np.ones((1, 3)), np.ones((1, 3)), one, np.tile([1.0, 0, 0, 0], (1, 2, 1)), (one[0],),
        solid("box", np.ones(3)), None, np.empty((0, 3)), GlobalShift(), {},
    )  # fmt: skip


def script(file: str, end: str) -> list[str]:
    return [sys.executable, "-c", FILL.format(file=file) + ENDS[end]]


@pytest.mark.parametrize("end", ENDS)
def test_an_animation(small: Path, end: str) -> None:
    old = small / "a.usdc"
    old.write_bytes(b"old")
    command = script("json.loads(sys.argv[1])['files'][0]", end)
    with pytest.raises(InputError) as caught:
        write_animation(animation(), [old, small / "a.glb"], command)
    assert str(caught.value) == (
        f"{small}: The disk is full: a.usdc, a.glb cannot be written. Make room, or choose a folder on another disk."
    )
    assert [path.name for path in small.iterdir()] == ["a.usdc"]
    assert old.read_bytes() == b"old"


@pytest.mark.parametrize("end", ["says another thing", "crashes"])
def test_a_film(small: Path, end: str) -> None:
    old = small / "film.mp4"
    old.write_bytes(b"old")
    command = script("json.loads(sys.argv[1])['out']", end)
    with pytest.raises(InputError, match=r"The disk is full: film\.mp4 cannot be written"), output_file(old) as draft:
        make_file(command, FilmJob("film", small / "film.blend", draft), silent)
    assert [(path.name, path.read_bytes()) for path in small.iterdir()] == [("film.mp4", b"old")]


def test_what_fails_with_room_on_the_disk_is_told_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(RockfallError, match=r"^the block has no name$"), watched_room(tmp_path, "a.glb", silent):
        raise RockfallError("the block has no name")
    with watched_room(tmp_path / "not" / "there", "a.glb", silent) as watched:
        watched("Writing", 0, 1)
