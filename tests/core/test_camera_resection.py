# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras from pairs: real ones with a known answer, and made ones under all conditions."""

import csv
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at, pinhole, project, rays, rotation_from_vector
from rockfall.core.camera.resection import resect as resect_module
from rockfall.core.camera.resection.advice import Geometry, remarks_on
from rockfall.core.camera.resection.resect import Resection, resect
from rockfall.core.camera.resection.starting import find_starts, poses_from_three
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.georeference import GlobalShift
from rockfall.core.vectors import norm, unit
from scipy import stats

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

from benchmarks.camera import HEIGHT, WIDTH, made

DATA = Path(__file__).parent.parent / "data" / "opencv_calib"

OPENCV_SAMPLE = Camera(
    640,
    480,
    535.91573396163199,
    535.91573396163199,
    342.28315473308373 + 0.5,
    235.57082909788173 + 0.5,
    k1=-0.26637260909660682,
    k2=-0.038588898922304653,
    k3=0.23839153080878486,
    p1=0.0017831947042852964,
    p2=-0.00028122100441115472,
)

TABLE = np.array(
    [[0, 1.525, 0], [2.74, 1.525, 0], [2.74, 0, 0], [0, 0, 0], [1.37, -0.1525, 0.1525], [1.37, 1.6775, 0.1525]]
)
"""A table-tennis table and the ends of its net [m]; below, pixels of two telephones, counted from the bottom of the
image (tt_tracker by ckjellson, MIT)."""
FIRST_TELEPHONE = np.array([[247, 327], [1021, 301], [1171, 77], [17, 114], [567, 122], [629, 366]])
SECOND_TELEPHONE = np.array([[297, 374], [1035, 447], [1243, 274], [184, 150], [723, 239], [662, 458]])


def error_squared(found: Resection, camera: Camera) -> float:
    """Of the position, in units of its covariance; 3 on average."""
    away = found.camera.position - camera.position
    return float(away @ np.linalg.solve(found.covariance[3:6, 3:6], away))


@pytest.mark.parametrize(
    ("n", "free", "planar"),
    [
        (4, (), False),
        (4, (), True),
        (6, (), False),
        (6, ("f",), False),
        (6, ("f",), True),
        (8, ("f",), False),
        (20, ("f",), True),
    ],
)
def test_no_start_is_needed(n: int, free: tuple[str, ...], planar: bool) -> None:
    for seed in range(15):
        camera, pixels, points = made(seed, n, planar=planar)
        known = replace(camera, position=np.zeros(3), rotation=np.eye(3)) if not free else None
        found = resect(pixels, points, WIDTH, HEIGHT, free=free, camera=known, sigma_px=0.5)
        assert error_squared(found, camera) < 30, seed
        assert found.used.all(), seed


@pytest.mark.parametrize("planar", [False, True])
def test_a_camera_that_is_nearly_known_leads_where_a_search_does(planar: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    searched = []

    def counted(*arguments: object, **more: object) -> object:
        searched.append(0)
        return find_starts(*arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(resect_module, "find_starts", counted)
    for seed in range(6):
        camera, pixels, points = made(seed, 12, planar=planar)
        near = replace(camera, position=camera.position + 0.05, fx=1.01 * camera.fx, fy=1.01 * camera.fy)
        alone = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5)
        known = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, camera=near)
        sigma = np.sqrt(np.diagonal(alone.covariance)[3:6])
        assert known.camera.position == pytest.approx(alone.camera.position, abs=1e-3 * float(sigma.min()))
        assert known.camera.fx == pytest.approx(alone.camera.fx, abs=1e-3 * alone.sigma["f"])
        assert known.remarks == alone.remarks
    assert len(searched) < 9  # six without a camera, and where the mirrored one may be a rival


def test_wrong_pairs_are_named_beside_a_camera_that_is_nearly_known() -> None:
    camera, pixels, points = made(3, 12)
    pixels[4] = np.clip(pixels[4] + (40.0, -30.0), 0, (WIDTH, HEIGHT))
    assert resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, camera=camera).wrong == ("5",)


