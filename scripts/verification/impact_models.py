# SPDX-License-Identifier: GPL-3.0-or-later
"""Every impact model against its equations, written again in plain numbers, and against what is published of it.

The second computation of each model works with speeds along and across the ground instead of vectors, on incident
states whose spin is about the horizontal axis across the motion, so that it shares neither code nor form.
"""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rockyfor3d
from checks import Check, compared
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.reconstruction.impact import apparent
from scipy.stats import kstest, norm, uniform

TITLE = "Impact models"
SUMMARY = "every model computed a second time, its chance, and what is published of it"
INTRODUCTION = (
    "Each model's equations with their sources stand in its module (`core/impact_models`), with what could not be "
    "checked against the primary text. Here each is computed a second time in another form, on 400 incident states; "
    "what is drawn by chance is tested for its distribution; and some results are set beside published ones."
)
COUNT = 400
CHANCE = 20_000
RADIUS, MASS = 0.175, 60.0


def checks() -> list[Check]:
    """All of this chapter."""
    return [*_formulas(), *_vectors(), *_chance(), *_published()]


def remarks() -> list[str]:
    """What is published and not reproduced."""
    return rockyfor3d.remarks()


def _states(count: int = COUNT) -> tuple[Incident, np.ndarray, np.ndarray, np.ndarray]:
    """Incident states, and their approach speeds, tangential speeds and forward spins."""
    rng = np.random.default_rng(1)
    angle = np.radians(90 * rng.random(count) ** 2)
    speed = rng.uniform(0.5, 30, count)
    normal_speed, along = speed * np.sin(angle), speed * np.cos(angle)
    spin = rng.uniform(-20, 120, count)
    n = rng.normal(size=(count, 3))
    n[:, 2] = np.abs(n[:, 2]) + 0.3
    n /= np.linalg.norm(n, axis=1)[:, None]
    t = rng.normal(size=(count, 3))
    t -= np.einsum("ni,ni->n", t, n)[:, None] * n
    t /= np.linalg.norm(t, axis=1)[:, None]
    state = Incident(
        along[:, None] * t - normal_speed[:, None] * n,
        n,
        spin[:, None] * np.cross(n, t),
        np.full(count, RADIUS),
        np.full(count, MASS),
    )
    return state, normal_speed, along, spin


Plane = Callable[[float, float, float], tuple[float, float, float]]
"""Approach speed, tangential speed, forward spin → the same after the impact, spin about the same axis."""


def azimi(vn: float, vt: float, w: float) -> tuple[float, float, float]:
    return 0.35 * vn, 0.85 * vt, 0.85 * vt / RADIUS


def crsp(vn: float, vt: float, w: float) -> tuple[float, float, float]:
    """Pfeiffer & Bowen 1989 in feet, as it was published."""
    foot, rn, rt = 0.3048, 0.35, 0.85
    friction = rt + (1 - rt) / (((vt - w * RADIUS) / foot / 20) ** 2 + 1.2)
    scaling = rt / ((vn / foot / 250 / rn) ** 2 + 1)
    energy = 0.5 * 0.4 * MASS * RADIUS**2 * w**2 + 0.5 * MASS * vt**2
    after = math.sqrt(2 * energy * friction * scaling / (0.4 * MASS + MASS))
    return vn * rn / (1 + (vn / foot / 30) ** 2), after, after / RADIUS


def dorren(vn: float, vt: float, w: float) -> tuple[float, float, float]:
    """Its mean: R_n = 0.43, obstacles of 0.7·0 + 0.2·0.05 + 0.1·0.10 m, a cuboid, no deviation."""
    rt = 1 / (1 + 0.02 / RADIUS)
    energy = 0.5 * (2 / 3) * MASS * RADIUS**2 * w**2 + 0.5 * MASS * vt**2
    after = math.sqrt(2 * energy * rt / (5 / 3 * MASS))
    return 0.43 * vn / (1 + (vn / 9) ** 2), after, after / RADIUS


def gripped(vt: float, w: float, q: float) -> tuple[float, float]:
    """A contact that grips: the impulse that leaves no slip, from the balance of momentum and spin."""
    impulse = (RADIUS * w - vt) / (1 + q)  # per mass, along the motion
    return vt + impulse, w - q / RADIUS * impulse


def noel(vn: float, vt: float, w: float) -> tuple[float, float, float]:
    theta = math.degrees(math.atan2(vn, vt))
    rn = 2.0 if theta <= 4 else min(2.0, 10 * (theta - 4) ** -1.08 + 0.08)
    grip, spin = gripped(vt, w, 1.5)
    along = 0.69 * grip
    if rn > 1:
        gain = min((rn**2 - 1) * vn**2, (1 - 0.8**2) * along**2)
        return math.sqrt(vn**2 + gain), math.copysign(math.sqrt(along**2 - gain), along), spin
    return rn * vn, along, spin


def wyllie(vn: float, vt: float, w: float) -> tuple[float, float, float]:
    theta = max(math.degrees(math.atan2(vn, vt)), 0.1)
    return 19.5 * theta**-1.03 * vn, *gripped(vt, w, 1.5)


