# SPDX-License-Identifier: GPL-3.0-or-later
"""rockfall align: the camera that made the pixels is found, with honest deviations, and mistakes are named."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at, project
from rockfall.core.cli import main
from rockfall.core.exchange.cameras import read_camera
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.georeference import GlobalShift
from rockfall.core.vectors import norm

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 1_000.0)
SIGMA_PX = 0.4
NAMES = [f"P{i}" for i in range(16)]


def truth(size=(1920, 1080), focal=1500.0) -> Camera:
    camera = look_at(*size, [-40.0, -55.0, 12.0], [0.0, 0.0, 20.0], focal_px=focal)
    return replace(camera, shift=SHIFT)


def scene(camera: Camera, seed=5):
    """Points of a rough slope that fill the camera's image, and their pixels."""
    rng = np.random.default_rng(seed)
    points = np.empty((0, 3))
    while len(points) < len(NAMES):
        more = np.stack([rng.uniform(-25, 40, 60), rng.uniform(-20, 50, 60), np.zeros(60)], axis=1)
        more[:, 2] = 0.7 * more[:, 1] + 4 * np.sin(more[:, 0] / 5) + rng.normal(size=60)
        pixel = project(camera, more)
        points = np.concatenate([points, more[((pixel > 10) & (pixel < np.array(camera.size) - 10)).all(axis=1)]])
    points = points[: len(NAMES)]
    return points, project(camera, points) + SIGMA_PX * rng.normal(size=(len(points), 2))


def write(path, points, pixels, extra=None):
    columns = ["name,u_px,v_px,x_m,y_m,z_m" + "".join(f",{name}" for name in extra or {})]
    for i, (pixel, point) in enumerate(zip(pixels.tolist(), SHIFT.to_survey(points).tolist(), strict=True)):
        more = [str(values[i]) for values in (extra or {}).values()]
        columns.append(",".join([f"P{i}", *map(repr, pixel), *map(repr, point), *more]))
    path.write_text("\n".join(columns) + "\n")
    return path


@pytest.fixture
def pairs(tmp_path):
    return write(tmp_path / "pairs.csv", *scene(truth()))


def align(capsys, table, *options):
    out = table.parent / "out"
    assert main(["align", str(table), *map(str, options), "--out", str(out)]) == 0
    return read_camera(out / "camera.toml", SHIFT), capsys.readouterr().out


def refused(capsys, table, *options):
    before = sorted(path.name for path in table.parent.iterdir())
    assert main(["align", str(table), *map(str, options), "--out", str(table.parent / "out")]) == 1
    assert sorted(path.name for path in table.parent.iterdir()) == before
    captured = capsys.readouterr()
    assert captured.out == ""
    *progress, message = captured.err.splitlines()
    assert all(line.endswith(" …") for line in progress)
    return message


