# SPDX-License-Identifier: GPL-3.0-or-later
"""A project, options, and observed runs of the same content let the same blocks fall, to the bit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import _parser
from rockfall.core.commands.observed_run_options import case_as_asked
from rockfall.core.commands.progress import PrintedProgress
from rockfall.core.commands.simulation_work import work_as_asked
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import Simulation
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply
from rockfall.core.workflow.simulation import run_models

EAST, NORTH = 2_600_000.0, 1_200_000.0
MOTION = ["--rolling", "coulomb", "--friction", "0.4", "--drag", "--seed", "7"]
FOREST = ["--stems-per-hectare", "300", "--dbh-cm", "30,8"]
STATED = """schema = 1
[terrain]
file = "slope.ply"
[block]
d1_m = {diameter}
d2_m = {diameter}
d3_m = {diameter}
[models.noel_2017]
rn_limit = 0.7
[simulation]
models = ["noel_2017", "stevens_1998"]
contact = "{contact}"
rolling = "coulomb"
friction = 0.4
drag = true
seed = 7
[simulation.releases]
from = "table"
file = "releases.csv"
number = 3
[simulation.trees]
stems_per_hectare = 300
dbh_cm = 30
dbh_sd_cm = 8
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    line = np.arange(0.0, 81.0)
    x, y = np.meshgrid(line, line)
    z = 500 - 0.8 * np.minimum(x, 50) + 0.2 * np.sin(x / 2) * np.cos(y / 3)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices, faces = np.column_stack([x.ravel(), y.ravel(), z.ravel()]), np.concatenate([lower, upper])
    write_ply(Surface(vertices, faces.astype(np.int32), GlobalShift(EAST, NORTH, 0.0), "slope"), folder / "slope.ply")
    rows = [f"R{i},{EAST + 5},{NORTH + 20 + 10 * i},3" for i in range(4)]
    (folder / "releases.csv").write_text("release,x_m,y_m,vx_mps\n" + "\n".join(rows) + "\n", encoding="utf-8")
    stops = [f"R{i},{EAST + 60},{NORTH + 20 + 10 * i}" for i in range(4)]
    (folder / "stops.csv").write_text("release,x_m,y_m\n" + "\n".join(stops) + "\n", encoding="utf-8")
    return folder


def of_simulate(*argv: str) -> tuple[Simulation, ...]:
    full = ["simulate", *argv, "--out", "nowhere"]
    work = work_as_asked(_parser(full).parse_args(full), PrintedProgress())
    return run_models(work.ground, work.releases, work.scenario.settings)


def asked(site: Path) -> list[str]:
    return [
        str(site / "releases.csv"), "--terrain", str(site / "slope.ply"), "--model", "noel_2017", "--model",
        "stevens_1998", "--set", "noel_2017.rn_limit=0.7", "--number", "3", *MOTION, *FOREST,
    ]  # fmt: skip


def same(one: tuple[Simulation, ...], other: tuple[Simulation, ...]) -> None:
    for a, b in zip(one, other, strict=True):
        assert replace(a.settings, trees=None) == replace(b.settings, trees=None)
        assert a.settings.trees is not None
        assert b.settings.trees is not None
        np.testing.assert_array_equal(a.settings.trees.position, b.settings.trees.position)
        assert len(a) == len(b) == 12
        for name in ("position", "time_s", "v_max_mps"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        np.testing.assert_array_equal(a.records.position, b.records.position)


@pytest.mark.parametrize(("contact", "diameter"), [("mesh", 0.5), ("points", 7.0)])
def test_a_project_and_options_let_the_same_blocks_fall(site: Path, contact: str, diameter: float) -> None:
    project = site / f"{contact}.toml"
    project.write_text(STATED.format(contact=contact, diameter=diameter), encoding="utf-8")
    of_options = of_simulate(*asked(site), "--contact", contact, "--diameter", str(diameter))
    same(of_simulate(str(project)), of_options)


def test_observed_runs_are_simulated_alike(site: Path) -> None:
    project = site / "mesh.toml"
    project.write_text(STATED.format(contact="mesh", diameter=0.5), encoding="utf-8")
    argv = ["compare-runs", *asked(site), "--diameter", "0.5", "--stops", str(site / "stops.csv"), "--out", "nowhere"]
    case = case_as_asked(_parser(argv).parse_args(argv), ["noel_2017", "stevens_1998"], 3, PrintedProgress())
    of_runs = run_models(case.ground, case.scenario.releases(case.ground), case.scenario.settings)
    same(of_simulate(str(project)), of_runs)
