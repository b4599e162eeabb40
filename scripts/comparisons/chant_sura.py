# SPDX-License-Identifier: GPL-3.0-or-later
"""Eq. 6 of Noël et al. 2018 against an instrumented block: four impacts at Chant Sura (Lu et al. 2019, table 2).

Prints the differences as picked, and with the flights started later and further along by a contact of given duration
that covers the scar.
"""

import csv
from pathlib import Path

import numpy as np
from rockfall.core.exchange.tables import read_picks
from rockfall.core.reconstruction.free_flight import incident_velocity, restituted_velocity
from rockfall.core.reconstruction.picks import Picks
from rockfall.core.vectors import Array, norm, unit

EXAMPLE = Path(__file__).parents[2] / "assets" / "examples" / "chant_sura_lu2019"
GRAVITY_MPS2 = 9.81
CONTACTS_S = (0.0, 0.1, 0.2)


def read_instrument() -> tuple[Array, Array]:
    """Velocities just before the impacts (4, 3) [m/s] and scar lengths (4,) [m]."""
    with (EXAMPLE / "instrument.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    velocity = np.array([[float(row[f"v{axis}_mps"]) for axis in "xyz"] for row in rows])
    return velocity, np.array([float(row["scar_length_m"]) for row in rows])


def incident_after_contact(picks: Picks, contact_s: float, path_m: Array) -> Array:
    """Incident velocities (n − 1, 3) when each flight starts `contact_s` later and `path_m` further on."""
    displacement = np.diff(picks.position, axis=0)
    displacement = displacement - unit(displacement) * path_m[:, None]
    duration = np.diff(picks.time_s) - contact_s
    start = restituted_velocity(displacement, duration, GRAVITY_MPS2)
    return incident_velocity(start, duration, GRAVITY_MPS2)


def main() -> None:
    """Print the comparison."""
    picks = read_picks(EXAMPLE / "picks.csv")
    measured, scar = read_instrument()
    measured = measured[1:]
    for contact in CONTACTS_S:
        velocity = incident_after_contact(picks, contact, scar[:-1] if contact else np.zeros(3))
        print(f"contact of {contact:.1f} s along the scar:" if contact else "eq. 6 as picked:")
        ours, theirs, difference = norm(velocity), norm(measured), velocity - measured
        level = norm(velocity[:, :2]) - norm(measured[:, :2])
        for i in range(3):
            speeds = f"{ours[i]:.2f} m/s, instrument {theirs[i]:.2f} m/s, ratio {ours[i] / theirs[i]:.3f}"
            print(f"  impact {i + 2}: {speeds}, horizontal {level[i]:+.2f} m/s, vertical {difference[i, 2]:+.2f} m/s")
        print(f"  root mean square of the velocity difference {np.sqrt(np.mean(norm(difference) ** 2)):.2f} m/s")


if __name__ == "__main__":
    main()
