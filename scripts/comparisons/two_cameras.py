# SPDX-License-Identifier: GPL-3.0-or-later
"""A table tennis ball in two cameras: what camera 1 alone tells against camera 2, and both against what is known.

Known are the table's height, the ball's radius, and gravity. Takes some minutes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rockfall.core.camera.model import project
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.tables import read_picks
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import Picks, take
from rockfall.core.reconstruction.refinement.refine import Refinement, refine
from rockfall.core.reconstruction.refinement.views import PixelObservations, View
from rockfall.core.reconstruction.sampling import sample_trajectories
from rockfall.core.reconstruction.triangulation import triangulate
from rockfall.core.terrain.surface import Surface
from rockfall.core.vectors import Array
from rockfall.core.workflow.footage import Footage, open_footage
from rockfall.core.workflow.opening import blocks_of, drag_of, open_terrain
from rockfall.core.workflow.refinement import pixels_of

EXAMPLE = Path(__file__).parents[2] / "assets" / "examples" / "two_cameras"
CAMERAS = ("camera", "clock", "clock_drift")
GRAVITY_MPS2 = 9.81
SIGMA_TABLE_M = 0.002
STEP_S = 1 / 300
GROUPS = 9
WITHIN_95 = 1.96


@dataclass(frozen=True)
class Table:
    """The example's data: everything that `refine` takes."""

    surface: Surface
    footage: Footage
    views: tuple[View, ...]
    seen: PixelObservations
    picks: Picks
    block: dict[str, Block]
    drag: Drag | None


def load(names: Sequence[str] | None = None) -> Table:
    """All runs, or some."""
    known = read_project(EXAMPLE / "project.toml")
    surface = open_terrain(known)
    assert surface is not None
    assert known.picks is not None
    footage = open_footage(known, surface)
    picks = read_picks(known.picks, surface.shift)
    seen, _ = pixels_of(footage.seen)
    if names is not None:
        picks, seen = take(picks, np.isin(picks.trajectory, names)), seen.take(np.isin(seen.trajectory, names))
    views = tuple(video.view for video in footage.seen)
    return Table(surface, footage, views, seen, picks, dict(blocks_of(known, picks)), drag_of(known))


def fit(
    table: Table,
    free: Sequence[str] = (),
    *,
    views: Sequence[View] | None = None,
    seen: PixelObservations | None = None,
    picks: Picks | None = None,
    drag: bool = True,
    on_table: bool = True,
) -> Refinement:
    """Refine with what is given instead of the example's own."""
    return refine(
        table.picks if picks is None else picks,
        table.views if views is None else views,
        table.seen if seen is None else seen,
        surface=table.surface if on_table else None,
        block=table.block,
        drag=table.drag if drag else None,
        free=free,
        sigma_terrain_m=SIGMA_TABLE_M,
        sigma_aim=0.0,
    )


def of_view(seen: PixelObservations, view: int) -> PixelObservations:
    """The pixels of one camera."""
    return seen.take(seen.view == view)


def of_run(table: Table, name: str) -> tuple[Picks, PixelObservations]:
    """Picks and pixels of one run."""
    seen = table.seen
    return take(table.picks, table.picks.trajectory == name), seen.take(seen.trajectory == name)


def predicted(table: Table, alone: Refinement, views: Sequence[View]) -> Array:
    """(m, 2) pixels of camera 2 less those that the motion seen by camera 1 alone predicts there [px]."""
    samples = sample_trajectories(alone.reconstruction, STEP_S)
    seen, view = of_view(table.seen, 1), views[1]
    error = np.full((len(seen), 2), np.nan)
    when = view.clock.to_common(seen.time_s)
    for name in np.unique(seen.trajectory):
        rows, path = np.flatnonzero(seen.trajectory == name), samples.trajectory == name
        time = samples.time_s[path]
        rows = rows[(when[rows] >= time[0]) & (when[rows] <= time[-1])]
        place = np.stack([np.interp(when[rows], time, axis) for axis in samples.position[path].T], axis=1)
        error[rows] = seen.pixel[rows] - project(view.path.reference, place)
    return error[np.isfinite(error[:, 0])]


def bounces(found: Refinement) -> Array:
    """(n, 3) places of the impacts [m]."""
    return found.picks.position[found.picks.kind == "impact"]


def miss_distances(table: Table, views: Sequence[View]) -> Array:
    """(n,) of the rays [m], camera 2's pixels taken between two frames to the time of camera 1's."""
    seen = table.seen
    first, second = of_view(seen, 0), of_view(seen, 1)
    when, other = (view.clock.to_common(part.time_s) for view, part in zip(views, (first, second), strict=True))
    place = np.searchsorted(other, when)
    good = (place > 0) & (place < other.size)
    before, after = place[good] - 1, place[good]
    near = (other[after] - other[before] < 1.2 / 30) & (second.trajectory[after] == first.trajectory[good])
    share = ((when[good] - other[before]) / (other[after] - other[before]))[near, None]
    pixel = (1 - share) * second.pixel[before[near]] + share * second.pixel[after[near]]
    cameras = [view.path.reference for view in views]
    return triangulate(cameras, np.stack([first.pixel[good][near], pixel])).miss_distance


def gravity(found: Refinement) -> tuple[float, float]:
    """Value and formal standard deviation [m/s²]."""
    return found.unknowns["gravity_mps2"]


