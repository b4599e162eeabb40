# SPDX-License-Identifier: GPL-3.0-or-later
"""From a request to a file: frames drawn, kept, and encoded by Blender."""

from dataclasses import dataclass, replace
from pathlib import Path

from ...errors import InputError
from ...exchange.job_inputs import digest_of, input_files, input_hashes
from ...opencv import opencv
from ...output import made_folder, output_file
from ...progress import Progress, silent
from ...versions import versions
from ..check import check_film, check_index, check_picture
from ..job import FilmJob
from ..maker import film_maker
from .catalogue import compose
from .frame_store import frame_store
from .kinds import CODECS, find_kind
from .material import open_material
from .request import FilmRequest
from .shots import ComposedFilm


@dataclass(frozen=True)
class Made:
    """What was written.

    Attributes
    ----------
    file : the film or picture.
    frames : how many it has; 1 of a picture.
    kept : of these, how many an earlier run had drawn.
    size : width and height [px].
    remarks : what a user should know of it.
    """

    file: Path
    frames: int
    kept: int
    size: tuple[int, int]
    remarks: tuple[str, ...]


def make_film(
    request: FilmRequest,
    out: Path,
    *,
    frames: tuple[int, int] | None = None,
    still: bool = False,
    images: bool = False,
    codec: str = "h264",
    name: str = "",
    progress: Progress = silent,
) -> Made:
    """Draw a film, or a picture, into a folder: NAME.mp4, NAME.png, or with `images` a folder NAME of pictures.

    Parameters
    ----------
    frames : first and last, both included; None for all.
    still : one picture only, of the first of `frames` or of the middle of the film.
    codec : one of `CODECS`.
    name : of the file, without its ending; empty for that of the kind of film.

    Notes
    -----
    Frames are kept in NAME.frames until the film is whole: a run that was ended goes on where it was.

    Raises
    ------
    RockfallError : the request or the project is bad, there is no Blender to encode with, the disk is full.
    """
    kind = find_kind(request.film)
    if codec not in CODECS:
        raise InputError(f"There is no codec {codec!r}", advice=f"Codecs: {', '.join(CODECS)}")
    maker = None if kind.is_picture or still or images else film_maker()
    material = open_material(request, progress)
    film = compose(kind, material)
    first, last = _span(film, frames)
    size = film.width, film.height
    if kind.is_picture or still:
        frame = 0 if kind.is_picture else first if frames else film.frames // 2
        file = out / f"{name or kind.name}.png"
        with made_folder(out), output_file(file) as draft:
            progress("Drawing", 0, 0)
            draft.write_bytes(opencv().imencode(".png", film.canvas(frame).picture)[1].tobytes())
            check_picture(draft, size)
        return Made(file, 1, 0, size, tuple(material.remarks))
    wanted = range(first, last + 1)
    name = name or kind.name
    folder = out / (name if images else f"{name}.frames")
    with made_folder(out), frame_store(folder, _states(request)) as store:
        kept = store.fill(wanted, lambda frame: film.canvas(frame).picture, progress)
        if images:
            return Made(folder, len(wanted), kept, size, (*material.remarks, *store.remarks))
        assert maker is not None
        file = out / f"{name}.mp4"
        with output_file(file) as draft:
            job = FilmJob("frames", store.folder, draft, fps=film.fps, codec=codec, frames=(first, last), size=size)
            maker.make(job, progress)
            if codec == "av1":
                check_index(draft, len(wanted), size)  # Blender has read it to its end
            else:
                check_film(draft, len(wanted), size, progress)
        store.remove()
    return Made(file, len(wanted), kept, size, (*material.remarks, *store.remarks))


def _span(film: ComposedFilm, frames: tuple[int, int] | None) -> tuple[int, int]:
    first, last = frames or (0, film.frames - 1)
    if first >= film.frames:
        raise InputError(f"The film has no frame {first}", advice=f"Its last frame is {film.frames - 1}")
    return first, min(last, film.frames - 1)


def _states(request: FilmRequest) -> dict[str, object]:
    """All that decides the frames."""
    hashes = input_hashes(input_files(request.project, [request.solid]))
    request = replace(request, project=Path(request.project.name))  # a copy of the project elsewhere is the same
    return {
        "request": request.to_json(),
        "inputs": hashes,
        "digest": digest_of("render", [request.to_json()], hashes, versions()),
    }