def test_the_camera_is_found_within_its_deviations(pairs, capsys):
    found, said = align(capsys, pairs, "--size", "1920x1080", "--sigma-px", SIGMA_PX)
    camera = found.path.reference
    assert abs(camera.fx - 1500) < 4 * found.sigma["fx"]
    assert found.sigma["fx"] < 10
    off = camera.position - truth().position
    for i, name in enumerate("xyz"):
        assert abs(off[i]) < 4 * found.sigma[name]
    assert norm(off) < 0.5
    assert found.pose_covariance_with_lens is not None
    with_lens, given_lens = (
        np.sqrt(np.diag(matrix))[3:] for matrix in (found.pose_covariance_with_lens, found.pose_covariance)
    )
    np.testing.assert_allclose(with_lens, [found.sigma[name] for name in "xyz"], rtol=1e-9)
    assert (given_lens < with_lens).all()
    assert 0.5 * SIGMA_PX < found.rmse_px / np.sqrt(2) < 1.5 * SIGMA_PX
    assert found.pose_covariance.shape == (6, 6)
    marginal = np.array([found.sigma[name] for name in "xyz"])
    assert (np.sqrt(np.diag(found.pose_covariance))[3:] <= 1.001 * marginal).all()  # for the focal length as it is
    assert "16 of 16 pairs" in said
    scale = np.hypot(36, 24) / np.hypot(1920, 1080)  # full frame over the image [mm/px]
    assert f"Focal length: {camera.fx:.1f} ± {found.sigma['fx']:.1f} px ({camera.fx * scale:.1f} mm equiv" in said
    place = SHIFT.to_survey(camera.position)
    assert f"Position: x {place[0]:.3f} ± {found.sigma['x']:.3f}, y {place[1]:.3f} ± {found.sigma['y']:.3f}, z" in said
    assert "Largest residuals: P" in said
    residuals = read_table(pairs.parent / "out" / "pairs_residuals.csv", ("pair", "u_px"), ())
    assert list(residuals.columns)[:7] == [
        "pair", "u_px", "v_px", "residual_u_px", "residual_v_px", "residual_m", "used"
    ]  # fmt: skip
    length = np.hypot(residuals.numbers("residual_u_px"), residuals.numbers("residual_v_px"))
    assert np.sqrt(np.mean(length**2)) == pytest.approx(found.rmse_px)
    # A pixel is as wide as the depth over the focal length, a little less across a slanting ray.
    depth = (scene(truth())[0] - camera.position) @ camera.rotation[2]
    share = residuals.numbers("residual_m") / (length * depth / camera.fx)
    assert (share < 1.0001).all()
    assert (share > 0.7).all()


def test_a_wrong_pair_is_named_left_out_and_still_in_the_table(tmp_path, capsys):
    points, pixels = scene(truth())
    pixels[4] += [35.0, -20.0]
    table = write(tmp_path / "pairs.csv", points, pixels)
    found, said = align(capsys, table, "--size", "1920x1080", "--sigma-px", SIGMA_PX)
    assert "15 of 16 pairs" in said
    assert "1 left out as wrong: P4" in said
    assert abs(found.path.reference.fx - 1500) < 4 * found.sigma["fx"]
    residuals = read_table(table.parent / "out" / "pairs_residuals.csv", ("pair",), ())
    assert residuals.text("used") == ["0" if i == 4 else "1" for i in range(16)]
    assert residuals.numbers("residual_u_px")[4] == pytest.approx(35, abs=3)
    kept, said = align(capsys, table, "--size", "1920x1080", "--no-robust")
    assert "16 of 16 pairs" in said
    assert kept.rmse_px > 3 * found.rmse_px


def test_pairs_that_are_not_used_check_the_camera(tmp_path, capsys):
    points, pixels = scene(truth())
    pixels[2] += [80.0, 0.0]
    table = write(tmp_path / "pairs.csv", points, pixels, {"used": ["0" if i in (2, 9) else "" for i in range(16)]})
    _, said = align(capsys, table, "--size", "1920X1080")
    assert "14 of 16 pairs" in said
    checked = re.search(r"Not used, to check: P2 (\S+) px, P9 (\S+) px\.", said)
    assert float(checked[1]) == pytest.approx(80, abs=1.5)
    assert float(checked[2]) < 2


def test_what_is_known_of_the_lens_is_kept(pairs, capsys):
    found, said = align(capsys, pairs, "--size", "1920 x 1080", "--focal", 1500)
    assert found.path.reference.fx == 1500.0
    assert "fx" not in found.sigma
    assert "Focal length: 1500.0 px" in said
    assert norm(found.path.reference.position - truth().position) < 0.2
    fov = np.degrees(2 * np.arctan(960 / 1500))
    found, _ = align(capsys, pairs, "--size", "1920x1080", "--fov", repr(float(fov)))
    assert found.path.reference.fx == pytest.approx(1500.0)
    both, _ = align(capsys, pairs, "--size", "1920x1080", "--focal", 1400, "--free", "f")
    assert abs(both.path.reference.fx - 1500) < 4 * both.sigma["fx"]


