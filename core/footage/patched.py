# SPDX-License-Identifier: GPL-3.0-or-later
"""A file as OpenCV is to see it: streams that are not to be decoded are hidden from it."""

import io
from collections.abc import Mapping
from pathlib import Path


class PatchedFile(io.BufferedIOBase):
    """A file of which some bytes are read as others.

    OpenCV has no choice of a stream in FFmpeg: it decodes the first. Where the entry of a stream carries the name of
    padding, or the kind of subtitles, it is passed over, and nothing moves.
    """

    def __init__(self, path: Path, patches: Mapping[int, bytes]) -> None:
        super().__init__()
        self._file = path.open("rb")
        self._patches = patches

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int | None = -1, /) -> bytes:
        """The next bytes."""
        begin = self._file.tell()
        data = self._file.read(-1 if size is None else size)
        touched = [at for at, new in self._patches.items() if at < begin + len(data) and at + len(new) > begin]
        if not touched:
            return data
        changed = bytearray(data)
        for at in touched:
            for i, value in enumerate(self._patches[at], at - begin):
                if 0 <= i < len(changed):
                    changed[i] = value
        return bytes(changed)

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Go to a place."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Where it is."""
        return self._file.tell()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()
