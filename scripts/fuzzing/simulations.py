# SPDX-License-Identifier: GPL-3.0-or-later
"""Small files of what simulations, design and films read, and who reads them."""

import io
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import examples
import numpy as np
from examples import SHIFT

MODEL = "noel_2017"
LINE = [(988404.0, 6375602.0), (988405.0, 6375616.0)]
SECTION = b"x_m,y_m\n988404,6375602\n988405,6375616\n"
STOPS = b"release,x_m,y_m,z_m\none,988416,6375607,\ntwo,988418,6375609,1510\n"
SCREENS = b"""\
name,x_m,y_m,height_m,capacity_kJ
road,988404,6375602,,
road,988405,6375616,,
net,988410,6375602,4,900
net,988411,6375616,,
"""
POSTERIOR = b"model,weight,rn_limit,friction\nnoel_2017,0.2,0.3,0.5\nnoel_2017,0.5,0.4,0.6\nnoel_2017,0.3,0.35,0.4\n"
FACTORS = b"""title = "Our office"
share = 0.95
clearance_m = 0.5
[[factor]]
symbol = "a"
on = "speed"
value = 1.02
meaning = "reliability"
source = "office"
[[factor]]
symbol = "b"
on = "capacity"
value = 1.2
"""
SWEEP = b"""schema = 1
projects = ["project.toml"]
[options]
model = ["noel_2017", "stevens_1998"]
number = 2
seed = [1, 2]
[parameters.stevens_1998]
rn = [0.3, 0.35]
"""
ZONE_TABLE = b"value,name,friction,noel_2017.rn_limit\n0,scree,0.4,0.3\n1,rock,0.6,0.4\n2,soil,0.5,0.2\n"
SIMULATION = b"""
[simulation]
models = ["noel_2017"]
seed = 2
friction = 0.5
posterior = "posterior.csv"
record = ["impacts"]
cell_m = 2.0
faces = true
[simulation.releases]
from = "line"
points_m = [[988402.0, 6375604.0], [988402.0, 6375616.0]]
number = 4
diameter_m = "lognormal:0.5,0.1"
[simulation.trees]
file = "trees.csv"
[simulation.zones]
file = "zones.geojson"
[[simulation.screens]]
name = "road"
points_m = [[988410.0, 6375602.0], [988411.0, 6375616.0]]
height_m = 4.0
capacity_kJ = 900.0
[[simulation.screens]]
file = "screens.gpkg"
"""


def geopackage(polygons: bool = False) -> bytes:
    """Lines, or polygons, as a GIS saves them, without its indices."""
    ring = [(988402.0, 6375604.0), (988416.0, 6375604.0), (988416.0, 6375616.0), (988402.0, 6375604.0)]
    points = ring if polygons else LINE
    body = struct.pack(f"<I{2 * len(points)}d", len(points), *np.ravel(points))
    shape = struct.pack("<BI", 1, 3) + struct.pack("<I", 1) + body if polygons else struct.pack("<BI", 1, 2) + body
    blob = b"GP\0\x01" + struct.pack("<i", 2154) + shape
    with closing(sqlite3.connect(":memory:")) as database:
        database.executescript(
            """
            PRAGMA page_size = 512; PRAGMA application_id = 1196444487;
            CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT, srs_id INTEGER PRIMARY KEY, organization TEXT,
                organization_coordsys_id INTEGER, definition TEXT);
            INSERT INTO gpkg_spatial_ref_sys VALUES ('Lambert', 2154, 'EPSG', 2154, '');
            CREATE TABLE gpkg_contents (table_name TEXT PRIMARY KEY, data_type TEXT, srs_id INTEGER);
            INSERT INTO gpkg_contents VALUES ('map', 'features', 2154);
            CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, srs_id INTEGER);
            INSERT INTO gpkg_geometry_columns VALUES ('map', 'geom', 2154);
            CREATE TABLE map (fid INTEGER PRIMARY KEY, geom BLOB, name TEXT, height_m REAL, capacity_kJ REAL);
            """
        )
        for number, height in enumerate((None, None) if polygons else (None, 4.0)):
            row = (number, blob, f"one {number}", height, None if height is None else 900.0)
            database.execute("INSERT INTO map VALUES (?, ?, ?, ?, ?)", row)
        database.commit()
        return bytes(database.serialize())