def test_a_rough_camera_gives_the_distortion_and_a_place_to_begin(tmp_path, capsys):
    lens = replace(truth(), k1=-0.12)
    table = write(tmp_path / "pairs.csv", *scene(lens))
    free, said = align(capsys, table, "--size", "1920x1080", "--free", "f,k1")
    assert abs(free.path.reference.k1 + 0.12) < 4 * free.sigma["k1"] < 0.1
    assert "Lens: k1 -0.1" in said
    (tmp_path / "rough.toml").write_bytes((tmp_path / "out" / "camera.toml").read_bytes())
    again, _ = align(capsys, table, "--size", "1920x1080", "--camera", tmp_path / "rough.toml", "--free", "none")
    assert again.path.reference.k1 == free.path.reference.k1
    assert again.path.reference.position == pytest.approx(free.path.reference.position, abs=1e-3)


def test_the_video_gives_the_size_and_the_check_picture(tmp_path, capsys):
    camera = truth((320, 240), 260.0)
    table = write(tmp_path / "pairs.csv", *scene(camera))
    video = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 25, (320, 240))
    for shade in (40, 90, 140):
        writer.write(np.full((240, 320, 3), shade, np.uint8))
    writer.release()
    found, said = align(capsys, table, "--video", video, "--frame", 1)
    assert found.path.reference.size == (320, 240)
    assert "align.png" in said
    picture = cv2.imread(str(tmp_path / "out" / "align.png"))
    assert picture.shape == (240, 320, 3)
    assert np.median(picture) == pytest.approx(90, abs=4)
    # The centre of each cross is green, at the pixel that holds the projected point.
    for u, v in project(found.path.reference, scene(camera)[0]):
        b, g, r = picture[int(v) - 1 : int(v) + 2, int(u) - 1 : int(u) + 2].reshape(-1, 3).astype(int).max(axis=0)
        assert g > 150
        assert g > max(b, r) - 1
    said = refused_again(capsys, table, "--video", video, "--frame", 7)
    assert "film.avi: There is no frame 7. It has the frames 0 to 2." in said
    write(table, *scene(camera), {"frame": ["", "2", "3", *["0"] * 13]})
    said = refused_again(capsys, table, "--video", video)
    assert "pairs.csv, row 4: There is no frame 3 in film.avi. It has the frames 0 to 2." in said


def refused_again(capsys, table, *options):
    out = table.parent / "other"
    assert main(["align", str(table), *map(str, options), "--out", str(out)]) == 1
    assert not out.exists()
    return capsys.readouterr().err


EAST, UP_SLOPE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.8, 0.6])
"""Axes of a slope through the local origin."""
PER_M = 16.0
FRAMES = 24


def filmed(tmp_path, poses):
    """A video of a speckled slope, its terrain, and the pixels of points on it in each frame."""
    rng = np.random.default_rng(2)
    speckle = cv2.GaussianBlur(rng.uniform(0, 255, (960, 1280)).astype(np.float32), (0, 0), 2.0)
    speckle = cv2.normalize(speckle, None, 20, 235, cv2.NORM_MINMAX).astype(np.uint8)
    # Texture pixel → slope [m] → pixel; OpenCV counts from the centre of the first pixel.
    onto = np.array([[1 / PER_M, 0, -40], [0, -1 / PER_M, 30], [0, 0, 1]]) @ [[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]]
    writer = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25, poses[0].size)
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, 95)
    for camera in poses:
        lens = np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])
        seen = np.stack([EAST, UP_SLOPE, -camera.position], axis=1)
        picture = cv2.warpPerspective(speckle, lens @ camera.rotation @ seen @ onto, camera.size)
        writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()
    x, y = np.meshgrid(np.arange(-60.0, 61, 5), np.arange(-60.0, 61, 5))
    corners = SHIFT.to_survey(x.ravel()[:, None] * EAST + y.ravel()[:, None] * UP_SLOPE)
    rows = "\n".join(" ".join(f"{z:.4f}" for z in corners[:, 2].reshape(x.shape)[::-1][i]) for i in range(25))
    head = "ncols 25\nnrows 25\nxllcenter 2599940\nyllcenter 1199952\ndx 5\ndy 4\nNODATA_value -9999\n"
    (tmp_path / "slope.asc").write_text(head + rows + "\n")


