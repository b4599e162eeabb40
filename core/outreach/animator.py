# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of animations are written by Blender, in a process of its own; they are staged like all output."""

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from ..blender_process import run_job
from ..errors import InputError, RockfallError
from ..film.room import watched_room
from ..output import output_folder
from ..progress import Progress, silent
from .animation import Animation, save_animation

ROOM = "Make room on the disk, or choose another folder."
LEAST_BYTES = 200
"""No file of an animation is smaller: Blender on a full disk may leave a piece."""


def write_animation(
    animation: Animation,
    files: Sequence[Path],
    command: Sequence[str],
    progress: Progress = silent,
) -> None:
    """Write an animation in the formats of the files' endings; they appear together when all are whole.

    Parameters
    ----------
    files : in one folder; their endings are of `FORMATS`.
    command : what runs Blender, see `blender_command`.

    Raises
    ------
    RockfallError : Blender cannot write one; no file is there, or the old ones are as they were.
    """
    with TemporaryDirectory(prefix="rockfall_") as name, output_folder(files[0].parent) as folder:
        source = Path(name) / "animation.npz"
        try:
            save_animation(animation, source)
        except OSError as error:
            raise InputError(
                f"The temporary folder cannot be written ({error.strerror})",
                file=name,
                advice="Make room there, or set TMPDIR to a folder with room",
            ) from error
        drafts = [folder / file.name for file in files]
        job = json.dumps({"source": str(source), "files": [str(draft.absolute()) for draft in drafts]})
        names = ", ".join(file.name for file in files)
        with watched_room(folder, names, progress) as watched:
            run_job([*command, job], names, watched, ROOM)
            for draft in drafts:
                if not _is_whole(draft):
                    raise RockfallError(f"What Blender has written of {draft.name} is not whole. {ROOM}")


def _is_whole(file: Path) -> bool:
    """Whether a file has what its format writes last: on a full disk Blender may end early, and say nothing."""
    if not file.is_file():
        return False
    size, ending = file.stat().st_size, file.suffix
    with file.open("rb") as stream:
        head = stream.read(24)
        if size < LEAST_BYTES:
            return False
        if ending == ".glb":
            return head[:4] == b"glTF" and int.from_bytes(head[8:12], "little") == size
        if ending == ".usdc":  # the place of the table of contents, which is written last
            return head[:8] == b"PXR-USDC" and 24 <= int.from_bytes(head[16:24], "little") < size
        if ending == ".abc":  # the byte that says that the archive was closed
            return head[:6] == b"Ogawa\xff"
        stream.seek(-4, 2)
        return stream.read().strip().endswith(b"}")
