# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates from one system into another, held against published examples and against PROJ."""

from math import radians

import numpy as np
import pytest
from rockfall.core.terrain.map_systems import (
    UTM_CODES,
    WGS84,
    MapSystem,
    name_of_wkt,
    same_system,
    system_of,
    system_of_wkt,
    transformed,
    unit_of_wkt,
    vertical_unit_of_wkt,
)

AIRY = (6377563.396, 299.32496)
CLARKE_1866 = (6378206.4, 294.9786982)
US_FOOT = 1200 / 3937
CODES = (
    *UTM_CODES, 3857, 2056, 21781, 2154, *range(3942, 3951), 3416, 31287, *range(31254, 31260), 3794, 2193,
)  # fmt: skip
WITH_GRIDS = (21781, 31287, *range(31254, 31260))
"""For these PROJ chooses among several relations of their datum to WGS 84."""


def degrees(d: float, m: float = 0.0, s: float = 0.0) -> float:
    return radians(d + m / 60 + s / 3600)


def test_transverse_mercator_as_published():
    """IOGP Guidance Note 7-2, 3.5.3.1: British National Grid, 00°30'00"E, 50°30'00"N."""
    grid = MapSystem("tm", (degrees(-2), degrees(49)), (4e5, -1e5), 0.9996012717, ellipsoid=AIRY)
    degree = MapSystem("geographic", ellipsoid=AIRY, unit=radians(1))
    place = transformed(np.array([[0.5, 50.5]]), degree, grid)
    np.testing.assert_allclose(place, [[577274.99, 69740.50]], atol=0.006)
    np.testing.assert_allclose(transformed(place, grid, degree), [[0.5, 50.5]], atol=1e-10)


def test_lambert_conformal_conic_as_published():
    """IOGP Guidance Note 7-2, 3.1.1.1: Texas South Central, 96°00'00"W, 28°30'00"N, in US survey feet."""
    grid = MapSystem(
        "lcc", (degrees(-99), degrees(27, 50)), (2e6 * US_FOOT, 0.0), 1.0, (degrees(28, 23), degrees(30, 17)),
        ellipsoid=CLARKE_1866,
    )  # fmt: skip
    degree = MapSystem("geographic", ellipsoid=CLARKE_1866, unit=radians(1))
    place = transformed(np.array([[-96.0, 28.5]]), degree, grid)
    np.testing.assert_allclose(place / US_FOOT, [[2963503.91, 254759.80]], atol=0.02)
    np.testing.assert_allclose(transformed(place, grid, degree), [[-96.0, 28.5]], atol=1e-10)


def test_the_swiss_grids_as_published():
    """swisstopo, Formulas and constants, example: the station Rigi, CH1903 8°29'11.111572", 47°03'28.956592"."""
    place = np.array([[8 + 29 / 60 + 11.111572 / 3600, 47 + 3 / 60 + 28.956592 / 3600]])
    for code, corner in ((2056, (2e6, 1e6)), (21781, (0.0, 0.0))):
        grid = system_of(f"EPSG:{code}")
        degree = MapSystem("geographic", ellipsoid=grid.ellipsoid, to_wgs84=grid.to_wgs84, unit=radians(1))
        np.testing.assert_allclose(transformed(place, degree, grid) - corner, [[679520.05, 212273.44]], atol=0.006)


def test_web_mercator_as_published():
    """IOGP Guidance Note 7-2, 3.5.2: 100°20'00.000"W, 24°22'54.433"N."""
    place = transformed(np.array([[-100 - 20 / 60, 24 + 22 / 60 + 54.433 / 3600]]), WGS84, system_of("EPSG:3857"))
    np.testing.assert_allclose(place, [[-11169055.58, 2800000.00]], atol=0.01)


def test_all_codes_as_proj_has_them():
    warp = pytest.importorskip("rasterio.warp")
    rng = np.random.default_rng(1)
    for code in CODES:
        system = system_of(f"EPSG:{code}")
        longitude = np.degrees(system.origin[0]) + rng.uniform(-2, 2, 20)
        south = UTM_CODES.get(code, 1) < 0 or code == 2193
        latitude = (np.degrees(system.origin[1]) or (-41 if south else 47)) + rng.uniform(-2, 2, 20)
        expected = np.column_stack(warp.transform("EPSG:4326", f"EPSG:{code}", longitude, latitude))
        found = transformed(np.column_stack([longitude, latitude]), WGS84, system)
        assert np.abs(found - expected).max() < 2.0, code  # between datums of continents
        if not (code in WITH_GRIDS or 2000 < code < 3200):
            assert np.abs(found - expected).max() < 2e-3, code


def test_a_text_is_the_same_system_as_its_code():
    crs = pytest.importorskip("rasterio.crs")
    for code in (32632, 25832, 3857, 2056, 21781, 2154, 3945, 31254, 31287, 3794, 2193):
        whole = crs.CRS.from_epsg(code)
        for version in ("WKT1_GDAL", "WKT1_ESRI", "WKT2_2019"):
            text = whole.to_wkt(version=version)
            assert same_system(system_of_wkt(text), system_of(f"EPSG:{code}")), (code, version)
            assert unit_of_wkt(text) == 1.0
    assert name_of_wkt(crs.CRS.from_epsg(2056).to_wkt()) == "EPSG:2056"
    assert same_system(system_of_wkt(crs.CRS.from_epsg(4326).to_wkt()), WGS84)


def test_feet_and_what_is_not_known():
    crs = pytest.importorskip("rasterio.crs")
    text = crs.CRS.from_epsg(2263).to_wkt()  # New York, US survey feet
    assert unit_of_wkt(text) == pytest.approx(US_FOOT)
    assert system_of_wkt(text).false_m == pytest.approx((3e5, 0.0))
    assert vertical_unit_of_wkt(text) is None
    compound = f'COMPD_CS["both",{text},VERT_CS["height",VERT_DATUM["x",2005],UNIT["foot",0.3048]]]'
    assert vertical_unit_of_wkt(compound) == 0.3048
    assert unit_of_wkt(compound) == pytest.approx(US_FOOT)
    assert system_of_wkt(crs.CRS.from_epsg(3035).to_wkt()) is None  # equal area
    assert system_of_wkt(crs.CRS.from_epsg(27572).to_wkt()) is None  # degrees from Paris
    old = system_of_wkt(crs.CRS.from_epsg(27700).to_wkt())  # a datum of its own
    assert old.to_wgs84 is None
    assert transformed(np.zeros((1, 2)), WGS84, old) is None
    assert system_of("EPSG:9999") is None
    assert system_of("somewhere") is None
    assert same_system(system_of("WGS 84 / UTM zone 32N"), system_of("EPSG:32632"))
    assert same_system(system_of("CH1903+_LV95"), system_of("EPSG:2056"))
