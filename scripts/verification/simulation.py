# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole falls against closed forms, scipy, and the impact models themselves."""

import math
from dataclasses import replace

import numpy as np
from checks import Check, compared
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.simulation import engine
from rockfall.core.simulation.engine import Settings, Simulation, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.trees import greatest_loss, placed_trees, random_trees
from rockfall.core.terrain.surface import Surface
from scipy.integrate import solve_ivp

G = 9.81
TITLE = "Simulation"
SUMMARY = "contacts, rolling, drag, energy and trees of whole falls"
INTRODUCTION = (
    "Blocks that fall on a terrain of triangles: contacts, flights, rolling and sliding, drag, energy and "
    "trees. The impact models have a chapter of their own. What real runs look like beside simulated ones is in the "
    "chapter on real data."
)
ELASTIC, DEAD = {"rn": 1.0, "rt": 1.0}, {"rn": 0.0, "rt": 1.0}
MODEL = "azimi_desvarreux_1977"


def checks() -> list[Check]:
    """All of this chapter."""
    return [*_contacts(), *_rolling(), *_drag(), *_energy(), *_drops(), *_trees()]


def plane(degrees: float, length: float = 400.0) -> Ground:
    """A slope towards +x, of triangles of 5 m."""
    line = np.arange(0.0, length + 1, 5.0)
    x, y = np.meshgrid(line, np.arange(0.0, 121.0, 5.0), indexing="ij")
    rows, columns = x.shape
    vertices = np.column_stack([x.ravel(), y.ravel(), -math.tan(math.radians(degrees)) * x.ravel()])
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate([
        np.stack([corner, corner + columns, corner + columns + 1], 1),
        np.stack([corner, corner + columns + 1, corner + 1], 1),
    ])  # fmt: skip
    return make_ground(Surface(vertices, faces.astype(np.int32), GlobalShift(), "plane"))


def _first_impacts(run: Simulation) -> np.ndarray:
    """Row of the first impact of each run."""
    hits = np.flatnonzero(run.records.what == engine.IMPACT)
    return hits[np.unique(run.records.run[hits], return_index=True)[1]]


def _contacts() -> list[Check]:
    """The first contact of a sphere with a plane: the root of a quadratic."""
    rows = []
    for degrees in (0.0, 37.0, 64.0):
        slope, rng = math.radians(degrees), np.random.default_rng(3)
        normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
        x, radius = rng.uniform(100, 200, 100), rng.uniform(0.05, 1.5, 100)
        start = np.column_stack([x, rng.uniform(40, 80, 100), -math.tan(slope) * x])
        start += (radius + rng.uniform(0.1, 8, 100))[:, None] * normal
        velocity = rng.normal(0, 4, (100, 3))
        releases = make_releases(start, velocity=velocity, diameter_m=2 * radius)
        run = simulate(plane(degrees), releases, Settings(MODEL, most_impacts=1))
        first = _first_impacts(run)
        away, speed, bend = start @ normal - radius, velocity @ normal, -G * normal[2]
        expected = (-speed - np.sqrt(speed**2 - 2 * bend * away)) / bend
        own = run.records.run[first]
        rows.append(
            compared(f"time of the first contact, slope of {degrees:.0f}°", "root of a quadratic", "closed form",
                     run.records.time_s[first], expected[own], 1e-6, "s")
        )  # fmt: skip
    return rows


def _rolling() -> list[Check]:
    """Stopping distance from 10 m/s with μ = 0.5: v²/(2 A g cos β (μ − tan β))."""
    rows = []
    for law, factor, words in (("azzoni_1995", 5 / 7, "a rolling sphere, A = 5/7"), ("coulomb", 1.0, "sliding, A = 1")):
        for degrees in (0, 20):
            slope = math.radians(degrees)
            along = np.array([math.cos(slope), 0.0, -math.sin(slope)])
            normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
            start = np.array([5.3, 60.7, -math.tan(slope) * 5.3]) + 0.5 * normal
            releases = make_releases(start[None], velocity=(10 * along - 1e-4 * normal)[None], diameter_m=1.0)
            run = simulate(plane(degrees), releases, Settings(MODEL, DEAD, rolling=law))
            expected = 100 / (2 * factor * G * math.cos(slope) * (0.5 - math.tan(slope)))
            rows.append(
                compared(f"run-out of {words}, slope of {degrees}°", "v²/(2 A g cos β (μ − tan β))", "closed form",
                         np.linalg.norm(run.position[0] - start), expected, 1e-4, "m")
            )  # fmt: skip
    return rows


def _drag() -> list[Check]:
    """A throw through air until it hits a plane, against scipy's integrator with an event."""
    drag, block = Drag(), Block(0.3, 0.3, 0.3)
    velocity, start = np.array([22.0, 3.0, 18.0]), np.array([10.0, 60.0, 40.0])
    releases = make_releases(start[None], velocity=velocity[None], diameter_m=0.3)
    run = simulate(plane(0.0), releases, Settings("noel_2017", drag=drag, most_impacts=1))
    hit = _first_impacts(run)[0]
    k = drag.per_metre(block)

    def motion(t: float, state: np.ndarray) -> np.ndarray:
        return np.r_[state[3:], -k * np.linalg.norm(state[3:]) * state[3:] - [0, 0, G]]

    def touches(t: float, state: np.ndarray) -> float:
        return float(state[2] - 0.15)

    touches.terminal = True  # type: ignore[attr-defined]
    other = solve_ivp(motion, (0, 20), np.r_[start, velocity], events=touches, method="DOP853", rtol=1e-11, atol=1e-11)
    high = make_releases(np.array([[60.0, 60.0, 9000.0]]), diameter_m=0.35)
    fallen = simulate(plane(0.0), high, Settings("noel_2017", drag=drag))
    mass, area = 2650 * math.pi / 6 * 0.35**3, math.pi / 4 * 0.35**2
    return [
        compared("place of the first contact after a throw through air", "scipy, DOP853 with an event", "independent",
                 run.records.position[hit], other.y[:3, -1], 1e-4, "m"),
        compared("velocity there", "scipy, DOP853 with an event", "independent", run.records.v1[hit], other.y[3:, -1],
                 1e-4, "m/s"),
        compared("terminal speed", "√(2mg/(ρC_D A))", "closed form", fallen.v_max_mps[0],
                 math.sqrt(2 * mass * G / (1.2 * 0.9 * area)), 1e-3),
    ]  # fmt: skip


