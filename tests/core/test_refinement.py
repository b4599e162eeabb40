# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories fitted to pixels: exact data come back exactly, noise as the standard deviations say."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project, rotation_from_vector
from rockfall.core.camera.path import CameraPath, fixed
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.footage.clock import Clock
from rockfall.core.georeference import GlobalShift
from rockfall.core.progress import CancelledError
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.node_motion import join_nodes, places_at
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.deviations import velocity_rows
from rockfall.core.reconstruction.refinement.problem import evaluate, moved, solve_segments
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.reconstruction.refinement.setup import prepare, set_up
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.surface import Surface

DIP = np.radians(35)
DOWN, OUT = np.array([np.cos(DIP), 0, -np.sin(DIP)]), np.array([np.sin(DIP), 0, np.cos(DIP)])
SURFACE = Surface(
    np.array([60 * a * DOWN + [0, 60 * b, 0] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "plane",
)
BLOCK = Block()
RADIUS = BLOCK.radius_m
TIME = np.array([2.013, 2.609, 3.317, 3.921, 4.602])
PLACE = np.array([-16.0, -11, -4.5, 3.0, 12.0])[:, None] * DOWN + np.array([0, 0.4, -0.3, 0.5, 1.0])[:, None] * [
    0,
    1,
    0,
]
EXACT = {"sigma_time_s": np.full(5, 1e3), "sigma_position_m": np.full(5, 1e4)}
HELD = 1e-12 * np.eye(6)
COVARIANCE = np.diag([4e-4, 4e-4, 4e-4, 0.1, 0.1, 0.1]) ** 2


def camera_at(degrees, distance=120.0):
    a = np.radians(degrees)
    return look_at(3840, 2160, distance * np.array([np.cos(a), np.sin(a), 0.3]), (0, 0, 0), focal_px=6500.0)


def view(degrees=50.0, **more):
    return View(f"from {degrees:.0f}°", fixed(camera_at(degrees)), **more)


def states(time, drag=0.0, gravity=9.81, lift=0.0):
    centre = PLACE + (RADIUS + np.reshape(lift, (-1, 1))) * OUT
    k = len(TIME) - 1
    motion = join_nodes(centre[:-1], centre[1:], TIME[:-1], TIME[1:], np.full(k, gravity), np.full(k, drag))
    which = np.clip(np.searchsorted(TIME, time, side="right") - 1, 0, k - 1)
    return motion, places_at(motion, which, time).position


def observe(views, *, rate=30.0, sigma=1.0, noise=0.0, seed=0, drag=0.0, gravity=9.81, lift=0.0):
    """Pixels of the true motion: exact, or with noise."""
    rng = np.random.default_rng(seed)
    rows = []
    for number, one in enumerate(views):
        common = np.arange(TIME[0] + 0.01 + 0.004 * number, TIME[-1], 1 / rate)
        video = np.asarray(one.clock.to_video(common))
        position, rotation = one.path.poses_at(video)
        exposed, pixel = common, None
        for _ in range(8):
            pixel = project(
                one.path.reference, states(exposed, drag, gravity, lift)[1], position=position, rotation=rotation
            )
            exposed = common + one.row_time_s * (pixel[:, 1] - one.path.reference.height / 2)
        keep = (exposed > TIME[0]) & (exposed < TIME[-1])
        rows.append((np.full(keep.sum(), number), video[keep], pixel[keep]))
    index, video, pixel = (np.concatenate(column) for column in zip(*rows, strict=True))
    pixel = pixel + noise * rng.normal(size=pixel.shape)
    return PixelObservations(index, np.full(index.size, "a"), video, pixel, np.full(index.size, sigma))


def marked(seed=1, off_m=0.15, off_s=0.03, **more):
    rng = np.random.default_rng(seed)
    n = len(TIME)
    plane = np.stack([DOWN, [0, 1, 0]])
    position = PLACE + off_m * rng.normal(size=(n, 2)) @ plane
    return make_picks(["a"] * n, TIME + off_s * rng.uniform(-1, 1, n), position, **more)


def run(views, pixels, picks=None, **more):
    options = {"surface": SURFACE, "block": BLOCK, "sigma_terrain_m": 0.02, "sigma_datum": 0.0, **more}
    return refine(marked(**EXACT) if picks is None else picks, views, pixels, **options)


def check_exact(result, atol=1e-9, drag=0.0, gravity=9.81):
    motion, _ = states(TIME, drag, gravity)
    flights, inner = result.reconstruction.flights, slice(1, 4)
    np.testing.assert_allclose(result.picks.time_s[inner], TIME[inner], atol=atol)
    np.testing.assert_allclose(result.picks.position[inner], PLACE[inner], atol=10 * atol)
    np.testing.assert_allclose(flights.end_velocity[:-1], motion.end_velocity[:-1], atol=100 * atol)
    np.testing.assert_allclose(flights.start_velocity[1:], motion.start_velocity[1:], atol=100 * atol)
    assert result.rmse_px < 1e-6
    assert result.converged


@pytest.mark.parametrize("count", [1, 2])
def test_exact_pixels_give_the_exact_motion(count):
    views = [view(50.0), view(-20.0)][:count]
    result = run(views, observe(views))
    check_exact(result)
    assert result.rmse_px_before > 3
    assert not result.outlier.any()


def test_from_picks_that_are_ten_pixels_and_two_frames_off():
    views = [view()]
    check_exact(run(views, observe(views), marked(3, off_m=0.3, off_s=0.066, **EXACT)))


def test_without_a_terrain_two_views_are_enough():
    views = [view(50.0), view(-20.0)]
    normals = np.tile(OUT, (5, 1))
    check_exact(run(views, observe(views), marked(normal=normals, **EXACT), surface=None), atol=1e-8)


def test_rolling_shutter():
    views = [view(row_time_s=1.2e-5)]
    pixels = observe(views)
    check_exact(run(views, pixels))
    ignored = run([replace(views[0], row_time_s=0.0)], pixels)
    assert np.abs(ignored.picks.time_s - TIME)[1:4].max() > 1e-3


def test_a_camera_that_moves():
    camera, frames = camera_at(40.0), np.linspace(0, 6, 181)
    shake = 0.01 * np.sin(np.outer(frames, [3.0, 4.0, 5.0]))
    path = CameraPath(
        camera,
        frames,
        camera.position + shake,
        rotation_from_vector(shake) @ camera.rotation,
        np.zeros(181),
        np.zeros(181),
    )
    views = [View("hand", path)]
    check_exact(run(views, observe(views)))


def test_drag_of_a_light_block_is_found():
    """A ball as light as foam: its drag is one that flights in a vacuum cannot imitate."""
    ball = Block(RADIUS * 2, RADIUS * 2, RADIUS * 2, 22.0)
    law = Drag(coefficient=0.47)
    k = law.per_metre(ball)
    assert k == pytest.approx(0.5 * 1.2 * 0.47 * 3 / (4 * RADIUS * 22))  # ½ρC_D·A/m of a ball
    views = [view(50.0), view(-20.0)]
    pixels = observe(views, drag=k)
    check_exact(run(views, pixels, block=ball, drag=law), drag=k, atol=1e-8)
    free = run(views, pixels, block=ball, drag=Drag(coefficient=0.9), free=("drag",))
    assert free.unknowns["drag_coefficient"][0] == pytest.approx(0.47, abs=1e-6)
    check_exact(free, drag=k, atol=1e-8)


def test_gravity_is_found():
    views = [view(50.0), view(-20.0)]
    result = run(views, observe(views, gravity=9.5), free=("gravity",))
    assert result.unknowns["gravity_mps2"][0] == pytest.approx(9.5, abs=1e-7)
    check_exact(result, gravity=9.5, atol=1e-8)


def test_a_clock_is_found_from_far_off():
    views = [view(50.0), view(-20.0, clock=Clock(1.3))]
    pixels = observe(views)
    result = run([views[0], replace(views[1], clock=Clock(1.3 + 0.41))], pixels, free=("clock",))
    value, sigma = result.unknowns["offset_s from -20°"]
    assert value == pytest.approx(1.3, abs=1e-8)
    assert 0 < sigma < 0.01
    assert result.views[1].clock.offset_s == value
    check_exact(result)
    held = run([views[0], replace(views[1], clock=Clock(1.35))], pixels)
    (late,) = [remark for remark in held.remarks if "fit the clocks" in remark.text]
    assert (late.severity, late.about) == ("advice", "clock from -20°")
    unset = run([views[0], replace(views[1], clock=Clock(1.3 + 0.41))], pixels).remarks[0]
    assert (unset.severity, unset.about) == ("warning", "clock from -20°"), "no impact is missing"
    assert float(late.text.split("about ")[1].split(" ms")[0]) == pytest.approx(-50, abs=10)


def test_a_pose_is_corrected_by_the_other_view():
    camera = camera_at(-20.0)
    turned = replace(camera, rotation=rotation_from_vector([3e-4, -2e-4, 1e-4]) @ camera.rotation)
    views = [view(50.0), view(-20.0)]
    pixels = observe(views)
    off = [replace(views[0], pose_covariance=HELD), View("off", fixed(turned), pose_covariance=COVARIANCE)]
    options = {"loss": "linear", "sigma_aim": 0.0}
    result = run(off, pixels, free=("camera",), **options)
    centres = PLACE + RADIUS * OUT
    true, before = project(camera, centres), project(turned, centres)
    after = project(result.views[1].path.reference, centres)
    assert np.abs(before - true).max() > 1.5
    assert np.abs(after - true).max() < 0.3
    assert np.sqrt(np.diag(result.views[1].pose_covariance))[0] < 4e-4
    held = [off[0], replace(off[1], pose_covariance=HELD)]
    assert result.rmse_px < 0.2 < run(held, pixels, **options).rmse_px


@pytest.mark.parametrize("drag", [None, Drag(coefficient=30.0)])
def test_the_derivatives_are_right(drag):
    views = [view(50.0, pose_covariance=COVARIANCE), view(-20.0, pose_covariance=COVARIANCE)]
    free = {"camera", "clock", "clock_drift", "gravity"} | ({"drag"} if drag else set())
    kinds = ["impact", "impact", "pass", "impact", "impact", "stop"]
    time = np.insert(TIME, 2, 3.0)
    place = np.insert(PLACE, 2, states(np.array([3.0]))[1], axis=0)
    picks = make_picks(["a"] * 6, time, place, kind=kinds, sigma_position_m=np.full(6, 0.1))
    ground = prepare(picks, SURFACE, BLOCK, drag, None, 0.02)
    setup = set_up(ground, tuple(views), observe(views, rate=12.0), ["a"], 9.81, frozenset(free), 0.15)
    problem = setup.problem
    rng = np.random.default_rng(4)
    state = moved(problem, setup.state, 1e-3 * rng.normal(size=problem.columns.size))
    here = evaluate(problem, state)
    chain = np.where(here.segment >= 0, 0, -1)

    def stacked(step):
        found = evaluate(problem, moved(problem, state, step), chain)
        return np.concatenate([rows.residual.ravel() for rows in (found.pixels, *found.others)])

    dense = []
    for rows in (here.pixels, *here.others):
        full = np.zeros((*rows.residual.shape, problem.columns.size + 1))
        for i in range(len(full)):
            for j, column in enumerate(rows.columns[i]):
                full[i, :, column] += rows.jacobian[i, :, j]
        dense.append(full[:, :, :-1].reshape(-1, problem.columns.size))
    analytic = np.concatenate(dense)
    for column in range(problem.columns.size):
        step = np.zeros(problem.columns.size)
        step[column] = 1e-6
        numeric = (stacked(step) - stacked(-step)) / 2e-6
        size = 1 + np.abs(numeric).max()
        np.testing.assert_allclose(analytic[:, column] / size, numeric / size, atol=3e-6, err_msg=str(column))


@pytest.mark.parametrize("drag", [None, Drag(coefficient=30.0)])
def test_the_derivatives_of_the_velocities_at_the_nodes_are_right(drag):
    """What the deviations of impacts are made of: by the nodes' places and times, drag and gravity."""
    free = {"gravity"} | ({"drag"} if drag else set())
    ground = prepare(marked(**EXACT), SURFACE, BLOCK, drag, None, 0.02)
    setup = set_up(ground, (view(),), observe([view()], rate=12.0), ["a"], 9.81, frozenset(free))
    problem, segments = setup.problem, np.arange(len(TIME) - 1)

    def velocity(step, at_end):
        motion = solve_segments(problem, moved(problem, setup.state, step))
        return motion.end_velocity if at_end else motion.start_velocity

    motion = solve_segments(problem, setup.state)
    for at_end in (False, True):
        rows = velocity_rows(problem, motion, segments, at_end=at_end)
        for column in range(problem.columns.size):
            step = np.zeros(problem.columns.size)
            step[column] = 1e-5
            numeric = (velocity(step, at_end) - velocity(-step, at_end)) / 2e-5
            np.testing.assert_allclose(rows[:, :, column], numeric, atol=1e-5, rtol=1e-5, err_msg=f"{at_end} {column}")
    assert not velocity_rows(problem, motion, np.array([-1]), at_end=True).any()


def test_what_is_not_known_of_a_moving_pose_is_added_to_the_pixels():
    """An angle is worth a focal length times it, a place a focal length times it over the distance."""
    camera, frames = camera_at(40.0), np.linspace(0, 6, 181)
    still = [np.repeat(one[None], frames.size, axis=0) for one in (camera.position, camera.rotation)]
    views, middle = [], (PLACE + RADIUS * OUT).mean(axis=0)
    for fx in (camera.fx, 0.9 * camera.fx):
        reference = replace(camera, fx=fx)
        views.append(View("hand", CameraPath(reference, frames, *still, np.full(181, 0.03), np.full(181, 2e-4))))
    pixels = observe(views, sigma=0.5)
    ground = prepare(marked(**EXACT), SURFACE, BLOCK, None, None, 0.02)
    found = set_up(ground, tuple(views), pixels, ["a"], 9.81, frozenset()).problem.sigma_px
    distance = np.linalg.norm(marked(**EXACT).position.mean(axis=0) + RADIUS * OUT - camera.position)
    assert distance == pytest.approx(np.linalg.norm(middle - camera.position), rel=0.01)
    for number, focal in enumerate((camera.fx, 0.95 * camera.fx)):
        expected = np.sqrt(0.5**2 + focal**2 * (2e-4**2 + (0.03 / distance) ** 2))
        np.testing.assert_allclose(found[pixels.view == number], expected, rtol=1e-9)


@pytest.mark.parametrize(("radius", "height", "lies"), [(0.2, 0.9, True), (0.2, 1.5, False), (1.0, 3.5, True)])
def test_a_release_in_the_air_does_not_lie_on_the_terrain(radius, height, lies):
    """In the air is what is more than a metre and more than two diameters off."""
    place = PLACE.copy()
    place[0] += height * OUT
    picks = make_picks(["a"] * 5, TIME, place, kind=["release", *["impact"] * 4])
    ground = prepare(picks, SURFACE, Block(2 * radius, 2 * radius, 2 * radius), None, None, 0.02)
    assert ground.grounded.tolist() == [lies, True, True, True, True]


def patches(normals):
    """A terrain of five squares of 2 m that the block touches at its contacts, each with its normal."""
    vertices, faces = [], []
    for place, normal in zip(PLACE + RADIUS * OUT - RADIUS * normals, normals, strict=True):
        along = np.cross([0, 1, 0], normal)
        along /= np.linalg.norm(along)
        across = np.cross(normal, along)
        faces += (np.array([[0, 1, 2], [0, 2, 3]]) + len(vertices)).tolist()
        vertices += [place + a * along + b * across for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Surface(np.array(vertices), np.array(faces, dtype=np.int32), GlobalShift(), "patches")


def aimed(views, pixels, parts):
    """Pixels whose spot is a part of the block's diameter off its centre, (v, 2)."""
    off = np.empty_like(pixels.pixel)
    for number, one in enumerate(views):
        mine = pixels.view == number
        place = states(np.asarray(one.clock.to_common(pixels.time_s[mine])))[1]
        size = one.path.reference.fx * 2 * RADIUS / np.linalg.norm(place - one.path.reference.position, axis=1)
        off[mine] = size[:, None] * parts[number]
    return replace(pixels, pixel=pixels.pixel + off)


def test_contacts_with_an_uneven_terrain_tell_where_the_tracked_spot_is():
    tilt = np.array([[0.2, 0.3], [-0.3, -0.4], [0.4, -0.3], [-0.2, 0.5], [0.3, -0.2]])
    normals = OUT + tilt @ np.stack([DOWN, [0, 1, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    touched = PLACE + RADIUS * (OUT - normals)
    views = [view(50.0, pose_covariance=HELD), view(-20.0, pose_covariance=HELD)]
    parts = np.array([[0.3, -0.2], [-0.1, 0.2]])
    pixels = aimed(views, observe(views, sigma=0.2), parts)
    picks = make_picks(["a"] * 5, TIME + 0.01, touched, **EXACT)
    options = {"surface": patches(normals), "sigma_terrain_m": 0.001, "normal_radius_m": 0.3}
    result = run(views, pixels, picks, sigma_aim=1.0, **options)
    assert list(result.aim) == [("from 50°", "a"), ("from -20°", "a")]
    np.testing.assert_allclose([found for found, _ in result.aim.values()], parts, atol=0.002)
    assert max(sigma.max() for _, sigma in result.aim.values()) < 0.1
    assert np.linalg.norm(result.picks.position - touched, axis=1)[1:-1].max() < 0.002
    ignored = run(views, pixels, picks, sigma_aim=0.0, **options)
    assert ignored.aim == {}
    assert np.linalg.norm(ignored.picks.position - touched, axis=1)[1:-1].min() > 0.05
    far = run(views, pixels, picks, sigma_aim=0.05, **options)
    off = [remark for remark in far.remarks if "of the block's diameter off its centre" in remark.text]
    assert [(remark.severity, remark.about) for remark in off] == [("warning", "a")] * len(off) != []


def test_ends_that_only_their_marks_hold_are_told():
    views = [view(50.0), view(-20.0)]
    picks = marked(normal=np.tile(OUT, (5, 1)))
    floating = run(views, observe(views, noise=1.0), picks, surface=None)
    (told,) = [remark for remark in floating.remarks if "begins or ends" in remark.text]
    assert (told.severity, told.about) == ("advice", "a")
    assert "2.0" in told.text
    assert "4.59" in told.text
    lying = run(views, observe(views, noise=1.0), picks)
    assert not any("begins or ends" in remark.text for remark in lying.remarks)


@pytest.mark.parametrize("sigma_aim", [0.0, 0.15])
def test_intervals_cover_the_truth(sigma_aim):
    views = [view(50.0, pose_covariance=HELD)]
    velocities, places, times = [], [], []
    for seed in range(60):
        rng = np.random.default_rng(100 + seed)
        picks = marked(seed, sigma_time_s=np.full(5, 0.01))
        picks = replace(picks, time_s=TIME + 0.01 * rng.normal(size=5))
        lift = 0.02 * rng.normal(size=5)
        motion, _ = states(TIME, lift=lift)
        pixels = observe(views, noise=1.0, seed=seed, lift=lift)
        seen = aimed(views, pixels, sigma_aim * rng.normal(size=(1, 2)))
        result = run(views, seen, picks, sigma_aim=sigma_aim, sigma_terrain_m=0.005)
        away = result.picks.position - PLACE - lift[:, None] * OUT
        places.append((away / result.picks.sigma_position_m[:, None])[1:-1])
        times.append(((result.picks.time_s - TIME) / result.picks.sigma_time_s)[1:-1])
        impacts = result.reconstruction.impacts
        v1 = (impacts.v1[1:] - motion.end_velocity) / impacts.sigma["v1"][1:]
        v2 = (impacts.v2[:-1] - motion.start_velocity) / impacts.sigma["v2"][:-1]
        velocities.append(np.stack([v1, v2]))
    # Over the standard deviation: (60 runs, v1 and v2, 4 impacts, xyz).
    off = np.array(velocities)
    assert 0.92 < np.mean(np.abs(off) < 1.96) < 0.98
    assert off.std() == pytest.approx(1, abs=0.1)
    np.testing.assert_allclose(np.sqrt(np.mean(off**2, axis=(0, 2))), 1, atol=0.2)
    assert np.std(times) == pytest.approx(1, abs=0.15)
    assert np.sqrt(np.mean(np.square(places))) == pytest.approx(1, abs=0.15)


def test_outliers_are_left_out():
    views = [view()]
    pixels = observe(views, noise=1.0, seed=5)
    clean = run(views, pixels, marked())
    wrong = np.arange(7, len(pixels), 9)
    spoilt = pixels.pixel.copy()
    spoilt[wrong] += np.random.default_rng(6).choice([-60.0, 45.0], size=(wrong.size, 2))
    result = run(views, replace(pixels, pixel=spoilt), marked())
    assert set(np.flatnonzero(result.outlier)) == set(wrong)
    far = np.abs(result.reconstruction.impacts.v1 - clean.reconstruction.impacts.v1)[1:]
    assert (far < 2.5 * clean.reconstruction.impacts.sigma["v1"][1:]).all()
    assert not run(views, replace(pixels, pixel=spoilt), marked(), loss="cauchy").outlier[0]


def test_more_noise_than_stated_enlarges_the_standard_deviations():
    views = [view()]
    pixels = observe(views, sigma=1.0, noise=3.0)
    honest = run(views, replace(pixels, sigma_px=3 * pixels.sigma_px), marked())
    boasting = run(views, pixels, marked())
    assert honest.noise_scale == 1.0
    assert boasting.noise_scale == pytest.approx((pixels.pixel - observe(views).pixel).std(), rel=0.05)
    assert any("as large as the stated" in remark.text for remark in boasting.remarks)
    np.testing.assert_allclose(
        boasting.reconstruction.impacts.sigma["v1"][1:], honest.reconstruction.impacts.sigma["v1"][1:], rtol=0.05
    )


def test_the_refined_picks_give_the_same_flights():
    views = [view()]
    result = run(views, observe(views, noise=1.0), marked(extra={"note": np.array(list("abcde"))}))
    again = reconstruct(result.picks, surface=SURFACE, block=BLOCK, flights="centres")
    np.testing.assert_allclose(again.flights.start_velocity, result.reconstruction.flights.start_velocity, atol=1e-9)
    np.testing.assert_allclose(again.impacts.rn, result.reconstruction.impacts.rn, atol=1e-9)
    assert result.picks.extra["note"].tolist() == list("abcde")
    np.testing.assert_allclose(np.abs(result.picks.position @ OUT), 0, atol=0.05)
    assert (result.picks.sigma_time_s < 0.05).all()
    assert result.reconstruction.ends == "centres"
    assert np.isfinite(result.reconstruction.impacts.sigma["kinetic1_j"][1:]).all()


def test_a_flight_without_pixels_rests_on_its_picks():
    views = [view()]
    pixels = observe(views, noise=1.0)
    dark = (pixels.time_s > TIME[1] - 0.05) & (pixels.time_s < TIME[2] + 0.05)
    picks = marked(sigma_time_s=np.full(5, 0.01), sigma_position_m=np.full(5, 0.2))
    result = run(views, pixels.take(~dark), picks)
    assert sum("has no pixels" in remark.text for remark in result.remarks) == 1
    seen = run(views, pixels, picks).reconstruction.impacts.sigma
    sigma = result.reconstruction.impacts.sigma
    for name, impact in (("v1", 2), ("v2", 1)):
        assert np.linalg.norm(sigma[name][impact]) > 1.1 * np.linalg.norm(seen[name][impact])


@pytest.mark.parametrize("free", [(), ("gravity", "clock")])
def test_several_trajectories(free):
    """Together where they share unknowns; one without pixels, and a shattered block's chains, stay what they are."""
    views = [view(50.0), view(-20.0)]
    pixels = observe(views)
    both = PixelObservations(
        np.tile(pixels.view, 2),
        np.repeat(["a", "c"], len(pixels)),
        np.tile(pixels.time_s, 2),
        np.tile(pixels.pixel, (2, 1)),
        np.tile(pixels.sigma_px, 2),
    )
    one, other = marked(1), marked(2)
    sigma = {"sigma_time_s": np.full(15, 1e3), "sigma_position_m": np.full(15, 1e4)}
    status = ["ok"] * 10 + ["ok", "ok", "shattered", "ok", "ok"]
    picks = make_picks(
        np.repeat(["a", "b", "c"], 5),
        np.concatenate([one.time_s, one.time_s, other.time_s]),
        np.concatenate([one.position, one.position, other.position]),
        status=status,
        **sigma,
    )
    result = run(views, both, picks, free=free)
    np.testing.assert_allclose(result.picks.time_s[1:4], TIME[1:4], atol=1e-8)
    np.testing.assert_allclose(result.picks.time_s[11], TIME[1], atol=1e-8)
    np.testing.assert_array_equal(result.picks.time_s[5:10], one.time_s)
    np.testing.assert_array_equal(result.picks.position[5:10], one.position)
    assert [remark.about for remark in result.remarks if "Trajectory b has no pixels" in remark.text] == ["b"]
    assert (result.reconstruction.impacts.sigma["kinetic1_j"][6:10] > 1).all()
    assert (result.reconstruction.impacts.sigma["v1"][6:10] > 1).all()
    if free:
        assert result.unknowns["gravity_mps2"][0] == pytest.approx(9.81, abs=1e-6)


def test_what_cannot_be_refined():
    views = [view()]
    pixels = observe(views)
    with pytest.raises(InputError, match="trajectory b: The block was tracked"):
        run(views, replace(pixels, trajectory=np.full(len(pixels), "b")))
    with pytest.raises(InputError, match="clocks do not overlap: the picks run from"):
        run(views, replace(pixels, time_s=pixels.time_s + 100))
    with pytest.raises(InputError, match="no pixels of the block"):
        run(views, pixels.take(np.zeros(0, dtype=int)))
    away = look_at(3840, 2160, (120, 0, 40), (240, 0, 40), focal_px=6500.0)
    with pytest.raises(InputError, match="behind the camera of view away"):
        run([View("away", fixed(away))], pixels)
    with pytest.raises(InputError, match="no view has a covariance"):
        run(views, pixels, free=("camera",))
    with pytest.raises(RockfallError, match="cannot be fitted"):
        run(views, pixels, free=("wind",))
    with pytest.raises(InputError, match="two picks or more"):
        run(views, pixels, make_picks(["a"], TIME[:1], PLACE[:1]))
    with pytest.raises(InputError, match="that nothing interrupts"):
        run(views, pixels, make_picks(["a"] * 2, TIME[:2], PLACE[:2], status=["shattered", "ok"]))
    late = run(views, replace(pixels, time_s=pixels.time_s + 0.5))
    assert any("outside of the marked motion" in remark.text for remark in late.remarks)


NO_FLIGHT = (
    "No flight with this drag joins the picks of trajectory a, the flight that starts at 2.028 s. "
    "Check the times, and the block's size."
)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"sigma_aim": -0.1}, "The standard deviation of the aim must be a number not below zero, not -0.1."),
        ({"sigma_aim": np.nan}, "The standard deviation of the aim must be a number not below zero, not nan."),
        ({"loss": "l2"}, "Unknown loss 'l2'. Use one of huber, cauchy, linear."),
        ({"gravity_mps2": 0.0}, "Gravity must be a positive number [m/s²], not 0.0."),
        ({"gravity_mps2": np.inf}, "Gravity must be a positive number [m/s²], not inf."),
        ({"sigma_terrain_m": 0.0}, "The standard deviation of the terrain must be a positive number [m], not 0.0."),
        ({"normal_radius_m": np.nan}, "The normal's radius must be a positive number [m], not nan."),
        ({"drag": Drag(coefficient=-1000.0)}, NO_FLIGHT),
        ({"drag": Drag(coefficient=1e5)}, NO_FLIGHT),
    ],
)
def test_parameters_out_of_range_are_refused(options, said):
    views = [view()]
    with pytest.raises(RockfallError) as refused:
        run(views, observe(views), **options)
    assert str(refused.value).startswith(said)


def test_pixels_of_views_that_do_not_exist_are_refused():
    views = [view(50.0), view(-20.0)]
    pixels = observe(views)
    for wrong in (-1, 2):
        index = pixels.view.copy()
        index[4] = wrong
        with pytest.raises(InputError, match=r"A pixel belongs to view -?[12], but there are 2"):
            run(views, replace(pixels, view=index))
    with pytest.raises(InputError, match="There is no view"):
        run([], pixels)
    with pytest.raises(InputError, match="The columns of the pixels have different lengths"):
        run(views, replace(pixels, sigma_px=pixels.sigma_px[1:]))
    with pytest.raises(InputError, match="The columns of the pixels have different lengths"):
        run(views, replace(pixels, pixel=pixels.pixel[:, :1]))
    for column, value in (("time_s", np.nan), ("sigma_px", 0.0), ("pixel", [np.inf, 0.0])):
        changed = getattr(pixels, column).copy()
        changed[1] = value
        with pytest.raises(InputError, match="Pixel 2 of view from 50° has a time, place or standard deviation"):
            run(views, replace(pixels, **{column: changed}))


@pytest.mark.parametrize("matrix", [np.eye(3), np.full((6, 6), np.nan), np.diag([1.0, 1, 1, 1, 1, -1])])
def test_a_covariance_that_is_none_is_refused(matrix):
    with pytest.raises(InputError, match="View from 50°: the covariance of the pose is not a positive definite 6 × 6"):
        view(pose_covariance=matrix)


def test_picks_too_close_in_time_are_refused():
    views = [view()]
    time = TIME.copy()
    time[2] = time[1] + 5e-5
    with pytest.raises(RockfallError, match="The picks are too close in time to be fitted"):
        run(views, observe(views), make_picks(["a"] * 5, time, PLACE, **EXACT))


def test_a_refinement_can_be_stopped():
    """The progress goes through all trajectories; raising in it ends the search."""
    views = [view()]
    pixels = observe(views, noise=1.0)
    both = PixelObservations(
        np.tile(pixels.view, 2),
        np.repeat(["a", "b"], len(pixels)),
        np.tile(pixels.time_s, 2),
        np.tile(pixels.pixel, (2, 1)),
        np.tile(pixels.sigma_px, 2),
    )
    one = marked(1)
    picks = make_picks(np.repeat(["a", "b"], 5), np.tile(one.time_s, 2), np.tile(one.position, (2, 1)))
    said = []
    result = run(views, both, picks, progress=lambda *step: said.append(step))
    assert {text for text, _, _ in said} == {"Fitting"}
    assert sorted({(done, total) for _, done, total in said}) == [(0, 2), (1, 2)]
    assert len(said) >= result.iterations > 1

    def stop(text, done, total):
        if done == 1:
            raise CancelledError

    with pytest.raises(CancelledError):
        run(views, both, picks, progress=stop)


@pytest.mark.parametrize("turn", [[0.9, -0.4, 0.7], [2e-5, 1e-5, -3e-5]])
def test_derivative_of_a_turn_is_that_of_differences(turn: list[float]) -> None:
    """exp(w + δ) exp(w)⁻¹ ≈ exp(J δ), by central differences of Rodrigues' formula."""
    from rockfall.core.camera.model import rotation_from_vector, vector_from_rotation
    from rockfall.core.reconstruction.refinement.problem import _left_jacobian

    w, step = np.array(turn), 1e-5
    for axis in range(3):
        delta = step * np.eye(3)[axis]
        ahead, behind = rotation_from_vector(w + delta), rotation_from_vector(w - delta)
        expected = vector_from_rotation(ahead @ behind.T) / (2 * step)
        np.testing.assert_allclose(_left_jacobian(w)[:, axis], expected, atol=1e-8)


def test_a_missing_impact_is_said_before_everything_else():
    views = [view()]
    pixels = observe(views)
    picks = marked()
    without = make_picks(["a"] * 4, np.delete(picks.time_s, 2), np.delete(picks.position, 2, axis=0))
    result = run(views, pixels, without)
    first = result.remarks[0]
    assert first.severity == "warning"
    used = int(np.isfinite(result.residual_px[:, 0]).sum())
    assert f"{result.outlier.sum()} of the {used} pixels of trajectory a" in first.text
    assert "is an impact missing there?" in first.text
    assert not any("do not fit" in remark.text for remark in run(views, pixels).remarks)


def test_a_gravity_that_is_none_tells_by_how_much_lengths_are_off():
    views = [view(50.0), view(-20.0)]
    result = run(views, observe(views, gravity=9.81 / 2), free=("gravity",))  # as if all lengths were halved
    (said,) = (remark.text for remark in result.remarks if remark.about == "gravity")
    assert "2 times as large" in said
    assert not any(r.about == "gravity" for r in run(views, observe(views, gravity=9.7), free=("gravity",)).remarks)
