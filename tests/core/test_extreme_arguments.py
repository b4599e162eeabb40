# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds, laws and options at and beyond their ends: taken, or refused in words before anything is read."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.simulation_entry import read_simulation
from rockfall.core.exchange.toml_text import TomlTable
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.distributions import Distribution, parse_distribution
from rockfall.core.simulation.engine import Settings, check_settings
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.trees import random_trees
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

GREATEST = 2**63 - 1
VERTICES = np.array([[x, y, -0.6 * x] for y in (0.0, 50.0) for x in (0.0, 50.0)])
PLANE = Surface(VERTICES, np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane")
SEEDED = {
    "simulate": ["releases.csv", "--terrain", "terrain.ply", "--model", "noel_2017"],
    "compare": ["impacts.csv"],
    "explore": ["impacts.csv"],
    "calibrate": ["impacts.csv", "--model", "noel_2017", "--fit", "rn_limit"],
    "equivalent": ["impacts.csv", "--from", "noel_2017", "--model", "stevens_1998"],
    "statistics": ["impacts.csv"],
    "compare-runs": ["picks.csv", "--terrain", "terrain.ply"],
    "back-analyse": ["picks.csv", "--terrain", "terrain.ply", "--model", "noel_2017", "--fit", "rn_limit"],
    "design": ["project.toml"],
    "render": ["project.toml"],
    "web": ["project.toml"],
}  # fmt: skip


@pytest.mark.parametrize(
    "seed", [str(GREATEST + 1), str(2**64), "1" + "0" * 5000, "-1", "0.5"], ids=lambda text: text[:9]
)
@pytest.mark.parametrize("command", SEEDED)
def test_a_seed_that_is_too_large_is_refused_with_the_range(command, seed, tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")] if command != "explore" else []
    assert main([command, *SEEDED[command], f"--seed={seed}", *out]) == 2
    assert f"is not a whole number from 0 to {GREATEST} (2^63 - 1)" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_every_command_with_a_seed_is_here():
    from importlib import import_module

    from rockfall.core.cli import COMMANDS

    files = {
        name: Path(import_module(f"rockfall.core.commands.{name.replace('-', '_')}").__file__) for name in COMMANDS
    }
    having = {name for name, file in files.items() if '"--seed"' in file.read_text(encoding="utf-8")}
    assert having <= set(SEEDED)


def test_the_greatest_seed_gives_blocks_and_a_project_too(tmp_path, capsys):
    write_ply(PLANE, tmp_path / "terrain.ply")
    project = tmp_path / "project.toml"
    for seed, status in ((GREATEST, 0), (GREATEST + 1, 1), (2**64, 1)):
        project.write_text(
            f'schema = 1\n[terrain]\nfile = "terrain.ply"\n[simulation]\nmodels = ["noel_2017"]\nseed = {seed}\n'
            'record = []\n[simulation.releases]\nfrom = "points"\npoints_m = [[5.0, 20.0]]\nnumber = 3\n'
            'diameter_m = "0.3..0.5"\n'
        )
        assert main(["simulate", str(project), "--out", str(tmp_path / str(seed))]) == status
    assert f"from 0 to {GREATEST}" in capsys.readouterr().err
    runs = (tmp_path / str(GREATEST) / "runs.csv").read_text().splitlines()
    assert len(runs) == 4
    again = tmp_path / "again"
    project.write_text(project.read_text().replace(str(2**64), "1"))
    assert main(["simulate", str(project), "--seed", str(GREATEST), "--out", str(again)]) == 0
    assert (again / "runs.csv").read_text().splitlines() == runs


@pytest.mark.parametrize("seed", [-1, GREATEST + 1])
def test_settings_with_a_seed_out_of_range_are_refused(seed):
    with pytest.raises(InputError, match="The seed is out of range"):
        check_settings(make_ground(PLANE), Settings("noel_2017", seed=seed))


@pytest.mark.parametrize(
    ("law", "said"),
    [
        ("lognormal:0.5,1e6", "more than 100 times its mean"),
        ("lognormal:0.5,1e200", "more than 100 times its mean"),
        ("lognormal:0.5,40", "beyond what can be"),
        ("lognormal:1e-6,1e-6", "beyond what can be"),
        ("0.3..1e9", "beyond what can be"),
        ("1e-9..0.3", "beyond what can be"),
        ("1e-300", "beyond what can be"),
        ("1e300", "beyond what can be"),
        ("normal:1e5,1", "beyond what can be"),
    ],
)
def test_a_law_with_diameters_that_cannot_be_is_refused(law, said, tmp_path, capsys):
    with pytest.raises(InputError, match=said):
        Blocks("sphere", parse_distribution(law))
    write_ply(PLANE, tmp_path / "terrain.ply")
    (tmp_path / "releases.csv").write_text("x_m,y_m\n5,20\n")
    words = ["simulate", str(tmp_path / "releases.csv"), "--terrain", str(tmp_path / "terrain.ply")]
    assert main([*words, "--model", "noel_2017", "--diameter", law, "--out", str(tmp_path / "out")]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("law", ["0.01..20", "lognormal:0.5,0.5", "lognormal:0.5,5", "normal:0.5,0.1", "0.35"])
def test_a_law_of_blocks_is_taken(law):
    Blocks("sphere", parse_distribution(law))


def test_densities_have_limits_too():
    with pytest.raises(InputError, match=r"A density of 1e\+09 is 1e\+09, beyond"):
        Blocks("sphere", density=Distribution("fixed", 1e9))
    text = {"models": ["noel_2017"], "releases": {"from": "steep", "density_kgpm3": "lognormal:2600,1e9"}}
    with pytest.raises(InputError, match="more than 100 times its mean"):
        read_simulation(TomlTable(text, "simulation", Path("project.toml")))


def test_a_forest_of_diameters_without_limit_is_refused():
    with pytest.raises(InputError, match="standard deviation of the diameters is 10000 m"):
        random_trees(PLANE, 400, 0.3, 1e4, 0)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (["--stems-per-hectare", "400"], "--stems-per-hectare is of a forest that is drawn, which needs --dbh-cm"),
        (["--dbh-cm", "32"], "--dbh-cm is of a forest that is drawn, which needs --stems-per-hectare"),
        (["--trees-within", "wood.geojson"], "--trees-within is of a forest that is drawn, which needs --stems-per"),
        (["--tree-height", "5"], "--tree-height is of trees, and there are none. Give --trees, or --stems-per-hectare"),
        (["--species", "coniferous"], "--species is of trees, and there are none"),
        (["--until-known", "0.9"], "--screen"),
        (["--runs", "3-2"], "range"),
        (["--evenly"], "--from-line"),
        (["--spin", "zero"], "--from-impacts"),
    ],
)
def test_options_that_need_another_name_it(given, named, tmp_path, capsys):
    write_ply(PLANE, tmp_path / "terrain.ply")
    (tmp_path / "releases.csv").write_text("x_m,y_m\n5,20\n")
    words = ["simulate", str(tmp_path / "releases.csv"), "--terrain", str(tmp_path / "terrain.ply")]
    assert main([*words, "--model", "noel_2017", *given, "--out", str(tmp_path / "out")]) in (1, 2)
    assert named in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["align", "pairs.csv", "--size", "64x48", "--frames", "1", "5"], "--moving"),
        (["align", "pairs.csv", "--size", "64x48", "--unit", "ft"], "--terrain"),
        (["reconstruct", "picks.csv", "--max-edge", "3"], "--terrain"),
        (["compare", "impacts.csv", "--all-points"], "--terrain"),
        (["compare", "impacts.csv", "--drag"], "--terrain"),
        (["simulate", "project.toml", "--unit", "ft"], "[terrain]"),
        (["simulate", "project.toml", "--ground-filter"], "[terrain]"),
        (["simulate", "project.toml", "--spin", "zero"], "--spin is what a project says itself"),
        (["simulate", "project.toml", "--evenly"], "--evenly is what a project says itself"),
        (["compare-runs", "project.toml", "--up", "y"], "[terrain]"),
        (["back-analyse", "project.toml", "--model", "noel_2017", "--fit", "rn_limit", "--up", "z"], "[terrain]"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused_before_anything_is_read(words, named, tmp_path, capsys):
    assert main([*words, "--out", str(tmp_path / "out")]) == 1
    assert named in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["--from-polygon", "--screen"])
