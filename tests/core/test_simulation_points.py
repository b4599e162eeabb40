# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks on points alone: contacts against closed forms, and the same falls as on triangles of the same surface."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.project import read_project, write_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.simulation import turns
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.distributions import Distribution
from rockfall.core.simulation.engine import ENDS, IMPACT, Settings, Simulation, simulate
from rockfall.core.simulation.ground import FEWEST, Ground, make_ground
from rockfall.core.simulation.measured_releases import from_reconstruction
from rockfall.core.simulation.point_kernels import CORE
from rockfall.core.simulation.polygons import Polygon
from rockfall.core.simulation.release import make_releases, overlapping, placed_on
from rockfall.core.simulation.release_sources import in_polygon, steeper_than
from rockfall.core.simulation.results import fell_through
from rockfall.core.terrain.cloud import Cloud, heights_above_points, local_planes, nearest_points
from rockfall.core.terrain.kernels import STACK_SIZE
from rockfall.core.terrain.readers import read_points, read_terrain
from rockfall.core.terrain.surface import Surface
from scipy.spatial import cKDTree
from scipy.stats import ks_2samp

G = 9.81


def scattered(spacing: float, height, size: float = 20.0, seed: int = 1, noise: float = 0.0) -> Cloud:
    """Points at random places in plan, `spacing` the side of the square that each has on the mean."""
    rng = np.random.default_rng(seed)
    plan = rng.uniform(0, size, (int((size / spacing) ** 2), 2))
    z = height(*plan.T) + noise * rng.standard_normal(len(plan))
    return Cloud(np.column_stack([plan, z]), GlobalShift(), "cloud")


def lattice(spacing: float, size: float = 20.0) -> Cloud:
    line = np.arange(0, size, spacing)
    x, y = np.meshgrid(line, line)
    return Cloud(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), GlobalShift(), "lattice")


def falls_on(cloud: Cloud, radius: float, count: int, seed: int = 2):
    """Start, velocity, time, normal and place of first contacts of blocks that fall on it."""
    from rockfall.core.simulation.point_kernels import first_contact

    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    rng = np.random.default_rng(seed)
    for _ in range(count):
        start = np.array([*rng.uniform(8, 12, 2), radius + rng.uniform(0.2, 3)])
        velocity = np.array([*rng.normal(0, 2, 2), -rng.uniform(0, 6)])
        found = first_contact(
            cloud.index.tree, stack, times, tuple(start), tuple(velocity), (0.0, 0.0, -G), radius, np.inf
        )
        yield start, velocity, *found


def test_nearest_point_and_spacing() -> None:
    cloud = scattered(0.1, lambda x, y: np.sin(x) + 0.3 * y)
    places = np.random.default_rng(5).uniform([2, 2, -1], [18, 18, 4], (300, 3))
    distance, number = nearest_points(cloud, places)
    expected, which = cKDTree(cloud.points).query(places)
    np.testing.assert_allclose(distance, expected, rtol=1e-12)
    np.testing.assert_array_equal(number, which)
    slope = np.sqrt(1 + 0.09 + np.cos(cloud.points[:, 0]) ** 2)
    assert cloud.spacing_m == pytest.approx(0.1 * np.sqrt(np.median(slope)), rel=0.08)


def test_a_contact_is_where_the_parabola_meets_the_first_point_or_shortly_before() -> None:
    """The roots of |p + v t + ½ a t² − q|² = r² for every point near the path, by their polynomial."""
    cloud, radius = scattered(0.12, lambda x, y: 0.2 * np.sin(3 * x)), 0.3
    a = np.array([0, 0, -G])
    earlier = []
    for start, velocity, t, _, place in falls_on(cloud, radius, 100):
        away = start - cloud.points
        polynomials = np.column_stack(
            [
                np.full(len(away), a @ a / 4),
                np.full(len(away), velocity @ a),
                velocity @ velocity + away @ a,
                2 * away @ velocity,
                (away**2).sum(axis=1) - radius**2,
            ]
        )
        end = start + velocity * t + a / 2 * t**2
        near = np.flatnonzero(((cloud.points - end) ** 2).sum(axis=1) < (2 * radius) ** 2)
        first, which = np.inf, -1
        for i in near:
            roots = np.roots(polynomials[i])
            real = roots[(abs(roots.imag) < 1e-9) & (roots.real > 0)].real
            if real.size and real.min() < first:
                first, which = real.min(), i
        assert cloud.index.number[place] == which
        assert t <= first + 1e-7
        earlier.append(np.linalg.norm(velocity + a * t) * (first - t))
    assert max(earlier) < 0.5 * radius
    assert np.median(earlier) < 0.05 * radius