def paired(path, poses, picked):
    """Pairs on the frames `picked`, with errors of 0.1 px."""
    rng = np.random.default_rng(8)
    lines = ["name,frame,u_px,v_px,x_m,y_m,z_m"]
    for frame in picked:
        place = rng.uniform([-14, -9], [14, 9], (12, 2))
        points = place[:, :1] * EAST + place[:, 1:] * UP_SLOPE
        pixels = project(poses[frame], points) + 0.1 * rng.normal(size=(12, 2))
        for i, (pixel, point) in enumerate(zip(pixels.tolist(), SHIFT.to_survey(points).tolist(), strict=True)):
            lines.append(",".join([f"P{i}", str(frame), *map(repr, [*pixel, *point])]))
    path.write_text("\n".join(lines) + "\n")
    return path


def walk(step_m):
    """Cameras that turn to and fro, and walk."""
    cameras = []
    for i in range(FRAMES):
        place = np.array([-4.0, -42.0, 6.0]) + np.array([1.0, 0.2, 0.05]) * step_m * i
        aim = [2 * np.sin(i / 6), 0.0, 1.5 * np.sin(i / 9)]
        cameras.append(replace(look_at(640, 480, place, aim, focal_px=620), shift=SHIFT))
    return cameras


def turn_px(path, poses):
    """Largest error of a frame's rotation, as it shows in the image [px]."""
    off = np.einsum("nij,nkj->nik", path.rotation, np.array([one.rotation for one in poses]))
    return 620 * np.arccos(np.clip((np.trace(off, axis1=1, axis2=2) - 1) / 2, -1, 1)).max()


def test_a_camera_that_turns_has_a_pose_for_each_frame(tmp_path, capsys):
    poses = walk(0.0)
    filmed(tmp_path, poses)
    table = paired(tmp_path / "pairs.csv", poses, [0])
    found, said = align(capsys, table, "--video", tmp_path / "film.avi", "--moving", "rotation", "--sigma-px", 0.1)
    path = found.path
    assert path.time_s == pytest.approx(np.arange(FRAMES) / 25)
    assert "a pose for each of 24 frames" in said
    assert turn_px(path, poses) < 1.5
    assert norm(path.position - poses[0].position).max() < 0.4
    assert np.ptp(path.position, axis=0).max() == 0


def test_a_camera_that_walks_is_tied_to_its_key_frames(tmp_path, capsys):
    poses = walk(0.04)
    filmed(tmp_path, poses)
    table = paired(tmp_path / "pairs.csv", poses, [0, FRAMES - 1])
    options = ["--video", tmp_path / "film.avi", "--sigma-px", 0.1, "--terrain", tmp_path / "slope.asc"]
    found, said = align(capsys, table, *options, "--moving", "full", "--focal", 620, "--frame", 0)
    truth_m = np.array([one.position for one in poses])
    position = found.path.reference.shift.to_survey(found.path.position) - SHIFT.vector
    assert norm(position - truth_m).max() < 0.15
    assert turn_px(found.path, poses) < 2.0
    assert "Frame 23: 12 pairs fit to 0." in said
    assert "off the terrain" in said
    residuals = read_table(tmp_path / "out" / "pairs_residuals.csv", ("pair",), ())
    assert np.abs(residuals.numbers("residual_u_px")).max() < 1.0
    assert residuals.text("frame") == ["0"] * 12 + ["23"] * 12
    # As one fixed camera the two frames contradict each other.
    wrong, _ = align(capsys, table, "--size", "640x480", "--focal", 620, "--no-robust")
    assert wrong.rmse_px > 3


