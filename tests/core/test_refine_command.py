# SPDX-License-Identifier: GPL-3.0-or-later
"""rockfall refine: from a project with filmed pixels to picks and impacts, checked against the filmed motion."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at, project, rays, rotation_from_vector
from rockfall.core.camera.path import CameraPath, fixed
from rockfall.core.cli import main
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.exchange.cameras import read_camera, write_camera
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.tables import read_impacts, read_picks
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.triangulation import contact_points
from rockfall.core.vectors import norm, unit
from rockfall.core.workflow.footage import open_footage, picks_from_footage
from rockfall.core.workflow.opening import open_project, open_terrain

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 1_000.0)
DIP = np.radians(30.0)
NORMAL = np.array([np.sin(DIP), 0.0, np.cos(DIP)])
RADIUS = 0.25
GRAVITY = np.array([0.0, 0.0, -9.81])
TIMES = {"B1": np.array([10.0, 10.9, 11.7, 12.6]), "B2": np.array([20.0, 20.8, 21.7])}
ALONG = {"B1": np.array([2.0, 8.0, 14.5, 22.0]), "B2": np.array([3.0, 9.0, 16.0])}
ACROSS = {"B1": np.array([0.0, 0.5, 0.2, 1.0]), "B2": np.array([-3.0, -2.5, -3.2])}
OFFSET = {"left": -2.5, "right": 7.25}
NOISE_PX = 0.3


def contacts(name):
    """(n, 3) where the block touches the plane z = −x tan 30°."""
    along = ALONG[name]
    return np.stack([along * np.cos(DIP), ACROSS[name], -along * np.sin(DIP)], axis=1)


def centre_at(name, time):
    """(m, 3) centre of the block on parabolas between the centres at the contacts."""
    knots, place = TIMES[name], contacts(name) + RADIUS * NORMAL
    k = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, knots.size - 2)
    span = (knots[k + 1] - knots[k])[:, None]
    start = (place[k + 1] - place[k]) / span - 0.5 * GRAVITY * span
    t = (time - knots[k])[:, None]
    return place[k] + start * t + 0.5 * GRAVITY * t**2


def velocities(name, i):
    """Incident and restituted velocity at contact i."""
    knots, place = TIMES[name], contacts(name) + RADIUS * NORMAL
    step, gone = np.diff(knots)[:, None], np.diff(place, axis=0)
    return gone[i - 1] / step[i - 1] + 0.5 * GRAVITY * step[i - 1], gone[i] / step[i] - 0.5 * GRAVITY * step[i]


def cameras() -> dict[str, Camera]:
    aim = [10.0, 0.0, -6.0]
    left = look_at(1280, 720, [18.0, -28.0, 2.0], aim, focal_px=1100)
    right = look_at(1280, 720, [32.0, 14.0, -4.0], aim, focal_px=1000)
    return {"left": replace(left, shift=SHIFT), "right": replace(right, k1=-0.05, shift=SHIFT)}


@pytest.fixture(scope="module")
def terrain(tmp_path_factory):
    """The plane as a mesh in survey coordinates."""
    path = tmp_path_factory.mktemp("terrain") / "plane.ply"
    x, y = np.meshgrid(np.arange(-6.0, 31.0), np.arange(-15.0, 16.0))
    survey = SHIFT.to_survey(np.stack([x.ravel(), y.ravel(), -x.ravel() * np.tan(DIP)], axis=1))
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    head = f"ply\nformat ascii 1.0\nelement vertex {len(survey)}\nproperty double x\nproperty double y\n"
    head += f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(repr, row)) for row in survey.tolist()] + [f"3 {p} {q} {r}" for p, q, r in faces.tolist()]
    path.write_text(head + "\n".join(rows) + "\n")
    return path


@pytest.fixture
def site(tmp_path, terrain):
    """A whole project: two videos, two blocks, picks a few decimetres and hundredths of a second off."""
    folder, rng = tmp_path / "site", np.random.default_rng(11)
    folder.mkdir()
    (folder / "plane.ply").write_bytes(terrain.read_bytes())
    for name, camera in cameras().items():
        write_camera(folder / f"{name}.toml", fixed(camera))
        rows, events = ["trajectory,frame,time_s,u_px,v_px,sigma_px"], ["trajectory,time_s,u_px,v_px,sigma_time_s,kind"]
        for block, knots in TIMES.items():
            common = np.arange(knots[0], knots[-1], 0.02) + 0.003
            pixel = project(camera, centre_at(block, common)) + NOISE_PX * rng.normal(size=(common.size, 2))
            for t, (u, v) in zip((common - OFFSET[name]).tolist(), pixel.tolist(), strict=True):
                rows.append(f"{block},{round(t * 50)},{t!r},{u!r},{v!r},{NOISE_PX}")
            late = 0.01 * rng.normal(size=knots.size)
            at_contact = project(camera, centre_at(block, knots)).tolist()
            for t, (u, v) in zip((knots + late - OFFSET[name]).tolist(), at_contact, strict=True):
                events.append(f"{block},{t!r},{u!r},{v!r},0.01,impact")
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
        (folder / f"{name}_events.csv").write_text("\n".join(events) + "\n")
    rows = ["trajectory,time_s,x_m,y_m,z_m,sigma_time_s,note"]
    for block, knots in TIMES.items():
        place, time = contacts(block), knots + 0.015 * rng.normal(size=knots.size)
        place = place + 0.15 * (rng.normal(size=place.shape) @ (np.eye(3) - np.outer(NORMAL, NORMAL)))
        for t, p in zip(time.tolist(), SHIFT.to_survey(place).tolist(), strict=True):
            rows.append(f"{block},{t!r},{','.join(map(repr, p))},0.02,kept")
    (folder / "picks.csv").write_text("\n".join(rows) + "\n")
    (folder / "project.toml").write_text(PROJECT)
    return folder


PROJECT = """schema = 1
[site]
name = "plane"
[terrain]
file = "plane.ply"
[picks]
file = "picks.csv"
[block]
d1_m = 0.5
d2_m = 0.5
d3_m = 0.5
[refinement]
sigma_aim = 0.0
sigma_terrain_m = 0.002
[[videos]]
name = "left"
file = "moved/away.mp4"
camera = "left.toml"
track = "left.csv"
events = "left_events.csv"
offset_s = -2.5
row_time_s = 0.0
operator = "kept"
[[videos]]
name = "right"
camera = "right.toml"
track = "right.csv"
offset_s = 7.25
row_time_s = 0.0
"""


def change(site, old, new, count=1):
    text = (site / "project.toml").read_text()
    assert old in text
    (site / "project.toml").write_text(text.replace(old, new, count))


def refused(capsys, site, *options):
    out = site.parent / "out"
    assert main(["refine", str(site / "project.toml"), *options, "--out", str(out)]) == 1
    assert not out.exists()
    assert [path.name for path in site.parent.iterdir()] == ["site"]
    captured = capsys.readouterr()
    assert captured.out == ""
    *progress, message = captured.err.splitlines()
    assert all(line.endswith(" …") for line in progress)
    return message


def check_picks(folder, names=tuple(TIMES)):
    """All within their own standard deviations; those between two flights are known to the millisecond and centimetre.

    The first and the last of a run may slide along their only flight, and along the plane.
    """
    picks = read_picks(folder / "picks.csv", SHIFT)
    late = np.abs(picks.time_s - np.concatenate([TIMES[name] for name in names]))
    off = norm(picks.position - np.concatenate([contacts(name) for name in names]))
    assert (late / picks.sigma_time_s).max() < 4
    assert (off / picks.sigma_position_m).max() < 6
    starts = np.r_[picks.group_starts, len(picks)]
    inner = np.setdiff1d(np.arange(len(picks)), np.r_[starts[:-1], starts[1:] - 1])
    assert late[inner].max() < 0.0015
    assert off[inner].max() < 0.015
    assert late.max() < 0.01
    assert off.max() < 0.1


def test_refined_picks_and_impacts_are_those_that_were_filmed(site, tmp_path, capsys):
    out = tmp_path / "runs" / "out"
    assert main(["refine", str(site / "project.toml"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    names = {"picks.csv", "impacts.csv", "trajectories.csv", "residuals.csv", "project.toml"}
    names |= {"what_if.csv", "reliability.csv"}
    assert {path.name for path in out.iterdir()} == names
    check_picks(out)
    before = read_picks(site / "picks.csv", SHIFT)
    assert norm(before.position - np.concatenate([contacts(name) for name in TIMES])).max() > 0.15
    assert read_picks(out / "picks.csv").extra["note"].tolist() == ["kept"] * 7

    impacts = read_impacts(out / "impacts.csv", SHIFT)
    i = int(np.flatnonzero((impacts.trajectory == "B1") & (impacts.impact == 2))[0])
    v1, v2 = velocities("B1", 1)
    assert impacts.v1[i] == pytest.approx(v1, abs=0.05)
    rn = abs(v2 @ NORMAL) / abs(v1 @ NORMAL)
    assert 0 < impacts.sigma["rn"][i] < 0.05
    assert abs(impacts.rn[i] - rn) < 4 * impacts.sigma["rn"][i] + 1e-3
    residuals = read_table(out / "residuals.csv", ("trajectory", "video"), ())
    size = np.sqrt(np.nanmean(residuals.numbers("residual_u_px") ** 2))
    assert NOISE_PX * 0.8 < size < NOISE_PX * 1.2
    assert set(residuals.text("video")) == {"left", "right"}
    for text in (
        "px off the marked motion",
        "By video: left 0.4",
        "The picks moved by",
        "R_N",
        "B2",
        " ± ",
        "Camera of left 0.3 m",
    ):
        assert text in said


def test_the_refined_project_reads_back_as_what_was_refined(site, tmp_path):
    out = tmp_path / "out"
    assert main(["refine", str(site / "project.toml"), "--out", str(out)]) == 0
    text = (out / "project.toml").read_text()
    assert 'file = "picks.csv"' in text
    assert 'camera = "../site/left.toml"' in text
    assert 'operator = "kept"' in text
    refined = read_project(out / "project.toml")
    assert refined.reconstruction.flights == "centres"
    _, result = open_project(refined)
    impacts = read_impacts(out / "impacts.csv", SHIFT)
    shifted = result.picks.shift.to_survey(result.impacts.position)
    assert np.abs(shifted - SHIFT.to_survey(impacts.position)).max() < 1e-6
    assert result.impacts.v1 == pytest.approx(impacts.v1, abs=1e-6, nan_ok=True)
    assert result.impacts.rn == pytest.approx(impacts.rn, abs=1e-6, nan_ok=True)


def test_without_picks_the_events_give_the_first_ones(site, tmp_path, capsys):
    change(site, '[picks]\nfile = "picks.csv"\n', "")
    first = picks_from_footage(read_project(site / "project.toml"), open_terrain(read_project(site / "project.toml")))
    truth = np.concatenate([contacts(name) for name in TIMES])
    assert norm(first.shift.to_survey(first.position) - SHIFT.to_survey(truth)).max() < 1e-6
    assert first.extra["video"].tolist() == ["left"] * 7
    assert main(["refine", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "7 first picks of 2 trajectories were made from the events" in capsys.readouterr().out
    check_picks(tmp_path / "out")


def test_one_video_is_enough_and_a_track_need_not_name_the_only_trajectory(site, tmp_path):
    change(site, '[picks]\nfile = "picks.csv"\n', '[[blocks]]\nname = "B1"\n')
    change(site, PROJECT[PROJECT.rindex("[[videos]]") :], "")
    for name in ("left.csv", "left_events.csv"):
        lines = (site / name).read_text().splitlines()
        kept = [line for line in lines if line.startswith(("trajectory", "B1"))]
        (site / name).write_text("\n".join(line.partition(",")[2] for line in kept) + "\n")
    assert main(["refine", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    assert read_picks(tmp_path / "out" / "picks.csv").trajectory.tolist() == ["B1"] * 4
    check_picks(tmp_path / "out", ("B1",))


def test_pixels_that_may_lie_off_the_centre_leave_the_places_less_known(site, tmp_path, capsys):
    """The table of impacts stays within a terminal."""
    for name, camera in cameras().items():
        write_camera(site / f"{name}.toml", fixed(camera), pose_covariance=1e-10 * np.eye(6))
    sigma = []
    for number, aim in enumerate(("0", "0.15")):
        argv = ["refine", str(site / "project.toml"), "--sigma-aim", aim, "--out", str(tmp_path / str(number))]
        assert main(argv) == 0
        said = capsys.readouterr().out
        assert ("The tracked spot lies" in said) == (aim != "0")
        table = [line for line in said.splitlines() if line.startswith(("trajectory", "B1  ", "B2  "))]
        assert len(table) == 8
        assert max(map(len, table)) <= 100
        assert "restituted m/s" in table[0]
        sigma.append(read_picks(tmp_path / str(number) / "picks.csv", SHIFT).sigma_position_m)
        assert read_project(tmp_path / str(number) / "project.toml").refinement.sigma_aim == float(aim)
    assert (sigma[1] > 1.2 * sigma[0])[[1, 2, 5]].all()


def test_one_trajectory_alone(site, tmp_path):
    argv = ["refine", str(site / "project.toml"), "--trajectory", "B2", "--loss", "linear", "--out"]
    assert main([*argv, str(tmp_path / "out")]) == 0
    assert set(read_picks(tmp_path / "out" / "picks.csv").trajectory.tolist()) == {"B2"}
    residuals = read_table(tmp_path / "out" / "residuals.csv", ("trajectory",), ())
    assert set(residuals.text("trajectory")) == {"B2"}
    assert read_project(tmp_path / "out" / "project.toml").refinement.loss == "linear"


def test_a_clock_that_is_off_is_found(site, tmp_path, capsys):
    change(site, "offset_s = 7.25", "offset_s = 7.29")
    argv = ["refine", str(site / "project.toml"), "--free", "clock", "--out", str(tmp_path / "out")]
    assert main(argv) == 0
    assert "offset_s right: 7.2" in capsys.readouterr().out
    right = read_project(tmp_path / "out" / "project.toml").videos[1]
    assert right.offset_s == pytest.approx(7.25, abs=0.002)


def test_a_slow_motion_file_runs_at_its_capture_rate(site, tmp_path):
    lines = (site / "right.csv").read_text().splitlines()
    slow = [line.split(",") for line in lines[1:]]
    # Eight frames in the file for each one of the fall: what was 50 per second was taken at 400 and stored at 50.
    table = [",".join([row[0], row[1], repr(int(row[1]) / 50), *row[3:]]) for row in slow]
    frames = np.array([int(row[1]) for row in slow])
    times = np.array([float(row[2]) for row in slow])
    late = float(np.mean(times - frames / 50))
    (site / "right.csv").write_text("\n".join([lines[0], *table]) + "\n")
    change(site, "offset_s = 7.25", f"offset_s = {7.25 + late}\ncapture_rate_hz = 50.0")
    footage = open_footage(read_project(site / "project.toml"))
    assert footage.videos[1].clock.rate == pytest.approx(1.0, abs=1e-12)
    change(site, "capture_rate_hz = 50.0", "capture_rate_hz = 400")
    assert open_footage(read_project(site / "project.toml")).videos[1].clock.rate == pytest.approx(1 / 8)
    without = [",".join([row[0], *row[2:]]) for row in (lines[0].split(","), *slow)]
    (site / "right.csv").write_text("\n".join(without) + "\n")
    with pytest.raises(InputError, match="Video right has a capture rate, but nothing tells the rate of its file"):
        open_footage(read_project(site / "project.toml"))


def test_a_camera_that_is_a_little_off_is_put_right(site, tmp_path):
    truth = cameras()["right"]
    turned = replace(truth, rotation=rotation_from_vector([0.002, -0.003, 0.001]) @ truth.rotation)
    covariance = np.diag([0.005**2] * 3 + [0.02**2] * 3)
    write_camera(site / "right.toml", fixed(turned), pose_covariance=covariance, extra={"operator": "kept"})
    argv = ["refine", str(site / "project.toml"), "--free", "camera", "--out", str(tmp_path / "out")]
    assert main(argv) == 0
    found = read_camera(tmp_path / "out" / "camera_right.toml", SHIFT)
    turn = np.arccos(np.clip((np.trace(found.path.reference.rotation @ truth.rotation.T) - 1) / 2, -1, 1))
    assert turn < 0.0005
    assert found.extra == {"operator": "kept"}
    assert found.pose_covariance[0, 0] < covariance[0, 0]
    assert read_project(tmp_path / "out" / "project.toml").videos[1].camera.name == "camera_right.toml"
    assert not (tmp_path / "out" / "camera_left.toml").exists()


def test_a_camera_that_turns_and_loses_a_frame(site, tmp_path, capsys):
    """The left camera turns back and forth; in some frames nothing was recognised, and their poses are wrong."""
    camera, rng = cameras()["left"], np.random.default_rng(4)
    lines = [line.split(",") for line in (site / "left.csv").read_text().splitlines()]
    time = np.array([float(line[2]) for line in lines[1:]])
    turn = rotation_from_vector(np.outer(np.sin(2 * time), [0.0, 0.03, 0.01])) @ camera.rotation
    for line, common, rotation in zip(lines[1:], time + OFFSET["left"], turn, strict=True):
        seen = project(replace(camera, rotation=rotation), centre_at(line[0], np.array([common])))[0]
        line[3:5] = map(repr, (seen + NOISE_PX * rng.normal(size=2)).tolist())
    (site / "left.csv").write_text("\n".join(map(",".join, lines)) + "\n")
    order, lost = np.argsort(time), np.zeros(time.size)
    lost[order[10:13]] = np.inf
    turn[order[10:13]] = camera.rotation
    place = np.repeat(camera.position[None], time.size, axis=0)
    write_camera(
        site / "left.toml", CameraPath(camera, time[order], place, turn[order], np.zeros(time.size), lost[order])
    )
    assert main(["refine", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "3 pixels are not used" in capsys.readouterr().out
    check_picks(tmp_path / "out")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('track = "left.csv"\n', "", None),
        (PROJECT[PROJECT.index("[[videos]]") :], "", ["The project has no videos", "rockfall align", 'track = "']),
        ("offset_s = 7.25", "offset_s = 70.25", ["clocks do not overlap", "view right", "offset"]),
        ("left.toml", "none.toml", ["videos 1: camera", "none.toml"]),
        ("d1_m = 0.5", "d1_m = -0.5", ["block.d1_m"]),
    ],
)
def test_a_project_that_cannot_be_refined_says_what_to_add(site, capsys, tmp_path, old, new, said):
    change(site, old, new)
    if said is None:
        assert main(["refine", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 0
        assert "Video left is not used: it has no track." in capsys.readouterr().out
        return
    message = refused(capsys, site)
    for text in said:
        assert text in message


def test_bad_tables_and_options_are_refused_with_their_place(site, capsys):
    good = (site / "left.csv").read_text()
    (site / "left.csv").write_text(good.replace("B2", "C7"))
    assert "no picks of this trajectory" in (message := refused(capsys, site))
    assert "C7" in message
    (site / "left.csv").write_text(good.replace("\nB1,", "\n,", 1))
    assert "row 2" in (message := refused(capsys, site))
    assert "does not name the trajectory" in message
    lines = good.splitlines()
    row = lines[3].split(",")
    lines[3] = ",".join([*row[:3], "5000", *row[4:]])
    (site / "left.csv").write_text("\n".join(lines) + "\n")
    message = refused(capsys, site)
    assert "left.csv, row 4, trajectory B1: The pixel (5000, " in message
    assert "lies far outside the image of camera left.toml" in message
    lines[3] = "B1,627,12.6,500,100,0.3"
    (site / "left.csv").write_text("\n".join(lines) + "\n")
    assert "left.csv, row 5, trajectory B1: The time 12.563 s does not come after 12.6 s" in refused(capsys, site)
    (site / "left.csv").write_text(good)
    assert "There is no trajectory 'B7'. The picks have: B1, B2" in refused(capsys, site, "--trajectory", "B7")
    assert "Did you mean clock?" in refused(capsys, site, "--free", "clok")
    assert "covariance" in refused(capsys, site, "--free", "camera")
    change(site, '[picks]\nfile = "picks.csv"\n', "")
    change(site, 'events = "left_events.csv"\n', "")
    for name in ("left.csv", "right.csv"):
        lines = (site / name).read_text().splitlines()
        (site / name).write_text("\n".join(lines[:8]) + "\n")
    assert "no video with events to make them from, and the tracked blocks change" in refused(capsys, site)
    project = read_project(site / "project.toml")
    blind = replace(project, videos=tuple(replace(video, track=None) for video in project.videos))
    with pytest.raises(RockfallError, match="no video with events to make them from: add"):
        picks_from_footage(blind, open_terrain(project))


def test_without_a_terrain_events_have_no_places(site, capsys):
    change(site, '[picks]\nfile = "picks.csv"\n', "")
    change(site, '[terrain]\nfile = "plane.ply"\n', "")
    assert "Picks can be made from events on a terrain only: add [terrain]" in refused(capsys, site)


def test_without_events_the_tracks_give_the_first_picks(site, tmp_path, capsys):
    """Impacts where the tracked pixels turn at once; the flights before the first and after the last end in passes."""
    change(site, '[picks]\nfile = "picks.csv"\n', "")
    change(site, 'events = "left_events.csv"\n', "")
    project = read_project(site / "project.toml")
    first = picks_from_footage(project, open_terrain(project))
    assert first.kind.tolist() == ["pass", "impact", "impact", "pass", "pass", "impact", "pass"]
    impacts = first.kind == "impact"
    assert np.abs(first.time_s[impacts] - [10.9, 11.7, 20.8]).max() < 0.005
    contact = SHIFT.to_survey(np.concatenate([contacts("B1")[1:3], contacts("B2")[1:2]]))
    assert norm(first.shift.to_survey(first.position[impacts]) - contact).max() < 0.05
    for i in np.flatnonzero(~impacts):
        place = centre_at(str(first.trajectory[i]), first.time_s[i : i + 1])
        assert norm(first.shift.to_survey(first.position[i : i + 1]) - SHIFT.to_survey(place)).max() < 0.3
    assert main(["refine", str(site / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "7 first picks of 2 trajectories were made from the tracks, where a block changes its velocity" in said
    refined = read_picks(tmp_path / "out" / "picks.csv", SHIFT)
    assert norm(refined.position[refined.kind == "impact"] - SHIFT.to_local(contact)).max() < 0.015


def test_an_event_whose_ray_misses_is_located(site, capsys):
    change(site, '[picks]\nfile = "picks.csv"\n', "")
    lines = (site / "left_events.csv").read_text().splitlines()
    lines[2] = "B1,13.4,640,2,0.01,impact"
    (site / "left_events.csv").write_text("\n".join(lines) + "\n")
    message = refused(capsys, site)
    assert "left_events.csv, row 3, trajectory B1" in message
    assert "misses the terrain" in message


def test_usage(site, capsys):
    assert main(["refine"]) == 2
    assert main(["refine", str(site / "project.toml"), "--loss", "l2", "--out", "x"]) == 2
    capsys.readouterr()


def test_contact_points_on_a_rough_terrain_are_a_radius_from_the_centre(terrain):
    surface = open_terrain(read_project_of(terrain))
    camera = cameras()["left"].in_shift(surface.shift)
    truth = surface.shift.to_local(SHIFT.to_survey(contacts("B1")))
    pixel = project(camera, truth + RADIUS * NORMAL)
    origins, directions = rays(camera, pixel)
    point, normal = contact_points(surface, origins, directions, np.full(4, 2 * RADIUS))
    assert norm(point - truth).max() < 1e-6
    assert normal == pytest.approx(np.tile(NORMAL, (4, 1)), abs=1e-9)
    # The centre lies on the ray, a radius out of the ground.
    away = point + RADIUS * normal - origins
    assert norm(np.cross(unit(away), directions)).max() < 1e-9


def read_project_of(terrain):
    path = terrain.parent / "only.toml"
    path.write_text(f'schema = 1\n[terrain]\nfile = "{terrain.name}"\n')
    return read_project(path)
