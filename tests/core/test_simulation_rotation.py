# SPDX-License-Identifier: GPL-3.0-or-later
"""The free rotation of blocks: published values, Euler's equations integrated by another code, SciPy's functions."""

from itertools import pairwise

import numpy as np
import pytest
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.simulation.block_shapes import principal_moments
from rockfall.core.simulation.chance_kernels import ATTITUDE, fill_uniform
from rockfall.core.simulation.elliptic_kernels import carlson_rc, carlson_rf, carlson_rj, jacobi
from rockfall.core.simulation.engine import IMPACT, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.rotation import drawn_axes, turn
from rockfall.core.terrain.surface import Surface
from scipy import special
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

CUBOID = tuple(principal_moments(np.array(["box"]), np.array([[3.0, 2.0, 1.0]]), np.array([1.0]))[0].tolist())
LEINE = (1e-3, 10.0, 1e-3)
UNTURNED = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
Triple = tuple[float, float, float]


def in_the_block(spin: Triple, axes: tuple[Triple, Triple, Triple]) -> np.ndarray:
    return np.array(axes) @ np.array(spin)


def integrated(moments: Triple, axes: np.ndarray, spin: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Euler's equations and the kinematics of the axes, by Dormand and Prince's eighth order."""
    inertia = np.array(moments)

    def rate(_: float, state: np.ndarray) -> np.ndarray:
        w, rows = state[:3], state[3:].reshape(3, 3)
        world = w @ rows
        return np.concatenate([np.cross(inertia * w, w) / inertia, np.cross(world, rows).ravel()])

    start = np.concatenate([axes @ spin, axes.ravel()])
    end = solve_ivp(rate, (0, t), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    rows = end[3:].reshape(3, 3)
    return rows, end[:3] @ rows


def test_the_cuboid_has_the_published_moments() -> None:
    np.testing.assert_allclose(CUBOID, (0.416667, 0.833333, 1.083333), atol=1e-6)


def test_the_cuboid_turns_over_when_it_should() -> None:
    """Leine et al. 2021, § 4.3: ω_y = 0 at four times, and ω after 20 s, in the block's frame."""
    axes, spin = turn(CUBOID, UNTURNED, LEINE, 20.0)
    np.testing.assert_allclose(in_the_block(spin, axes), (-3.03963, 9.36381, 2.43365), atol=1e-5)
    for zero in (2.4653, 6.9378, 11.4104, 15.8829):
        before, after = (
            in_the_block(*reversed(turn(CUBOID, UNTURNED, LEINE, zero + step)))[1] for step in (-1e-4, 1e-4)
        )
        assert before * after < 0


def test_the_cuboid_keeps_energy_and_momentum() -> None:
    inertia = np.array(CUBOID)
    first = np.array(LEINE)
    axes, spin = UNTURNED, LEINE
    for _ in range(300):
        axes, spin = turn(CUBOID, axes, spin, 0.37)
    own = in_the_block(spin, axes)
    assert (inertia * own**2).sum() == pytest.approx((inertia * first**2).sum(), rel=1e-11)
    np.testing.assert_allclose((inertia * own) @ np.array(axes), inertia * first, atol=1e-10)
    np.testing.assert_allclose(np.array(axes) @ np.array(axes).T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    "moments",
    [CUBOID, (1.0833, 0.4167, 0.8333), (0.8333, 1.0833, 0.4167), (0.4167, 1.0833, 0.8333), (0.8333, 0.4167, 1.0833),
     (1.0833, 0.8333, 0.4167), (1.0, 1.0, 0.5), (1.0, 1.0, 1.7), (0.5, 1.0, 1.0), (1.0, 1.7, 1.0),
     (1.0, 1.0 + 1e-6, 1.7)],
)  # fmt: skip
def test_any_order_of_the_moments_agrees_with_integration(moments: Triple) -> None:
    rng = np.random.default_rng(5)
    for k in range(6):
        rows = Rotation.random(random_state=k).as_matrix()
        spin = rng.normal(0.0, 6.0, 3)
        if k == 4:
            spin = 5.0 * rows[k % 3]
        if k == 5:
            spin = rows[0] * 5.0 + rows[1] * 4.0
        t = float(rng.uniform(0.05, 3.0))
        axes, now = turn(moments, tuple(map(tuple, rows.tolist())), tuple(spin.tolist()), t)
        expected_rows, expected = integrated(moments, rows, spin, t)
        np.testing.assert_allclose(axes, expected_rows, atol=2e-9)
        np.testing.assert_allclose(now, expected, atol=2e-8)


def test_spin_on_the_separatrix_and_about_the_middle_axis_is_finite() -> None:
    a, b, c = CUBOID
    on_it = (np.sqrt(c * (c - b) / (a * (b - a))), 3.0, 1.0)
    for spin in (on_it, (0.0, 7.0, 0.0), (1e-200, 7.0, 0.0)):
        axes, now = turn(CUBOID, UNTURNED, spin, 2.0)
        own = in_the_block(now, axes)
        assert (np.array(CUBOID) * own**2).sum() == pytest.approx((np.array(CUBOID) * np.square(spin)).sum(), rel=1e-12)
    np.testing.assert_allclose(turn(CUBOID, UNTURNED, (0.0, 7.0, 0.0), 2.0)[1], (0.0, 7.0, 0.0), atol=1e-12)


def test_elliptic_functions_are_those_of_scipy() -> None:
    rng = np.random.default_rng(2)
    for m1 in (1.0, 0.7, 0.3, 1e-3, 1e-8):
        for v in rng.uniform(0.0, 30.0, 20):
            sn, cn, dn, am = special.ellipj(v, 1.0 - m1)
            np.testing.assert_allclose(jacobi(v, m1), (am, sn, cn, dn), atol=1e-6 if m1 < 1e-6 else 1e-10)
    for x, y, z, p in rng.uniform(0.0, 3.0, (200, 4)):
        assert carlson_rf(x, y, z) == pytest.approx(special.elliprf(x, y, z), rel=1e-13)
        assert carlson_rj(x, y, z, 5 * p) == pytest.approx(special.elliprj(x, y, z, 5 * p), rel=1e-12)
        assert carlson_rc(x, y) == pytest.approx(special.elliprc(x, y), rel=1e-13)


def test_drawn_axes_are_rotations_and_point_everywhere() -> None:
    rows = np.array([drawn_axes(u) for u in np.random.default_rng(1).uniform(size=(3000, 3))])
    np.testing.assert_allclose(rows @ rows.transpose(0, 2, 1), np.broadcast_to(np.eye(3), rows.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(rows), 1.0)
    assert abs(rows.mean(axis=0)).max() < 4 / np.sqrt(3 * 3000)
    np.testing.assert_allclose((rows**2).mean(axis=0), np.full((3, 3), 1 / 3), atol=0.02)


def falls(shape: str, threads: int = 1, first: int = 0, count: int = 40, drag: Drag | None = None):
    """Boxes that are thrown over a slope, turning, with a model that leaves spin: two flights at least."""
    line = np.arange(0.0, 121.0, 5.0)
    x, y = np.meshgrid(line, line)
    vertices = np.column_stack([x.ravel(), y.ravel(), -0.6 * x.ravel()])
    i = np.arange(line.size**2).reshape(line.size, -1)
    faces = np.concatenate(
        [np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], -1), np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], -1)]
    )
    ground = make_ground(Surface(vertices, faces.reshape(-1, 3).astype(np.int32), GlobalShift(), "slope"))
    rng = np.random.default_rng(6)
    start = np.column_stack([rng.uniform(8, 20, count), rng.uniform(50, 70, count), rng.uniform(0, 4, count)])
    releases = make_releases(
        start,
        velocity=rng.normal(0.0, 3.0, (count, 3)),
        angular_velocity=rng.normal(0.0, 15.0, (count, 3)),
        axes_m=np.tile([1.2, 0.9, 0.5], (count, 1)),
        shape=shape,  # type: ignore[arg-type]
    )
    settings = Settings("wyllie_2014", seed=8, drag=drag, most_impacts=20)
    return simulate(ground, releases.take(slice(first, count)), settings, first_run=first, threads=threads)


