# SPDX-License-Identifier: GPL-3.0-or-later
"""What `rockfall simulate` refuses of measured impacts, attributes, posteriors and projects; nothing is written."""

import re
from pathlib import Path

import pytest
from rockfall.core.cli import main

SLOPE = [(0, 0), (100, 0), (100, 60), (0, 60)]
IMPACT = (
    "trajectory,impact,time_s,x_m,y_m,z_m,nx,ny,nz,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps,diameter_m,mass_kg"
)
LEAVING = ",0.573,0,0.819,5,0,-5,4,0,2"
ON = ["--terrain", "@slope.ply", "--model", "noel_2017"]


def slope_ply(faces: str = "", of_faces: bool = True) -> str:
    """A plane of two triangles; the attribute `zone` is of these, or of the vertices."""
    vertices = "".join(f"{x} {y} {50 - 0.7 * x}{'' if of_faces else ' 1'}\n" for x, y in SLOPE)
    more = "" if of_faces else "property float zone\n"
    faces = faces or ("3 0 1 2 1\n3 0 2 3 1\n" if of_faces else "3 0 1 2\n3 0 2 3\n")
    count = faces.count("\n")
    return (
        f"ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n{more}"
        f"element face {count}\nproperty list uchar int vertex_indices\n{'property int zone' if of_faces else ''}\n"
        f"end_header\n{vertices}{faces}"
    ).replace("\n\n", "\n")


def impacts(*rows: str, more: str = "") -> str:
    return "\n".join([IMPACT + more, *rows]) + "\n"