@pytest.mark.parametrize(("spacing", "angle"), [(0.2, 0.1), (0.1, 0.02), (0.05, 0.02)])
def test_contacts_on_a_plane_of_points_against_the_closed_form(spacing: float, angle: float) -> None:
    """Between the points of a lattice a sphere sinks by r − √(r² − s²/2): no contact is later than that.

    The plane of the points gives the contact on the plane itself, up to the part that holds it level.
    """
    radius, cloud = 0.4, lattice(spacing)
    sag = radius - np.sqrt(radius**2 - spacing**2 / 2)
    for start, velocity, t, normal, _ in falls_on(cloud, radius, 150):
        plane = (velocity[2] + np.sqrt(velocity[2] ** 2 + 2 * G * (start[2] - radius))) / G
        deep = (velocity[2] + np.sqrt(velocity[2] ** 2 + 2 * G * (start[2] - radius + sag))) / G
        assert plane - 1e-4 <= t <= deep
        assert t - plane < 0.02 * (deep - plane) + 1e-5
        assert np.degrees(np.arccos(min(normal[2], 1.0))) < angle


def test_the_normal_on_a_plane_of_random_points_betters_with_their_density() -> None:
    """The mean direction alone would be off by 0.33 s/r (rms): its scatter over a patch that counts by depth."""
    errors = {}
    for spacing in (0.2, 0.1, 0.05):
        cloud = scattered(spacing, lambda x, y: 0 * x)
        normals = np.array([normal for _, _, _, normal, _ in falls_on(cloud, 0.5, 300)])
        errors[spacing] = np.sqrt((np.arccos(np.minimum(normals[:, 2], 1.0)) ** 2).mean())
        assert errors[spacing] < 0.33 * spacing / 0.5
    assert errors[0.1] < errors[0.2] / 2
    assert errors[0.05] < errors[0.1] / 2
    noisy = [
        np.sqrt(np.mean([n[2] for *_, n, _ in falls_on(scattered(0.05, lambda x, y: 0 * x, noise=s), 0.5, 200)]))
        for s in (0.0, 0.02)
    ]
    assert noisy[1] < noisy[0]


def test_heights_above_points() -> None:
    cloud = scattered(0.1, lambda x, y: 0.8 * x + 0.1 * np.sin(x))
    rng = np.random.default_rng(4)
    plan, above = rng.uniform(2, 18, (500, 2)), rng.uniform(0.2, 5, 500)
    ground = 0.8 * plan[:, 0] + 0.1 * np.sin(plan[:, 0])
    heights = heights_above_points(cloud, np.column_stack([plan, ground + above]))
    np.testing.assert_allclose(heights, above, atol=0.01)
    below = heights_above_points(cloud, np.column_stack([plan, ground - 3.0]))
    np.testing.assert_allclose(below, -3.0, atol=0.01)
    assert np.isnan(heights_above_points(cloud, np.array([[-5.0, 3.0, 1.0]]))).all()


def test_releases_are_placed_on_points_and_their_depth_is_known() -> None:
    ground = make_ground(scattered(0.05, lambda x, y: -0.5 * x))
    places = placed_on(ground, np.array([[10.0, 10.0], [5.0, 12.0], [50.0, 10.0]]), np.full(3, 0.6))
    expected = -0.5 * places[:2, 0] + 0.3 * np.hypot(1, 0.5)
    np.testing.assert_allclose(places[:2, 2], expected, atol=0.01)
    assert np.isnan(places[2]).all()
    releases = make_releases(places[:2] - np.array([[0, 0, 0], [0, 0, 0.2]]), diameter_m=0.6)
    np.testing.assert_allclose(overlapping(ground, releases), [0, 0.2 / np.hypot(1, 0.5)], atol=0.01)
    with pytest.raises(InputError, match="beside the terrain"):
        overlapping(ground, make_releases(np.array([[50.0, 10.0, 0.0]]), diameter_m=0.6))