@pytest.mark.parametrize("drag", [None, Drag()])
def test_boxes_turn_freely_between_their_impacts(drag: Drag | None) -> None:
    """The spin at the first two impacts, by integration from the attitude that belongs to the seed and the run."""
    run = falls("box", drag=drag)
    records, moments = run.records, tuple(run.releases.principal_kgm2[0].tolist())
    compared = 0
    for number in range(12):
        u = np.empty(3)
        fill_uniform(8, number, ATTITUDE, u)
        axes = np.array(drawn_axes(u))
        own = np.flatnonzero(records.run == number)
        for before, after in pairwise(own[:3].tolist()):
            if records.what[after] != IMPACT:
                break
            flight = records.time_s[after] - records.time_s[before]
            axes, spin = integrated(moments, axes, records.omega2[before], flight)
            np.testing.assert_allclose(records.omega1[after], spin, atol=1e-7 * np.linalg.norm(spin))
            compared += abs(records.omega1[after] - records.omega2[before]).max() > 0.1
    assert compared > 12


def test_spheres_and_cubes_keep_their_spin_in_flight() -> None:
    for shape in ("sphere", "cube"):
        records = falls(shape).records
        flights = np.flatnonzero((records.what[1:] == IMPACT) & (records.what[:-1] <= IMPACT))
        np.testing.assert_array_equal(records.omega1[flights + 1], records.omega2[flights])


def test_boxes_are_the_same_for_any_threads_and_parts() -> None:
    whole, other, part = falls("box"), falls("box", threads=3), falls("box", first=25)
    for name in ("time_s", "position", "omega1", "omega2"):
        values = getattr(whole.records, name)
        np.testing.assert_array_equal(values, getattr(other.records, name))
        np.testing.assert_array_equal(values[whole.records.run >= 25], getattr(part.records, name))
