# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets, frames and words of a film."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import Project, RenderPreset
from rockfall.core.film.files import film_file
from rockfall.core.film.job import FilmJob
from rockfall.core.film.presets import AFTERGLOW_S, FilmTiming, find_preset, parse_frames
from rockfall.core.film.wording import estimate, fastest_speed, notes


def test_presets_that_every_project_has() -> None:
    preview, hd = (find_preset(Project(), name) for name in ("preview", "hd"))
    assert (preview.width, preview.height) == (640, 360)
    assert (hd.width, hd.height) == (1920, 1080)
    own = RenderPreset("preview", width=320, height=180)
    assert find_preset(Project(render=(own,)), "preview") is own
    with pytest.raises(InputError, match=r"no render preset 'film'.*Known presets: preview, 720p, hd, 4k, mine"):
        find_preset(Project(render=(RenderPreset("mine"),)), "film")


@pytest.mark.parametrize(
    "fps", [24.0, 25.0, 29.97, 30000 / 1001, 23.976, 12.5, 240.0, 59.94, 119.88, 187.35, 24000 / 1001, 0.1, 1000.0]
)
def test_blender_gets_the_frame_rate_exactly(fps: float) -> None:
    whole, base = FilmTiming(fps).base
    assert whole <= 32767
    assert base == round(base)
    assert whole / base == pytest.approx(fps, rel=1e-12)


@pytest.mark.parametrize(
    ("fps", "pair"),
    [(60000 / 1001, (30000, 500.5)), (120000 / 1001, (30000, 250.25)), (240000 / 1001, (30000, 125.125))],
)
def test_fast_rates_of_television_are_exact_with_halves(fps: float, pair: tuple[int, float]) -> None:
    assert FilmTiming(fps).base == pair
    assert pair[0] / pair[1] == fps


@pytest.mark.parametrize("fps", [29.83, 59.9273847, 47.952047952, 29.8345678912, 7.77777, 0.0123456, 239.123456, 611.7])
def test_any_other_rate_is_met_closely(fps: float) -> None:
    """Of Blender's numbers, the second is kept in single precision, and four of its decimals reach the film."""
    whole, base = FilmTiming(fps).base
    assert whole <= 32767
    assert np.float32(base) == base
    assert base * 10_000 == round(base * 10_000)
    assert whole / base == pytest.approx(fps, rel=1e-8)


@pytest.mark.parametrize("fps", [59.94, 60000 / 1001, 187.35, 59.9273847, 1e5])
def test_a_frame_lasts_as_long_as_blenders_rate_says(fps: float) -> None:
    timing = FilmTiming(fps, 0.5)
    whole, base = timing.base
    assert timing.frame_s * whole / base == pytest.approx(0.5, rel=1e-15)


@pytest.mark.parametrize(
    ("scale", "remap"), [(1.0, (1, 1)), (0.5, (1, 2)), (0.1, (1, 10)), (2.0, (2, 1)), (0.3, (3, 10))]
)
def test_slow_motion(scale: float, remap: tuple[int, int]) -> None:
    timing = FilmTiming(25.0, scale)
    assert timing.remap == remap
    assert timing.frame_s == pytest.approx(scale / 25)
    assert timing.last_frame(10.0) == int(np.ceil(10.0 / scale * 25 - 1e-6)) + round(AFTERGLOW_S * 25)


@pytest.mark.parametrize("scale", [1e-3, 0.123456, 1.1, 17.3, 900.0])
def test_any_time_scale_is_in_blenders_range(scale: float) -> None:
    old, new = FilmTiming(25.0, scale).remap
    assert 1 <= old <= 900
    assert 1 <= new <= 900
    assert old / new == pytest.approx(scale, rel=0.12)


def test_frames_of_the_command_line() -> None:
    assert parse_frames("3-17") == (3, 17)
    assert parse_frames("40") == (40, 40)
    for text in ("", "7-3", "a-b", "-4"):
        with pytest.raises(ValueError):  # noqa: PT011 - argparse makes the message
            parse_frames(text)


def test_fastest_block() -> None:
    a = (np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 10.0, 4.0, 6.0]))
    b = (np.array([1.5, 3.0]), np.array([5.0, 8.0]))
    found = fastest_speed([a, b], np.array([-1.0, 0.5, 1.5, 2.0, 3.0, 3.1]))
    np.testing.assert_allclose(found, [0, 5, 5, 6, 8, 0])
    np.testing.assert_allclose(fastest_speed([], np.zeros(2)), 0)


def test_notes() -> None:
    assert notes() == ""
    assert notes(4.0) == "Blocks drawn 4× their size"
    assert notes(1.5, 0.25, rings=True) == "Blocks drawn 1.5× their size, rings mark impacts, slowed down 4×"
    assert notes(1.0, 2.0) == "Sped up 2×"


def test_job_survives_the_way_to_another_process() -> None:
    job = FilmJob(
        "film", Path("a b/project.toml"), Path("/tmp/Ωmega.mp4"), "cycles", "hd", frames=(3, 9), unit_m=0.3048
    )
    assert FilmJob.from_json(job.to_json()) == job
    assert FilmJob.from_json(FilmJob("slope", Path("p"), Path("q")).to_json()).frames is None


@pytest.mark.parametrize(
    ("asked", "file"),
    [
        ("", "site/fall.mp4"), ("  ", "site/fall.mp4"), ("{0}", "fall.mp4"), ("{0}/", "fall.mp4"),
        ("{0}/new/", "new/fall.mp4"), ("{0}/new/..", "new/../fall.mp4"),
        ("own", "site/own.mp4"), ("{0}/v1.2", "v1.2.mp4"), ("{0}/A.MP4", "A.MP4"),
    ],
)  # fmt: skip
def test_a_film_always_has_a_name_in_the_folder_that_is_meant(asked: str, file: str, tmp_path: Path) -> None:
    assert film_file(asked.format(tmp_path), tmp_path / "site" / "fall.mp4") == tmp_path / file


@pytest.mark.parametrize(
    ("frame_s", "frames", "said"), [(0.01, 3, "5 s"), (0.28, 200, "55 s"), (0.28, 452, "2 min"), (12.0, 1000, "3.5 h")]
)
def test_how_long_a_film_takes_is_said_as_roughly_as_it_is_known(frame_s: float, frames: int, said: str) -> None:
    assert estimate(frame_s, frames) == f"About {said} for {frames} frames on this machine"
