# SPDX-License-Identifier: GPL-3.0-or-later
"""Files inside a zip archive, read within limits: an archive of a kilobyte may promise petabytes."""

import zipfile
from pathlib import Path, PurePosixPath

from ..errors import InputError

MOST_BYTES = 200_000_000
"""Of one file when it is unpacked."""
MOST_FILES = 10_000
HIDDEN = ("__MACOSX", ".")
"""What begins so is of the program that made the archive."""


def names_in(archive: zipfile.ZipFile, suffix: str, path: Path) -> list[str]:
    """The files with an ending, in their order.

    Raises
    ------
    InputError : too many files.
    """
    if len(archive.infolist()) > MOST_FILES:
        raise InputError(
            f"The archive has {len(archive.infolist()):,} files",
            file=path,
            advice="Unpack it, and give one file",
        )
    return [
        one.filename
        for one in archive.infolist()
        if one.filename.lower().endswith(suffix)
        and not any(part.startswith(HIDDEN) for part in PurePosixPath(one.filename).parts)
    ]


def unpacked(archive: zipfile.ZipFile, name: str, path: Path) -> bytes:
    """A file's bytes.

    Raises
    ------
    InputError : it is larger than `MOST_BYTES`, or is protected by a password.
    """
    if archive.getinfo(name).flag_bits & 1:
        raise InputError("The archive is protected by a password", file=path, advice="Unpack it first")
    with archive.open(name) as stream:
        data = stream.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise InputError(
            f"{PurePosixPath(name).name} in the archive is larger than {MOST_BYTES // 10**6} MB",
            file=path,
            advice="Unpack it, and leave out what is not needed",
        )
    return data
