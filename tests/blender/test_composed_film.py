# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that were drawn outside Blender become a film: all of them, in order, at their rate, in their colours."""

from pathlib import Path

import cv2
import numpy as np
import pytest

SIZE = (160, 96)
LEVELS = (20, 60, 100, 140, 180, 220)


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """Six pictures, numbered from 7: grey on the left, each brighter than the last, and orange on the right."""
    for i, level in enumerate(LEVELS):
        picture = np.full((SIZE[1], SIZE[0], 3), level, np.uint8)
        picture[:, 80:] = (20, 130, 235)
        cv2.imwrite(str(tmp_path / f"{i + 7:06d}.png"), picture)
    return tmp_path


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_frames_become_a_film(frames: Path, part, codec: str) -> None:
    job, make = part("core.film.job"), part("rockfall_addon.steps.film.render").make
    out, told = frames / "film.mp4", []
    asked = job.FilmJob("frames", frames, out, fps=30000 / 1001, codec=codec, frames=(7, 12), size=SIZE)
    assert job.FilmJob.from_json(asked.to_json()) == asked
    make(asked, lambda *words: told.append(words))
    assert told[-1] == ("Writing the film", 6, 6)
    film = cv2.VideoCapture(str(out))
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(30000 / 1001, rel=1e-6)
    for level in LEVELS:
        there, picture = film.read()
        assert there
        assert picture.shape == (SIZE[1], SIZE[0], 3)
        assert picture[20:70, 20:60].mean() == pytest.approx(level, abs=4)
        assert picture[20:70, 100:140].reshape(-1, 3).mean(axis=0) == pytest.approx([20, 130, 235], abs=9)
    assert not film.read()[0]


def test_av1_is_read_again_by_blender(frames: Path, part) -> None:
    job, make = part("core.film.job"), part("rockfall_addon.steps.film.render").make
    out, size = frames / "film.mp4", (640, 360)
    for i in range(7, 13):
        cv2.imwrite(str(frames / f"{i:06d}.png"), np.full((360, 640, 3), 10 * i, np.uint8))
    make(job.FilmJob("frames", frames, out, fps=25.0, codec="av1", frames=(7, 12), size=size), lambda *_: None)
    part("core.film.check").check_index(out, 6, size)
    with pytest.raises(Exception, match="it says that it has 6 frames"):
        part("core.film.check").check_index(out, 7, size)


def test_a_codec_that_cannot_be_written_is_said_with_the_reason(frames: Path, part) -> None:
    """AV1 does not know frames as small as these."""
    job, make = part("core.film.job"), part("rockfall_addon.steps.film.render").make
    asked = job.FilmJob("frames", frames, frames / "film.mp4", codec="av1", frames=(7, 12), size=SIZE)
    with pytest.raises(Exception, match=r"cannot write AV1 here.*h264 is written by all"):
        make(asked, lambda *_: None)


def test_the_scene_is_as_it_was(frames: Path, part) -> None:
    import bpy

    job, make = part("core.film.job"), part("rockfall_addon.steps.film.render").make
    before = sorted(scene.name for scene in bpy.data.scenes)
    make(job.FilmJob("frames", frames, frames / "f.mp4", frames=(7, 8), size=SIZE), lambda *_: None)
    assert sorted(scene.name for scene in bpy.data.scenes) == before


def test_the_list_of_films_and_what_each_needs(scan, part) -> None:
    import bpy

    composed, kinds = part("rockfall_addon.steps.film.composed"), part("core.film.composed.kinds")
    settings = scan.rockfall_composed_film
    assert [item[0] for item in composed._kinds(settings, bpy.context)] == list(kinds.NAMES)
    assert all((composed.PICTURES / f"{name}.jpg").is_file() for name in kinds.NAMES)
    assert "no trajectories" in composed.lacking(scan)
    assert not bpy.ops.rockfall.make_film.poll()
    settings.kind, settings.language = "turntable", "fr"
    request = composed.request_of(scan)
    assert (request.film, request.language, request.rate) == ("turntable", "fr", None)
    assert part("core.film.composed.request").FilmRequest.from_json(request.to_json()) == request


def test_a_picture_is_made_of_the_open_scene(rockfall, part, tmp_path: Path) -> None:
    """The demo's footage with its camera, from the scene to a picture that is checked."""
    import bpy

    assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    scene, composed = bpy.context.scene, part("rockfall_addon.steps.film.composed")
    assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    scene.rockfall_composed_film.kind = "story"
    assert composed.lacking(scene) == ""
    scene.rockfall_film.file = str(tmp_path / "site.mp4")
    scene.rockfall_film.size = "preview"
    scene.rockfall_composed_film.kind = "contact_sheet"
    assert bpy.ops.rockfall.make_film() == {"FINISHED"}
    picture = cv2.imread(str(tmp_path / "site_contact_sheet.png"))
    assert picture.shape == (360, 640, 3)
    assert picture.std() > 20
    assert [file.name for file in tmp_path.iterdir()] == ["site_contact_sheet.png"]