@pytest.fixture(scope="module")
def cliff() -> Cloud:
    """20 m wide: 20° over 30 m of slope, a face of 80° over 20 m with half the points, then level ground."""
    rng = np.random.default_rng(6)
    x, z, parts = 0.0, 0.0, []
    for length, angle, spacing in ((30.0, 20.0, 0.1), (20.0, 80.0, 0.14), (30.0, 0.0, 0.1)):
        along = rng.uniform(0, length, int(length * 20 / spacing**2))
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        parts.append(np.column_stack([x + c * along, rng.uniform(0, 20, along.size), z - s * along]))
        x, z = x + c * length, z - s * length
    return Cloud(np.concatenate(parts), GlobalShift(), "cliff")


CLIFF_X = 30 * np.cos(np.radians(20)), 30 * np.cos(np.radians(20)) + 20 * np.cos(np.radians(80))


def test_local_planes_of_a_cloud(cliff: Cloud) -> None:
    places = np.array([[10.0, 10, -10 * np.tan(np.radians(20))], [35.0, 10.0, cliff.points[:, 2].min()]])
    places = np.vstack([places, cliff.points[np.argmin(abs(cliff.points - [29.5, 10, -17]).sum(axis=1))]])
    normals, areas = local_planes(cliff, places)
    np.testing.assert_allclose(np.degrees(np.arccos(normals[:, 2])), [20, 0, 80], atol=0.01)
    np.testing.assert_allclose(areas, [0.01, 0.01, 0.0196], rtol=0.5)
    few = Cloud(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), GlobalShift(), "few")
    assert np.isnan(local_planes(few, few.points)[1]).all()


def test_releases_on_points_are_as_many_on_each_square_metre(cliff: Cloud) -> None:
    """On the face, whose points are half as many, as on the slope; both in true area."""
    ground, blocks, n = make_ground(cliff), Blocks(diameter=Distribution("fixed", 0.6)), 6000
    whole = in_polygon(
        ground, [Polygon("area", (np.array([[0.0, 0], [70, 0], [70, 20], [0, 20]]),))], blocks, n, seed=2
    )
    near = np.digitize(whole.position[:, 0] - 0.3 * (whole.position[:, 2] < -11), CLIFF_X)
    counts = np.bincount(near, minlength=3)
    np.testing.assert_allclose(counts / n, [30 / 80, 20 / 80, 30 / 80], atol=0.025)
    steep = steeper_than(ground, np.radians(60), blocks, 500, seed=2)
    away = (steep.position - [CLIFF_X[0], 0, -30 * np.sin(np.radians(20))]) @ [
        np.sin(np.radians(80)), 0, np.cos(np.radians(80)),
    ]  # fmt: skip
    assert (abs(away - 0.3) < 0.02).mean() > 0.97  # they touch the face, less at its edges
    assert overlapping(ground, steep).max() < 0.02
    with pytest.raises(InputError, match="steeper than 85°"):
        steeper_than(ground, np.radians(85), blocks, 10)


def test_blocks_that_would_hang_on_single_points_are_refused() -> None:
    ground = make_ground(lattice(0.5))
    releases = make_releases(np.array([[10.0, 10.0, 3.0]] * 3), diameter_m=np.array([2.4, 1.2, 1.3]))
    with pytest.raises(InputError, match=r"points of the terrain.*2 of 3 blocks.*diameter of 1\.2 m"):
        simulate(ground, releases, Settings("azimi_desvarreux_1977"))


def test_a_wall_of_points_on_a_mesh_and_a_wall_of_triangles_on_points() -> None:
    flat = np.array([[0.0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    floor = Surface(flat, faces, GlobalShift(), "floor")
    line, up = np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 2, 0.1))
    points = Cloud(np.column_stack([np.full(line.size, 15.0), line.ravel(), up.ravel()]), GlobalShift(), "wall")
    corners = np.array([[15.0, 0, 0], [15, 20, 0], [15, 20, 2], [15, 0, 2]])
    wall = Surface(corners, faces, GlobalShift(), "wall")
    releases = make_releases(np.array([[11.0, 10.0, 1.2]]), velocity=np.array([[20.0, 1.0, 0.0]]), diameter_m=1.0)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.3, "rt": 0.8})
    for terrain, structure in ((floor, points), (lattice(0.1), wall), (lattice(0.1), points)):
        run = simulate(make_ground(terrain, {"wall": structure}), releases, settings)
        hits = run.ground.owner[run.records.face[run.records.what == 1]] == 1
        assert hits.any()
        assert 0.5 < 15 - run.position[0, 0] < 10
        first = np.flatnonzero(run.records.what == 1)[np.argmax(hits)]
        np.testing.assert_allclose(run.records.normal[first], [-1, 0, 0], atol=0.02)
        np.testing.assert_allclose(15 - run.records.position[first, 0], 0.5, atol=0.02)


