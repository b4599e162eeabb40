# SPDX-License-Identifier: GPL-3.0-or-later
"""First picks from what was seen: events and kinks of a known motion down a plane, seen by a camera that may turn."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project, rotation_from_vector
from rockfall.core.camera.path import CameraPath, fixed
from rockfall.core.errors import RockfallError
from rockfall.core.footage.clock import Clock
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.views import View
from rockfall.core.reconstruction.sightings import Events, SeenVideo, Sightings
from rockfall.core.terrain.surface import Surface
from rockfall.core.vectors import norm
from rockfall.core.workflow.first_picks import first_picks
from rockfall.core.workflow.refinement import pixels_of, refine_picks

G = np.array([0.0, 0.0, -9.81])
DIP = np.radians(35)
DOWN, OUT = np.array([np.cos(DIP), 0, -np.sin(DIP)]), np.array([np.sin(DIP), 0, np.cos(DIP)])
SURFACE = Surface(
    np.array([60 * a * DOWN + [0, 60 * b, 0] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "plane",
)
BLOCK = Block(0.5, 0.5, 0.5)
TIME = np.array([2.0, 2.7, 3.5, 4.2, 5.0])
CONTACT = np.array([-14.0, -8.0, -1.0, 6.0, 14.0])[:, None] * DOWN
CLOCK = Clock(1.5, 1e-3)
ROW_S = 1e-5


def centre_at(time):
    """(m, 3) on parabolas between the centres at the contacts."""
    place = CONTACT + BLOCK.radius_m * OUT
    k = np.clip(np.searchsorted(TIME, time, side="right") - 1, 0, TIME.size - 2)
    span, t = np.diff(TIME)[k, None], (time - TIME[k])[:, None]
    return place[k] + ((place[k + 1] - place[k]) / span - 0.5 * G * span) * t + 0.5 * G * t**2


def view(name="left", turning=0.0, side=-1.0):
    camera = look_at(1920, 1080, (0.0, 60.0 * side, 10.0), (0, 0, 0), focal_px=2000.0)
    if not turning:
        return View(name, fixed(camera), CLOCK, ROW_S)
    frames = np.arange(0.0, 5.0, 0.02)
    turn = rotation_from_vector(turning * np.sin(np.outer(frames, [5.0, 7.0, 4.0]))) @ camera.rotation
    place = np.repeat(camera.position[None], frames.size, axis=0)
    zeros = np.zeros(frames.size)
    return View(name, CameraPath(camera, frames, place, turn, zeros, zeros.copy()), CLOCK, ROW_S)


def seen(one, begin=2.25, end=4.75, name="a"):
    """Exact pixels of every picture between two common times."""
    video = np.arange(0.0, 5.0, 0.02)
    video = video[(CLOCK.to_common(video) > begin) & (CLOCK.to_common(video) < end)]
    position, rotation = one.path.poses_at(video)
    exposed = CLOCK.to_common(video)
    for _ in range(6):
        pixel = project(one.path.reference, centre_at(exposed), position=position, rotation=rotation)
        exposed = one.exposed_at(video, pixel)
    frame = np.round(video / 0.02).astype(np.intp)
    return Sightings(np.full(video.size, name), frame, video, pixel, np.full(video.size, 0.3))


def events(one, impacts, name="a"):
    video = CLOCK.to_video(TIME[impacts])
    position, rotation = one.path.poses_at(video)
    for _ in range(6):
        pixel = project(one.path.reference, centre_at(TIME[impacts]), position=position, rotation=rotation)
        late = one.exposed_at(video, pixel) - TIME[impacts]
        video = video - late / CLOCK.speed
    count = video.size
    return Events(
        np.full(count, name), np.full(count, -1), video, pixel, np.full(count, 0.01), np.full(count, "impact")
    )


def picks_of(*videos, **more):
    return first_picks(videos, SURFACE, {"a": BLOCK, "b": BLOCK}, gravity_mps2=9.81, **more)


def check(picks, kinds, atol_s, atol_m):
    assert picks.kind.tolist() == kinds
    contact = picks.kind == "impact"
    truth = np.abs(picks.time_s[contact, None] - TIME).argmin(axis=1)
    np.testing.assert_allclose(picks.time_s[contact], TIME[truth], atol=atol_s)
    np.testing.assert_allclose(picks.position[contact], CONTACT[truth], atol=atol_m)
    np.testing.assert_allclose(picks.position[~contact], centre_at(picks.time_s[~contact]), atol=10 * atol_m)


def test_events_become_contacts_and_open_flights_are_closed():
    one = view()
    video = SeenVideo(one, seen(one), events(one, [1, 2, 3]))
    found = picks_of(video)
    check(found.picks, ["pass", "impact", "impact", "impact", "pass"], 1e-6, 1e-4)
    first, last = one.exposed_at(video.sightings.time_s, video.sightings.pixel)[[0, -1]]
    assert found.picks.time_s[[0, -1]] == pytest.approx([first, last], abs=1e-9)
    assert found.picks.sigma_time_s[1] == pytest.approx(0.01 * CLOCK.speed)
    assert found.picks.extra["video"].tolist() == ["left"] * 5
    assert found.picks.extra["frame"][0] == str(video.sightings.frame[0])
    assert float(found.picks.extra["v_px"][0]) == video.sightings.pixel[0, 1]
    assert [missed.tolist() for missed in found.missed] == [[]]


@pytest.mark.parametrize("turning", [0.0, 0.02])
def test_without_events_the_kinks_of_the_track_are_impacts(turning):
    """Also where the camera turns: its own movement makes no kinks."""
    one = view(turning=turning)
    found = picks_of(SeenVideo(one, seen(one))).picks
    check(found, ["pass", "impact", "impact", "impact", "pass"], 0.003, 0.05)
    assert (found.sigma_time_s[1:-1] > 0).all()


def test_a_trajectory_comes_from_the_video_with_most_events():
    left, right = view("left"), view("right", side=1.0)
    videos = (
        SeenVideo(left, seen(left), events(left, [1])),
        SeenVideo(right, seen(right), events(right, [1, 2, 3])),
    )
    assert set(picks_of(*videos).picks.extra["video"].tolist()) == {"right"}
    assert set(picks_of(*videos[::-1]).picks.extra["video"].tolist()) == {"right"}
    equal = (videos[0], replace(videos[1], events=events(right, [1])))
    assert set(picks_of(*equal).picks.extra["video"].tolist()) == {"left"}


def test_marked_picks_stay_and_close_flights():
    """No second pick at their moments, no kinks for a trajectory that has events, no pass beyond a shattered block."""
    one = view()
    video = SeenVideo(one, seen(one))
    marked = make_picks(["a"] * 2, TIME[[1, 3]] + 0.03, CONTACT[[1, 3]])
    check(picks_of(video, marked=marked).picks, ["impact"], 0.003, 0.05)  # 30 ms late: no flight fits the pixels
    exact = replace(marked, time_s=TIME[[1, 3]])
    check(picks_of(video, marked=exact).picks, ["pass", "impact", "pass"], 0.003, 0.05)
    shattered = replace(exact, status=np.array(["ok", "shattered"]))
    check(picks_of(video, marked=shattered).picks, ["pass", "impact"], 0.003, 0.05)
    closed = picks_of(video).picks
    assert len(picks_of(video, marked=closed).picks) == 0


def test_events_off_the_terrain_are_missed():
    one = view()
    marked = events(one, [1, 2, 3])
    pixel = marked.pixel.copy()
    pixel[1] = [960.0, 1.0]
    found = picks_of(SeenVideo(one, events=replace(marked, pixel=pixel)))
    assert found.missed[0].tolist() == [1]
    check(found.picks, ["impact", "impact"], 1e-6, 1e-4)


def test_pictures_without_a_pose_count_nowhere():
    one = view(turning=0.02)
    lost = np.arange(100, 106)
    sigma, turn = one.path.sigma_rotation.copy(), one.path.rotation.copy()
    sigma[lost], turn[lost] = np.inf, one.path.reference.rotation
    tracked = seen(one)
    blind = replace(one, path=replace(one.path, sigma_rotation=sigma, rotation=turn))
    assert one.path.known_at([1.99, 2.0, 2.1, 2.105, 2.2]).all()
    assert blind.path.known_at([1.989, 2.0, 2.1, 2.105, 2.2]).tolist() == [True, False, False, False, True]
    video = SeenVideo(blind, tracked)
    check(picks_of(video).picks, ["pass", "impact", "impact", "impact", "pass"], 0.003, 0.05)
    pixels, frame = pixels_of([video])
    assert set(tracked.frame.tolist()) - set(frame.tolist()) == set(lost.tolist())
    assert len(pixels) == len(tracked) - lost.size
    result = refine_picks(picks_of(video).picks, [video], surface=SURFACE, block={"a": BLOCK}, gravity_mps2=9.81)
    assert len(result.seen) == len(pixels)
    assert any(remark.text.startswith("6 pixels are not used") for remark in result.remarks)
    assert result.fit.rmse_px < 0.2
    assert not result.fit.outlier.any()


def test_the_fit_of_some_trajectories_and_what_it_changes():
    one = view()
    both = [seen(one, name="a"), seen(one, name="b")]
    joined = Sightings(*(np.concatenate([getattr(s, n) for s in both]) for n in Sightings.__dataclass_fields__))
    marked = make_picks(np.repeat(["a", "b"], 3), np.tile(TIME[1:4], 2), np.tile(CONTACT[1:4] + 0.1 * DOWN, (2, 1)))
    options = {"surface": SURFACE, "block": {"a": BLOCK, "b": BLOCK}, "gravity_mps2": 9.81}
    result = refine_picks(marked, [SeenVideo(one, joined)], names=["b"], free=("clock", "gravity"), **options)
    assert result.before.trajectory.tolist() == ["b"] * 3
    assert set(result.seen.trajectory.tolist()) == {"b"}
    assert set(result.fit.unknowns) == {"gravity_mps2"}, "one video has no clock to be told against"
    assert result.pose_covariance == (None,)
    assert result.drag_coefficient is None
    np.testing.assert_allclose(result.moved_m, norm(result.fit.picks.position - result.before.position))
    np.testing.assert_allclose(result.later_s, result.fit.picks.time_s - TIME[1:4])
    assert result.moved_m[1] == pytest.approx(0.1, abs=0.02)
    with pytest.raises(RockfallError, match=r"There is no trajectory 'c'. The picks have: a, b\."):
        refine_picks(marked, [SeenVideo(one, joined)], names=["c"], **options)