def bourrier(vn: float, vt: float, w: float) -> tuple[float, float, float]:
    rn, rt, slope = 10 / (10 + vn), 0.9, math.tan(math.radians(20))
    slip = vt - w * RADIUS
    if 2 / 7 * rt * abs(slip) <= slope * (1 + rn) * vn:  # grips: 5/7 and 2/7
        along = rt * (5 * vt + 2 * RADIUS * w) / 7
        return rn * vn, along, along / RADIUS
    push = math.copysign(slope * (1 + rn) * vn, slip)
    return rn * vn, rt * vt - push, rt * w + 2.5 * push / RADIUS


SECOND: dict[str, tuple[Plane, dict[str, object], str]] = {
    "azimi_desvarreux_1977": (azimi, {}, "constant coefficients"),
    "dorren_2015": (dorren, {}, "energy balance of Rockyfor3D"),
    "noel_2017": (noel, {}, "the poster's equations"),
    "pfeiffer_bowen_1989": (crsp, {}, "energy balance of CRSP, in feet"),
    "stevens_1998": (crsp, {}, "that of CRSP, with its means"),
    "wyllie_2014": (wyllie, {}, "the power law; balance of momentum"),
    "bourrier_hungr": (bourrier, {}, "sticking and sliding, each by itself"),
}


def _formulas() -> list[Check]:
    state, vn, vt, w = _states()
    t = np.cross(np.cross(state.normal, state.velocity), state.normal)
    t /= np.linalg.norm(t, axis=1)[:, None]
    axis = np.cross(state.normal, t)
    found = []
    for name, (second, parameters, words) in SECOND.items():
        out = MODELS[name].rebound(state, parameters)
        other = np.array([second(*row) for row in zip(vn.tolist(), vt.tolist(), w.tolist(), strict=True)])
        velocity = other[:, :1] * state.normal + other[:, 1:2] * t
        title = MODELS[name].title
        found += [
            compared(f"{title}: v2", words, "independent", out.velocity, velocity, 1e-9, "m/s"),
            compared(f"{title}: ω2", words, "independent", out.angular_velocity, other[:, 2:] * axis, 1e-7, "rad/s"),
        ]
    return found


def _vectors() -> list[Check]:
    """The table of worked vectors, which another program wrote from the equations."""
    path = Path(__file__).parents[2] / "tests" / "data" / "impact_model_vectors.csv"
    with path.open(encoding="utf-8") as stream:
        rows = [
            row for row in csv.DictReader(stream) if row["case"] in ("azimi_velocity", "crsp", "noel", "wyllie_cube")
        ]
    names = {"azimi_velocity": "azimi_desvarreux_1977", "crsp": "pfeiffer_bowen_1989", "noel": "noel_2017",
             "wyllie_cube": "wyllie_2014"}  # fmt: skip
    dip = math.radians(40)
    incident = {
        "A": ((0, 0, 1), (8, 0, -6), (0, 0, 0)),
        "B": ((0, 0, 1), (8, 0, -6), (0, 40, 0)),
        "C": ((math.sin(dip), 0, math.cos(dip)), (7, 0, -9), (0, 30, 0)),
        "E": ((0, 0, 1), (12, 0, -0.5), (0, 60, 0)),
    }
    found, expected = [], []
    for row in rows:
        n, v, w = (np.array([each], dtype=float) for each in incident[row["incident"]])
        out = MODELS[names[row["case"]]].rebound(Incident(v, n, w, np.array([RADIUS]), np.array([MASS])))
        seen = apparent(v, out.velocity, n)
        found.append([*out.velocity[0], seen.rn[0], seen.rt[0], seen.r[0], math.degrees(seen.theta_dev[0])])
        columns = ("v2x_mps", "v2y_mps", "v2z_mps", "rn", "rt", "r", "theta_dev_deg")
        expected.append([float(row[column]) for column in columns])
    return [
        compared("v2, R_N, R_T, R, θ_dev of four impacts, four models", "tests/data/impact_model_vectors.csv",
                 "independent", found, expected, 1e-5, "1")
    ]  # fmt: skip


def _drawn(name: str, parameters: dict[str, object], incident: Incident) -> np.ndarray:
    rng = np.random.default_rng(7)
    return MODELS[name].rebound(incident, parameters, rng).velocity


