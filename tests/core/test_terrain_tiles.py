# SPDX-License-Identifier: GPL-3.0-or-later
"""Several files of one terrain: clouds are meshed as one, other tiles are joined; every command takes them."""

import json

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.terrain.opening import HowToRead
from rockfall.core.terrain.raycast import cast_rays
from rockfall.core.terrain.readers import read_terrain, read_tile_points, read_tiles


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A slope of 40 × 20 m as one cloud, as two clouds cut at x = 20, and its western half as a grid."""
    folder = tmp_path_factory.mktemp("site")
    rng = np.random.default_rng(7)
    x, y = 2_600_000 + 40 * rng.random(4000), 1_200_000 + 20 * rng.random(4000)
    points = np.column_stack([x, y, 500 - 0.6 * (x - 2_600_000)])
    west = points[:, 0] < 2_600_020
    for name, part in (("whole", points), ("west", points[west]), ("east", points[~west])):
        np.savetxt(folder / f"{name}.xyz", part, fmt="%.4f")
    heights = 500 - 0.6 * (np.arange(11) * 2.0)
    head = "ncols 11\nnrows 11\nxllcenter 2600000\nyllcenter 1200000\ncellsize 2\n"
    (folder / "west.asc").write_text(head + (" ".join(f"{z:.3f}" for z in heights) + "\n") * 11)
    (folder / "releases.csv").write_text("x_m,y_m\n2600004,1200008\n2600005,1200012\n")
    return folder


def test_clouds_are_meshed_as_one_without_a_gap_between_them(site):
    whole = read_terrain(site / "whole.xyz")
    tiles = read_tiles([site / "west.xyz", site / "east.xyz"], HowToRead())
    assert len(tiles.faces) == len(whole.faces)
    assert len(tiles.vertices) == len(whole.vertices)
    assert tiles.name == "west.xyz, east.xyz"
    assert [line for line in tiles.summary if line.startswith(("west", "east"))] == [
        f"{name}.xyz: Cloud of {len(np.loadtxt(site / f'{name}.xyz')):,} points." for name in ("west", "east")
    ]
    places = np.column_stack([np.full(50, 2_600_020), np.linspace(1_200_001, 1_200_019, 50), np.full(50, 600)])
    hit = cast_rays(tiles, tiles.shift.to_local(places), (0, 0, -1))
    np.testing.assert_allclose(hit.distance, 600 - (500 - 0.6 * 20), atol=1e-3)


def test_a_cloud_and_a_grid_are_joined(site):
    joined = read_tiles([site / "west.asc", site / "east.xyz"], HowToRead())
    assert joined.summary[-1] == f"2 tiles are one surface of {len(joined.faces):,} faces."
    survey = joined.shift.to_survey(joined.vertices)
    np.testing.assert_allclose(survey[:, 2], 500 - 0.6 * (survey[:, 0] - 2_600_000), atol=1e-3)


def test_the_ground_filter_reaches_across_the_border(site):
    how = HowToRead(ground_filter_m=1.0)
    points = read_tile_points([site / "west.xyz", site / "east.xyz"], how)
    assert len(points.points) == 4000
    assert sum("cloth" in line for line in points.summary) == 1


def test_a_bad_tile_is_named(site, tmp_path):
    (tmp_path / "broken.xyz").write_text("1 2 3\n4 five 6\n")
    with pytest.raises(InputError, match="five") as refused:
        read_tiles([site / "west.xyz", tmp_path / "broken.xyz"], HowToRead())
    assert refused.value.file == tmp_path / "broken.xyz"
    assert refused.value.row == 2


@pytest.mark.parametrize("contact", ["mesh", "points"])
def test_a_simulation_on_two_tiles_is_that_on_the_whole(site, tmp_path, contact, capsys):
    ends = {}
    for name, files in (("whole", ["whole.xyz"]), ("tiles", ["west.xyz", "east.xyz"])):
        out = tmp_path / name
        argv = ["simulate", str(site / "releases.csv"), "--terrain", *(str(site / file) for file in files)]
        argv += ["--model", "noel_2017", "--diameter", "2.2", "--contact", contact, "--out", str(out)]
        assert main(argv) == 0, capsys.readouterr().err
        ends[name] = np.genfromtxt(out / "runs.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
        ends[name + " inputs"] = json.loads((out / "summary.json").read_text())["inputs"]
    assert ends["tiles"]["end"].tolist() == ends["whole"]["end"].tolist()
    np.testing.assert_allclose(ends["tiles"]["x_m"], ends["whole"]["x_m"], atol=0.05)
    assert (ends["tiles"]["x_m"] > 2_600_025).any(), "a block passes the border"
    assert [ends["tiles inputs"][f"terrain {i}"]["file"] for i in (1, 2)] == ["west.xyz", "east.xyz"]
    assert ends["whole inputs"]["terrain"]["file"] == "whole.xyz"


def test_a_table_that_was_taken_for_a_tile_is_said(site, tmp_path, capsys):
    argv = ["simulate", "--terrain", str(site / "whole.xyz"), str(site / "releases.csv"), "--model", "noel_2017"]
    assert main([*argv, "--out", str(tmp_path / "out")]) == 1
    assert "Write the table of releases before --terrain" in capsys.readouterr().err
