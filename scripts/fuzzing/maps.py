# SPDX-License-Identifier: GPL-3.0-or-later
"""Small files of lines and polygons as GIS and Google Earth save them, world files, and who reads them."""

import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import simulations
from examples import SHIFT

THERE = replace(SHIFT, crs="EPSG:2154")
WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]]'
)
RING = [
    (988402.0, 6375604.0),
    (988402.0, 6375616.0),
    (988416.0, 6375616.0),
    (988416.0, 6375604.0),
    (988402.0, 6375604.0),
]
HOLE = [(988405.0, 6375607.0), (988408.0, 6375607.0), (988408.0, 6375610.0), (988405.0, 6375607.0)]


def _shapefile(kind: int, parts: list[list[tuple[float, ...]]]) -> dict[str, bytes]:
    import shapefile

    files = {suffix: io.BytesIO() for suffix in ("shp", "shx", "dbf")}
    with shapefile.Writer(**files, shapeType=kind) as writer:
        writer.field("name", "C", 20)
        writer.field("height_m", "N", 8, 2)
        writer.field("capacity_k", "N", 8, 2)
        writer.field("seen", "D")
        for number in range(2):
            {3: writer.line, 5: writer.poly, 13: writer.linez, 15: writer.polyz}[kind](parts)
            writer.record(f"one {number}", 4.0, 900.0, "20260102")
        data = {}
    for suffix, stream in files.items():
        data[suffix] = stream.getvalue()
    return data


def _zipped(files: dict[str, bytes]) -> bytes:
    with io.BytesIO() as stream:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in files.items():
                archive.writestr(name, data)
        return stream.getvalue()


def files() -> dict[str, bytes]:
    """What `readers` read."""
    from rockfall.core.terrain.map_systems import WGS84 as DEGREES
    from rockfall.core.terrain.map_systems import system_of, transformed

    ring = transformed(np.array(RING), system_of("EPSG:2154"), DEGREES)
    line = " ".join(f"{x:.9f},{y:.9f},1500" for x, y in ring.tolist())
    kml = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder>'
        "<Placemark><name>one</name><ExtendedData><Data name='height_m'><value>4</value></Data></ExtendedData>"
        "<{0}>{1}</{0}></Placemark></Folder></Document></kml>"
    )
    edge = f"<coordinates>{line}</coordinates>"
    area = f"<outerBoundaryIs><LinearRing>{edge}</LinearRing></outerBoundaryIs>"
    found = {
        "line.kml": kml.format("LineString", f"<altitudeMode>absolute</altitudeMode>{edge}").encode(),
        "area.kml": kml.format("Polygon", area).encode(),
        "line.gpkg": simulations.geopackage(), "area.gpkg": simulations.geopackage(polygons=True),
    }  # fmt: skip
    found["area.kmz"] = _zipped({"doc.kml": found["area.kml"]})
    for name, data in (
        ("line", _shapefile(13, [[(x, y, 1500.0) for x, y in RING]])),
        ("area", _shapefile(5, [RING, HOLE])),
    ):
        found |= {f"{name}.{suffix}": part for suffix, part in data.items()}
        found |= {f"{name}.cpg": b"UTF-8"}
    found["degrees.shp"] = _shapefile(5, [[(x, y) for x, y in ring[::-1].tolist()]])["shp"]
    found["degrees.prj"] = WGS84.encode()
    found["area.zip"] = _zipped({name: data for name, data in found.items() if name.startswith("area.s")})
    found["grid.tfw"] = b"2.0\n0.0\n0.0\n-2.0\n988401.0\n6375623.0\n"
    found["grid.tif"] = _tiff()
    return found


def _tiff() -> bytes:
    import tifffile

    with io.BytesIO() as stream:
        tifffile.imwrite(stream, np.add.outer(np.arange(12.0), np.arange(12.0)).astype(np.float32) + 1500)
        return stream.getvalue()


def _finite(shapes: object) -> object:
    """Shapes whose numbers are such as can be computed with."""
    for shape in shapes:
        for part in shape.parts:
            assert np.isfinite(part[:, :2]).all(), "a coordinate is not finite"
            assert np.nanmax(np.abs(part), initial=0.0) < 1e10, "a coordinate is absurd"
    return shapes


def readers() -> dict[str, tuple[tuple[str, ...], Callable[[Path], object]]]:
    """Name → the files that are damaged, and who reads them; all of `files` are beside them."""
    from rockfall.core.exchange.map_shapes import polygon_of, read_lines, read_polygons
    from rockfall.core.exchange.screens import read_screens
    from rockfall.core.terrain.readers import read_terrain

    def lines(name: str) -> Callable[[Path], object]:
        return lambda at: _finite(read_lines(at / name, THERE))

    def areas(name: str) -> Callable[[Path], object]:
        return lambda at: [polygon_of(shape, at / name) for shape in _finite(read_polygons(at / name, THERE))]

    return {
        "shapefile of lines": (("line.shp", "line.shx", "line.dbf", "line.cpg"), lines("line.shp")),
        "shapefile of polygons": (("area.shp", "area.shx", "area.dbf"), areas("area.shp")),
        "shapefile in degrees": (("degrees.prj", "degrees.shp"), areas("degrees.shp")),
        "shapefile in an archive": (("area.zip",), areas("area.zip")),
        "shapefile of screens": (("line.shp", "line.dbf"), lambda at: read_screens(at / "line.shp", THERE)),
        "kml of lines": (("line.kml",), lines("line.kml")),
        "kml of polygons": (("area.kml",), areas("area.kml")),
        "kmz": (("area.kmz",), areas("area.kmz")),
        "geopackage of lines": (("line.gpkg",), lines("line.gpkg")),
        "geopackage of polygons": (("area.gpkg",), areas("area.gpkg")),
        "world file": (("grid.tfw",), lambda at: read_terrain(at / "grid.tif")),
    }