def test_intervals_and_errors_are_those_promised() -> None:
    """Components within 1.96 σ in 95 % of the cases, and errors no larger than the Cramér–Rao bound allows."""
    inside, squared = [], []
    for seed in range(70):
        camera, pixels, points = made(1000 + seed, 10, sigma_m=0.02)
        found = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, sigma_m=0.02)
        if found.sigma["f"] > 0.05 * found.camera.fx:
            continue
        away = np.append(found.camera.position - camera.position, found.camera.fx - camera.fx)
        inside += (np.abs(away) < 1.96 * np.array([found.sigma[name] for name in ("x", "y", "z", "f")])).tolist()
        squared.append(error_squared(found, camera) * max(1.0, found.scatter) ** 2)
    assert len(squared) > 50
    assert 0.92 < np.mean(inside) < 0.985
    assert np.sqrt(np.mean(squared) / 3) < 1.2


def test_the_covariance_is_that_of_finite_differences() -> None:
    """An independent way: all derivatives by differences, (JᵀJ)⁻¹."""
    _, pixels, points = made(5, 12)
    lens = replace(pinhole(WIDTH, HEIGHT, 4000.0), cx=WIDTH / 2 + 1e-3, cy=HEIGHT / 2 + 1e-3, k1=1e-9)  # known, so
    found = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, camera=lens, robust=False)
    columns = []
    steps = ([1e-6] * 3) + ([1e-4] * 3) + [1e-2]
    for i, h in enumerate(steps):
        ends = []
        for sign in (1, -1):
            turn, move = np.zeros(3), np.zeros(3)
            if i < 3:
                turn[i] = sign * h
            elif i < 6:
                move[i - 3] = sign * h
            focal = found.camera.fx + (sign * h if i == 6 else 0)
            other = replace(
                found.camera,
                rotation=rotation_from_vector(turn) @ found.camera.rotation,
                position=found.camera.position + move,
                fx=focal,
                fy=focal,
            )
            ends.append(project(other, points).ravel())
        columns.append((ends[0] - ends[1]) / (2 * h) / 0.5)
    jacobian = np.stack(columns, axis=1)
    spare = 2 * 12 - 7
    variance = max(1.0, found.scatter**2, (4 + spare * found.scatter**2) / (4 + spare))
    quantile = 3 * stats.f(3, 4 + spare).ppf(0.95) / stats.chi2(3).ppf(0.95)
    expected = np.linalg.inv(jacobian.T @ jacobian) * variance * quantile
    np.testing.assert_allclose(found.covariance, expected, rtol=2e-3)
    assert found.parameters == ("rx", "ry", "rz", "x", "y", "z", "f")
    assert found.sigma["fy"] == found.sigma["f"]
    assert -1 <= found.correlation("f", "x") <= 1


def test_the_pose_for_a_held_lens_is_known_as_if_the_lens_had_been_given() -> None:
    _, pixels, points = made(3, 14)
    found = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, robust=False)
    held = resect(pixels, points, WIDTH, HEIGHT, free=(), camera=found.camera, sigma_px=0.5, robust=False)
    scale = np.sqrt(np.diag(held.pose_covariance))
    assert held.camera.position == pytest.approx(found.camera.position, abs=1e-4 * scale[3:].max())
    known = np.sqrt(np.diag(held.pose_covariance_given_lens))
    ratio = np.sqrt(np.diag(found.pose_covariance_given_lens)) / known
    assert ratio == pytest.approx(np.full(6, ratio[0]), rel=1e-3)
    assert ratio[0] == pytest.approx(found.scatter / held.scatter, rel=0.03)
    assert np.sqrt(np.diag(found.pose_covariance))[3:].max() > 1.5 * known[3:].max()


@pytest.mark.parametrize("swap", [False, True])
def test_wrong_pairs_are_named(swap: bool) -> None:
    named = 0
    for seed in range(12):
        camera, pixels, points = made(50 + seed, 12)
        if swap:
            pixels[[3, 7]] = pixels[[7, 3]]
        else:
            pixels[3] += np.where(pixels[3] > 100, -1, 1) * [30, 40]
        found = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, names=[f"P{i}" for i in range(12)])
        named += found.wrong == (("P3", "P7") if swap else ("P3",))
        assert not found.used[3]
        assert error_squared(found, camera) < 30
        assert "P3 does not fit" in found.remarks[0].text
        assert (found.remarks[0].about, found.remarks[0].severity) == ("pair P3", "warning")
    assert named >= 11


