# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of faces as files: read by GDAL and as a table, against what the runs themselves did."""

import csv
import sqlite3
from collections import Counter
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.commands.demo import SITE
from rockfall.core.errors import InputError
from rockfall.core.exchange.geopackage import FeatureLayer, write_geopackage
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.ground import make_ground
from rockfall.core.terrain.cloud import Cloud
from rockfall.core.workflow.maps import check_faces


@pytest.fixture(scope="module")
def output(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("faces") / "out"
    arguments = [str(SITE / "project.toml"), "--model", "pfeiffer_bowen_1989", "--number", "4", "--faces"]
    assert main(["simulate", *arguments, "--record", "impacts", "--out", str(out)]) == 0
    return out


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_contacts_are_those_of_the_table_of_impacts(output: Path) -> None:
    """Each impact is on the face whose plane and outline hold its place; stays on the ground come on top of that."""
    faces = rows_of(output / "maps" / "faces.csv")
    impacts = rows_of(output / "impacts.csv")
    assert len(faces) > 50
    assert sum(float(row["Nr_contacts"]) for row in faces) >= len(impacts)
    runs = rows_of(output / "runs.csv")
    for row in faces:
        assert float(row["Reach_probability"]) == pytest.approx(100 * float(row["Nr_blocks"]) / len(runs), rel=1e-6)
    fastest = max(np.linalg.norm([float(row[f"v1{axis}_mps"]) for axis in "xyz"]) for row in impacts)
    assert max(float(row["V_max"]) for row in faces) == pytest.approx(fastest, rel=1e-5)
    assert Counter(row["of"] for row in faces) == {"terrain": len(faces)}
    assert all(0 <= float(row["dip_deg"]) <= 180 and float(row["area_m2"]) > 0 for row in faces)


def test_polygons_in_space_are_read_by_gdal(output: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    path = output / "maps" / "faces.gpkg"
    rows = rows_of(output / "maps" / "faces.csv")
    info = pyogrio.read_info(path, layer="faces")
    assert info["features"] == len(rows)
    assert info["crs"] == "EPSG:2154"
    assert info["geometry_type"] in ("Polygon", "Polygon Z", "2.5D Polygon")
    _, _, shapes, columns = pyogrio.raw.read(path, layer="faces")
    names = list(info["fields"])
    np.testing.assert_allclose(columns[names.index("V_max")], [float(row["V_max"]) for row in rows], rtol=1e-6)
    for shape, row in zip(shapes[:40], rows, strict=False):
        data = np.frombuffer(shape[13:], "<f8").reshape(-1, 3)  # order, type, rings, points
        assert len(data) == 4
        np.testing.assert_array_equal(data[0], data[3])
        np.testing.assert_allclose(data[:3].mean(axis=0), [float(row[f"{axis}_m"]) for axis in "xyz"], atol=1e-3)
        area = np.linalg.norm(np.cross(data[1] - data[0], data[2] - data[0])) / 2
        assert area == pytest.approx(float(row["area_m2"]), rel=1e-3)


def test_points_have_no_faces() -> None:
    cloud = Cloud(np.random.default_rng(1).random((500, 3)) * [5, 5, 0], GlobalShift(), "cloud.xyz")
    with pytest.raises(InputError, match="no faces to be mapped"):
        check_faces(make_ground(cloud))


def test_an_outline_that_is_not_closed_is_refused(tmp_path: Path) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    layer = FeatureLayer("open", "An outline", corners, np.array([0, 4]), closed=True)
    with pytest.raises(InputError, match="not closed"):
        write_geopackage(tmp_path / "open.gpkg", [layer], GlobalShift())
    assert not (tmp_path / "open.gpkg").exists()


def test_the_style_has_a_class_for_each_face(output: Path) -> None:
    """As QGIS reads it: ranges that follow each other, each with a symbol, from 0 to the greatest value."""
    with closing(sqlite3.connect(output / "maps" / "faces.gpkg")) as database:
        ((text,),) = database.execute("SELECT styleQML FROM layer_styles WHERE f_table_name = 'faces'").fetchall()
    renderer = ElementTree.fromstring(text).find("renderer-v2")
    assert renderer.get("attr") == "Reach_probability"
    ranges = renderer.findall("ranges/range")
    edges = [(float(one.get("lower")), float(one.get("upper"))) for one in ranges]
    assert edges[0][0] == 0
    assert all(high == low for (_, high), (low, _) in pairwise(edges))
    greatest = max(float(row["Reach_probability"]) for row in rows_of(output / "maps" / "faces.csv"))
    assert edges[-1][1] >= greatest * (1 - 1e-6)
    symbols = {one.get("name"): one for one in renderer.findall("symbols/symbol")}
    assert {one.get("symbol") for one in ranges} == set(symbols)
    colours = {one.find(".//Option[@name='color']").get("value") for one in symbols.values()}
    assert len(colours) == len(symbols)