def test_a_name_with_half_a_character_is_refused_before_anything_falls(option, tmp_path, capsys):
    """JSON can say it, and no table, no page and no GeoPackage can have it."""
    write_ply(PLANE, tmp_path / "terrain.ply")
    kind, ring = ("Polygon", [[[3, 10], [8, 10], [8, 30], [3, 10]]]) if "polygon" in option else (
        "LineString", [[10, 0], [10, 50]]
    )  # fmt: skip
    geometry = {"type": kind, "coordinates": ring}
    feature = {"type": "Feature", "properties": {"name": "a\ud800b"}, "geometry": geometry}
    (tmp_path / "map.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    (tmp_path / "releases.csv").write_text("x_m,y_m\n5,20\n")
    source = [] if "polygon" in option else [str(tmp_path / "releases.csv")]
    words = ["simulate", *source, "--terrain", str(tmp_path / "terrain.ply"), "--model", "noel_2017"]
    assert main([*words, option, str(tmp_path / "map.geojson"), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert "map.geojson: " in said
    assert "Simulating" not in said
    assert "in Rockfall itself" not in said


def test_a_name_whose_bytes_are_no_text_is_refused_at_once(tmp_path, capsys):
    name = os.fsdecode(b"caf\xe9.csv") if os.name != "nt" else "caf\udce9.csv"
    assert main(["reconstruct", name, "--out", str(tmp_path / "out")]) == 1
    assert "bytes that are no characters" in capsys.readouterr().err