def jackknife(table: Table, views: Sequence[View]) -> float:
    """Standard deviation of g over groups of runs, the cameras held [m/s²] (delete-a-group jackknife)."""
    names = list(dict.fromkeys(table.picks.trajectory.tolist()))
    values = []
    for group in range(GROUPS):
        kept = [name for i, name in enumerate(names) if i % GROUPS != group]
        seen, picks = table.seen, table.picks
        part = fit(
            table,
            ("gravity",),
            views=views,
            seen=seen.take(np.isin(seen.trajectory, kept)),
            picks=take(picks, np.isin(picks.trajectory, kept)),
        )
        values.append(gravity(part)[0])
    return float(np.sqrt((GROUPS - 1) / GROUPS * np.sum((np.array(values) - np.mean(values)) ** 2)))


def spread(values: Array, digits: int = 4) -> str:
    """Median and quartiles."""
    low, middle, high = np.nanpercentile(values, [25, 50, 75])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def main() -> None:
    """Print the numbers of the README."""
    table = load()
    seen, names = table.seen, list(dict.fromkeys(table.picks.trajectory.tolist()))
    print(f"{len(names)} runs, {(table.picks.kind == 'impact').sum()} bounces, {len(seen)} pixels")
    for entry, solved in ((video.entry, video.camera) for video in table.footage.videos):
        camera = solved.path.reference
        print(f"{entry.name}: f {camera.fx:.0f} px, at {camera.position.round(2)}, rmse {solved.rmse_px:.2f} px")

    both = fit(table, CAMERAS)
    held = both.views
    print(
        f"both: {both.rmse_px_by_view.round(2)} px, {both.outlier.sum()} outliers, noise x {both.noise_scale:.2f}; at "
        + ", ".join(str(view.path.reference.position.round(3)) for view in held)
    )
    for name, (value, sigma) in both.unknowns.items():
        print(f"  {name} {value:.5f} ± {sigma:.5f}")
    for label, views in (("as aligned", table.views), ("refined with both", held)):
        now = [replace(view, clock=better.clock) for view, better in zip(views, held, strict=True)]
        alone = fit(table, views=now, seen=of_view(seen, 0))
        error = np.hypot(*predicted(table, alone, now).T)
        print(
            f"camera 1 alone, cameras {label}: {alone.rmse_px:.2f} px; camera 2 is predicted to {spread(error, 1)} px"
        )
        together = fit(table, views=now)
        here, there, sigma = (
            bounces(alone),
            bounces(together),
            alone.picks.sigma_position_m[alone.picks.kind == "impact"],
        )
        off = np.abs(here - there)[:, :2]
        inside = (off < WITHIN_95 * sigma[:, None] * np.sqrt(1.5)).mean()
        print(
            f"  bounces are {spread(1e3 * np.hypot(*off.T), 0)} mm from those of both; {100 * inside:.0f} % within 95 %"
        )
    print(f"rays miss by {spread(1e3 * miss_distances(table, held), 1)} mm")
    print("  as aligned " + spread(1e3 * miss_distances(table, [
        replace(view, clock=better.clock) for view, better in zip(table.views, held, strict=True)
    ]), 1))  # fmt: skip
    free_z = fit(table, views=held, on_table=False)
    print(f"centre at the bounces {spread(1e3 * bounces(free_z)[:, 2], 1)} mm above the table")
    own = [replace(view, clock=better.clock) for view, better in zip(table.views, held, strict=True)]
    print(f"  cameras as aligned {spread(1e3 * bounces(fit(table, views=own, on_table=False))[:, 2], 1)} mm")

    for label, free, drag in (
        ("drag 0.42", ("gravity",), True),
        ("drag free", ("gravity", "drag"), True),
        ("no drag", ("gravity",), False),
    ):
        found = fit(table, (*CAMERAS, *free), drag=drag)
        value, sigma = gravity(found)
        coefficient = "".join(f", C_D {v:.3f} ± {s:.3f}" for n, (v, s) in found.unknowns.items() if n[0:4] == "drag")
        rmse = f"{found.rmse_px:.2f} px, {found.outlier.sum()} outliers"
        print(
            f"g, {label}: {value:.3f} ± {sigma:.3f} m/s² ({100 * (value / GRAVITY_MPS2 - 1):+.1f} %)"
            f"{coefficient}; {rmse}"
        )
        if label == "drag 0.42":
            with_g = found
    print(f"  over groups of runs ± {jackknife(table, with_g.views):.3f}")
    each: list[tuple[float, float]] = []
    kept: list[float] = []
    bounced: list[int] = []
    for name in names:
        picks, pixels = of_run(table, name)
        one = fit(table, ("gravity",), views=with_g.views, seen=pixels, picks=picks)
        each.append(gravity(one))
        made = one.reconstruction.impacts
        kept.append(float(made.rt[0]))
        bounced.append(len(made))
    g, sigma = np.array(each).T
    error = g.std(ddof=1) / np.sqrt(g.size)
    print(
        f"g of each run: {spread(g, 2)}, mean {g.mean():.2f} ± {error:.2f}, sd {g.std(ddof=1):.2f}, "
        f"own {np.median(sigma):.2f}, from {g.min():.2f} to {g.max():.2f}"
    )
    serve = np.array(bounced) > 1
    print(
        f"  {serve.sum()} runs of two bounces: {g[serve].round(2)}; "
        f"correlation with R_T {np.corrcoef(g, kept)[0, 1]:.2f}"
    )
    impacts = both.reconstruction.impacts
    first = np.array([impacts.rn[impacts.trajectory == name][0] for name in names])
    print(f"R_N {spread(impacts.rn, 3)} at {spread(impacts.vn1, 2)} m/s; sigma {np.nanmedian(impacts.sigma['rn']):.3f}")
    clean = first > 0.7
    print(
        f"  its correlation with the g of the run {np.corrcoef(g[clean], first[clean])[0, 1]:.2f}; "
        f"left out of it: {np.array(names)[~clean]}"
    )


if __name__ == "__main__":
    main()
