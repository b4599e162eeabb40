# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of the ground: polygons and attributes, what overlaps, what is not covered, and what they change."""

import json
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.zones import read_zones
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.polygons import Polygon
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.zones import face_values, zones_of_values, zones_within
from rockfall.core.terrain.ply_attributes import read_ply_attribute
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.simulation import Scenario, run_scenario

EAST, NORTH = 2_600_000.0, 1_200_000.0


def plane(degrees: float = 0.0, size: int = 40) -> Surface:
    """Squares of 1 m, each two triangles, that fall along +x, in survey coordinates by the shift."""
    x, y = np.meshgrid(np.arange(size + 1.0), np.arange(size + 1.0))
    z = -np.tan(np.radians(degrees)) * x
    i = np.arange((size + 1) ** 2).reshape(size + 1, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    return Surface(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces, GlobalShift(EAST, NORTH, 0.0), "plane")


def square(name: str, x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return Polygon(name, (np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]),))


def geojson(path: Path, *zones: tuple[dict, list[list[float]]], crs: str = "") -> Path:
    features = [
        {
            "type": "Feature",
            "properties": properties,
            "geometry": {
                "type": "Polygon",
                "coordinates": [[[EAST + x, NORTH + y] for x, y in [*ring, ring[0]]]],
            },
        }
        for properties, ring in zones
    ]
    content: dict = {"type": "FeatureCollection", "features": features}
    if crs:
        content["crs"] = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{crs}"}}
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


LOWER = [[20.0, 0.0], [40.0, 0.0], [40.0, 40.0], [20.0, 40.0]]
PART = [[30.0, 0.0], [40.0, 0.0], [40.0, 10.0], [30.0, 10.0]]


def test_a_face_is_in_the_zone_that_its_middle_is_in() -> None:
    terrain = plane()
    cover = zones_within(terrain, [square("wood", 10, 10, 20, 30), square("scree", 5.4, 0, 10, 10)])
    assert cover.names == ("terrain", "wood", "scree")
    counts = np.bincount(cover.of_element)
    assert counts[1] == 2 * 10 * 20
    # Middles at x = 5 1/3 are out, those at 5 2/3 in.
    assert counts[2] == 2 * 4 * 10 + 10
    assert [str(remark) for remark in cover.remarks] == [
        f"{3200 - 400 - 90} of 3200 faces are in no zone: they have the parameters of the whole."
    ]


def test_of_zones_that_overlap_the_first_has_the_face() -> None:
    cover = zones_within(plane(), [square("a", 0, 0, 20, 20), square("b", 10, 0, 30, 20), square("a", 5, 0, 6, 40)])
    assert np.bincount(cover.of_element)[1:].tolist() == [2 * (400 + 20), 2 * 200]
    assert str(cover.remarks[0]).startswith("400 of 3200 faces are in more than one zone")
    assert cover.remarks[0].severity == "warning"


def test_zones_that_cannot_be_are_refused() -> None:
    for polygons, message in (
        ([square("", 0, 0, 9, 9)], "no name"),
        ([square("terrain", 0, 0, 9, 9)], "called 'terrain'"),
        ([square("far", 900, 900, 990, 990)], "The zone far is wholly outside of the terrain"),
    ):
        with pytest.raises(InputError, match=message):
            zones_within(plane(), polygons)
    cover = zones_within(plane(), [square("a", 0, 0, 9, 9), square("small", 4.1, 4.1, 4.2, 4.2)])
    assert "The zone small is nowhere on the terrain." in [str(remark) for remark in cover.remarks]


def test_friction_of_a_zone_stops_blocks_there(tmp_path: Path) -> None:
    """On 20° a block slides on with μ = 0.3 < tan 20°; v² = v0² − 2 g cosβ (μ − tanβ) s in the zone with μ = 0.8."""
    terrain = plane(20.0)
    path = geojson(tmp_path / "zones.geojson", ({"name": "wood", "friction": 0.8, "fid": 7}, LOWER))
    zones = read_zones(path, terrain, ["azimi_desvarreux_1977"])
    assert dict(zones.friction) == {"wood": 0.8}
    assert "Not used of the zones: fid" in str(zones.remarks[1])
    beta = np.radians(20)
    normal = np.array([np.sin(beta), 0.0, np.cos(beta)])
    along = np.array([np.cos(beta), 0.0, -np.sin(beta)])
    start = np.array([5.0, 20.3, -np.tan(beta) * 5.0]) + 0.25 * normal
    scenario = Scenario(
        terrain,
        lambda ground: make_releases(start[None], velocity=3 * along[None], diameter_m=0.5),
        {"azimi_desvarreux_1977": {"rn": 0.1, "rt": 1.0}},
        zones=zones,
        rolling="coulomb",
        friction=0.3,
    )
    (run,) = run_scenario(scenario, threads=1)
    until = (20 - 5) / np.cos(beta)
    square_speed = 9 + 2 * 9.81 * np.cos(beta) * (np.tan(beta) - 0.3) * until
    stops = until + square_speed / (2 * 9.81 * np.cos(beta) * (0.8 - np.tan(beta)))
    assert np.linalg.norm(run.position[0] - start) == pytest.approx(stops, rel=0.02)
    assert run.releases.remarks == ()


