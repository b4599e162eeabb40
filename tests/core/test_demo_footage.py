# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo site's footage agrees with its truth, as measured in the pictures themselves."""

import csv
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

FOOTAGE = Path(__file__).parents[2] / "assets" / "demo" / "footage"
FILM = FOOTAGE / "footage.mp4"
MATRIX = [f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]


def table(name: str) -> list[dict[str, str]]:
    with (FOOTAGE / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def numbers(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in rows])


def projected(points: np.ndarray, camera: list[dict[str, str]]) -> np.ndarray:
    """Pixels (n, 2) of points (n, 3), each seen by the camera of its own row."""
    rotation = numbers(camera, *MATRIX).reshape(-1, 3, 3)
    seen = np.einsum("nij,nj->ni", rotation, points - numbers(camera, "x_m", "y_m", "z_m"))
    return numbers(camera, "fx_px", "fy_px") * seen[:, :2] / seen[:, 2:] + numbers(camera, "cx_px", "cy_px")


@pytest.fixture(scope="module")
def film() -> tuple[list[float], dict[int, np.ndarray]]:
    """All timestamps [s], and every tenth frame."""
    video, times, frames = cv2.VideoCapture(str(FILM)), [], {}
    while True:
        good, image = video.read()
        if not good:
            break
        if len(times) % 10 == 0:
            frames[len(times)] = image
        times.append(video.get(cv2.CAP_PROP_POS_MSEC) / 1000.0)
    video.release()
    return times, frames


def test_the_film_has_all_frames_at_thirty_a_second(film) -> None:
    times, frames = film
    assert len(times) == 300
    assert frames[0].shape == (720, 1280, 3)
    np.testing.assert_allclose(times, np.arange(300) / 30.0, atol=1e-6)
    np.testing.assert_allclose(numbers(table("truth/block.csv"), "time_s")[:, 0], times, atol=1e-6)
    assert FILM.stat().st_size < 6e6


def brightest_body(image: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Centre (2,) of what is brighter than the ground around a place: the block is paler than all rock."""
    left, top = (int(value) - 14 for value in near)
    window = image[top : top + 29, left : left + 29].astype(float).min(axis=2)
    ground = np.median(window)
    weight = np.clip(window - (ground + 0.55 * (window.max() - ground)), 0.0, None)
    count, parts = cv2.connectedComponents((weight > 0).astype(np.uint8))
    largest = max(range(1, count), key=lambda part: float(weight[parts == part].sum()))
    weight = np.where(parts == largest, weight > 0, 0.0)
    rows, columns = np.indices(weight.shape) + 0.5
    return np.array([left + (weight * columns).sum() / weight.sum(), top + (weight * rows).sum() / weight.sum()])


def test_the_block_is_where_the_truth_says(film) -> None:
    """The pale blob's centre in decoded frames, found without the camera; the sunny side pulls it a little."""
    block = table("truth/block.csv")
    off = []
    for frame, image in film[1].items():
        pixel = numbers(block[frame : frame + 1], "u_px", "v_px")[0]
        if block[frame]["visible"] == "1" and np.all((pixel > 40) & (pixel < (1240, 680))):
            off.append(np.linalg.norm(brightest_body(image, pixel) - pixel))
    assert len(off) > 20
    assert np.median(off) < 1.0
    assert np.quantile(off, 0.9) < 1.6


def test_pixels_of_the_block_are_those_of_the_camera() -> None:
    block = table("truth/block.csv")
    pixels = projected(numbers(block, "x_m", "y_m", "z_m"), table("truth/camera.csv"))
    np.testing.assert_allclose(pixels, numbers(block, "u_px", "v_px"), atol=0.01)


def test_survey_targets_agree_with_the_camera() -> None:
    """Pixels come from the picture, places from the survey: a centimetre there is a quarter of a pixel."""
    pairs, camera = table("pairs.csv"), table("truth/camera.csv")
    assert 10 <= len(pairs) <= 14
    off = numbers(pairs, "u_px", "v_px") - projected(numbers(pairs, "x_m", "y_m", "z_m"), camera[:1] * len(pairs))
    assert 0.02 < np.sqrt((off**2).mean()) < 0.7
    assert np.ptp(numbers(pairs, "u_px")) > 900
    assert np.ptp(numbers(pairs, "v_px")) > 450


def test_the_clicks_are_on_the_block() -> None:
    block = table("truth/block.csv")
    for click in table("clicks.csv"):
        row = block[int(click["frame"])]
        assert row["visible"] == "1"
        assert np.abs(numbers([click], "u_px", "v_px") - numbers([row], "u_px", "v_px")).max() <= 2.5


def test_the_block_flies_on_parabolas_between_its_impacts() -> None:
    block, impacts = table("truth/block.csv"), table("truth/impacts.csv")
    times, places = numbers(block, "time_s")[:, 0], numbers(block, "x_m", "y_m", "z_m")
    assert len(impacts) >= 6
    for before, after in pairwise(impacts):
        start = float(before["leave_time_s"])
        t = times - start
        flying = (t > 0.0) & (times < float(after["time_s"]))
        place = numbers([before], "leave_x_m", "leave_y_m", "leave_z_m")
        velocity = numbers([before], "v2x_mps", "v2y_mps", "v2z_mps")
        drop = np.outer(0.5 * 9.81 * t**2, [0.0, 0.0, 1.0])
        np.testing.assert_allclose((place + velocity * t[:, None] - drop)[flying], places[flying], atol=1e-5)


def test_impacts_are_those_of_the_campaign() -> None:
    """Where the demo site's own truth knows the impact, it is the same one on another clock."""
    campaign = {
        row["impact"]: row for row in csv.DictReader((FOOTAGE.parent / "truth.csv").open()) if row["trajectory"] == "B10"
    }
    offsets = []
    for row in table("truth/impacts.csv"):
        if row["campaign_impact"]:
            known = campaign[row["campaign_impact"]]
            offsets.append(float(known["time_s"]) - float(row["time_s"]))
            assert {key: row[key] for key in row if key.startswith(("x_", "contact_", "v1", "v2", "omega"))} == {
                key: known[key] for key in known if key.startswith(("x_", "contact_", "v1", "v2", "omega"))
            }
    assert len(offsets) == 6
    np.testing.assert_allclose(offsets, 465.499, atol=1e-6)


def test_no_part_of_the_visible_run_is_hidden() -> None:
    block = table("truth/block.csv")
    seen = numbers(block, "visible")[:, 0] > 0
    assert seen[50:].all()
    assert not seen[:30].any()