def _energy() -> list[Check]:
    """Perfect rebounds in a bowl keep what they have, contact by contact."""
    line = np.linspace(-30, 30, 61)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = 0.02 * (x**2 + y**2) + 0.1 * np.sin(x) * np.cos(y)
    n = line.size
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + 1], 1)]
    )
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    bowl = make_ground(Surface(vertices, faces.astype(np.int32), GlobalShift(), "bowl"))
    places = np.random.default_rng(2).uniform(-8, 8, (20, 2))
    releases = make_releases(np.column_stack([places, np.full(20, 6.0)]), diameter_m=0.4)
    settings = Settings(MODEL, ELASTIC, friction=0.0, rolling="coulomb", most_impacts=400)
    records = simulate(bowl, releases, settings).records
    hits = np.flatnonzero(records.what == engine.IMPACT)
    before, after = (
        0.5 * (speed[hits] ** 2).sum(axis=1) + G * records.position[hits, 2] for speed in (records.v1, records.v2)
    )
    return [
        compared("energy before and after perfect rebounds in a bowl", "the same", "closed form", after, before, 1e-9)
    ]


def _drops() -> list[Check]:
    """1 000 blocks that drop from heights of 1 to 50 m on a plate."""
    rng = np.random.default_rng(6)
    height, diameter = rng.uniform(1, 50, 1000), rng.uniform(0.1, 2, 1000)
    start = np.column_stack([rng.uniform(20, 380, 1000), rng.uniform(10, 110, 1000), height + diameter / 2])
    releases = make_releases(start, diameter_m=diameter)
    run = simulate(plane(0.0), releases, Settings(MODEL, most_impacts=1))
    first = _first_impacts(run)
    energy = 0.5 * releases.mass_kg * (run.records.v1[first] ** 2).sum(axis=1)
    return [
        compared("blocks that hit a plate of 1 000 that drop on it", "all", "closed form", first.size, 1000, 0, "1"),
        compared("their energy ½mv² at the plate", "mgh", "closed form", energy / (releases.mass_kg * G * height), 1.0,
                 1e-6, "1"),
    ]  # fmt: skip


def _trees() -> list[Check]:
    """Throws past one stem, and straight ways through a forest."""
    rng, ground, radius, thick = np.random.default_rng(7), plane(0.0), 0.3, 0.4
    reach, axis = radius + thick / 2, np.array([30.0, 60.0])
    stem = placed_trees(
        ground.terrain, axis[None], np.array([thick]), np.array([20.0]), greatest_loss(np.array([thick]))
    )
    offset, speed = rng.uniform(0, 0.999, 100), rng.uniform(20, 80, 100)
    start = np.column_stack([np.full(100, 10.0), 60 + offset * reach, np.full(100, 8.0)])
    velocity = np.column_stack([speed, np.zeros((100, 2))])
    releases = make_releases(start, diameter_m=2 * radius, velocity=velocity)
    records = simulate(ground, releases, Settings(MODEL, gravity_mps2=G, trees=stem)).records
    hits = np.flatnonzero(records.what == engine.TREE)
    hits = hits[np.unique(records.run[hits], return_index=True)[1]]
    before, after = (0.5 * releases.mass_kg * (v[hits] ** 2).sum(axis=1) for v in (records.v1, records.v2))
    share = np.maximum(-0.046 + (0.98 + 0.046) / (1 + 10 ** ((0.58 - offset) * -8.007)), 0)
    taken = np.minimum(share * 38.7 * (100 * thick) ** 2.31, before)
    forest = random_trees(ground.terrain, 4000.0, 0.2, 0.0, seed=5, height_m=50.0)
    weak = replace(forest, energy_j=np.full(len(forest), 1e-9))
    ways = np.arange(5.0, 115.0, 0.9)
    start = np.column_stack([np.full(ways.size, 20.0), ways, np.full(ways.size, 20.0)])
    straight = make_releases(start, diameter_m=0.6, velocity=np.tile([1000.0, 0.0, 0.0], (ways.size, 1)))
    crossed = simulate(ground, straight, Settings(MODEL, gravity_mps2=1e-6, trees=weak)).records
    met = np.count_nonzero((crossed.what == engine.TREE) & (crossed.position[:, 0] < 380.0))
    expected = 0.4 * (0.2 + 0.6) * 360 * ways.size
    return [
        compared("time at which a thrown block meets a stem", "line and circle in plan", "closed form",
                 records.time_s[hits], (20 - reach * np.sqrt(1 - offset**2)) / speed, 1e-9, "s"),
        compared("energy ½mv² behind the stem", "38.7 D^2.31 J and Rockyfor3D's sigmoid, second-hand", "closed form",
                 after, before - taken, 1e-9),
        compared("stems that straight ways through a forest meet", "n (D + 2r) L, by chance within 4/√n", "closed form",
                 met / expected, 1.0, 4 / math.sqrt(expected), "1"),
    ]  # fmt: skip