def test_with_the_fewest_pairs_nothing_is_called_wrong() -> None:
    camera, pixels, points = made(3, 4)
    pixels[0] += [40, 0]
    found = resect(pixels, points, WIDTH, HEIGHT, free=(), camera=camera)
    assert found.used.all()
    assert any("nothing tells a wrong one" in remark.text for remark in found.remarks)


@pytest.mark.parametrize("view", [1, 2, 3, 4, 5, 6])
def test_chessboards_of_opencv(view: int) -> None:
    """With the samples' own calibration each view fits as solvePnP makes it fit; view 2 has a column found wrongly."""
    with (DATA / "corners.csv").open(encoding="utf-8") as file:
        table = [row for row in csv.DictReader(file) if row["view"] == str(view)]
    points = np.array([[0.025 * int(row["column"]), 0.025 * int(row["row"]), 0] for row in table])
    pixels = np.array([[float(row["u_px"]), float(row["v_px"])] for row in table])
    found = resect(pixels, points, 640, 480, free=(), camera=OPENCV_SAMPLE, sigma_px=0.3, robust=False)
    known = OPENCV_SAMPLE
    matrix = np.array([[known.fx, 0, known.cx - 0.5], [0, known.fy, known.cy - 0.5], [0, 0, 1]])
    distortion = np.array([known.k1, known.k2, known.p1, known.p2, known.k3])
    _, turn, move = cv2.solvePnP(points, pixels - 0.5, matrix, distortion)
    theirs = cv2.projectPoints(points, turn, move, matrix, distortion)[0][:, 0] + 0.5
    rmse = np.sqrt(np.mean(norm(theirs - pixels) ** 2))
    robust = resect(pixels, points, 640, 480, free=(), camera=OPENCV_SAMPLE, sigma_px=0.3)
    if view == 2:
        assert {"1", "10", "19", "28", "37", "46"} == set(robust.wrong)
        assert robust.rmse_px < 0.2
        return
    # The sample's own errors of these views: 0.193, 0.173, 0.193, 0.160, 0.180 px.
    printed = {1: 0.192965463, 3: 0.173180386, 4: 0.193417311, 5: 0.159574091, 6: 0.179683909}
    assert found.rmse_px == pytest.approx(rmse, rel=1e-3)
    assert found.rmse_px == pytest.approx(printed[view], abs=0.01)
    np.testing.assert_allclose(found.camera.rotation, cv2.Rodrigues(turn)[0], atol=1e-4)
    assert robust.used.all()
    free = resect(pixels, points, 640, 480, camera=OPENCV_SAMPLE, sigma_px=0.3)
    assert abs(free.camera.fx - 535.916) < 3 * free.sigma["f"]


def test_two_telephones_at_a_table() -> None:
    for pixels, order, focal, rmse, place in (
        (FIRST_TELEPHONE, [0, 1, 2, 3, 4, 5], 1242, 2.5, (1.7, -2.6, 1.5)),
        (SECOND_TELEPHONE, [2, 3, 0, 1, 5, 4], 1255, 2.8, (1.6, 4.4, 1.6)),
    ):
        found = resect(pixels * [1, -1] + [0, 720], TABLE[order], 1280, 720, sigma_px=3)
        assert found.camera.fx == pytest.approx(focal, abs=2)
        assert found.rmse_px == pytest.approx(rmse, abs=0.05)
        np.testing.assert_allclose(found.camera.position, place, atol=0.06)
        assert found.used.all()


def test_the_whole_lens_from_many_pairs() -> None:
    camera = replace(made(8, 4)[0], fx=3000.0, fy=2970.0, cx=1950.0, cy=1060.0, k1=-0.12, k2=0.03, p1=4e-4, p2=-3e-4)
    rng = np.random.default_rng(2)
    truth = rng.uniform((50, 50), (WIDTH - 50, HEIGHT - 50), (60, 2))
    origins, directions = rays(camera, truth)
    points = origins + directions * rng.uniform(40, 150, (60, 1))
    free = ("fx", "fy", "c", "k1", "k2", "p1", "p2")
    found = resect(truth + 0.3 * rng.normal(size=(60, 2)), points, WIDTH, HEIGHT, free=free, sigma_px=0.3)
    for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"):
        assert abs(getattr(found.camera, name) - getattr(camera, name)) < 4 * found.sigma[name], name
    assert error_squared(found, camera) < 25
    assert found.scatter == pytest.approx(1, abs=0.25)