def coloured() -> dict[str, bytes]:
    """Terrains that bring their colours, name → content; what stands beside them too."""
    import cv2
    import laspy
    import trimesh

    points, faces = examples._hill()
    n = len(points)
    colours = np.stack([np.arange(n) % 256, np.arange(n) * 7 % 256, np.full(n, 90)], axis=1).astype(np.uint8)
    local = points - SHIFT.vector
    head = "".join(
        f"property {kind} {name}\n"
        for kind, names in (("double", "xyz"), ("uchar", ("red", "green", "blue")))
        for name in names
    )
    rows = np.empty(n, [("p", "<f8", 3), ("c", "u1", 3)])
    rows["p"], rows["c"] = points, colours
    triangles = np.empty(len(faces), [("n", "u1"), ("i", "<i4", 3)])
    triangles["n"], triangles["i"] = 3, faces
    files = {
        "a.ply": f"ply\nformat binary_little_endian 1.0\nelement vertex {n}\n{head}element face {len(faces)}\n".encode()
        + b"property list uchar int vertex_indices\nend_header\n" + rows.tobytes() + triangles.tobytes(),
        "a.csv": ("x,y,z,r,g,b\n" + "".join(
            f"{x:.3f},{y:.3f},{z:.3f},{r},{g},{b}\n" for (x, y, z), (r, g, b) in zip(points, colours, strict=True)
        )).encode(),
        "a.obj": ("".join(
            f"v {x:.3f} {y:.3f} {z:.3f} {r / 255:.3f} {g / 255:.3f} {b / 255:.3f}\n"
            for (x, y, z), (r, g, b) in zip(points, colours, strict=True)
        ) + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)).encode(),
        "a.glb": trimesh.Trimesh(local, faces, vertex_colors=colours, process=False).export(file_type="glb"),
    }  # fmt: skip
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales, header.offsets = [0.001] * 3, SHIFT.vector
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.red, las.green, las.blue = (colours.T.astype(np.uint16)) * 257
    las.classification = np.full(n, 2, np.uint8)
    with io.BytesIO() as stream:
        las.write(stream)
        files["a.las"] = stream.getvalue()
    textured = "mtllib t.mtl\n" + "".join(f"v {x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in local)
    textured += "".join(f"vt {x / 22:.3f} {y / 22:.3f}\n" for x, y, _ in local) + "usemtl skin\n"
    textured += "".join(f"f {a + 1}/{a + 1} {b + 1}/{b + 1} {c + 1}/{c + 1}\n" for a, b, c in faces)
    files["t.obj"], files["t.mtl"] = textured.encode(), b"newmtl skin\nKd 1 1 1\nmap_Kd t.png\n"
    files["t.png"] = cv2.imencode(".png", colours.reshape(12, 12, 3))[1].tobytes()
    return files


def readers() -> dict[str, tuple[tuple[str, ...], Callable[[Path], object]]]:
    """Name → those of `FILES` that are damaged, and who reads them; terrain.ply is beside them."""
    from rockfall.core.exchange import (
        comparison_tables,
        partial_factors,
        posterior_tables,
        sweep,
        tables,
        trees,
        whole_run_tables,
        zones,
    )
    from rockfall.core.exchange.map_shapes import read_lines, read_polygons
    from rockfall.core.exchange.screens import read_screens
    from rockfall.core.exchange.simulation_tables import read_releases
    from rockfall.core.simulation.blocks import Blocks
    from rockfall.core.simulation.ground import Ground, make_ground
    from rockfall.core.terrain.opening import HowToRead
    from rockfall.core.terrain.readers import read_terrain
    from rockfall.core.workflow.chunk_store import ChunkStore

    def ground(at: Path) -> Ground:
        return make_ground(read_terrain(at / "terrain.ply"))

    def stops(at: Path) -> object:
        on = ground(at)
        return whole_run_tables.read_stops(at / "stops.csv", read_releases(at / "releases.csv", on, Blocks()), on)

    def predictions(at: Path) -> object:
        return comparison_tables.read_predictions(at / "predictions.csv", tables.read_impacts(at / "impacts.csv"))

    def attribute_zones(at: Path) -> object:
        return zones.open_zones(
            at / "zone_table.csv", "zone", read_terrain(at / "terrain.ply"), [MODEL],
            terrain_files=[at / "terrain.ply"], how=HowToRead(),
        )  # fmt: skip

    return {
        "lines": (("screens.gpkg",), lambda at: read_lines(at / "screens.gpkg", SHIFT)),
        "polygons": (("area.gpkg",), lambda at: read_polygons(at / "area.gpkg", SHIFT)),
        "screens": (("screens.gpkg",), lambda at: read_screens(at / "screens.gpkg", SHIFT)),
        "screen table": (("screens.csv",), lambda at: read_screens(at / "screens.csv", SHIFT)),
        "trees": (
            ("trees.csv",),
            lambda at: trees.read_trees(at / "trees.csv", read_terrain(at / "terrain.ply"), 10.0, "coniferous"),
        ),
        "posterior": (("posterior.csv",), lambda at: posterior_tables.read_posterior(at / "posterior.csv")),
        "factors": (("factors.toml",), lambda at: partial_factors.read_factors(at / "factors.toml")),
        "sweep": (("sweep.toml",), lambda at: sweep.find_jobs(at / "sweep.toml")),
        "section": (("section.csv",), lambda at: whole_run_tables.read_section(at / "section.csv", "a", ground(at))),
        "stops": (("stops.csv", "releases.csv"), stops),
        "predictions": (("predictions.csv",), predictions),
        "zones": (
            ("zones.geojson",),
            lambda at: zones.read_zones(at / "zones.geojson", read_terrain(at / "terrain.ply"), [MODEL]),
        ),
        "zone table": (("zone_table.csv",), attribute_zones),
        "chunks": (("merged.npz",), lambda at: ChunkStore(at).merged()),
    }


def files() -> dict[str, bytes]:
    """What `readers` and the commands read."""
    with io.BytesIO() as stream:
        np.savez(stream, **{"cells/count": np.arange(6.0), "screens/hits": np.arange(3), "chunks": np.arange(4)})
        chunks = stream.getvalue()
    predictions = "model,replicate,trajectory,impact,v2x_mps,v2y_mps,v2z_mps,flags\n" + "".join(
        f"{MODEL},{replicate},B{i % 3},{i // 3 + 1},4,0.2,{1 + i % 3},\n" for replicate in range(2) for i in range(15)
    )
    return {
        "screens.gpkg": geopackage(), "area.gpkg": geopackage(polygons=True), "screens.csv": SCREENS,
        "trees.csv": examples.TREES, "posterior.csv": POSTERIOR, "factors.toml": FACTORS, "sweep.toml": SWEEP,
        "section.csv": SECTION, "stops.csv": STOPS, "releases.csv": examples.RELEASES,
        "predictions.csv": predictions.encode(), "impacts.csv": examples.IMPACTS, "zones.geojson": examples.GEOJSON,
        "zone_table.csv": ZONE_TABLE, "merged.npz": chunks, "picks.csv": examples.PICKS,
        "project.toml": examples.PROJECT.partition(b"[simulation]")[0] + SIMULATION,
    }  # fmt: skip


COMMANDS = {
    "simulate with maps": (
        ("screens.gpkg", "posterior.csv", "releases.csv"),
        ("simulate", "@releases.csv", "--terrain", "@terrain.ply", "--model", MODEL, "--screen", "@screens.gpkg",
         "--posterior", "@posterior.csv", "--cell", "2", "--faces", "--geopackage", "--threads", "1"),
    ),
    "simulate all of a project": (
        ("project.toml", "trees.csv", "posterior.csv", "zones.geojson", "screens.gpkg"),
        ("simulate", "@project.toml", "--threads", "1"),
    ),
    "design": (
        ("project.toml", "factors.toml", "screens.gpkg"),
        ("design", "@project.toml", "--factors", "@factors.toml", "--no-pdf", "--no-holdout", "--threads", "1"),
    ),
    "compare-runs": (
        ("stops.csv", "releases.csv", "section.csv"),
        ("compare-runs", "@releases.csv", "--stops", "@stops.csv", "--terrain", "@terrain.ply", "--model", MODEL,
         "--number", "5", "--section", "a=@section.csv", "--tables-only", "--threads", "1"),
    ),
    "back-analyse": (
        ("stops.csv", "releases.csv"),
        ("back-analyse", "@releases.csv", "--stops", "@stops.csv", "--terrain", "@terrain.ply", "--model", MODEL,
         "--fit", "rn_limit", "--sets", "150", "--rounds", "1", "--tables-only", "--threads", "1"),
    ),
    "web": (("project.toml", "picks.csv"), ("web", "@project.toml")),
}  # fmt: skip
"""Name → the files that are damaged, and the words; terrain.ply and all of `files` are beside them."""
