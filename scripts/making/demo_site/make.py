# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the demo site, ``assets/demo``: a synthetic gully, fifteen falling blocks, what was marked, and the truth.

Run ``python scripts/making/demo_site/make.py`` (about a minute). The same seed gives the same files.
"""

import argparse
import csv
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from making.demo_site import campaign, terrain
from rockfall.core.exchange.project import (
    BlockEntry,
    Project,
    ReconstructionSettings,
    RenderPreset,
    Site,
    TerrainSource,
    write_project,
)

SEED = 2017
SHIFT = (988_400.0, 6_375_600.0, 1_500.0)
OUT = Path(__file__).resolve().parents[3] / "assets" / "demo"

XYZ = ("x", "y", "z")
PICK_COLUMNS = (
    *("trajectory", "time_s", "x_m", "y_m", "z_m", "kind", "status", "sigma_time_s", "sigma_position_m"),
    *("frame", "note"),
)
TRUTH_COLUMNS = (
    *("trajectory", "impact", "time_s", "x_m", "y_m", "z_m"),
    *(f"contact_{axis}_m" for axis in XYZ),
    *(f"n{axis}" for axis in XYZ),
    *(f"v1{axis}_mps" for axis in XYZ),
    *(f"v2{axis}_mps" for axis in XYZ),
    *(f"omega1{axis}_radps" for axis in XYZ),
    *(f"omega2{axis}_radps" for axis in XYZ),
    *(f"effective_n{axis}" for axis in XYZ),
    *("contacts", "leave_time_s", "leave_x_m", "leave_y_m", "leave_z_m", "diameter_m", "status"),
)


def main() -> None:
    """Write the whole folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    field = campaign.Campaign(SEED)
    write_ply(field.terrain, folder / "terrain.ply")
    observed = [field.observed(block) for block in range(campaign.BLOCKS)]
    write_csv(folder / "picks.csv", PICK_COLUMNS, (row for one in observed for row in pick_rows(field, one)))
    write_csv(folder / "truth.csv", TRUTH_COLUMNS, (row for one in observed for row in truth_rows(field, one)))
    write_project(project(observed, folder), folder / "project.toml")
    print(f"{sum(len(one.impacts) for one in observed)} impacts of {len(observed)} blocks in {folder}")


def pick_rows(field: campaign.Campaign, observed: campaign.Observed) -> Iterable[list[str]]:
    """The rows of picks.csv of one block."""
    for pick in campaign.in_survey(field.picks(observed), field.terrain.line):
        place = [f"{value:.3f}" for value in pick.position]
        sigma_time = f"{campaign.SIGMA_TIME_S:.4f}" if pick.kind != "pass" else "0"
        sigmas = [sigma_time, f"{campaign.SIGMA_POSITION_M:g}"]
        yield [pick.trajectory, f"{pick.time:.6f}", *place, pick.kind, pick.status, *sigmas, str(pick.frame), pick.note]


def truth_rows(field: campaign.Campaign, observed: campaign.Observed) -> Iterable[list[str]]:
    """The rows of truth.csv of one block: the impacts that were seen, exactly."""
    line = field.terrain.line

    def place(point: np.ndarray) -> list[str]:
        return [f"{value:.6f}" for value in terrain.to_survey(point, line)]

    def vector(values: np.ndarray) -> list[str]:
        return [f"{value:.9f}" for value in terrain.turned(values, line)]

    for number, impact in enumerate(observed.impacts, 1):
        broken = observed.shattered and number == len(observed.impacts)
        after = [""] * 3 if broken else vector(impact.v2)
        spin = [""] * 3 if broken else vector(impact.omega2)
        yield [
            observed.name,
            str(number),
            f"{observed.start_s + impact.time:.9f}",
            *place(impact.centre),
            *place(impact.contact),
            *vector(impact.normal),
            *vector(impact.v1),
            *after,
            *vector(impact.omega1),
            *spin,
            *vector(impact.effective_normal),
            str(impact.contacts),
            f"{observed.start_s + impact.leave_time:.9f}",
            *place(impact.leave_centre),
            f"{observed.diameters.mean():.6f}",
            "shattered" if broken else "ok",
        ]


def write_csv(path: Path, header: Iterable[str], rows: Iterable[list[str]]) -> None:
    """A table with one header row and line feeds, on every system."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def write_ply(site: terrain.Terrain, path: Path) -> None:
    """Binary PLY with double coordinates: single precision would lose the survey's centimetres."""
    header = f"""ply
format binary_little_endian 1.0
comment Synthetic gully, made by a script; no real terrain
comment crs {terrain.CRS}
element vertex {len(site.survey)}
property double x
property double y
property double z
element face {len(site.faces)}
property list uchar int vertex_indices
end_header
"""
    faces = np.empty(len(site.faces), dtype=[("count", "u1"), ("index", "<i4", (3,))])
    faces["count"], faces["index"] = 3, site.faces
    path.write_bytes(header.encode("ascii") + site.survey.astype("<f8").tobytes() + faces.tobytes())


def project(observed: list[campaign.Observed], folder: Path) -> Project:
    """Everything that ``rockfall reconstruct`` and ``rockfall render`` need."""
    film = {"stagger_s": 0.25, "engine": "auto"}
    return Project(
        site=Site(
            "Synthetic gully", "Made by a script after the Riou Bourdoux gully of Noël et al. 2018; no real place"
        ),
        terrain=TerrainSource((folder / "terrain.ply",), SHIFT, terrain.CRS, up="z"),
        picks=folder / "picks.csv",
        block=BlockEntry(),
        blocks=tuple(BlockEntry(one.name, *one.diameters.tolist()) for one in observed),
        reconstruction=ReconstructionSettings(normal_radius_m=0.6),
        render=(
            RenderPreset("preview", 640, 360, 25.0, **film),
            RenderPreset("hd", 1920, 1080, 25.0, **film),
        ),
    )


if __name__ == "__main__":
    main()
