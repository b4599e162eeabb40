# SPDX-License-Identifier: GPL-3.0-or-later
"""The tangential and spin laws of the impact models beside a sphere on glass (Kharaz, Gorham & Salman 2001).

Every model is set to the sphere's R_n as far as it has one: what is compared is the form of its law. A model has the
law where R_T and ω come near for every angle; the table says where each departs, and why.
"""

import csv
from pathlib import Path

import numpy as np
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.registry import MODELS

TABLE = Path(__file__).parents[2] / "tests" / "data" / "kharaz2001.csv"
RADIUS_M, SPEED_MPS, MASS_KG = 0.0025, 3.9, 2.6e-4
RN, FRICTION = 0.98, 0.092
SMOOTH = {"rg70": 0.0, "rg20": 0.0, "rg10": 0.0, "rn_spread": 0.0, "block_shape": "sphere"}

SETTINGS = {
    "azimi_desvarreux_1977": ({"rn": RN}, "one R_T at every angle; rolls after every impact"),
    "bourrier_hungr": (
        {"half_speed": 191.0, "rt": 1.0, "friction_angle": float(np.degrees(np.arctan(FRICTION)))},
        "friction where it slides, 5/7 where it grips; no elastic springing back",
    ),
    "dorren_2015": (SMOOTH | {"rn": RN}, "one R_T, √(5/7) = 0.85; always rolls"),
    "noel_2017": ({"transfer": 0.0, "rt": 1.0}, "cube: 3/5 at every angle; grips whatever the friction"),
    "pfeiffer_bowen_1989": ({"rn": RN}, "R_T falls with the slip, here it rises; always rolls"),
    "stevens_1998": ({"rn": RN}, "as CRSP"),
    "wyllie_2014": ({"inertia": "sphere"}, "5/7 at every angle; grips whatever the friction"),
}


def measured(quantity: str) -> tuple[np.ndarray, np.ndarray]:
    """Incident angle from the normal [°] and the values."""
    lines = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = [(float(angle), float(value)) for name, angle, value, _ in csv.reader(lines) if name == quantity]
    angle, value = np.array(rows).T
    return angle, value


def computed(name: str, from_normal_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_T and ω [rad/s]."""
    angle, n = np.radians(from_normal_deg), from_normal_deg.size
    velocity = SPEED_MPS * np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
    up, still = np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros((n, 3))
    out = MODELS[name].rebound(
        Incident(velocity, up, still, np.full(n, RADIUS_M), np.full(n, MASS_KG)), SETTINGS[name][0]
    )
    return out.velocity[:, 0] / velocity[:, 0], out.angular_velocity[:, 1]


def main() -> None:
    """Print both laws, and how far each model is from them."""
    for quantity, which, form in (("R_T", 0, "{:7.2f}"), ("omega_out", 1, "{:7.0f}")):
        angle, values = measured(quantity)
        print(f"{quantity}, incident angle from the normal [°]")
        print(f"{'':<24}" + "".join(f"{each:7.0f}" for each in angle) + f"{'RMS error':>14}")
        print(f"{'measured':<24}" + "".join(form.format(each) for each in values))
        for name in SETTINGS:
            model = computed(name, angle)[which]
            error = np.sqrt(np.mean((model / values - 1) ** 2))
            print(f"{name:<24}" + "".join(form.format(each) for each in model) + f"{100 * error:>12.0f} %")
        print()
    for name, (_, why) in SETTINGS.items():
        print(f"{name:<24}{why}")


if __name__ == "__main__":
    main()