def _chance() -> list[Check]:
    """Random parts: Kolmogorov–Smirnov's distance from the stated distribution, with its bound at one in a million."""
    n = np.tile([0.0, 0.0, 1.0], (CHANCE, 1))
    v = np.tile([6.0, 0.0, -6.0], (CHANCE, 1))
    state = Incident(v, n, np.zeros((CHANCE, 3)), np.full(CHANCE, RADIUS), np.full(CHANCE, MASS))
    bound = 2.69 / math.sqrt(CHANCE)
    rows = []

    def distance(what: str, against: str, values: np.ndarray, law: object) -> None:
        rows.append(
            Check(what, against, "printed", float(kstest(values, law.cdf).statistic), bound, CHANCE, "of probability")  # type: ignore[attr-defined]
        )

    scaled = 1 + (6 / 9.144) ** 2
    stevens = _drawn("stevens_1998", {}, state)
    distance("RocFall: R_n drawn", "N(0.35, 0.04), Noël et al. 2018", stevens[:, 2] / 6 * scaled, norm(0.35, 0.04))
    rocky = _drawn("dorren_2015", {"deviation": "off"}, state)
    distance(
        "Rockyfor3D: R_n drawn", "0.43 ± 10 %, uniform", rocky[:, 2] / 6 * (1 + (6 / 9) ** 2), uniform(0.387, 0.086)
    )
    noel_2017 = _drawn("noel_2017", {}, state)
    theta = 45.0
    exponent = np.log((noel_2017[:, 2] / 6 - 0.08) / 10) / math.log(theta - 4)
    sd = 0.15 * (1 - theta / 100)
    distance("Noël 2017: exponent of R_N at 45°", "N(−1.08, 0.15 (1 − θ1/100)), the poster", exponent, norm(-1.08, sd))
    factor = noel_2017[:, 0] / (0.6 * 6)
    below = factor < 1
    rows.append(
        compared("Noël 2017: share of R_T at its limit of 1", "1 − Φ((1 − 0.69)/0.13)", "closed form",
                 np.mean(~below), norm.sf((1 - 0.69) / 0.13), 0.004, "1")
    )  # fmt: skip
    distance("Noël 2017: R_T below its limit", "N(0.69, 0.13), the poster", np.where(below, factor, 2.0),
             _Censored(norm(0.69, 0.13)))  # fmt: skip
    return rows


class _Censored:
    """A distribution below 1; all above is one atom far out."""

    def __init__(self, law: object) -> None:
        self.law = law

    def cdf(self, x: np.ndarray) -> np.ndarray:
        below = np.minimum(np.asarray(x, dtype=float), 1.0)
        return np.where(np.asarray(x) >= 2.0, 1.0, self.law.cdf(below))  # type: ignore[attr-defined]


def _published() -> list[Check]:
    """Statements of Noël et al. 2018 and a law of friction from the laboratory."""
    state, *_ = _states(4000)
    energies = {}
    for name, factor in (("noel_2017", 2 / 3), ("pfeiffer_bowen_1989", 2 / 5), ("dorren_2015", 2 / 3)):
        out = MODELS[name].rebound(state, {}, np.random.default_rng(3))

        def energy(v: np.ndarray, w: np.ndarray, c: float = factor) -> np.ndarray:
            return 0.5 * ((v**2).sum(axis=1) + c * RADIUS**2 * (w**2).sum(axis=1))

        before = energy(state.velocity, state.angular_velocity)
        energies[name] = float(np.max(energy(out.velocity, out.angular_velocity) / before - 1))
    azimi_rn = apparent(state.velocity, MODELS["azimi_desvarreux_1977"].rebound(state).velocity, state.normal).rn
    grazing = np.array([13.109, 8.609])
    v = np.stack([np.cos(np.radians(grazing)), 0 * grazing, -np.sin(np.radians(grazing))], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    still = Incident(v, up, np.zeros((2, 3)), np.full(2, RADIUS), np.full(2, MASS))
    noel_rn = apparent(v, MODELS["noel_2017"].rebound(still, {"transfer": 1.0}).velocity, up).rn
    rows = [
        compared("Azimi: R_N at any angle and speed", "constant, 0.35 (Noël et al. 2018)", "printed", azimi_rn, 0.35,
                 1e-9, "1"),
        compared("Noël 2017: R_N at 13.109° and 8.609°", "1 and 2, from the poster's law", "closed form", noel_rn,
                 [1.0, 2.0], 2e-4, "1"),
    ]  # fmt: skip
    for name, gain in energies.items():
        rows.append(
            Check(
                f"{MODELS[name].title}: greatest gain of energy with spin",
                "none",
                "printed",
                max(gain, 0.0),
                1e-12,
                4000,
            )
        )
    rows.append(_kharaz())
    return rows


def _kharaz() -> Check:
    """A sphere on glass (Kharaz, Gorham & Salman 2001), of which friction alone decides while it slides."""
    path = Path(__file__).parents[2] / "tests" / "data" / "kharaz2001.csv"
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = [(float(angle), float(value)) for quantity, angle, value, _ in csv.reader(lines) if quantity == "R_T"]
    sliding = np.array([row for row in rows if row[0] >= 39.0])
    angle = np.radians(sliding[:, 0])
    n = np.tile([0.0, 0.0, 1.0], (len(angle), 1))
    v = 3.9 * np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
    radius = np.full(len(angle), 0.0025)
    state = Incident(v, n, np.zeros((len(angle), 3)), radius, np.full(len(angle), 2.6e-4))
    parameters = {"half_speed": 191.0, "rt": 1.0, "friction_angle": math.degrees(math.atan(0.092))}
    seen = apparent(v, MODELS["bourrier_hungr"].rebound(state, parameters).velocity, n)
    return compared("Friction-limited rebound: R_T of a sphere that slides on glass, 39–60° from the normal",
                    "Kharaz, Gorham & Salman 2001", "measured", seen.rt, sliding[:, 1], 0.03, "1")  # fmt: skip