def survey_height(x, y):
    """A rough slope of 35° that runs out at 11°."""
    drop = -0.7 * np.minimum(x, 60) - 0.2 * np.maximum(x - 60, 0)
    return drop + 0.4 * np.sin(x / 3) * np.cos(y / 4) + 0.1 * np.sin(2.1 * x + y) * np.cos(1.7 * y)


LENGTH, WIDTH = 110.0, 30.0


@pytest.fixture(scope="module")
def one_surface(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Ground]:
    """The same slope as a mesh, as a cloud of points at random places, and as an ESRI grid that is read."""
    step = 0.25
    x, y = np.meshgrid(np.arange(0, LENGTH, step), np.arange(0, WIDTH, step))
    z = survey_height(x, y)
    i = np.arange(x.size).reshape(x.shape)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    mesh = Surface(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces, GlobalShift(), "mesh")
    plan = np.random.default_rng(8).uniform(0, [LENGTH, WIDTH], (int(LENGTH * WIDTH / 0.15**2), 2))
    cloud = Cloud(np.column_stack([plan, survey_height(*plan.T)]), GlobalShift(), "cloud")
    file = tmp_path_factory.mktemp("grid") / "slope.asc"
    header = f"ncols {x.shape[1]}\nnrows {x.shape[0]}\nxllcenter 0\nyllcenter 0\ncellsize {step}\nNODATA_value -9999\n"
    np.savetxt(file, z[::-1], fmt="%.6f", header=header.rstrip(), comments="")
    grid = read_terrain(file, shift=GlobalShift())
    assert len(grid.faces) == len(faces)
    return {"mesh": make_ground(mesh), "cloud": make_ground(cloud), "grid": make_ground(grid)}


def fall_on(
    ground: Ground,
    model: str = "noel_2017",
    count: int = 400,
    diameter: float = 1.5,
    drag: Drag | None = None,
    **more,
) -> Simulation:
    rng = np.random.default_rng(1)
    plan = rng.uniform([6, 8], [20, WIDTH - 8], (count, 2))
    start = np.column_stack([plan, survey_height(*plan.T) + diameter + 0.5])
    return simulate(ground, make_releases(start, diameter_m=diameter), Settings(model, drag=drag, seed=3), **more)


def run_out(run: Simulation) -> np.ndarray:
    return np.hypot(*(run.position - run.releases.position)[:, :2].T)


def test_mesh_cloud_and_grid_of_one_surface_give_the_same_run_out(one_surface: dict[str, Ground]) -> None:
    """Kolmogorov and Smirnov's test of two samples of 400 runs; points at a fifth of the radius, triangles at a third.

    The same test tells a block of another size from this one.
    """
    runs = {name: fall_on(ground) for name, ground in one_surface.items()}
    for run in runs.values():
        assert np.bincount(run.end, minlength=len(ENDS))[ENDS.index("stopped")] > 390
    for name in ("cloud", "grid"):
        assert ks_2samp(run_out(runs[name]), run_out(runs["mesh"])).pvalue > 0.05
        assert np.median(run_out(runs[name])) == pytest.approx(np.median(run_out(runs["mesh"])), rel=0.03)
    thick = Drag(air_density=200.0)  # that of air is hardly felt on such a slope
    slowed = {name: fall_on(ground, drag=thick) for name, ground in one_surface.items()}
    assert ks_2samp(run_out(slowed["grid"]), run_out(slowed["mesh"])).pvalue > 0.05
    assert np.median(slowed["mesh"].v_max_mps) < 0.9 * np.median(runs["mesh"].v_max_mps)
    # Slow blocks hop off the facets of triangles where they keep to the plane of many points, and so run farther there.
    assert np.median(run_out(slowed["cloud"])) == pytest.approx(np.median(run_out(slowed["mesh"])), rel=0.05)
    small = fall_on(one_surface["cloud"], diameter=0.65)
    assert ks_2samp(run_out(small), run_out(runs["mesh"])).pvalue < 1e-3


