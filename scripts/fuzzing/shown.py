# SPDX-License-Identifier: GPL-3.0-or-later
"""Small files of what films, pages, animations, spins and the live page read, and who reads them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import examples
import live
import numpy as np
from examples import DATA, SHIFT

MOVES = "moves of the live page"
SLOW = (MOVES,)
VIDEO = "constant.mp4"
"""40 frames of 64 × 48 pixels in 1.3 s."""
EXTRA = b"""
[[videos]]
name = "side"
file = "side.mp4"
camera = "side.toml"
spin_marks = "marks.csv"
offset_s = 0.1
[models.noel_2017]
rn_limit = 0.4
[[render]]
name = "small"
width = 192
height = 108
fps = 5.0
time_scale = 0.5
"""


def files(folder: Path) -> dict[str, bytes]:
    """A project with a video and its camera, a scanned block, marks of its spin, and frames of a film."""
    import cv2
    import trimesh
    from rockfall.core.camera.model import look_at
    from rockfall.core.camera.path import fixed
    from rockfall.core.exchange.cameras import write_camera

    folder.mkdir(exist_ok=True)
    camera = replace(look_at(64, 48, [9.0, -22.0, 34.0], [9.0, 7.0, 22.0], focal_px=60.0), shift=SHIFT)
    write_camera(folder / "side.toml", fixed(camera))
    scan = trimesh.creation.icosphere(subdivisions=1, radius=0.25)
    scan.visual.vertex_colors = np.arange(4 * len(scan.vertices)).reshape(-1, 4) % 256
    text = examples.PROJECT.replace(
        b'name = "Slope"', b'name = "Slope"\ndescription = "A hill"\ncredits = "Us"\ndoi = "10.1000/1"'
    )
    marks = b"trajectory,frame,time_s,u_px,v_px,sigma_px\n" + b"".join(
        b"A,%d,%.4f,%.2f,%.2f,0.7\n" % (frame, frame / 30, 30 + 0.4 * frame, 20 + 0.2 * frame) for frame in range(4, 12)
    )
    return {
        "project.toml": text + EXTRA, "picks.csv": examples.PICKS, "side.toml": (folder / "side.toml").read_bytes(),
        "side.mp4": (DATA / "videos" / VIDEO).read_bytes(), "marks.csv": marks,
        "scan.ply": scan.export(file_type="ply"), "scan.obj": scan.export(file_type="obj").encode(),
        "scan.stl": scan.export(file_type="stl"),
        "frames/film.json": json.dumps({"film": "a"}, indent=2, sort_keys=True).encode(),
        "frames/000000.png": cv2.imencode(".png", np.full((5, 7, 3), 9, np.uint8))[1].tobytes(),
        "impacts.csv": examples.IMPACTS, "p.toml": examples.PARAMETERS, "releases.csv": examples.RELEASES,
        "moves.txt": live.moves(),
    }  # fmt: skip


def readers() -> dict[str, tuple[tuple[str, ...], Callable[[Path], object]]]:
    """Name → the files that are damaged, and what reads them where a command would need Blender or a browser."""
    from rockfall.core.film.composed.frame_store import frame_store
    from rockfall.core.outreach.animation import animate
    from rockfall.core.outreach.show import ShowRequest, open_show

    def frames(at: Path) -> object:
        with frame_store(at / "frames", {"film": "a"}) as store:
            store.fill(range(2), lambda _: np.zeros((5, 7, 3), np.uint8), lambda *_: None)
            return store.file(1).read_bytes()

    def animation(at: Path) -> object:
        made = animate(open_show(ShowRequest(at / "project.toml", ("noel_2017",), 2)), 5.0, "rock")
        assert made.frames < 1e6, "an animation without end"
        return made

    return {
        "frames": (("frames/film.json", "frames/000000.png"), frames),
        "animation": (("project.toml", "picks.csv", "terrain.ply"), animation),
        "explore": (("impacts.csv", "p.toml"), _explore),
        MOVES: (("moves.txt",), live.explore),
    }


def _explore(at: Path) -> object:
    """The live page is put together, with what it would save; `live` moves what is on it."""
    from bokeh.document import Document
    from rockfall.core.analysis.courses import find_courses
    from rockfall.core.analysis.explorer import Exploration, open_page
    from rockfall.core.exchange.parameters import read_parameters, write_parameters
    from rockfall.core.exchange.tables import read_impacts

    impacts, given = read_impacts(at / "impacts.csv"), read_parameters(at / "p.toml")
    courses = find_courses(impacts, "table", None)

    def save(settings: object) -> str:
        write_parameters(settings, at / "saved.toml")
        return str(at)

    document = Document()
    open_page(document, Exploration(impacts, courses, ("noel_2017", *given), save, given))
    return document.to_json()


FILM = ("render", "@project.toml", "--preset", "small", "--film")
COMMANDS = {
    "render a turntable": (
        ("project.toml", "picks.csv", "terrain.ply"), (*FILM, "turntable", "--still", "--dust")
    ),
    "render an overlay": (
        ("project.toml", "side.toml", "side.mp4", "picks.csv"), (*FILM, "overlay", "--still", "--graphs", "motion")
    ),
    "render with models": (
        ("project.toml", "picks.csv"),
        (*FILM, "side_by_side", "--still", "--model", "noel_2017", "--number", "2", "--parameters", "@p.toml"),
    ),
    "render frames": (
        ("project.toml", "picks.csv", "side.toml"), (*FILM, "story", "--images", "--frames", "0-1", "--language", "de")
    ),
    "render a stroboscope": (("side.mp4", "side.toml", "project.toml"), (*FILM, "stroboscopic")),
    "render a contact sheet": (("side.mp4", "side.toml", "project.toml"), (*FILM, "contact_sheet")),
    **{
        f"render a {name}": ((name,), (*FILM, "fly_along", "--still", "--block", f"@{name}"))
        for name in ("scan.ply", "scan.obj", "scan.stl")
    },
    "web with models": (
        ("project.toml", "picks.csv", "side.mp4", "side.toml"),
        ("web", "@project.toml", "--simulate", "noel_2017", "--number", "2", "--terrain-colours", "footage"),
    ),
    **{
        f"export {name}": (
            ("project.toml", "picks.csv", "terrain.ply"),
            ("export", "@project.toml", "--format", name, "--rate", "5", "--simulate", "noel_2017", "--number", "2"),
        )
        for name in ("glb", "usdc", "usda", "abc")
    },
    "spin": (("project.toml", "marks.csv", "side.toml", "picks.csv"), ("spin", "@project.toml")),
}  # fmt: skip
"""Name → the files that are damaged, and the words; terrain.ply and all of `files` are beside them."""
