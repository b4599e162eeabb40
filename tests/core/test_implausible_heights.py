# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights and places that cannot be: what is refused, what is said, and that real terrain passes in silence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core import cli
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.advice import of_heights
from rockfall.core.terrain.misplaced import unit_hint
from rockfall.core.terrain.readers import inspect_terrain, read_points, read_terrain
from rockfall.core.terrain.surface import Surface

ROOT = Path(__file__).parents[2]
CASES = ROOT / "tests" / "data" / "field_cases"
FOOT = 0.3048


def slope(angle_deg: float, width_m: float = 200.0, noise_m: float = 1.0) -> np.ndarray:
    """(n, 3) points of a slope with bumps."""
    rng = np.random.default_rng(3)
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0, width_m, 60), np.linspace(0, width_m, 60)))
    return np.column_stack([x, y, 1500 - np.tan(np.radians(angle_deg)) * x + noise_m * rng.normal(size=x.size)])


def written(path: Path, points: np.ndarray) -> Path:
    np.savetxt(path, points, fmt="%.4f")
    return path


def square(points: np.ndarray) -> Surface:
    """A surface with the box of some points, in survey coordinates far away."""
    low, high = points.min(axis=0), points.max(axis=0)
    corners = np.array([[low[0], low[1], high[2]], [high[0], low[1], low[2]], [low[0], high[1], high[2]], high])
    shift = GlobalShift(2600000.0, 1200000.0, 0.0)
    return Surface(corners, np.array([[0, 1, 2], [1, 3, 2]], np.int32), shift, "square", (), corners[:0], False, None)


@pytest.mark.parametrize("name", ["terrain.ply", "dem.tif"])
def test_a_terrain_that_can_be_is_read_in_silence(name):
    path = ROOT / "assets" / "demo" / name if name == "terrain.ply" else CASES / "11-release-outside" / name
    surface = read_terrain(path)
    assert of_heights(surface.vertices) == []
    said = [*surface.summary, *inspect_terrain(path).summary]
    assert not [one for one in said if "feet" in one or "taken as without" in one or "on the Earth" in one]


@pytest.mark.parametrize("name", ["las_chablais3.laz", "sample_lareunion_epsg2975.laz"])
def test_real_clouds_are_read_in_silence(name):
    assert of_heights(read_points(ROOT / "tests" / "data" / name).points) == []


@pytest.mark.parametrize("angle_deg", [20.0, 45.0, 55.0])
def test_slopes_that_are_steep_are_not_beyond_belief(angle_deg):
    assert of_heights(slope(angle_deg)) == []


def test_heights_in_feet_over_metres_are_steep_beyond_belief(tmp_path):
    points = slope(38.0) * [1, 1, 1 / FOOT]
    (said,) = of_heights(points)
    assert "steeper than 69° over 200 × 200 m" in said  # atan(tan 38° / 0.3048)
    assert "then it would be 38°" in said
    path = written(tmp_path / "feet.xyz", points)
    assert said in read_terrain(path).summary
    assert said in inspect_terrain(path).summary
    assert not [one for one in read_terrain(path, height_unit_m=FOOT).summary if "steeper" in one]
    assert of_heights(slope(75.0, 60.0)) == [], "a rock face that was scanned by itself"


@pytest.mark.parametrize(("height", "way", "what"), [(-5000.0, "below", "pits"), (9000.0, "above", "spikes")])
def test_a_few_heights_far_from_all_others_are_said(tmp_path, height, way, what):
    points = slope(30.0)
    points[[100, 900, 2000], 2] = height
    (said,) = of_heights(points)
    assert said.startswith("3 points lie ")
    assert f"m or more {way} all others" in said
    assert f"Such {what} are no ground" in said
    assert said in read_terrain(written(tmp_path / "a.xyz", points)).summary


def test_two_levels_of_a_terrain_are_no_pits():
    cliff = slope(10.0)
    cliff[: len(cliff) // 3, 2] += 400.0
    assert of_heights(cliff) == []


def test_heights_that_are_nowhere_on_the_earth(tmp_path):
    points = slope(30.0)
    with pytest.raises(InputError, match=r"a\.xyz: Heights from 5,129,\d+ to 5,129,5\d+ m are nowhere on the Earth"):
        read_terrain(written(tmp_path / "a.xyz", points + np.array([0, 0, 5128000])))
    with pytest.raises(InputError, match="nowhere on the Earth"):
        inspect_terrain(tmp_path / "a.xyz")
    assert np.isclose(read_terrain(tmp_path / "a.xyz", unit_m=0.001).bounds[1, 2], 5129.5, atol=0.5)
    for height in (12000.0, -3000.0):
        said = read_terrain(written(tmp_path / "b.xyz", points + np.array([0, 0, height]))).summary
        assert [one for one in said if "are not those of ground on the Earth" in one]


AT = np.array([[100.0, 100.0, 1440.0], [50.0, 60.0, 1470.0]])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p, ""),
        (lambda p: p + np.array([0, 0, 300.0]), ""),
        (lambda p: p * [1, 1, 1 / FOOT], "The heights look like feet"),
        (lambda p: p * [1, 1, FOOT], "The terrain's heights look like feet"),
        (lambda p: p / FOOT, "The coordinates look like feet"),
        (lambda p: p * [1 / FOOT, 1 / FOOT, 1], "The coordinates look like feet"),
        (lambda p: (p / FOOT)[:, :2], "The coordinates look like feet"),
        (lambda p: p * FOOT, "The terrain's coordinates look like feet"),
        (lambda p: p + np.array([5000.0, 0, 0]), ""),
        (lambda p: p * np.nan, ""),
    ],
)
def test_places_in_feet_are_told_from_places_elsewhere(change, said):
    terrain = square(slope(30.0))
    places = change(terrain.shift.to_survey(AT))
    local = places - terrain.shift.vector[: places.shape[1]]
    found = unit_hint(local, terrain)
    assert found.startswith(said)
    assert bool(found) == bool(said)