def test_parameters_are_those_of_the_models_by_name(tmp_path: Path) -> None:
    terrain = plane()
    path = geojson(
        tmp_path / "zones.geojson",
        ({"name": "a", "rt": 0.4, "noel_2017.rt_sd": 0.0, "stevens_1998.rn": 0.2, "soil_type": 3}, LOWER),
        ({"name": "a", "rt": 0.4}, [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]]),
    )
    zones = read_zones(path, terrain, ["noel_2017", "azimi_desvarreux_1977"])
    assert zones.parameters == {"a": {"noel_2017": {"rt": 0.4, "rt_sd": 0.0}, "azimi_desvarreux_1977": {"rt": 0.4}}}
    unused = next(str(remark) for remark in zones.remarks if "Not used" in str(remark))
    assert "stevens_1998.rn, soil_type" in unused


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"name": "a", "rtt": 0.4}, "'rtt' is no parameter of noel_2017. Did you mean rt"),
        ({"name": "a", "fricton": 0.4}, "Did you mean friction"),
        ({"name": "a", "noel_2017.rtt": 0.4}, "Did you mean rt"),
        ({"name": "a", "noel_2071.rt": 0.4}, "Did you mean noel_2017"),
        ({"name": "a", "rt": 4}, "Zone a: noel_2017.rt is 4, outside its range"),
        ({"name": "a", "friction": "much"}, "Zone a: the friction is 'much'"),
        ({"name": "a", "friction": -1}, "Zone a: the friction is -1"),
        ({"rt": 0.4}, "A zone has no name"),
    ],
)
def test_properties_that_make_no_sense_are_refused(tmp_path: Path, properties: dict, message: str) -> None:
    path = geojson(tmp_path / "zones.geojson", (properties, LOWER))
    with pytest.raises(InputError, match=message):
        read_zones(path, plane(), ["noel_2017"])


def test_two_values_of_one_zone_are_refused(tmp_path: Path) -> None:
    path = geojson(tmp_path / "z.geojson", ({"name": "a", "rt": 0.4}, LOWER), ({"name": "a", "rt": 0.5}, PART))
    with pytest.raises(InputError, match="different values of rt"):
        read_zones(path, plane(), ["noel_2017"])