def test_uncertain_points_weigh_less() -> None:
    camera, pixels, points = made(21, 12, sigma_px=0.2)
    points[5] += [0, 0, 1.0]
    sigma_m = np.where(np.arange(12) == 5, 1.0, 0.0)
    found = resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.2, sigma_m=sigma_m)
    assert found.used.all()
    assert error_squared(found, camera) < 25
    assert found.residual_m[5] > 0.01
    place = found.camera.position
    direction = rays(found.camera, pixels[5:6])[1][0]
    foot = place + direction * ((points[5] - place) @ direction)
    assert found.residual_m[5] == pytest.approx(np.linalg.norm(points[5] - foot))


def test_survey_coordinates_keep_their_shift() -> None:
    camera, pixels, points = made(4, 8)
    shift = GlobalShift(2_600_000, 1_100_000, 1000)
    known = camera.in_shift(GlobalShift(5, 5, 5))
    found = resect(pixels, shift.to_local(points), WIDTH, HEIGHT, sigma_px=0.5, shift=shift, camera=known)
    assert found.camera.shift == shift
    assert np.linalg.norm(shift.to_survey(found.camera.position) - camera.position) < 5 * max(
        found.sigma["x"], found.sigma["y"], found.sigma["z"]
    )


def test_flat_pairs_that_face_the_camera_cannot_tell_the_focal_length() -> None:
    camera = look_at(WIDTH, HEIGHT, (0, 0, 0), (0, 100, 2), focal_px=6000)
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-25, 25, 10), np.full(10, 100.0), rng.uniform(-12, 15, 10)])
    pixels = project(camera, points) + rng.normal(size=(10, 2))
    found = resect(pixels, points, WIDTH, HEIGHT)
    assert any(
        "focal length is known" in remark.text and "plane facing the camera. Lock it" in remark.text
        for remark in found.remarks
    )
    locked = resect(pixels, points, WIDTH, HEIGHT, free=(), camera=camera)
    assert not any("focal" in remark.text for remark in locked.remarks)


def test_pairs_in_a_corner_cannot_tell_the_lens() -> None:
    camera, _, _ = made(8, 4)
    camera = replace(camera, fx=3500.0, fy=3500.0)
    rng = np.random.default_rng(4)
    truth = rng.uniform((100, 100), (900, 700), (12, 2))
    origins, directions = rays(camera, truth)
    points = origins + directions * rng.uniform(40, 150, (12, 1))
    found = resect(truth + rng.normal(size=(12, 2)), points, WIDTH, HEIGHT, free=("f", "cx", "cy", "k1"))
    text = " ".join(map(str, found.remarks))
    assert "centre cx is known to" in text
    assert "distortion k1" in text
    assert "cover only" in text


LINE = "lie on a line, from which no camera can be found. Add pairs beside the line."


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda pixels, points: pixels.__setitem__((2, 0), np.nan),
            ", row 4: pair 3: a coordinate is not a finite number. Pick it again.",
        ),
        (
            lambda pixels, points: points.__setitem__((2, 2), np.inf),
            ", row 4: pair 3: a coordinate is not a finite number. Pick it again.",
        ),
        (
            lambda pixels, points: pixels.__setitem__(2, (1000.5, 2200.0)),
            f", row 4: pair 3: the pixel (1000.5, 2200) lies outside the image of {WIDTH} × {HEIGHT} px. "
            "Check the size of the image, and that v counts down from its top.",
        ),
        (
            lambda pixels, points: pixels.__setitem__(2, (-0.5, 20.0)),
            f", row 4: pair 3: the pixel (-0.5, 20) lies outside the image of {WIDTH} × {HEIGHT} px. "
            "Check the size of the image, and that v counts down from its top.",
        ),
        (
            lambda pixels, points: pixels.__setitem__(5, pixels[1]),
            ", row 7: pair 6: the same pixel as pair 2. Leave one of the two out.",
        ),
        (
            lambda pixels, points: points.__setitem__(5, points[1]),
            ", row 7: pair 6: the same point as pair 2. Leave one of the two out.",
        ),
        (lambda pixels, points: points.__setitem__((slice(None), slice(1, 3)), 0), f": All points {LINE}"),
        (lambda pixels, points: pixels.__setitem__((slice(None), 1), 500.0), f": All pixels {LINE}"),
    ],
)
def test_bad_pairs_are_refused(spoil: object, message: str) -> None:
    _, pixels, points = made(3, 8)
    spoil(pixels, points)
    with pytest.raises(InputError) as caught:
        resect(pixels, points, WIDTH, HEIGHT, rows=range(2, 10), source="pairs.csv")
    assert str(caught.value) == f"pairs.csv{message}"


