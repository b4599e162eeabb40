# SPDX-License-Identifier: GPL-3.0-or-later
"""Small files of every format."""

import base64
import json
from pathlib import Path

import numpy as np
from rockfall.core.extras import E57, is_there
from rockfall.core.georeference import GlobalShift

ROOT = Path(__file__).resolve().parents[2]
DATA, FOOTAGE = ROOT / "tests" / "data", ROOT / "assets" / "demo" / "footage"
TRUTH, CAMERAS = ROOT / "assets" / "demo" / "truth.csv", ROOT / "assets" / "examples" / "two_cameras"
SHIFT = GlobalShift(988400.0, 6375600.0, 1500.0)


def _hill(n: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a slope of 2 m cells."""
    x, y = np.meshgrid(np.arange(n) * 2.0, np.arange(n) * 2.0)
    z = 30.0 - 0.8 * x + np.sin(y / 3.0)
    points = np.stack([x + 988400.0, y + 6375600.0, z + 1500.0], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + n], axis=1), np.stack([corner + 1, corner + n + 1, corner + n], axis=1)]
    )
    return points, faces


def _e57(points: np.ndarray, path: Path) -> bytes:
    import pye57

    file = pye57.E57(str(path), mode="w")
    for part in np.split(points, 2):
        raw = {f"cartesian{axis}": np.ascontiguousarray(column) for axis, column in zip("XYZ", part.T, strict=True)}
        file.write_scan_raw(raw, rotation=np.array([1.0, 0.0, 0.0, 0.0]), translation=SHIFT.vector)
    file.close()
    return path.read_bytes()


def terrain_files(folder: Path) -> dict[str, bytes]:
    import laspy
    import tifffile
    import trimesh

    points, faces = _hill()
    mesh = trimesh.Trimesh(points, faces, process=False)
    local = trimesh.Trimesh(points - SHIFT.vector, faces, process=False)
    n = len(points)
    head = f"element vertex {n}\nproperty double x\nproperty double y\nproperty double z\n"
    face_head = f"element face {len(faces)}\nproperty list uchar int vertex_indices\nproperty int zone\n"
    rows = "".join(f"{x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in points)
    triangles = np.empty(len(faces), [("n", "u1"), ("i", "<i4", 3), ("zone", "<i4")])
    triangles["n"], triangles["i"], triangles["zone"] = 3, faces, np.arange(len(faces)) % 3
    grid = points[:, 2].reshape(12, 12)[::-1]
    asc_head = "ncols 12\nnrows 12\nxllcorner 988400\nyllcorner 6375600\ncellsize 2\nNODATA_value -9999\n"
    files = {
        "a.ply": b"ply\nformat ascii 1.0\n" + f"{head}{face_head}end_header\n{rows}".encode()
        + "".join(f"3 {a} {b} {c} {i % 3}\n" for i, (a, b, c) in enumerate(faces)).encode(),
        "b.ply": b"ply\nformat binary_little_endian 1.0\n" + f"{head}{face_head}end_header\n".encode()
        + points.tobytes() + triangles.tobytes(),
        "c.ply": b"ply\nformat binary_big_endian 1.0\n" + f"{head}end_header\n".encode()
        + points.astype(">f8").tobytes(),
        "a.obj": mesh.export(file_type="obj").encode(),
        "a.stl": local.export(file_type="stl"),
        "b.stl": local.export(file_type="stl_ascii").encode(),
        "a.glb": local.export(file_type="glb"),
        "a.asc": (asc_head + "\n".join(" ".join(f"{z:.2f}" for z in row) for row in grid)).encode(),
        "a.xyz": rows.encode(),
        "a.csv": ("x;y;z\n" + rows.replace(" ", ";").replace(".", ",")).encode(),
        "b.csv": ("name,x,y,z\n" + "".join(f"p,{line}\n" for line in rows.replace(" ", ",").split("\n")[:-1])).encode(),
    }  # fmt: skip
    scan = "{}\n12\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n988400 6375600 1500 1\n{}"
    seen = [
        "".join(f"{x:.3f} {y:.3f} {z:.3f} 0.5\n" for x, y, z in part) for part in np.split(points - SHIFT.vector, 2)
    ]
    files["a.ptx"] = "".join(scan.format(7, "0 0 0 0.5\n" * 12 + part) for part in seen).encode()
    if is_there(E57):
        files["a.e57"] = _e57(points - SHIFT.vector, folder / "a.e57")
    parts = local.export(file_type="gltf")
    text = json.loads(parts.pop("model.gltf"))
    for buffer in text["buffers"]:
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(parts[buffer["uri"]]).decode()
    files["a.gltf"] = json.dumps(text).encode()
    place = [(33550, 12, 3, (2.0, 2.0, 0.0)), (33922, 12, 6, (0, 0, 0, 988400.0, 6375624.0, 0))]
    for name, options in {
        "a.tif": {},
        "b.tif": {"compression": "deflate", "predictor": 2},
        "c.tif": {"compression": "deflate", "tile": (16, 16)},
    }.items():
        heights = (grid * 10).astype(np.int16) if "predictor" in options else grid.astype(np.float32)
        tifffile.imwrite(folder / name, heights, extratags=[(*tag, True) for tag in place], **options)
        files[name] = (folder / name).read_bytes()
    for name in ("lzw_float32_tiles.tif", "packbits_int16.tif", "deflate_predictor3_float32.tif"):
        files[name] = (DATA / "geotiff" / name).read_bytes()
    for name in ("a.las", "b.laz", "c.las"):
        header = laspy.LasHeader(point_format=6 if name == "c.las" else 1, version="1.4" if name == "c.las" else "1.2")
        header.scales, header.offsets = [0.001] * 3, SHIFT.vector
        if name == "c.las":
            header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", b'PROJCS["x",AUTHORITY["EPSG","2154"]]\0'))
        las = laspy.LasData(header)
        las.x, las.y, las.z = points.T
        las.classification = np.full(n, 2, np.uint8)
        las.write(str(folder / name))
        files[name] = (folder / name).read_bytes()
    return files


IMPACTS = (
    "site,trajectory,impact,time_s,x_m,y_m,z_m,nx,ny,nz,v1x_mps,v1y_mps,v1z_mps,v2x_mps,v2y_mps,v2z_mps,"
    "diameter_m,mass_kg,omega1x_radps,omega1y_radps,omega1z_radps\n"
    + "".join(
        f"north,B{i % 3},{i // 3 + 1},{i * 0.4:.2f},{i},{2 * i},{50 - i},0.2,0.0,0.9798,"
        f"{6 + i % 5},0.3,{-4 - i % 4},{5 + i % 4},0.2,{2 + i % 3},0.4,90,0,{3 + i % 6},0\n"
        for i in range(15)
    )
).encode()
PICKS = (
    "trajectory,time_s,x_m,y_m,z_m,kind,status,sigma_time_s\n"
    + "".join(
        f"A,{0.5 * i:.3f},{988402 + 4.0 * i:.3f},{6375606 + i * 0.7:.3f},"
        f"{1528.4 - 3.2 * i + np.sin((6 + 0.7 * i) / 3):.3f},impact,ok,0.01\n"
        for i in range(5)
    )
).encode()
TREES = b"""\
tree,x_m,y_m,dbh_cm,height_m,species
one,988403,6375600,30,18,coniferous
two,988406,6375596,42,,broadleaved
"""
RELEASES = b"""\
release,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps,diameter_m,density_kgpm3,number
one,988403,6375606,,1,0,0,0.5,2600,2
two,988404,6375608,1540,1,0,0,0.4,,1
"""
SPIN_MARKS = (
    b"trajectory,frame,time_s,u_px,v_px,sigma_px,axis,counted_turns_per_s\n"
    b"A,12,0.48,640.5,360.25,1,rolling,\nA,13,0.52,652.5,355.75,1,rolling,4.5\n"
)
POLYGON = b"name,x_m,y_m,friction\nscree,988402,6375604,0.4\nscree,988416,6375604,0.4\nscree,988416,6375616,0.4\n"
GEOJSON = json.dumps(
    {"type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2154"}},
     "features": [{"type": "Feature", "properties": {"name": "scree", "friction": 0.4},
                   "geometry": {"type": "Polygon", "coordinates": [[[988402.0, 6375604.0], [988416.0, 6375604.0],
                                                                    [988416.0, 6375616.0], [988402.0, 6375604.0]]]}}]},
).encode()  # fmt: skip
PARAMETERS = b"[models.noel_2017]\nrn_limit = 0.4\nrt = 0.8\n"
PROJECT = b"""schema = 1
[site]
name = "Slope"
[terrain]
file = "terrain.ply"
shift = [988400.0, 6375600.0, 1500.0]
unit_m = 1.0
[picks]
file = "picks.csv"
[block]
d1_m = 0.4
d2_m = 0.4
d3_m = 0.3
density_kgpm3 = 2650.0
[[blocks]]
name = "A"
d1_m = 0.5
[reconstruction]
gravity_mps2 = 9.81
drag = true
drag_coefficient = 0.9
air_density_kgpm3 = 1.2
normal_radius_m = 1.0
[simulation]
model = "noel_2017"
seed = 3
[[render]]
name = "hd"
width = 640
height = 360
fps = 25.0
camera = { position = [1.0, 2.0, 3.0], target = [0.0, 0.0, 0.0], fov_deg = 40.0 }
"""


def head_of(path: Path, size: int, end: bytes = b"\n") -> bytes:
    """The beginning of a text file, whole rows or whole sections of it."""
    return path.read_bytes()[:size].rpartition(end)[0]


def two_cameras() -> dict[str, bytes]:
    """A project with two cameras and one trajectory."""
    files = {path.name: path.read_bytes() for path in CAMERAS.iterdir() if path.suffix in (".toml", ".csv", ".ply")}
    for name in [name for name in files if name.startswith(("track", "picks"))]:
        lines = files[name].split(b"\n")
        files[name] = b"\n".join(line for line in lines if line.startswith((b"traj", b"run_0001")))
    return files