def test_a_table_of_corners_is_the_same_as_geojson(tmp_path: Path) -> None:
    rows = [f"wood,{EAST + x},{NORTH + y},{0.8 if k == 0 else ''},0.4" for k, (x, y) in enumerate(LOWER)]
    path = tmp_path / "zones.csv"
    path.write_text("\n".join(["name,x_m,y_m,friction,noel_2017.rt", *rows]) + "\n", encoding="utf-8")
    table = read_zones(path, plane(), ["noel_2017"])
    same = geojson(tmp_path / "z.json", ({"name": "wood", "friction": 0.8, "noel_2017.rt": 0.4}, LOWER), crs="2056")
    other = read_zones(same, plane(), ["noel_2017"])
    np.testing.assert_array_equal(table.of_face, other.of_face)
    assert table.parameters == other.parameters
    assert table.friction == other.friction
    rows[2] = rows[2].replace("0.4", "0.5")
    path.write_text("\n".join(["name,x_m,y_m,friction,noel_2017.rt", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"row 4: noel_2017\.rt of wood is 0\.4 and 0\.5"):
        read_zones(path, plane(), ["noel_2017"])


def test_geojson_of_another_system_is_refused(tmp_path: Path) -> None:
    terrain = plane()
    there = Surface(terrain.vertices, terrain.faces, GlobalShift(EAST, NORTH, 0.0, "EPSG:2056"), "plane")
    zone = ({"name": "a", "rt": 0.4}, LOWER)
    with pytest.raises(InputError, match="in EPSG:27572, the terrain in EPSG:2056"):
        read_zones(geojson(tmp_path / "z.json", zone, crs="27572"), there, ["noel_2017"])
    path = tmp_path / "degrees.json"
    ring = [[7.4, 46.9], [7.5, 46.9], [7.5, 47.0], [7.4, 46.9]]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}), encoding="utf-8")
    nowhere = Surface(terrain.vertices, terrain.faces, GlobalShift(EAST, NORTH, 0.0), "plane")
    with pytest.raises(InputError, match="seems to be in degrees"):
        read_zones(path, nowhere, ["noel_2017"])


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("of", ["vertex", "face"])
def test_attributes_of_a_ply_file_are_zones(tmp_path: Path, form: str, of: str) -> None:
    """The terrain as read has fewer vertices (doubles are merged) and other faces; the values are found by place."""
    terrain = plane(10.0, 12)
    vertices = terrain.vertices[terrain.faces].reshape(-1, 3)  # each corner for itself: the reader merges them
    faces = np.arange(len(vertices)).reshape(-1, 3)
    middle_x = vertices[faces].mean(axis=1)[:, 0]
    order = "<" if form != "binary_big_endian" else ">"
    header = [
        "ply", f"format {form} 1.0", f"element vertex {len(vertices)}",
        "property double x", "property double y", "property double z",
        *(["property uchar soil"] if of == "vertex" else []), f"element face {len(faces)}",
        *(["property uchar soil"] if of == "face" else []), "property list uchar int vertex_indices", "end_header",
    ]  # fmt: skip
    survey = terrain.shift.to_survey(vertices)
    own = np.where((vertices if of == "vertex" else vertices[faces].mean(axis=1))[:, 0] > 6, 3, 1)
    path = tmp_path / "soil.ply"
    if form == "ascii":
        lines = [
            " ".join(map(repr, row)) + (f" {own[i]}" if of == "vertex" else "") for i, row in enumerate(survey.tolist())
        ]
        lines += [
            (f"{own[i]} " if of == "face" else "") + f"3 {a} {b} {c}" for i, (a, b, c) in enumerate(faces.tolist())
        ]
        path.write_text("\n".join([*header, *lines]) + "\n", encoding="ascii")
    else:
        soil = [("soil", "u1")]
        rows = np.zeros(len(vertices), [("p", order + "f8", 3), *(soil if of == "vertex" else [])])
        rows["p"] = survey
        cells = np.zeros(len(faces), [*(soil if of == "face" else []), ("n", "u1"), ("i", order + "i4", 3)])
        cells["n"], cells["i"] = 3, faces
        (rows if of == "vertex" else cells)["soil"] = own
        path.write_bytes("\n".join([*header, ""]).encode() + rows.tobytes() + cells.tobytes())
    read = read_terrain(path)
    assert len(read.vertices) < len(vertices)
    attribute = read_ply_attribute(path, "soil")
    assert attribute.of_faces == (of == "face")
    np.testing.assert_array_equal(np.sort(attribute.values), np.sort(own))

    from rockfall.core.exchange.zones import read_attribute_zones

    table = tmp_path / "soil.csv"
    table.write_text("value,name,friction\n3,scree,0.7\n1,meadow,0.4\n", encoding="utf-8")
    places = read.shift.to_local(attribute.places)
    zones = read_attribute_zones(table, read, attribute, places, ["noel_2017"])
    found = read.vertices[read.faces].mean(axis=1)[:, 0] + read.shift.x - EAST
    assert zones.names == ("terrain", "scree", "meadow")
    expected = np.where(found > 6.2, 1, 2)
    clear = abs(found - 6) > 0.9
    np.testing.assert_array_equal(zones.of_face[clear], expected[clear])
    assert np.bincount(zones.of_face)[1] == pytest.approx((middle_x > 6).sum(), abs=24)
    with pytest.raises(InputError, match=r"no attribute 'soli'\. Did you mean soil"):
        read_ply_attribute(path, "soli")


def test_a_face_has_the_value_of_most_of_its_corners() -> None:
    terrain = Surface(np.zeros((5, 3)), np.array([[0, 1, 2], [2, 3, 4], [0, 2, 4]], np.int32), GlobalShift(), "x")
    np.testing.assert_array_equal(face_values(terrain, np.array([1.0, 2, 2, 3, 5])), [2, 2, 1])
    with pytest.raises(InputError, match="Check the name of the attribute"):
        zones_of_values(terrain, np.array([1.0, 1, 1]), ["a"], [7])
