# SPDX-License-Identifier: GPL-3.0-or-later
"""What `rockfall simulate` refuses: what is wrong and what to do is said, and nothing is written."""

from pathlib import Path

import pytest
from rockfall.core.cli import main

EAST, NORTH = 2_600_000.0, 1_200_000.0
CORNERS = ((0, 0), (100, 0), (100, 60), (0, 60))
SQUARE = ((-5, -5), (150, -5), (150, 150), (-5, 150))
SCREEN = "name,x_m,y_m,height_m,capacity_kJ"


def rows(head: str, places: tuple[tuple[float, float], ...], name: str = "", more: str = "") -> str:
    return "\n".join([head, *(f"{name},{EAST + x},{NORTH + y}{more}" for x, y in places)]) + "\n"


def shape(places: tuple[tuple[float, float], ...], name: str = "a") -> str:
    return rows("name,x_m,y_m,friction", places, name, ",0.4")


def screen(x: float, more: str) -> str:
    return rows(SCREEN, ((x, 5), (x, 55)), "net", more)


def tree(more: str, head: str = "") -> str:
    return f"x_m,y_m,dbh_cm,height_m{head}\n{EAST + 20},{NORTH + 30},{more}\n"


FILES = {
    "slope.obj": "".join(f"v {EAST + x} {NORTH + y} {500 - 0.7 * x}\n" for x, y in CORNERS) + "f 1 2 3\nf 1 3 4\n",
    "r.csv": f"release,x_m,y_m,z_m,diameter_m,number\na,{EAST + 10},{NORTH + 30},,0.4,2\n",
    "net.csv": screen(50, ",,"), "no_height.csv": screen(50, ",0,900"), "no_net.csv": screen(50, ",,900"),
    "weak.csv": screen(50, ",4,-1"), "beside.csv": screen(5000, ",4,900"),
    "dot.csv": rows(SCREEN, ((50, 5), (50, 5)), "net", ",4,900"),
    "all.csv": shape(SQUARE), "rest.csv": shape(SQUARE, "terrain"), "nameless.csv": shape(SQUARE, ""),
    "bow.csv": shape(((5, 5), (50, 50), (50, 5), (5, 50)), "bow"),
    "flat.csv": shape(((5, 5), (10, 10), (50, 50)), "flat"),
    "far.csv": shape(((5000, 5), (5050, 5), (5050, 50)), "far"),
    "far_line.csv": rows("name,x_m,y_m", ((1000, 5), (1000, 50)), "l"),
    "point.csv": rows("name,x_m,y_m", ((10, 5), (10, 5)), "l"),
    "line.csv": rows("name,x_m,y_m", ((10, 5), (10, 50)), "l"),
    "thick.csv": tree("3000,20"), "low.csv": tree("30,-20"), "palm.csv": tree("30,20,palm", ",species"),
    "far_tree.csv": f"x_m,y_m,dbh_cm,height_m\n{EAST + 2000},{NORTH + 30},30,20\n",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plane slope of 35°, 100 m by 60 m, and what is to be on it."""
    place = tmp_path_factory.mktemp("slope")
    for name, text in FILES.items():
        (place / name).write_text(text, encoding="utf-8")
    return place


def refused(folder: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> str:
    """What is said in the end, without the folder's name."""
    capsys.readouterr()
    words = [word.replace("@", f"{folder}/") for word in words]
    assert main(["simulate", *words, "--out", str(folder / "out")]) == 1
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    return capsys.readouterr().err.strip().split("\n")[-1].replace(f"{folder}/", "@")


ON = ["--terrain", "@slope.obj", "--model", "noel_2017"]
SCREENED = ["--screen", "@net.csv"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--until-known", "0.05"], "--until-known is known nowhere. Give --screen: a line, or the closed outline"),
        (["--workers", "2", "--scheduler", "tcp://x:1"], "--workers are started here, and --scheduler has its own"),
        (["--workers", "0"], "--workers 0 compute nothing. Give at least one"),
        (["--workers", "2", "--threads", "2"], "--threads is of one process, and each worker has its own. Leave out"),
        (["--workers", "2", "--until-known", "0.1", *SCREENED], "--until-known is of one process, and workers do not"),
        (["--runs", "1-99"], "--runs asks for run 99 of 2. Choose among these"),
        (["--structure", "net=@slope.obj", *SCREENED], "@net.csv: 'net' is a screen and a structure. Give each a name"),
        (["--structure", "wall"], "--structure wall names no file. Write NAME=FILE"),
        (["--structure", "a=@slope.obj", "--structure", "a=@slope.obj"], "--structure a is given twice. Give each"),
        ([*SCREENED, *SCREENED], "@net.csv and @net.csv: There are two screens 'net'. Give each a name of its own"),
        (["--screen", "@beside.csv"], "@beside.csv: Screen 'net' is beside the terrain. Draw it across the slope"),
        (["--screen", "@dot.csv"], "@dot.csv: Screen 'net' is no line in plan. Draw it through two or more different"),
        (["--screen", "@no_height.csv"], "@no_height.csv: Screen 'net' is 0 m high. Give a height above zero, or none"),
        (["--screen", "@no_net.csv"], "@no_net.csv: Barrier 'net' has a capacity and no height. Give it height_m"),
        (["--screen", "@weak.csv"], "@weak.csv: The capacity of barrier 'net' is -1 kJ. Give kJ above zero"),
        (["--zones", "@rest.csv"], "@rest.csv: A zone is called 'terrain', as the rest of the ground is. Give"),
        (["--zones", "@nameless.csv"], "@nameless.csv: A zone has no name. Name each"),
        (["--zones", "@far.csv"], "@far.csv: The zone far (feature 1) is wholly outside of the terrain. Check its"),
        (["--zones", "@bow.csv"], "@bow.csv: The polygon bow crosses itself. Give the corners in their order"),
        (["--zones", "@flat.csv"], "@flat.csv: The polygon flat has no area: its corners are on a line. Give corners"),
        (["--contact", "points", "--max-edge", "2"], "--max-edge is of a mesh, and --contact points makes none. Leave"),
        (["--trees", "@thick.csv"], "@thick.csv, row 2: This tree is 30 m thick. dbh_cm is in centimetres"),
        (["--trees", "@low.csv"], "@low.csv, row 2: The height of this tree is -20. Give a number above zero"),
        (["--trees", "@palm.csv"], "@palm.csv, row 2: There is no kind of tree 'palm'. Known are coniferous"),
        (["--trees", "@far_tree.csv"], "@far_tree.csv: No tree stands on the terrain. Give their coordinates"),
        (["--stems-per-hectare", "300"], "a forest that is drawn, which needs --dbh-cm, too. Give both"),
        (["--dbh-cm", "30"], "a forest that is drawn, which needs --stems-per-hectare, too. Give both"),
    ],
)  # fmt: skip
def test_options_beside_a_table_of_releases(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in refused(folder, capsys, ["@r.csv", *ON, *words])


@pytest.mark.parametrize(
    ("stems", "dbh", "said"),
    [
        ("1e9", "30", "1e+09 stems per hectare are 6e+08 trees on this terrain. "),
        ("0.001", "30", "No tree was drawn. Give more stems per hectare, or a larger area"),
        ("300", "x", "--dbh-cm x is no mean diameter with a deviation. Write 32, or 32,12: in cm"),
        ("300", "30,-1", "--dbh-cm 30,-1 is no mean diameter with a deviation. "),
        ("300", "9000", "The mean diameter is 90 m. Diameters are in cm, and below 500"),
    ],
)
def test_trees_that_cannot_be_drawn(
    folder: Path, capsys: pytest.CaptureFixture[str], stems: str, dbh: str, said: str
) -> None:
    assert said in refused(folder, capsys, ["@r.csv", *ON, "--stems-per-hectare", stems, "--dbh-cm", dbh])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "Nothing says where blocks start. Give a table of releases, or give --from-line"),
        (["--from-line", "@point.csv"], "@point.csv: The line l has no length. Give at least two different points"),
        (["--from-line", "@far_line.csv"], "@far_line.csv: The line of releases l is wholly outside of the terrain."),
        (["--from-line", "@line.csv", "--diameter", "500"], "A block of 500 m is larger than the terrain, which"),
        (["--from-line", "@line.csv", "--number", "0"], "@line.csv: 0 blocks cannot be released. Release at least one"),
        (["--from-line", "@line.csv", "--proportions", "3:x:1"], "--proportions 3:x:1 are not three numbers. Write"),
        (["--from-line", "@line.csv", "--diameter", "normal:0.5"], "'normal:0.5' is no number and no law. Write 0.5"),
        (["--from-line", "@line.csv", "--diameter", "uniform:2,1"], "2..1 ends below its beginning. Give the lowest"),
        (["--from-line", "@line.csv", "--diameter", "lognormal:0.5,-1"], "standard deviation of lognormal:0.5,-1 is"),
        (["--steeper-than", "80"], "No terrain is steeper than 80°. Give a smaller angle; the steepest is 35.0°"),
        (["--steeper-than", "200"], "200° is no angle of a slope. Give one from 0 to 180"),
        (["--from-polygon", "@far.csv"], "@far.csv: The release area far (feature 1) is wholly outside of"),
        (
            ["--from-polygon", "@all.csv", "--steeper-than", "80"],
            "@all.csv: There is no terrain within the polygon that is steeper than 80°. Give a smaller angle",
        ),
    ],
)  # fmt: skip
def test_places_where_no_block_can_start(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    usual = [] if "--diameter" in words else ["--diameter", "0.5"]
    usual += [] if "--number" in words else ["--number", "3"]
    assert said in refused(folder, capsys, [*ON, *words, *usual])


@pytest.mark.parametrize(("left_out", "said"), [(0, "--terrain is missing"), (2, "--model is missing")])
def test_without_a_project_terrain_and_model_are_needed(
    folder: Path, capsys: pytest.CaptureFixture[str], left_out: int, said: str
) -> None:
    words = ["@r.csv", *ON[:left_out], *ON[left_out + 2 :]]
    assert f"{said}. Only a project, project.toml, can do without it" in refused(folder, capsys, words)


@pytest.mark.parametrize("text", ["9-3", "0-2", "a", "4"])
def test_runs_that_are_no_range(folder: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    words = ["simulate", str(folder / "r.csv"), "--runs", text, "--out", str(folder / "out")]
    assert main(words) == 2
    assert f"argument --runs: {text} is not a range of whole numbers such as 51-100" in capsys.readouterr().err