def test_pixels_that_lie_outside_because_u_and_v_are_exchanged() -> None:
    """As of a phone held upright, whose pixels were read in the picture as it is stored."""
    _, pixels, points = made(3, 8)
    pixels[2] = (10.0, max(WIDTH, HEIGHT) - 5.0) if WIDTH > HEIGHT else (max(WIDTH, HEIGHT) - 5.0, 10.0)
    pixels[:2] %= min(WIDTH, HEIGHT)
    pixels[3:] %= min(WIDTH, HEIGHT)
    with pytest.raises(InputError, match="With u and v exchanged all pairs lie inside"):
        resect(pixels, points, WIDTH, HEIGHT)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sigma_px": 0.0}, "pair 1: its error is not a positive number"),
        ({"sigma_px": [1, 1, np.inf, 1, 1, 1]}, "pair 3: its error is not a positive number"),
        ({"sigma_m": [0, -1e-9, 0, 0, 0, 0]}, "pair 2: its error is not a positive number"),
        ({"sigma_m": [0, 0, 0, 0, np.nan, 0]}, "pair 5: its error is not a positive number"),
        ({"sigma_m": [0, 0, 0, np.inf, 0, 0]}, "pair 4: its error is not a positive number"),
    ],
)
def test_errors_that_cannot_be(change: dict[str, object], message: str) -> None:
    _, pixels, points = made(3, 6)
    with pytest.raises(InputError) as caught:
        resect(pixels, points, WIDTH, HEIGHT, **change)
    assert str(caught.value) == f"{message}. Give pixels an error above zero, points zero or more."


MORE = "Add pairs (10 or more are good), or lock parameters: 4 pairs give the pose."
COLUMNS = "f, fx, fy, c, cx, cy, k1, k2, k3, p1, p2"


@pytest.mark.parametrize(
    ("n", "change", "message"),
    [
        (4, {}, f"4 pairs are too few: the pose and f needs 5. {MORE}"),
        (6, {"free": ("k2 k1", "f", "c")}, f"6 pairs are too few: the pose and f, cx, cy, k1, k2 needs 7. {MORE}"),
        (3, {"free": (), "camera": True}, "3 pairs are too few: the pose alone needs 4. Add pairs."),
        (4, {"free": ()}, "The focal length is neither free nor known. Free it, or give a camera that has it."),
        (
            6,
            {"free": ("fy",)},
            "The focal length is neither free nor known. Free it, or give a camera that has it.",
        ),
        (4, {"free": ("focal",)}, f"“focal” is no parameter of a camera. Choose among {COLUMNS}."),
        (4, {"free": ("f", "fx")}, "f already frees fx and fy. Free either f, or fx and fy."),
        (6, {"names": list("abcde")}, "There are 6 pairs, but not as many names or rows."),
        (6, {"rows": range(7)}, "There are 6 pairs, but not as many names or rows."),
    ],
)
def test_too_little_is_refused(n: int, change: dict[str, object], message: str) -> None:
    camera, pixels, points = made(3, n)
    if "camera" in change:
        change = {**change, "camera": camera}
    with pytest.raises(InputError) as caught:
        resect(pixels, points, WIDTH, HEIGHT, **change)
    assert str(caught.value) == message


def test_what_does_not_belong_together_is_refused() -> None:
    camera, pixels, points = made(3, 6)
    with pytest.raises(InputError) as caught:
        resect(pixels, points[:3], WIDTH, HEIGHT, source="pairs.csv")
    assert str(caught.value) == "pairs.csv: There are 6 pixels but 3 points."
    for size in ((WIDTH + 1, HEIGHT), (WIDTH, HEIGHT + 1)):
        with pytest.raises(InputError) as caught:
            resect(pixels, points, *size, free=(), camera=camera)
        assert str(caught.value) == (
            f"The known camera has {WIDTH} × {HEIGHT} px, the image {size[0]} × {size[1]} px. "
            "A lens is known for one image size; scale its parameters, or free them."
        )


