# SPDX-License-Identifier: GPL-3.0-or-later
"""Rockyfor3D beside what Noël et al. 2018 say of it, which no reading of its random deviation gives altogether.

They find most of its apparent R_N above 1, and its deviation larger than that of the blocks. Neither the axis of the
turn nor the limit of its third class is printed.
"""

import csv
from pathlib import Path

import numpy as np
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.reconstruction.impact import Apparent, apparent

COUNT = 20_000
RADIUS, MASS = 0.175, 60.0
LEAST_DEG, SPEEDS_MPS, AZIMUTH_SD_DEG = 0.3, (5.0, 20.0), 25.0
"""Of the incident states: θ1 from that of the paper's most grazing impact on, blocks that roll about down the slope."""
ANGLES = (("even in θ1", 60.0, False), ("even in ln θ1", 60.0, True), ("even in θ1", 5.0, False))
DIPS_DEG = (30, 50)
AXES = ("normal", "vertical", "cone")
LIMITS_DEG = (45.0, 55.0, 180.0)
TRUTH = Path(__file__).parents[2] / "assets" / "demo" / "truth.csv"


def remarks() -> list[str]:
    """What is not reproduced, with numbers, as paragraphs and a table of Markdown."""
    rows, shares = [], []
    for words, most_deg, logarithmic in ANGLES:
        for dip in DIPS_DEG:
            state = _states(dip, most_deg, logarithmic)
            rows.append(_row(f"θ1 {LEAST_DEG:g}–{most_deg:g}°, {words}; slope {dip}°", state, "–"))
            limits = [_above_one(_rebound(state, {"deviation_limit": limit})) for limit in LIMITS_DEG]
            shares.append(max(limits) - min(limits))
    state, measured = _demo()
    rows.append(_row("those of the demo site", state, f"{_deviation(measured):.0f}°"))
    heads = ["incident states", *(f"R_N > 1, {axis}" for axis in AXES)]
    heads += ["deviation, without", *(axis for axis in AXES), "of the blocks"]
    return [
        "## Not reproduced: Rockyfor3D's random deviation",
        "Noël et al. 2018 find most of Rockyfor3D's apparent R_N above 1 and scattered, where those without the random "
        "deviation are as CRSP's, and more deviation than their blocks had. Neither what the deviation turns about nor "
        "the limit of its third class is printed. A turn about the normal leaves R_N as it is: the first statement "
        "rules it out. Of the others, a cone gives most above 1 where half of the impacts are below 5°; the vertical, "
        f"which is the default, only where all are and the slope is steep. The limit, {LIMITS_DEG[0]:.0f}° to "
        f"{LIMITS_DEG[-1]:.0f}°, changes the share by {100 * max(shares):.0f} % of the impacts at most and decides "
        "nothing. The second statement needs the paper's impacts, which are not published; on those of the demo site, "
        "made by another law, Rockyfor3D deviates less with any axis. The axis and the limit stay open, as parameters.",
        "\n".join(["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *rows]),
        f"Blocks that roll at {SPEEDS_MPS[0]:g} to {SPEEDS_MPS[1]:g} m/s within {AZIMUTH_SD_DEG:g}° (standard "
        f"deviation) of the fall line, {COUNT} draws a line; of the demo site each impact {COUNT // 100} times. "
        "Deviation: median angle between v1 and v2. A turn also sends blocks into the ground, whose R_N is that of the "
        "speeds.",
    ]


def _states(dip_deg: float, most_deg: float, logarithmic: bool) -> Incident:
    rng = np.random.default_rng(1)
    dip, share = np.radians(dip_deg), rng.random(COUNT)
    theta = LEAST_DEG * (most_deg / LEAST_DEG) ** share if logarithmic else LEAST_DEG + (most_deg - LEAST_DEG) * share
    theta, azimuth = np.radians(theta), np.radians(AZIMUTH_SD_DEG * rng.normal(size=COUNT))
    speed = rng.uniform(*SPEEDS_MPS, COUNT)
    normal, down = np.array([np.sin(dip), 0.0, np.cos(dip)]), np.array([np.cos(dip), 0.0, -np.sin(dip)])
    along = np.cos(azimuth)[:, None] * down + np.sin(azimuth)[:, None] * [0.0, 1.0, 0.0]
    velocity = speed[:, None] * (np.cos(theta)[:, None] * along - np.sin(theta)[:, None] * normal)
    spin = np.cross(normal, along) * (speed * np.cos(theta) / RADIUS)[:, None]
    return Incident(velocity, np.tile(normal, (COUNT, 1)), spin, np.full(COUNT, RADIUS), np.full(COUNT, MASS))


def _demo() -> tuple[Incident, Apparent]:
    """The impacts of the demo site as they were made, and their rebounds."""
    with TRUTH.open(encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row["v1x_mps"] and row["v2x_mps"]]

    def vectors(*columns: str) -> np.ndarray:
        return np.array([[float(row[column]) for column in columns] for row in rows])

    v1, v2, spin = (vectors(*(f"{name}{axis}_{unit}" for axis in "xyz"))
                    for name, unit in (("v1", "mps"), ("v2", "mps"), ("omega1", "radps")))  # fmt: skip
    normal, diameter = vectors("nx", "ny", "nz"), vectors("diameter_m")[:, 0]
    often = COUNT // 100
    state = Incident(*(np.repeat(one, often, axis=0) for one in (v1, normal, spin, diameter / 2, 0 * diameter + MASS)))
    return state, apparent(v1, v2, normal)


def _rebound(state: Incident, parameters: dict[str, object]) -> Apparent:
    out = MODELS["dorren_2015"].rebound(state, parameters, np.random.default_rng(2))
    return apparent(state.velocity, out.velocity, state.normal)


def _above_one(seen: Apparent) -> float:
    return float(np.mean(seen.rn > 1))


def _deviation(seen: Apparent) -> float:
    return float(np.degrees(np.nanmedian(seen.theta_dev)))


def _row(words: str, state: Incident, of_blocks: str) -> str:
    turned = [_rebound(state, {"deviation_axis": axis}) for axis in AXES]
    cells = [words, *(f"{100 * _above_one(seen):.0f} %" for seen in turned)]
    cells += [f"{_deviation(seen):.0f}°" for seen in (_rebound(state, {"deviation": "off"}), *turned)]
    return "| " + " | ".join([*cells, of_blocks]) + " |"