FILES = {
    "slope.ply": slope_ply(),
    "vertices.ply": slope_ply(of_faces=False),
    "quad.ply": slope_ply("4 0 1 2 3 1\n"),
    "mixed.ply": slope_ply("3 0 1 2 1\n4 0 1 2 3 2\n"),
    "slope.obj": "".join(f"v {x} {y} {50 - 0.7 * x}\n" for x, y in SLOPE) + "f 1 2 3\nf 1 3 4\n",
    "r.csv": "release,x_m,y_m,z_m,diameter_m,number\na,10,30,,0.4,2\n",
    "still.csv": impacts("A,1,0,10,30,43,0.573,0,0.819,,,,,,,0.4,90"),
    "unknown.csv": impacts(f"A,1,0,10,30,43{LEAVING},,"),
    "above.csv": impacts(f"A,1,0,10,30,93{LEAVING},0.4,90"),
    "take_off.csv": impacts(
        f"A,1,0,10,30,43{LEAVING},0.4,90,here,30,43,2", more=",x2_m,y2_m,z2_m,time2_s"
    ),
    "twice.csv": "value,name,friction\n1,scree,0.4\n1,rock,0.5\n",
    "odd.csv": "value,name,friction\n1,scree,0.4\n2,rock,steep\n",
    "wrong.csv": "value,name,noel_2017.rn_limit\n1,scree,hard\n",
    "elsewhere.csv": "value,name,friction\n7,scree,0.4\n",
    "post.csv": "model,weight,friction\nnoel_2017,1,0.5\nnoel_2017,1,0.6\n",
    "bare.csv": "model,weight\nnoel_2017,1\n",
    "negative.csv": "model,weight,friction\nnoel_2017,-1,0.5\n",
    "other.csv": "model,weight,friction\nstevens_1998,1,0.5\n",
    "picks.csv": "trajectory,time_s,x_m,y_m,z_m,kind\n" + "".join(
        f"A,{0.5 * k},{10 + 4 * k},30,{43 - 2.8 * k},impact\n" for k in range(4)
    ),
    "sizes.csv": "d1_m,d2_m,d3_m\n0.5,0.4,0.3\n",
    "trees.csv": "x_m,y_m,dbh_cm\n20,30,30\n",
    "project.toml": 'schema = 1\n[terrain]\nfile = "slope.obj"\n[picks]\nfile = "picks.csv"\n[block]\nd1_m = 0.4\n'
    'd2_m = 0.4\nd3_m = 0.4\n[simulation]\nmodel = "noel_2017"\n',
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def refused(folder: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> str:
    """What is said in the end, without the folder's name."""
    capsys.readouterr()
    there = sorted(path.name for path in folder.iterdir())
    words = [word.replace("@", f"{folder}/") for word in words]
    assert main(["simulate", *words, "--out", str(folder / "out")]) == 1
    assert sorted(path.name for path in folder.iterdir()) == there
    return capsys.readouterr().err.strip().split("\n")[-1].replace(f"{folder}/", "@")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["@still.csv"], "@still.csv: No impact has a position and a velocity after it. Give a table of impacts as"),
        (["@unknown.csv"], "@unknown.csv: The impact A 1 has no diameter and mass. Say what falls, with a diameter"),
        (["@above.csv"], "@above.csv: The start A 1 is 44.1 m from the terrain. Give the terrain"),
        (["@take_off.csv"], "@take_off.csv: The place of a take-off is no number: here. Correct x2_m, y2_m, z2_m"),
    ],
)
def test_impacts_from_which_no_block_can_start(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in refused(folder, capsys, [*ON, "--from-impacts", *words])


@pytest.mark.parametrize(
    ("terrain", "attribute", "table", "said"),
    [
        (
            "slope.ply",
            "zona",
            "odd.csv",
            "@slope.ply: The file has no attribute 'zona'. Did you mean zone? It has zone",
        ),
        ("slope.obj", "zone", "odd.csv", "@slope.obj: Only PLY files have attributes. Export the terrain as PLY"),
        ("slope.ply", "zone", "twice.csv", "@twice.csv, row 3: The value 1 is there twice. Give each value one row"),
        (
            "slope.ply",
            "zone",
            "odd.csv",
            "@odd.csv, row 3: Zone rock: the friction is 'steep'. Give a number of zero or more",
        ),
        ("slope.ply", "zone", "wrong.csv", "@wrong.csv, row 2: Zone scree: noel_2017.rn_limit is 'hard'"),
        ("slope.ply", "zone", "elsewhere.csv", "@elsewhere.csv: No zone is anywhere on the terrain. Check the name"),
        ("quad.ply", "zone", "odd.csv", "@quad.ply: The faces are not all triangles. Triangulate the mesh"),
        ("mixed.ply", "zone", "odd.csv", "@mixed.ply: The faces are not all triangles. Triangulate the mesh"),
    ],
)
def test_attributes_that_are_no_zones(
    folder: Path, capsys: pytest.CaptureFixture[str], terrain: str, attribute: str, table: str, said: str
) -> None:
    on = ["--terrain", f"@{terrain}", "--model", "noel_2017"]
    assert said in refused(folder, capsys, ["@r.csv", *on, "--zones", f"@{table}", "--zone-attribute", attribute])


def test_tiles_with_an_attribute_of_faces_and_one_of_vertices(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    on = ["--terrain", "@slope.ply", "--terrain", "@vertices.ply", "--model", "noel_2017"]
    said = refused(folder, capsys, ["@r.csv", *on, "--zones", "@elsewhere.csv", "--zone-attribute", "zone"])
    assert "@vertices.ply: The attribute 'zone' is of vertices here, of faces in @slope.ply. Export the tiles" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--posterior", "@bare.csv"], "@bare.csv: The table has no parameter. Add a column for one of noel_2017"),
        (["--posterior", "@negative.csv"], "@negative.csv, row 2: The weight is -1. Give zero or more"),
        (["--posterior", "@other.csv"], "@other.csv: The posterior is of stevens_1998, which is not simulated"),
        (["--posterior", "@post.csv", "--posterior", "@post.csv"], "@post.csv: There are two posteriors of noel_2017"),
        (["--posterior", "@post.csv", "--friction", "0.5"], "friction is both drawn from --posterior and set"),
    ],
)  # fmt: skip
def test_posteriors_that_cannot_be_drawn_from(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in refused(folder, capsys, ["@r.csv", *ON, *words])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--terrain", "@slope.obj"], "--terrain is what a project says itself. Write it into the project"),
        (["--diameter", "@sizes.csv"], "A project takes no table of measured sizes. Give a number, a range or a law"),
    ],
)
def test_what_a_project_says_itself(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in refused(folder, capsys, ["@project.toml", *words])


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('[[blocks]]\nname = "A"\nd1_m = 1\n[[blocks]]\nname = "A"\nd1_m = 2\n', "blocks names 'A' twice. Give"),
        ('[[render]]\nname = "hd"\n[[render]]\nname = "hd"\n', "render names 'hd' twice. Give each entry"),
        ("[simulation.trees]\nheight_m = 20\n", "simulation.trees.stems_per_hectare is missing. Give a file of trees"),
        ("[simulation.trees]\nstems_per_hectare = 9\n", "simulation.trees.dbh_cm is missing. Give a file of trees"),
        (
            '[simulation.trees]\nfile = "trees.csv"\ndbh_cm = 30\n',
            "simulation.trees.dbh_cm is given beside file. The table has each stem: leave out one of them",
        ),
    ],
)  # fmt: skip
def test_projects_that_contradict_themselves(
    folder: Path, capsys: pytest.CaptureFixture[str], more: str, said: str
) -> None:
    (folder / "project.toml").write_text(FILES["project.toml"] + more, encoding="utf-8")
    assert f"@project.toml: {said}" in refused(folder, capsys, ["@project.toml"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--set", "stevens_1998.rn=0.3"], "--set gives parameters of stevens_1998, which is not used. Add"),
        (["--observed", "@above.csv"], "--observed gives measured impacts, which no model draws from. Add"),
        (["--model", "observed"], "The model observed draws from measured impacts, and there are none. Give"),
    ],
)  # fmt: skip
def test_options_of_models_that_are_not_asked_for(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in refused(folder, capsys, ["@r.csv", *ON, *words])


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ('{"coordinates": [1, 2]}', "This is no GeoJSON: an object has no type. Export"),
        (
            '{"type": "Polygon", "coordinates": [[[0, 0], [1e10, 0], [5, 5], [0, 0]]]}',
            "has a coordinate beyond every survey (1e9 m). Correct it",
        ),
        (
            '{"type": "Polygon", "coordinates": [[[0, 0], [NaN, 0], [5, 5], [0, 0]]]}',
            "has a coordinate that is not finite. Correct it",
        ),
    ],
)
def test_maps_that_cannot_be_drawn(folder: Path, capsys: pytest.CaptureFixture[str], geometry: str, said: str) -> None:
    text = (
        '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"name": "a"}, "geometry": %s}]}'
    )
    (folder / "zone.geojson").write_text(text % geometry, encoding="utf-8")
    from_there = ["--from-polygon", "@zone.geojson", "--diameter", "1", "--number", "2"]
    assert re.search(rf"^rockfall: @zone.geojson: .*{re.escape(said)}", refused(folder, capsys, [*ON, *from_there]))
