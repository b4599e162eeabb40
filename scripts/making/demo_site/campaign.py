# SPDX-License-Identifier: GPL-3.0-or-later
"""The field campaign on the synthetic gully: which blocks were thrown, what was seen of them, and what was marked."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import blocks, terrain

Array = NDArray[np.float64]

FPS = 30.0
SIGMA_TIME_S = 1.0 / FPS / np.sqrt(12.0)
"""Standard deviation of a time that is rounded to the nearest frame."""

SIGMA_POSITION_M = 0.10
MERGE_S = 0.20
"""Contacts closer in time than this are one impact to the person who marks them."""

BLOCKS = 15
COMPLETE = (0, 5, 10)
"""Blocks that are seen from the release to the stop; of the others a part is hidden by the flanks."""

SHATTERED, DOUBTFUL = 6, 9


@dataclass(frozen=True, eq=False)
class Observed:
    """One block's run as it was seen.

    Attributes
    ----------
    run : the true fall; times count from its own release.
    start_s : its release on the common clock [s].
    impacts : the impacts that were seen.
    released, stopped : whether the release and the stop were seen.
    """

    name: str
    diameters: Array
    start_s: float
    run: blocks.Run
    impacts: tuple[blocks.Impact, ...]
    released: bool
    stopped: bool
    shattered: bool = False


@dataclass(frozen=True, eq=False)
class Pick:
    """One row of picks.csv, in the gully's frame."""

    trajectory: str
    time: float
    position: Array
    kind: str
    status: str
    frame: int
    note: str


@dataclass(frozen=True)
class Campaign:
    """Everything follows from the seed; each block has random numbers of its own, so that one can be made alone."""

    seed: int

    @cached_property
    def terrain(self) -> terrain.Terrain:
        return terrain.terrain(self.seed)

    @cached_property
    def ground(self) -> blocks.Ground:
        site = self.terrain
        return blocks.Ground(
            site.vertices, site.faces, site.rows_x, site.columns_y, rest_beyond_x=site.line.apex_m - 4.0
        )

    def candidate(self, block: int, attempt: int) -> tuple[Array, blocks.Run]:
        """One throw of a block: its three diameters [m], and its fall."""
        rng = np.random.default_rng([self.seed, block, attempt])
        mean = rng.uniform(0.31, 0.39)
        diameters = np.round(mean * np.array([1.0 + (s := rng.uniform(0.01, 0.03)), 1.0, 1.0 - s]), 3)
        x = 2.0 + rng.uniform(-1.0, 1.0)
        y = float(terrain.axis_y(np.array(x), self.terrain.line.apex_m)) + rng.uniform(-3.0, 3.0)
        velocity = np.array([2.4, 0.0, 0.5]) + 0.4 * rng.standard_normal(3)
        return diameters, blocks.fall(self.ground, float(diameters.mean()) / 2.0, x, y, velocity, rng)

    def observed(self, block: int) -> Observed:
        """The throw of a block that was filmed well enough, and what was seen of it."""
        for attempt in range(200):
            diameters, run = self.candidate(block, attempt)
            seen = tuple(blocks.merged(run.impacts, MERGE_S))
            longest = 14 if block in COMPLETE else 20
            if run.rolling and len(seen) <= longest and _well_filmed(seen):
                return self._seen_part(block, diameters, run, seen)
        raise RuntimeError(f"No throw of block {block} was filmed well enough")

    def _seen_part(self, block: int, diameters: Array, run: blocks.Run, seen: tuple[blocks.Impact, ...]) -> Observed:
        rng = np.random.default_rng([self.seed, block, 999])
        name, start = f"B{block + 1:02d}", round(20.0 + 48.0 * block + rng.uniform(-6.0, 6.0), 3)
        if block in COMPLETE:
            return Observed(name, diameters, start, run, seen, released=True, stopped=True)
        count = int(rng.integers(9, 13)) // 2
        if block == SHATTERED:
            return Observed(name, diameters, start, run, seen[:count], True, False, shattered=True)
        if block % 2:
            return Observed(name, diameters, start, run, seen[-count:], released=False, stopped=True)
        return Observed(name, diameters, start, run, seen[:count], released=True, stopped=False)

    def picks(self, observed: Observed) -> Iterator[Pick]:
        """What a person marked: times to the frame, positions to a decimetre on the terrain."""
        rng = np.random.default_rng([self.seed, int(observed.name[1:]), 7])

        def pick(time: float, contact: Array, kind: str, status: str = "ok", note: str = "") -> Pick:
            frame = round((observed.start_s + time) * FPS)
            return Pick(observed.name, frame / FPS, self._beside(contact, rng), kind, status, frame, note)

        if observed.released:
            yield pick(0.0, observed.run.release_contact, "release")
        last = len(observed.impacts) - 1
        doubtful = observed.name == f"B{DOUBTFUL + 1:02d}"
        for i, impact in enumerate(observed.impacts):
            status, note = "ok", ""
            if i == 0 and not observed.released:
                note = "first seen here, the flank hides what was before"
            if i == last and observed.shattered:
                status, note = "shattered", "breaks into three pieces"
            elif i == last and not observed.stopped:
                note = "lost from sight behind the flank"
            elif doubtful and i == 2:
                status, note = "doubtful", "dust hides the contact"
            yield pick(impact.time, impact.contact, "impact", status, note)
            if i < last and observed.impacts[i + 1].time - impact.leave_time > 1.4:
                yield self._passing(observed, impact, observed.impacts[i + 1], rng)
        if observed.stopped:
            for (time, _, contact), kind in zip(observed.run.rolling[1:], ("contact", "stop"), strict=True):
                yield pick(time, contact, kind)

    def _passing(
        self, observed: Observed, impact: blocks.Impact, after: blocks.Impact, rng: np.random.Generator
    ) -> Pick:
        """A point in flight at a frame near the middle: the block's underside, which lies on the line of contacts."""
        start, centre = impact.leave_time, impact.leave_centre
        frame = round((observed.start_s + (start + after.time) / 2.0) * FPS)
        t = frame / FPS - observed.start_s - start
        drop = np.array([0.0, 0.0, 0.5 * blocks.GRAVITY_MPS2 * t**2])
        lift = (centre - impact.contact + after.centre - after.contact) / 2.0
        place = centre + impact.v2 * t - drop - lift + SIGMA_POSITION_M * rng.standard_normal(3)
        return Pick(observed.name, frame / FPS, place, "pass", "ok", frame, "underside of the block")

    def _beside(self, contact: Array, rng: np.random.Generator) -> Array:
        """A point of the terrain near the true contact: noise in the tangent plane, then the nearest surface point."""
        normal = self.ground.normal(contact)
        noise = SIGMA_POSITION_M * rng.standard_normal(3)
        moved = contact + noise - (noise @ normal) * normal
        return self.ground.closest(moved, 1.0)[1]


def _well_filmed(seen: tuple[blocks.Impact, ...]) -> bool:
    """Enough impacts, none of them a long skid, and speeds as in the field."""
    skids = max(impact.leave_time - impact.time for impact in seen)
    fastest = max(float(np.linalg.norm(impact.v1)) for impact in seen)
    return len(seen) >= 7 and skids < 0.2 and fastest < 22.0


def in_survey(picks: Iterator[Pick], line: terrain.Profile) -> list[Pick]:
    """The same picks in survey coordinates."""
    return [replace(pick, position=terrain.to_survey(pick.position, line)) for pick in picks]