def grid(folder: Path) -> Path:
    """A slope of 38° in an ESRI grid."""
    rows = [" ".join(f"{1500 - 0.78 * 2 * x:.3f}" for x in range(60))] * 60
    header = "ncols 60\nnrows 60\nxllcorner 2600000\nyllcorner 1200000\ncellsize 2\n"
    (folder / "slope.asc").write_text(header + "\n".join(rows) + "\n")
    return folder / "slope.asc"


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (f"2600050,1200060,{1465 / FOOT}", "The heights look like feet"),
        (f"{2600050 / FOOT},{1200060 / FOOT},{1465 / FOOT}", "The coordinates look like feet"),
        (f"{2600050 / FOOT},{1200060 / FOOT},", "The coordinates look like feet"),
    ],
)
def test_releases_in_feet_are_refused(tmp_path, capsys, row, said):
    terrain = grid(tmp_path)
    (tmp_path / "releases.csv").write_text(f"x_m,y_m,z_m\n{row}\n")
    options = ["--terrain", str(terrain), "--model", "noel_2017", "--out", str(tmp_path / "out")]
    assert cli.main(["simulate", str(tmp_path / "releases.csv"), *options]) == 1
    assert said in capsys.readouterr().err.replace(str(tmp_path), "")


@pytest.mark.parametrize("what", ["--from-polygon", "--from-line", "--zones"])
def test_maps_in_feet_are_refused(tmp_path, capsys, what):
    terrain = grid(tmp_path)
    corners = [(2600050, 1200060), (2600070, 1200060), (2600070, 1200080)]
    rows = "".join(f"a,{x / FOOT},{y / FOOT},0.5\n" for x, y in corners)
    (tmp_path / "map.csv").write_text(f"name,x_m,y_m,friction\n{rows}")
    (tmp_path / "releases.csv").write_text("x_m,y_m\n2600050,1200060\n")
    options = ["--terrain", str(terrain), "--model", "noel_2017", "--out", str(tmp_path / "out"), what]
    first = [str(tmp_path / "releases.csv")] if what == "--zones" else []
    assert cli.main(["simulate", *first, *options, str(tmp_path / "map.csv")]) == 1
    assert "The coordinates look like feet" in capsys.readouterr().err.replace(str(tmp_path), "")


def test_picks_in_feet_are_named(tmp_path, capsys):
    terrain = grid(tmp_path)
    heights = [1500 - 0.78 * (x - 2600001) for x in (2600020, 2600040, 2600070)]
    rows = [
        f"A,{i},{x},1200050,{z / FOOT}"
        for i, (x, z) in enumerate(zip((2600020, 2600040, 2600070), heights, strict=True))
    ]
    (tmp_path / "picks.csv").write_text("trajectory,time_s,x_m,y_m,z_m\n" + "\n".join(rows) + "\n")
    options = ["--terrain", str(terrain), "--out", str(tmp_path / "out")]
    assert cli.main(["reconstruct", str(tmp_path / "picks.csv"), *options]) == 1
    assert "The heights look like feet" in capsys.readouterr().err.replace(str(tmp_path), "")


def test_a_camera_in_feet_is_said(tmp_path):
    from rockfall.core.camera.model import look_at
    from rockfall.core.camera.path import fixed
    from rockfall.core.exchange.cameras import write_camera
    from rockfall.core.workflow.opening import read_project_camera

    terrain = square(slope(30.0))
    camera = replace(look_at(1600, 900, (-150.0, 100.0, 1600.0), (100, 100, 1400), fov_deg=50.0), shift=terrain.shift)
    write_camera(tmp_path / "camera.toml", fixed(camera))
    assert read_project_camera(tmp_path / "camera.toml", terrain)[1] == ()
    text = (tmp_path / "camera.toml").read_text()
    (line,) = [row for row in text.splitlines() if row.startswith("position")]
    feet = f"position = [{2600000 - 150}, {1200000 + 100}, {(1600) / FOOT}]"
    (tmp_path / "camera.toml").write_text(text.replace(line, feet))
    (said,) = read_project_camera(tmp_path / "camera.toml", terrain)[1]
    assert said.startswith("The camera camera.toml is far from the terrain. The heights look like feet")


def test_pairs_whose_heights_are_in_feet_are_named(tmp_path, capsys):
    case = CASES / "10-nonsquare-camera"
    options = ["--size", "1920x1080", "--out", str(tmp_path / "out")]
    assert cli.main(["align", str(case / "ftz.csv"), *options]) == 1
    said = capsys.readouterr().err
    assert "With z_m in feet they fit to 0." in said
    assert "Multiply z_m by 0.3048" in said