def test_blocks_that_are_just_large_enough_for_the_points_run_out_as_on_triangles(
    one_surface: dict[str, Ground],
) -> None:
    """Radius of two spacings: the median of 400 runs; see `FEWEST`."""
    diameter = 2.02 * FEWEST * one_surface["cloud"].spacing_m["the terrain"]
    cloud, mesh = (np.median(run_out(fall_on(one_surface[name], diameter=diameter))) for name in ("cloud", "mesh"))
    assert cloud == pytest.approx(mesh, rel=0.08)


def test_no_point_is_deeper_in_a_block_than_is_stated_on_any_flight(one_surface: dict[str, Ground]) -> None:
    run = fall_on(one_surface["cloud"], count=100)
    cloud, records = one_surface["cloud"].terrain, run.records
    assert isinstance(cloud, Cloud)
    start = np.flatnonzero((records.what[:-1] == IMPACT) & (records.what[1:] == IMPACT))
    start = start[records.run[start] == records.run[start + 1]]
    assert start.size > 400
    for part in np.linspace(0, 1, 21):
        t = part * (records.time_s[start + 1] - records.time_s[start])[:, None]
        place = records.position[start] + records.v2[start] * t + np.array([0, 0, -G / 2]) * t**2
        assert nearest_points(cloud, place)[0].min() > (1 - CORE) * 0.75 - 1e-6


def test_points_give_the_same_bits_for_any_threads_and_batches(
    one_surface: dict[str, Ground], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = fall_on(one_surface["cloud"], count=60, threads=1)
    monkeypatch.setattr(turns, "BATCH", 7)
    for threads in (2, 7):
        other = fall_on(one_surface["cloud"], count=60, threads=threads)
        np.testing.assert_array_equal(other.position, one.position)
        np.testing.assert_array_equal(other.records.v2, one.records.v2)


def test_energy_never_grows_on_points(one_surface: dict[str, Ground]) -> None:
    for model in ("noel_2017", "azimi_desvarreux_1977"):
        run = fall_on(one_surface["cloud"], model, count=60)
        records = run.records
        energy = 0.5 * (records.v2**2).sum(axis=1) + G * records.position[:, 2]
        spin = 0.5 * 0.4 * (run.releases.diameter_m[0] / 2) ** 2 * (records.omega2**2).sum(axis=1)
        first = G * run.releases.position[records.run, 2]
        assert (energy <= first + 1e-6 + spin).all()


def test_a_large_block_rides_over_what_stops_a_small_one() -> None:
    """A slope of points at 25° with waves 1.6 m long, 0.6 m from trough to crest."""
    cloud = scattered(0.05, lambda x, y: -np.tan(np.radians(25)) * x + 0.3 * np.sin(4 * x), size=40.0)
    ground = make_ground(cloud)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.2, "rt": 0.9}, friction=0.35)
    far = {}
    for diameter in (0.3, 3.0):
        places = placed_on(ground, np.column_stack([np.full(20, 5.0), np.linspace(8, 32, 20)]), np.full(20, diameter))
        velocity = 2.0 * np.tile([np.cos(0.43), 0.0, -np.sin(0.43)], (20, 1))
        run = simulate(ground, make_releases(places, velocity=velocity, diameter_m=diameter), settings)
        far[diameter] = run.position[:, 0] - 5.0
    # A sphere on the function itself, by `simulation_oracle.fall_on_function`: 2.55 m. Points scatter about it.
    assert np.median(far[0.3]) == pytest.approx(2.55, abs=0.5)
    assert (far[0.3] < 10).all()
    assert (far[3.0] > 30).all()


def test_a_block_that_falls_through_a_hole_of_the_cloud_is_counted() -> None:
    cloud = lattice(0.1)
    hole = np.hypot(cloud.points[:, 0] - 10, cloud.points[:, 1] - 10) < 2
    ground = make_ground(Cloud(cloud.points[~hole], GlobalShift(), "cloud"))
    deep = np.array([[1.0, 1.0, -30.0]])  # so that the terrain reaches below
    ground = make_ground(Cloud(np.concatenate([ground.points, deep]), GlobalShift(), "cloud"))
    releases = make_releases(np.array([[10.0, 10.0, 2.0], [5.0, 5.0, 2.0], [19.0, 10.0, 2.0]]), diameter_m=0.6)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.1})
    for speed, through in ((0.0, False), (2.2, True)):  # straight down it ends under the hole, not under points
        velocity = np.array([[speed, 0, 0], [0, 0, 0], [9, 0, 0]])
        run = simulate(ground, replace(releases, velocity=velocity), settings)
        assert [ENDS[end] for end in run.end] == ["left_terrain", "stopped", "left_terrain"]
        assert fell_through(run).tolist() == [through, False, False]


