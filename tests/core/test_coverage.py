# SPDX-License-Identifier: GPL-3.0-or-later
"""Release areas, zones, screens and forests that reach beyond the terrain: which, and how much of each."""

import json

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import BlockEntry
from rockfall.core.exchange.simulation_entry import ReleaseEntry, SimulationEntry, TreesEntry
from rockfall.core.exchange.trees import open_trees
from rockfall.core.exchange.zones import read_zones
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.screens import Screen
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.coverage import check_areas, parts_on, places_along, places_within
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.polygons import Polygon
from rockfall.core.simulation.release_sources import in_polygon, on_line
from rockfall.core.terrain.cloud import Cloud
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.scenarios import placed_source
from rockfall.core.workflow.screens import outside_remarks


def plane() -> Surface:
    """100 m × 100 m, rising to the east."""
    y, x = np.mgrid[0:101, 0:101].astype(np.float64)
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.5 * x.ravel()])
    i = np.arange(100)[:, None] * 101 + np.arange(100)
    i = i.ravel()
    faces = np.concatenate([np.column_stack([i, i + 1, i + 102]), np.column_stack([i, i + 102, i + 101])])
    return Surface(vertices, faces.astype(np.int32), GlobalShift(), "plane")


def square(x: float, y: float, side: float = 40.0, name: str = "", number: int = 0) -> Polygon:
    return Polygon(name, (np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]]),), number)


def test_places_are_spread_evenly():
    ring = np.array([[0.0, 0.0], [40.0, 0.0], [20.0, 30.0]])
    places = places_within(Polygon("", (ring,)))
    assert Polygon("", (ring,)).contains(places).all()
    np.testing.assert_allclose(places.mean(axis=0), [20.0, 10.0], atol=0.1)  # the centroid
    assert (places[:, 1] < 15).mean() == pytest.approx(0.75, abs=0.01)
    np.testing.assert_allclose(
        places_along(np.array([[0.0, 0], [10, 0], [10, 30]]), 4), [[5, 0], [10, 5], [10, 15], [10, 25]]
    )


def test_the_share_of_an_area():
    terrain = plane()
    assert check_areas(terrain, [square(0, 0, 100.0)], "zone", "x") == ()  # to the very edge
    (remark,) = check_areas(terrain, [square(10, 10), square(90, 10, name="b", number=2)], "zone", "it ends there")
    assert str(remark) == "75 % of the area of the zone b (feature 2) is outside of the terrain: it ends there."
    with pytest.raises(InputError, match=r"The zone c \(feature 3\) is wholly outside of the terrain\. Check"):
        check_areas(terrain, [square(10, 10), square(200, 10, name="c", number=3)], "zone", "x")
    cloud = Cloud(terrain.vertices, terrain.shift, "plane")
    (same,) = check_areas(cloud, [square(90, 10, name="b", number=2)], "zone", "it ends there")
    assert 50 < float(str(same).split(" ", maxsplit=1)[0]) <= 76  # ground is known some way beyond the last point


def test_release_areas_and_lines():
    ground = make_ground(plane())
    releases = in_polygon(ground, [square(80, 10)], Blocks(), 20)
    assert "50 % of the area of the release area is outside of the terrain" in str(releases.remarks[0])
    assert (releases.position[:, 0] < 101).all()
    line = np.array([[50.0, 50.0, np.nan], [150.0, 50.0, np.nan]])
    releases = on_line(ground, [line], Blocks(), 50, evenly=True, names=["edge"])
    assert "50 % of the length of the line of releases edge is outside" in str(releases.remarks[0])
    np.testing.assert_allclose(np.sort(releases.position[:, 0])[[0, -1]], [50.5, 99.5], atol=0.3)
    assert len(parts_on(ground.terrain, line)) == 1
    whole = on_line(ground, [np.array([[10.0, 50, np.nan], [90, 50, np.nan]])], Blocks(), 5)
    assert not whole.remarks
    with pytest.raises(InputError, match=r"The line of releases far is wholly outside of the terrain"):
        on_line(ground, [line + np.array([100.0, 0, 0])], Blocks(), 5, names=["far"])


def test_a_project_releases_from_a_map(tmp_path):
    ground = make_ground(plane())
    ring = [[80, 10], [120, 10], [120, 50], [80, 10]]
    for source, geometry in (("polygon", {"type": "Polygon", "coordinates": [ring]}), ("line", None)):
        geometry = geometry or {"type": "LineString", "coordinates": ring[:2]}
        (tmp_path / "map.geojson").write_text(json.dumps(geometry))
        entry = ReleaseEntry(source=source, file=tmp_path / "map.geojson", number=7, name="niche")
        releases = placed_source(SimulationEntry(releases=entry), BlockEntry())(ground)
        assert releases.name.tolist() == ["niche"] * 7
        assert (releases.position[:, 0] > 79).all()
        assert any("is outside of the terrain" in str(remark) for remark in releases.remarks)


def test_screens():
    ground = make_ground(plane())
    screens = [
        Screen("road", np.array([[50.0, -25.0], [50.0, 75.0]])),
        Screen("inside", np.array([[20.0, 10], [20, 90]])),
    ]
    (remark,) = outside_remarks(screens, ground)
    assert str(remark).startswith("25 % of the length of the screen road (feature 1) is outside of the terrain")


def test_zones_and_forests(tmp_path):
    def written(x: float) -> str:
        ring = [*square(x, 10).rings[0].tolist(), square(x, 10).rings[0][0].tolist()]
        feature = {
            "type": "Feature", "properties": {"name": "wood", "friction": 0.7},
            "geometry": {"type": "Polygon", "coordinates": [ring]},
        }  # fmt: skip
        (tmp_path / "wood.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
        return str(tmp_path / "wood.geojson")

    terrain = plane()
    zones = read_zones(written(80), terrain, ["noel_2017"])
    assert any("50 % of the area of the zone wood (feature 1) is outside" in str(remark) for remark in zones.remarks)
    forest = TreesEntry(stems_per_hectare=800, dbh_cm=30, within=tmp_path / "wood.geojson")
    trees, _ = open_trees(forest, terrain, 1)
    assert any("50 % of the area of the forest wood (feature 1) is outside" in text for text in trees.left_out)
    written(300)
    for read in (lambda: read_zones(forest.within, terrain, ["noel_2017"]), lambda: open_trees(forest, terrain, 1)):
        with pytest.raises(InputError, match=r"wood \(feature 1\) is wholly outside of the terrain") as told:
            read()
        assert told.value.file == forest.within