@pytest.mark.parametrize("robust", [True, False])
def test_pixels_that_the_lens_cannot_see_have_no_camera(robust: bool) -> None:
    """The distortion ends within the image, and the known pose looks away."""
    camera = replace(look_at(1920, 1080, (0, 0, 0), (0, -10, 0), focal_px=1000.0), k1=-1.0)
    pixels = np.array([[50, 50], [1850, 60], [1860, 1000], [70, 1010], [960, 20], [900, 1070.0]])
    points = np.array([[-5, 20, 3], [5, 20, 3], [5, 21, -3], [-5, 22, -3], [0, 25, 4], [1, 19, -5.0]])
    with pytest.raises(RockfallError) as caught:
        resect(pixels, points, 1920, 1080, free=(), camera=camera, robust=robust)
    assert str(caught.value) == (
        "No camera sees the points where they were picked. Check that each pixel belongs to its point, that v counts "
        "down from the top of the image, and the points' coordinates."
    )


def test_an_undetermined_camera_has_no_pose_for_a_held_lens_either() -> None:
    _, pixels, points = made(3, 8)
    found = resect(pixels, points, WIDTH, HEIGHT)
    lost = replace(found, covariance=np.full(found.covariance.shape, np.inf))
    assert np.isposinf(lost.pose_covariance_given_lens).all()


def looked_at(**change: object) -> Geometry:
    """Eight sound pairs in a tenth of a wide image's width and height, in depth."""
    camera = look_at(2000, 1000, (0, 0, 0), (0, 50, 0), focal_px=2000.0)
    corners = np.array([[0, 0], [200, 0], [200, 200], [0, 200], [10, 90], [90, 10], [110, 190], [190, 110.0]])
    pixels = corners + np.array([900.0, 400.0])
    depth = np.linspace(30.0, 70.0, 8)
    origins, directions = rays(camera, pixels)
    given = {
        "camera": camera,
        "pixels": pixels,
        "points": origins + directions * depth[:, None],
        "depth": depth,
        "parameters": ("rx", "ry", "rz", "x", "y", "z", "f"),
        "covariance": np.diag([1e-8] * 3 + [1e-4] * 3 + [1.0]),
        "scatter": 1.0,
        "redundancy": 9,
        "rmse_px": 1.0,
        "other": None,
        "wrong": (),
        "asked": (),
        "relied_on": ("1", 0.0, 1.0),
    }
    return Geometry(**(given | change))


def one_far_out(seed: int, gross_px: float = 0.0):
    """Nine pairs in the middle of the picture of a slope and one at its edge, that with a gross error."""
    rng = np.random.default_rng(seed)
    camera = look_at(4000, 3000, (rng.uniform(-20, 20), -90, 15), (0, 60, 42), focal_px=3600.0)
    x, y = rng.uniform(-60, 60, 3000), rng.uniform(0, 120, 3000)
    points = np.column_stack([x, y, 0.7 * y + 6 * np.sin(x / 9) + 4 * np.cos(y / 7)])
    pixels = project(camera, points)
    inside = ((pixels > 120) & (pixels < np.array(camera.size) - 120)).all(axis=1)
    radius = np.hypot(*(pixels - [2000, 1500]).T)
    near, far = np.flatnonzero(inside & (radius < 900)), np.flatnonzero(inside & (radius > 1700))
    chosen = np.r_[rng.choice(near, 9, replace=False), rng.choice(far, 1)]
    clicked = pixels[chosen] + 1.5 * rng.normal(size=(10, 2))
    clicked[9] += gross_px * np.array([0.6, -0.8])
    return camera, clicked, points[chosen]


def test_a_good_pair_far_out_is_kept_and_named_when_the_camera_rests_on_it() -> None:
    rested = 0
    for seed in range(25):
        _, pixels, points = one_far_out(seed)
        found = resect(pixels, points, 4000, 3000, sigma_px=1.5, sigma_m=0.05)
        assert found.used[9]
        said = [remark.text for remark in found.remarks if "rests on" in remark.text]
        if said:
            rested += 1
            assert "rests on pair 10" in said[0]
            without = resect(pixels[:9], points[:9], 4000, 3000, sigma_px=1.5, sigma_m=0.05)
            sigma = np.sqrt(np.linalg.eigvalsh(without.pose_covariance[3:, 3:])[-1])
            assert float(said[0].split("known to ")[1].split(" m")[0]) == pytest.approx(sigma, rel=0.4)
    assert rested > 12