def test_a_tripod_needs_one_pose(tmp_path, capsys):
    poses = walk(0.0)[:1] * 6
    filmed(tmp_path, poses)
    table = paired(tmp_path / "pairs.csv", poses, [0])
    found, said = align(capsys, table, "--video", tmp_path / "film.avi", "--moving", "rotation")
    assert found.path.is_fixed
    assert "stands still" in said
    assert "--moving full needs the terrain" in refused_again(
        capsys, table, "--video", tmp_path / "film.avi", "--moving", "full"
    )
    assert "--video" in refused_again(capsys, table, "--size", "640x480", "--moving", "rotation")
    moving = ["--video", tmp_path / "film.avi", "--moving", "rotation"]
    assert "It has the frames 0 to 5." in refused_again(capsys, table, *moving, "--frames", "0", "9")
    assert "on frame 0, outside of the frames 2 to 5" in refused_again(capsys, table, *moving, "--frames", "2", "5")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--size", "1920"], ["--size 1920 is no size", "1920x1080"]),
        (["--size", "0x1080"], ["no size"]),
        (["--size", "1920x1080", "--free", "f,k9"], ["'k9'", "Did you mean k", "none"]),
        (["--size", "1920x1080", "--free", "f,fx"], ["f already frees"]),
        (["--size", "1920x1080", "--free", "none"], ["focal length is neither free nor known"]),
        (["--size", "1920x1080", "--fov", "180"], ["below 180"]),
        (["--size", "640x480"], ["pairs.csv, row ", "outside the image of 640 × 480 px"]),
        (["--video", "none.mp4"], ["none.mp4"]),
        (["--size", "1920x1080", "--camera", "none.toml"], ["none.toml", "no such file"]),
    ],
)  # fmt: skip
def test_mistakes_are_named(pairs, capsys, options, said):
    message = refused(capsys, pairs, *options)
    for text in said:
        assert text in message


def test_pairs_that_give_no_camera_are_refused(tmp_path, capsys):
    points, pixels = scene(truth())
    few = write(tmp_path / "pairs.csv", points[:3], pixels[:3])
    assert "3 pairs are too few" in refused(capsys, few, "--size", "1920x1080")
    line = points[0] + np.linspace(0, 1, 16)[:, None] * (points[1] - points[0])
    write(few, line, project(truth(), line))
    assert "lie on a line" in refused(capsys, few, "--size", "1920x1080")
    write(few, points, pixels, {"used": ["0"] * 16})
    assert "No pair is to be used" in refused(capsys, few, "--size", "1920x1080")
    few.write_text("u_px,v_px,x,y,z\n1,2,3,4,5\n")
    assert "x_m, y_m, z_m" in refused(capsys, few, "--size", "1920x1080")


def test_a_text_is_no_video(pairs, capsys, tmp_path):
    fake = tmp_path / "film.mp4"
    fake.write_text("this is no video\n" * 50)
    assert "film.mp4" in refused(capsys, pairs, "--video", fake)


def test_usage(pairs, capsys):
    for options, said in (
        ([], "one of the arguments --size --video is required"),
        (["--size", "10x10", "--video", "a.mp4"], "--video: not allowed with argument --size"),
        (["--size", "1920x1080", "--sigma-px", "0"], "--sigma-px: 0 is not a number above zero"),
        (["--size", "1920x1080", "--sigma-m", "-1"], "--sigma-m: -1 is not a number of zero or more"),
        (["--size", "1920x1080", "--sigma-m", "inf"], "--sigma-m: inf is not a number of zero or more"),
    ):
        assert main(["align", str(pairs), *options, "--out", "x"]) == 2
        assert said in capsys.readouterr().err
