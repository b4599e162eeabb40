# SPDX-License-Identifier: GPL-3.0-or-later
"""A reconstruction in a few sentences."""

import numpy as np

from ..vectors import Array, Names, norm
from .impact import FLAGS, Impacts
from .trajectory import Reconstruction

MEANINGS = {
    "first": "without incident velocity",
    "last": "without restituted velocity",
    "departing": "leave the ground before they touch it, no coefficients",
    "into_ground": "go on into the ground",
    "below_terrain": "beside a flight that passes under the terrain",
    "gap": "beside a gap (shattered or discarded)",
    "contact": "beside rolling or sliding",
}
"""What the flags say about impacts, for people."""
MOST_NOTES = 12
FEWEST_TRAJECTORIES = 8


def summarise(reconstruction: Reconstruction) -> tuple[str, ...]:
    """Sentences: what there is, what is typical, what deserves a look."""
    picks, flights, impacts = reconstruction.picks, reconstruction.flights, reconstruction.impacts
    take_offs = int((picks.kind[flights.last_pick] == "takeoff").sum())
    contacts = int(flights.is_contact.sum()) - take_offs
    slides = f" ({take_offs} with a take-off)" if take_offs else ""
    drag = " with air drag" if reconstruction.drag else ""
    sentences = [
        f"{_count(len(picks), 'pick')} of {_count(picks.group_starts.size, 'trajectory', 'trajectories')}: "
        f"{_count(int((~flights.is_contact).sum()), 'flight')}{drag}, {_count(contacts, 'contact segment')}, "
        f"{_count(len(impacts), 'impact')}{slides}, {int(np.isfinite(impacts.r).sum())} with R, "
        f"{int(impacts.complete.sum())} with all coefficients."
    ]
    sentences += _typical(impacts)
    radius = normal_radius_in_words(impacts)
    sentences += [radius] if radius else []
    flagged = [f"{name} {int(impacts.flags[name].sum())}" for name in FLAGS if impacts.flags[name].any()]
    if flagged:
        sentences.append(f"Flags: {', '.join(flagged)}.")
    for name in ("departing", "into_ground", "below_terrain"):
        sentences += _where(impacts, name)
    if len(impacts) and np.isnan(impacts.normal[:, 0]).any():
        bare = int(np.isnan(impacts.normal[:, 0]).sum())
        sentences.append(
            f"{_count(bare, 'impact')} without a terrain normal: velocities, R and deviation only. "
            "Give a terrain, or nx, ny, nz."
        )
    notes = reconstruction.remarks
    sentences += [remark.text for remark in notes[:MOST_NOTES]]
    if notes[MOST_NOTES:]:
        sentences.append(f"… and {len(notes) - MOST_NOTES} more.")
    return tuple(sentences)


def normal_radius_in_words(impacts: Impacts) -> str:
    """Over which radius the normals of the terrain were fitted, on which R_N, R_T and θ₁ depend; "" without any."""
    radii = impacts.normal_radius_m[np.isfinite(impacts.normal_radius_m)]
    if not radii.size:
        return ""
    low, high = f"{radii.min():.2f}", f"{radii.max():.2f}"
    if low == high:
        return f"The terrain normals are of a radius of {low} m; with another radius R_N, R_T and θ1 differ."
    return f"The terrain normals are of radii from {low} to {high} m; R_N, R_T and θ1 depend on the radius."


def _typical(impacts: Impacts) -> list[str]:
    values: tuple[tuple[str, Array, str, int], ...] = (
        ("incident speed", norm(impacts.v1), " m/s", 1),
        ("R_N", impacts.rn, "", 2),
        ("R_T", impacts.rt, "", 2),
        ("R", impacts.r, "", 2),
        ("θ1", np.degrees(impacts.theta1), "°", 1),
        ("deviation", np.degrees(impacts.theta_dev), "°", 1),
        ("bounce height", impacts.bounce_height_m, " m", 2),
    )
    parts, is_wide = [], False
    for name, column, unit, digits in values:
        if not np.isfinite(column).any():
            continue
        ends = median_interval(column, impacts.trajectory)
        is_wide |= ends is not None
        between = "" if ends is None else f" ({ends[0]:.{digits}f}–{ends[1]:.{digits}f})"
        parts.append(f"{name} {np.nanmedian(column):.{digits}f}{between}{unit}")
    if not parts:
        return []
    said = " (and 95 % intervals, over trajectories)" if is_wide else ""
    return [f"Medians{said}: {', '.join(parts)}."]


def median_interval(values: Array, trajectory: Names) -> tuple[float, float] | None:
    """95 % interval of a median, which takes into account that the impacts of a trajectory are not independent.

    Parameters
    ----------
    values, trajectory : (n,) NaN is left out.

    Returns
    -------
    Its two ends; None of fewer than `FEWEST_TRAJECTORIES`, of which it would be too narrow.

    Notes
    -----
    The values that a sign test does not refuse: with s the number of a trajectory's impacts above a value, less that
    below it, Σs/√Σs² follows Student's t of one less than the number of trajectories.
    """
    from scipy.special import stdtrit

    known = np.isfinite(values)
    _, group = np.unique(trajectory[known], return_inverse=True)
    groups = int(group.max(initial=-1)) + 1
    if groups < FEWEST_TRAJECTORIES:
        return None
    found, limit = values[known], float(stdtrit(groups - 1, 0.975))
    ascending = np.sort(found)

    def refused(place: int) -> bool:
        signs = np.bincount(group, np.sign(found - ascending[place]), minlength=groups)
        return bool(abs(signs.sum()) > limit * np.sqrt(max(float(signs @ signs), 1e-300)))

    middle = found.size // 2
    ends = []
    for outer in (0, found.size - 1):
        inside, outside = middle, outer
        if not refused(outer):
            inside = outside
        while abs(inside - outside) > 1:
            between = (inside + outside) // 2
            inside, outside = (inside, between) if refused(between) else (between, outside)
        ends.append(float(ascending[inside]))
    return ends[0], ends[1]


def _where(impacts: Impacts, flag: str) -> list[str]:
    rows = np.flatnonzero(impacts.flags[flag])
    if not rows.size:
        return []
    named = [f"{impacts.trajectory[i]} impact {impacts.impact[i]}" for i in rows[:8]]
    return [f"{MEANINGS[flag][:1].upper()}{MEANINGS[flag][1:]}: {', '.join(named)}{', …' if rows.size > 8 else ''}."]


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"