def test_a_wrong_pair_far_out_is_left_out_and_what_it_would_do_is_said() -> None:
    out, errors = 0, []
    for seed in range(25):
        camera, pixels, points = one_far_out(seed, gross_px=120.0)
        found = resect(pixels, points, 4000, 3000, sigma_px=1.5, sigma_m=0.05)
        if found.wrong == ("10",):
            out += 1
            (said,) = [
                remark.text for remark in found.remarks if remark.about == "pair 10" and "left out" in remark.text
            ]
            kept = resect(pixels, points, 4000, 3000, sigma_px=1.5, sigma_m=0.05, robust=False, camera=found.camera)
            away = np.linalg.norm(kept.camera.position - found.camera.position)
            if "would stand" in said:
                assert float(said.split("would stand ")[1].split(" m")[0]) == pytest.approx(away, rel=0.06)
            else:
                assert away <= 1.05 * np.sqrt(np.linalg.eigvalsh(found.pose_covariance[3:, 3:])[-1])
            errors.append([np.linalg.norm(each.camera.position - camera.position) for each in (found, kept)])
    assert out > 18
    left_out, with_it = np.median(errors, axis=0)
    assert left_out < with_it / 2


def test_how_much_of_the_image_pairs_cover() -> None:
    """A square of 200 px is 2 % of 2000 × 1000 px; from 10 % on nothing is said."""
    assert [str(each) for each in remarks_on(looked_at())] == [
        "The pairs cover only 2 % of the image; away from them the camera is an extrapolation. Spread the pairs."
    ]
    wide = look_at(2000, 1000, (0, 0, 0), (0, 50, 0), focal_px=2000.0)
    spread = (looked_at().pixels - [900, 400]) * [2.3, 2.3]
    assert remarks_on(looked_at(camera=wide, pixels=spread)) == ()


def test_how_wide_a_field_pairs_span() -> None:
    """200 px at 2000 px focal length across and down are 0.1414 rad along the diagonal, 8.1°; twice as many are 16°."""
    poor = np.diag([1e-8] * 3 + [1e-4] * 3 + [100.0**2])
    first = str(remarks_on(looked_at(covariance=poor))[0])
    assert first == (
        "The focal length is known to 5 % only: the pairs span only 8.1° of view. Lock it, or add pairs nearer or "
        "farther."
    )
    wide = str(remarks_on(looked_at(covariance=poor, pixels=2 * looked_at().pixels - [1000, 500]))[0])
    assert wide == (
        "The focal length is known to 5 % only: the pairs are few, or close together. Lock it, or add pairs nearer or "
        "farther."
    )


def test_three_pairs_leave_the_true_pose_among_four() -> None:
    for seed in range(30):
        camera, _, points = made(seed, 6, sigma_px=0.0)
        seen = (points[:3] - camera.position) @ camera.rotation.T
        _, position, rotation = poses_from_three(unit(seen)[None], points[None, :3])
        assert 1 <= len(position) <= 4
        away = np.linalg.norm(position - camera.position, axis=1)
        best = int(np.argmin(away))
        assert away[best] < 1e-3 * norm(seen).mean()
        np.testing.assert_allclose(rotation[best], camera.rotation, atol=2e-3)


@pytest.mark.parametrize("free", [("f",), ("f", "c", "k1")])
def test_the_position_is_as_uncertain_as_is_said_with_the_lens_in_it(free: tuple[str, ...]) -> None:
    """χ² of the position with its covariance is above its 95 % point in 5 % of 120 cases (binomial, 99.9 %: 12)."""
    beyond, given_lens = 0, 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        camera, _, _ = one_far_out(seed)
        origins, directions = rays(camera, rng.uniform([100, 100], [3900, 2900], (20, 2)))
        points = origins + directions * rng.uniform(80, 200, (20, 1))
        pixels = project(camera, points) + 1.5 * rng.normal(size=(20, 2))
        found = resect(pixels, points + 0.03 * rng.normal(size=points.shape), 4000, 3000, free=free, sigma_px=1.5,
                       sigma_m=0.03)  # fmt: skip
        off = found.camera.position - camera.position
        beyond += bool(off @ np.linalg.solve(found.pose_covariance[3:, 3:], off) > 7.815)
        given_lens += bool(off @ np.linalg.solve(found.pose_covariance_given_lens[3:, 3:], off) > 7.815)
    assert beyond <= 14
    assert given_lens > beyond