@pytest.mark.parametrize("name", ["las_chablais3.laz", "sample_lareunion_epsg2975.laz"])
def test_blocks_on_a_real_cloud(name: str) -> None:
    cloud = read_points(Path(__file__).parents[1] / "data" / name)
    low, high = cloud.bounds
    assert 0.001 * np.hypot(*(high - low)[:2]) < cloud.spacing_m < 0.1 * np.hypot(*(high - low)[:2])
    ground = make_ground(cloud)
    diameter = 8 * cloud.spacing_m
    rng = np.random.default_rng(2)
    plan = rng.uniform(low[:2] + 0.3 * (high - low)[:2], high[:2] - 0.3 * (high - low)[:2], (60, 2))
    places = placed_on(ground, plan, np.full(60, diameter))
    places = places[np.isfinite(places).all(axis=1)]
    releases = make_releases(places, diameter_m=diameter)
    assert len(releases) > 40
    assert overlapping(ground, releases).max() < 1e-6
    run = simulate(ground, releases, Settings("noel_2017", seed=1))
    assert len(run) == len(releases)
    counts = np.bincount(run.end, minlength=len(ENDS))
    assert counts.sum() == len(releases)
    assert counts[ENDS.index("limit")] == 0
    fallen = run.releases.position[:, 2] - run.position[:, 2]
    assert (fallen > -1e-6).all()
    assert (0.5 * run.v_max_mps**2 <= G * (places[:, 2] - low[2] + diameter) + 1e-6).all()
    stopped = run.end == ENDS.index("stopped")
    assert (abs(nearest_points(cloud, run.position[stopped])[0] / (diameter / 2) - 1) < 0.15).all()


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a slope and a wall as tables of points, and a table of releases, in survey coordinates."""
    folder = tmp_path_factory.mktemp("survey")
    east, north = 2_600_000.0, 1_200_000.0
    plan = np.random.default_rng(3).uniform(0, [60, 20], (int(60 * 20 / 0.15**2), 2))
    slope = np.column_stack([plan[:, 0] + east, plan[:, 1] + north, 500 - 0.7 * np.minimum(plan[:, 0], 30)])
    along, up = np.meshgrid(np.arange(0, 20, 0.1), np.arange(479, 486, 0.1))
    wall = np.column_stack([np.full(along.size, east + 40), north + along.ravel(), up.ravel()])
    for name, points in (("slope", slope), ("wall", wall)):
        np.savetxt(folder / f"{name}.xyz", points, fmt="%.4f")
    rows = [f"{east + 5},{north + y},,1.2" for y in (8, 9, 10, 11)]
    (folder / "releases.csv").write_text("x_m,y_m,z_m,diameter_m\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return folder


def simulated(survey: Path, out: Path, *more: str) -> dict:
    argv = ["simulate", str(survey / "releases.csv"), "--terrain", str(survey / "slope.xyz"), "--out", str(out)]
    assert main([*argv, "--model", "azimi_desvarreux_1977", *more]) == 0
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def test_the_command_lets_blocks_meet_points_and_walls_of_points(survey: Path, tmp_path: Path, capsys) -> None:
    wall = ("--structure", f"wall={survey / 'wall.xyz'}", "--friction", "0.2")
    summary = simulated(survey, tmp_path / "points", "--contact", "points", *wall)
    assert summary["contact"] == "points"
    assert summary["point_spacing_m"] == pytest.approx({"the terrain": 0.16, "wall": 0.1}, rel=0.15)
    assert "Blocks meet the points of the terrain, 0.1" in capsys.readouterr().out
    (model,) = summary["models"].values()
    assert sum(model["ends"].values()) == 4
    assert model["fell_through"] == 0
    hits = read_table(tmp_path / "points" / "hits.csv", ("structure", "x_m"), ()).numbers("x_m")
    assert ((hits > 2_600_039) & (hits < 2_600_041)).all()
    assert hits.size >= 4
    mesh = simulated(survey, tmp_path / "mesh", *wall)
    assert mesh["contact"] == "mesh"
    assert list(mesh["point_spacing_m"]) == ["wall"]
    ends = [read_table(tmp_path / name / "runs.csv", ("x_m",), ()).numbers("x_m") for name in ("points", "mesh")]
    np.testing.assert_allclose(*ends, atol=6.0)  # the wall sends them back a little
    assert (np.concatenate(ends) < 2_600_039.41).all()


def test_the_command_releases_blocks_where_points_are_steep(survey: Path, tmp_path: Path) -> None:
    """The upper half of the slope has 35°, the rest is level; the faces of the mesh of the same points say the same."""
    for contact in ("points", "mesh"):
        out = tmp_path / contact
        argv = ["simulate", "--steeper-than", "20", "--number", "300", "--diameter", "1", "--seed", "4"]
        argv += [
            "--terrain",
            str(survey / "slope.xyz"),
            "--contact",
            contact,
            "--model",
            "noel_2017",
            "--out",
            str(out),
        ]
        assert main(argv) == 0
        rows = read_table(out / "trajectories.csv", ("time_s", "x_m", "z_m"), ())
        starts = rows.numbers("time_s") == 0
        x, z = rows.numbers("x_m")[starts] - 2_600_000, rows.numbers("z_m")[starts]
        assert (x < 31).all()
        assert np.median(x) == pytest.approx(15, abs=1.5)
        np.testing.assert_allclose((z - 500 + 0.7 * x) / np.hypot(1, 0.7), 0.5, atol=0.06)


def test_measured_releases_start_on_points() -> None:
    """One in the air where it was, one that is seen from its impact on touching the plain of points there."""
    fall = np.sqrt(2 * 5 / 9.81)
    picks = make_picks(
        ["a", "a", "b", "b"],
        [0.0, fall, 10.0, 10.6],
        [[2.0, 10.0, 5.0], [2.0 + 3 * fall, 10.0, 0.0], [4.0, 15.0, 0.0], [6.0, 15.0, 0.0]],
        kind=["release", "impact", "impact", "impact"],
        normal=[[0.0, 0.0, 1.0]] * 4,
    )
    made = from_reconstruction(make_ground(lattice(0.1)), reconstruct(picks, block=Block(0.6, 0.5, 0.4, 2700, "box")))
    np.testing.assert_allclose(made.position, [[2.0, 10.0, 5.0], [4.0, 15.0, 0.25]], atol=0.01)
    np.testing.assert_allclose(made.velocity, [[3.0, 0.0, 0.0], [2 / 0.6, 0.0, 9.81 * 0.3]], atol=1e-6)
    np.testing.assert_allclose(made.angular_velocity[1], [0.0, 2 / 0.6 / 0.25, 0.0], atol=1e-6)


def test_the_command_refuses_what_points_cannot_do(survey: Path, tmp_path: Path, capsys) -> None:
    argv = ["simulate", str(survey / "releases.csv"), "--terrain", str(survey / "slope.xyz"), "--contact", "points"]
    argv += ["--model", "noel_2017", "--out", str(tmp_path / "out")]
    assert main([*argv, "--max-edge", "2"]) == 1
    assert "--max-edge is of a mesh" in capsys.readouterr().err
    (tmp_path / "small.csv").write_text("x_m,y_m,diameter_m\n2600005,1200008,0.1\n", encoding="utf-8")
    argv[1] = str(tmp_path / "small.csv")
    assert main(argv) == 1
    assert "single points" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_project_asks_for_points(survey: Path, tmp_path: Path) -> None:
    project = tmp_path / "project.toml"
    project.write_text(
        f'schema = 1\n[terrain]\nfile = "{survey / "slope.xyz"}"\n[simulation]\nmodels = ["azimi_desvarreux_1977"]\n'
        f'contact = "points"\n[simulation.releases]\nfrom = "table"\nfile = "{survey / "releases.csv"}"\n',
        encoding="utf-8",
    )
    assert main(["simulate", str(project), "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["contact"] == "points"
    again = tmp_path / "again.toml"
    write_project(read_project(project), again)
    assert read_project(again).simulation.contact == "points"
    project.write_text(project.read_text(encoding="utf-8").replace('"points"', '"lines"'), encoding="utf-8")
    with pytest.raises(InputError, match="contact"):
        read_project(project)
