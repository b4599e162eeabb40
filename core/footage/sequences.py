# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in files of their own that follow each other: a folder of them, or a name like img_%04d.png."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..opencv import quiet_opencv
from ..vectors import Indices

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")
PATTERN = re.compile(r"%(0?)(\d*)d")
NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")
RATE = (
    "Say how many were taken a second: --fps 25, rate_hz = 25 in the project's [[videos]], or Pictures per Second in "
    "Blender's file window"
)


class PictureSequence(NamedTuple):
    """The p pictures of a sequence, ascending, and the number (p,) in the name of each."""

    files: tuple[Path, ...]
    number: Indices


def names_sequence(path: Path) -> bool:
    """Whether a path stands for a sequence of pictures: a folder, or a name with %d."""
    return path.is_dir() or PATTERN.search(path.name) is not None


def sequence_of(path: Path) -> PictureSequence:
    """The pictures of a folder, or those whose names are as img_%04d.png says.

    Raises
    ------
    InputError : there are fewer than two, names without numbers, names of several kinds, or a number twice.
    """
    if path.is_dir():
        files = [one for one in path.iterdir() if one.suffix.lower() in PICTURES and not one.name.startswith(".")]
        parts = {one: NUMBERED.fullmatch(one.stem) for one in files}
        nameless = sorted(one.name for one, found in parts.items() if found is None)
        if nameless:
            raise InputError(
                f"The picture {nameless[0]} has no number in its name, so its place in the sequence is not known",
                file=path,
                advice="Take it out of the folder, or give the name of the others, such as img_%04d.png",
            )
        kinds = {(found[1], found[3], one.suffix.lower()) for one, found in parts.items() if found is not None}
        if len(kinds) > 1:
            some = sorted(f"{head}…{tail}{suffix}" for head, tail, suffix in kinds)
            raise InputError(
                f"The folder has pictures of {len(kinds)} kinds: {', '.join(some[:3])}",
                file=path,
                advice="Give the name of one kind, such as folder/img_%04d.png",
            )
        numbers = {one: int(found[2]) for one, found in parts.items() if found is not None}
    else:
        pattern = PATTERN.search(path.name)
        if pattern is None or not path.parent.is_dir():
            raise InputError("There is no such folder", file=path.parent, advice="Check the path")
        width = int(pattern[2] or 0) if pattern[1] else 0
        digits = rf"(\d{{{width},}})" if width else r"(\d+)"
        wanted = re.compile(
            re.escape(path.name[: pattern.start()]) + digits + re.escape(path.name[pattern.end() :]), re.IGNORECASE
        )
        found_files = ((one, wanted.fullmatch(one.name)) for one in path.parent.iterdir())
        numbers = {one: int(found[1]) for one, found in found_files if found is not None}
    if len(numbers) < 2:
        raise InputError(
            f"{_kind(path)} {'a single picture' if numbers else 'no pictures'}, and a sequence has two or more",
            file=path,
            advice=f"Give a folder of pictures, or a name such as img_%04d.png; known are {', '.join(PICTURES)}",
        )
    ordered = sorted(numbers, key=lambda one: (numbers[one], one.name))
    number = np.array([numbers[one] for one in ordered], np.intp)
    twice = np.flatnonzero(np.diff(number) == 0)
    if twice.size:
        one, other = ordered[twice[0]], ordered[twice[0] + 1]
        raise InputError(
            f"{one.name} and {other.name} have the same number", file=path, advice="Take one of them out of the folder"
        )
    return PictureSequence(tuple(ordered), number)


def _kind(path: Path) -> str:
    return "This is a folder with" if path.is_dir() else "By this name there is"


def sequence_beside(picture: Path) -> Path:
    """The name, as img_%04d.png, of the sequence that a picture belongs to; its own where it has no number."""
    found = NUMBERED.fullmatch(picture.stem)
    if found is None:
        return picture
    return picture.with_name(f"{found[1]}%0{len(found[2])}d{found[3]}{picture.suffix}")


def is_there(path: Path) -> bool:
    """Whether a video file, or at least the folder of a sequence of pictures, is where a path says."""
    return path.is_file() or (names_sequence(path) and path.parent.is_dir())


def load_picture(file: Path) -> np.ndarray:
    """A picture as it is to be seen, (h, w, 3) BGR uint8: turned as its EXIF data say, 16 bits reduced to 8.

    Raises
    ------
    InputError : it cannot be read.
    """
    with quiet_opencv() as cv2:
        picture: np.ndarray | None = cv2.imdecode(np.fromfile(file, np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise InputError("This picture cannot be read", file=file, advice="Copy it again, or save it as PNG")
    return picture
