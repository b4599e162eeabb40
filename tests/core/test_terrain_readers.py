# SPDX-License-Identifier: GPL-3.0-or-later
"""Every terrain format: written by another program or by hand, read back, numbers compared; real lidar."""

import json
import re
import struct
from pathlib import Path

import laspy
import numpy as np
import pytest
import rockfall.core.terrain.geotiff as geotiff_module
import tifffile
import trimesh
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.crs import CoordinateSystem, system_from_geokeys, system_from_wkt
from rockfall.core.terrain.meshes import read_obj
from rockfall.core.terrain.opening import READERS
from rockfall.core.terrain.ply_attributes import read_ply_attribute
from rockfall.core.terrain.readers import inspect_terrain, read_terrain
from rockfall.core.terrain.text import BLOCK_BYTES, line_blocks
from rockfall.core.terrain.writers import write_ply

DATA = Path(__file__).parents[1] / "data"
LV95 = np.array([2_600_000.0, 1_200_000.0, 1_500.0])


def hill(n: int = 9) -> trimesh.Trimesh:
    """A small hill around LV95's 2 600 000, 1 200 000, with coordinates that float32 cannot hold."""
    x, y = np.meshgrid(np.arange(n) * 1.5, np.arange(n) * 1.5)
    z = 3 * np.sin(x / 3) + np.random.default_rng(0).normal(0, 0.1, x.shape)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    vertices = np.stack([x, y, z], -1).reshape(-1, 3) + LV95 + 0.123456789
    return trimesh.Trimesh(vertices, faces, process=False)


def said(surface, words: str) -> bool:
    return any(words in sentence for sentence in surface.summary)


def ply_bytes(mesh: trimesh.Trimesh, form: str, extra: bool = False) -> bytes:
    """PLY by hand, in any byte order, with or without properties that are not needed."""
    header = ["ply", f"format {form} 1.0", "comment by hand", f"element vertex {len(mesh.vertices)}"]
    header += ["property double x", "property double y"] + ["property uchar red"] * extra + ["property double z"]
    header += [f"element face {len(mesh.faces)}"] + ["property float quality"] * extra
    header += ["property list uchar int vertex_indices", "end_header", ""]
    text = "\n".join(header).encode()
    if form == "ascii":
        for x, y, z in mesh.vertices.tolist():
            text += (f"{x!r} {y!r} 7 {z!r}\n" if extra else f"{x!r} {y!r} {z!r}\n").encode()
        for face in mesh.faces.tolist():
            text += (("0.5 " if extra else "") + f"3 {face[0]} {face[1]} {face[2]}\n").encode()
        return text
    order = "<" if "little" in form else ">"
    fields = [("x", f"{order}f8"), ("y", f"{order}f8")] + [("red", "u1")] * extra + [("z", f"{order}f8")]
    vertices = np.zeros(len(mesh.vertices), fields)
    for k, axis in enumerate("xyz"):
        vertices[axis] = mesh.vertices[:, k]
    faces = np.zeros(len(mesh.faces), [("quality", f"{order}f4")] * extra + [("count", "u1"), ("v", f"{order}i4", 3)])
    faces["count"], faces["v"] = 3, mesh.faces
    return text + vertices.tobytes() + faces.tobytes()


@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_keeps_doubles_exactly(tmp_path, form, extra):
    mesh = hill()
    (tmp_path / "hill.ply").write_bytes(ply_bytes(mesh, form, extra))
    surface = read_terrain(tmp_path / "hill.ply")
    assert surface.shift == GlobalShift(2_600_000, 1_200_000, 0)
    np.testing.assert_array_equal(surface.shift.to_survey(surface.vertices), mesh.vertices)
    np.testing.assert_array_equal(surface.faces, mesh.faces)
    assert np.abs(surface.vertices[:, :2]).max() < 20
    assert said(surface, "Mesh of 81 vertices and 128 faces")
    assert said(surface, "Shifted by (2600000, 1200000, 0)")


def test_survey_coordinates_survive_write_and_read(tmp_path):
    mesh = hill()
    source = write(tmp_path / "a.ply", ply_bytes(mesh, "binary_little_endian"))
    surface = read_terrain(source, shift=GlobalShift(2_600_000, 1_200_000, 0, "EPSG:2056"))
    write_ply(surface, tmp_path / "b.ply")
    again = read_terrain(tmp_path / "b.ply")
    assert again.shift == surface.shift
    np.testing.assert_allclose(again.shift.to_survey(again.vertices), mesh.vertices, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(again.vertices, surface.vertices)
    np.testing.assert_array_equal(again.faces, surface.faces)
    loaded = trimesh.load_mesh(tmp_path / "b.ply", process=False)
    np.testing.assert_array_equal(loaded.faces, surface.faces)


def write(path: Path, data: bytes | str) -> Path:
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_ply_with_quads_and_triangles(tmp_path, form):
    head = f"ply\nformat {form} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 2\nproperty list uchar int vertex_index\nend_header\n"
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 1]], "<f4")
    if form == "ascii":
        body = "\n".join(" ".join(map(str, p)) for p in points.tolist()) + "\n4 0 1 2 3\n3 1 4 2\n"
        path = write(tmp_path / "q.ply", head + body)
    else:
        quad = b"\4" + np.array([0, 1, 2, 3], "<i4").tobytes()
        path = write(
            tmp_path / "q.ply", head.encode() + points.tobytes() + quad + b"\3" + np.array([1, 4, 2], "<i4").tobytes()
        )
    surface = read_terrain(path)
    np.testing.assert_array_equal(surface.vertices, points)
    np.testing.assert_array_equal(surface.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2]])


def test_ply_with_points_only_is_a_cloud(tmp_path):
    path = tmp_path / "cloud.ply"
    path.write_bytes(trimesh.PointCloud(hill().vertices - LV95).export(file_type="ply"))
    surface = read_terrain(path)
    assert len(surface.vertices) == 81
    assert said(surface, "2.5-D Delaunay")
    assert (surface.face_normals[:, 2] > 0).all()


def test_ply_of_trimesh_and_other_mesh_formats(tmp_path):
    mesh = hill()
    mesh.apply_translation(-LV95)
    for name in ("a.ply", "a.obj", "a.stl", "b.stl"):
        mesh.export(tmp_path / name, **({"file_type": "stl_ascii"} if name == "b.stl" else {}))
        surface = read_terrain(tmp_path / name)
        assert len(surface.vertices) == 81, name
        triangles = surface.vertices[surface.faces]
        np.testing.assert_allclose(triangles, mesh.triangles, atol=1e-5, err_msg=name)
        assert said(surface, "Merged 303 vertices") == name.endswith("stl")


def test_obj_keeps_doubles_and_understands_its_face_forms(tmp_path):
    obj = "# made by hand\nmtllib x.mtl\nv 2600000.123456789 1200000.5 3 0.5 0.5 0.5\nv 2600001 1200000 3 1 1 1\n"
    obj += "v 2600001 1200001 3.5 0 0 0\nv 2600000 1200001 3 0 0 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1 4\n"
    obj += "v 2600002 1200000.5 4 0 0 0\n"
    obj += "f -4 -1 -3\n"
    surface = read_terrain(write(tmp_path / "a.obj", obj))
    assert surface.shift.to_survey(surface.vertices)[0, 0] == 2600000.123456789
    np.testing.assert_array_equal(surface.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2]])


def test_obj_of_several_objects_with_polygons_and_relative_numbers(tmp_path):
    """Numbers from the back count from the face on, not from the end of the file."""
    text = "o one\nv 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 6 0\nv 0 4 0\ng pentagon\nusemtl stone\ns 1\nf -5 -4 -3 -2 -1\n"
    text += "o two\nvt 0 0\nv 10 0 0\nv 14 0 0\nv 14 4 1\nl 1 2\nf -3/1 -2/1 -1/1\nf\t6//  8 7\n"
    source = read_obj(write(tmp_path / "a.obj", text))
    np.testing.assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7], [5, 7, 6]])
    np.testing.assert_array_equal(source.points[[3, 7]], [[2, 6, 0], [14, 4, 1]])


def test_obj_that_is_read_in_several_blocks_counts_its_corners_and_rows_through(tmp_path):
    path, quads = tmp_path / "long.obj", 15_000
    heights = np.random.default_rng(2).uniform(0, 0.2, 4 * quads)
    corners = [f"v {i % 4 in (1, 2):d}.25 {i // 4 + (i % 4 > 1)}.5 {z:.9f}" for i, z in enumerate(heights)]
    lines = [line for i in range(quads) for line in (*corners[4 * i : 4 * i + 4], "f -4 -3 -2 -1")]
    path.write_bytes("\r\n".join(lines).encode())
    assert path.stat().st_size > BLOCK_BYTES
    source = read_obj(path)
    np.testing.assert_array_equal(source.points[:, 2], np.round(heights, 9))
    fans = np.array([[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(source.faces.reshape(-1, 2, 3), 4 * np.arange(quads)[:, None, None] + fans)
    for bad, problem in (("f 1 2 60001", "does not exist"), ("v 0 zero 0", "not a number"), ("v 0 0", "2 values")):
        path.write_text("\n".join([*lines, bad]))
        with pytest.raises(InputError, match=problem) as caught:
            read_obj(path)
        assert caught.value.row == 5 * quads + 1


@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
def test_lines_in_blocks_are_those_of_the_whole_text(tmp_path, newline):
    path, lines = tmp_path / "a.txt", [b"one", b"", b"three and more", b"4"]
    for end in (b"", newline):
        path.write_bytes(newline.join(lines) + end)
        for size in range(1, 30):
            found = [line for block in line_blocks(path, size) for line in block]
            assert found == lines, (size, end)


def test_obj_of_polygons_as_trimesh_reads_it(tmp_path):
    rng = np.random.default_rng(4)
    counts = rng.choice([3, 5, 6, 7], 300)
    on_circles = [np.sort(rng.choice(60, count, replace=False)) + 1 for count in counts]
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)  # polygons of points on a circle are convex
    points = LV95 + np.stack([9 * np.cos(angles), 9 * np.sin(angles), 3 * np.cos(angles)], axis=1)
    corners = [np.roll(face, k) for face, k in zip(on_circles, rng.integers(0, 7, 300), strict=True)]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + ["vt 0 0", "vn 0 0 1"]
    lines += ["f " + " ".join(f"{corner}/1/1" for corner in face) for face in corners]
    path = write(tmp_path / "a.obj", "\n".join(lines))
    source, other = read_obj(path), trimesh.load_mesh(path, process=False, maintain_order=True, skip_materials=True)
    np.testing.assert_array_equal(source.points, other.vertices)
    assert sorted(source.faces.tolist()) == sorted(other.faces.tolist())


@pytest.mark.parametrize("extension", ["glb", "gltf"])
def test_gltf_is_y_up_and_its_nodes_place_it(tmp_path, extension):
    mesh = hill()
    mesh.apply_translation(-LV95)
    y_up = mesh.copy()
    y_up.vertices = np.stack([mesh.vertices[:, 0], mesh.vertices[:, 2], -mesh.vertices[:, 1]], 1)
    scene = trimesh.Scene()
    scene.add_geometry(y_up, node_name="a")
    scene.add_geometry(y_up, node_name="b", transform=trimesh.transformations.translation_matrix([100, 0, 0]))
    for name, data in (
        {f"a.{extension}": scene.export(file_type="glb")} if extension == "glb" else scene.export(file_type="gltf")
    ).items():
        (tmp_path / name.replace("model", "a")).write_bytes(data)
    surface = read_terrain(tmp_path / f"a.{extension}")
    np.testing.assert_allclose(surface.vertices[:81], mesh.vertices, atol=1e-5)
    np.testing.assert_allclose(surface.vertices[81:], np.add(mesh.vertices, [100, 0, 0]), atol=2e-5)
    assert (surface.face_normals[:, 2] > 0).all()
    assert said(surface, "Turned from Y up to Z up")
    flat = read_terrain(tmp_path / f"a.{extension}", up="z")
    np.testing.assert_allclose(flat.vertices[:81], y_up.vertices, atol=1e-5)
    assert said(flat, "read it with Y up")


def test_y_up_and_millimetres_are_options(tmp_path):
    mesh = hill()
    in_mm = (mesh.vertices - LV95)[:, [0, 2, 1]] * [1000, 1000, -1000]
    path = write(tmp_path / "a.ply", ply_bytes(trimesh.Trimesh(in_mm, mesh.faces, process=False), "ascii"))
    surface = read_terrain(path, up="y", unit_m=0.001)
    np.testing.assert_allclose(surface.vertices, mesh.vertices - LV95, atol=1e-9)
    assert said(surface, "Turned from Y up to Z up, as asked")
    assert said(surface, "Multiplied by 0.001")
    info = inspect_terrain(path, up="y", unit_m=0.001)
    np.testing.assert_allclose([info.minimum, info.maximum], surface.bounds)
    for bad in ({"up": "x"}, {"unit_m": 0}, {"unit_m": np.nan}):
        with pytest.raises(InputError, match=r"up axis|unit of"):
            read_terrain(path, **bad)


def test_size_gives_away_millimetres_and_degrees(tmp_path):
    table = np.random.default_rng(0).uniform(0, 1, (50, 3))
    np.savetxt(tmp_path / "mm.xyz", table * [80_000, 90_000, 60_000])
    assert said(read_terrain(tmp_path / "mm.xyz"), "in millimetres")
    np.savetxt(tmp_path / "degrees.xyz", table * [0.002, 0.002, 100] + [7.1, 46.2, 1500])
    with pytest.raises(InputError, match="look like degrees"):
        read_terrain(tmp_path / "degrees.xyz")


def test_any_winding_ends_with_normals_out_of_the_ground(tmp_path):
    mesh = hill()
    expected = mesh.face_normals
    rng = np.random.default_rng(1)
    for turned in (np.ones(len(mesh.faces), bool), rng.uniform(size=len(mesh.faces)) < 0.3):
        faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
        path = write(tmp_path / "w.ply", ply_bytes(trimesh.Trimesh(mesh.vertices, faces, process=False), "ascii"))
        surface = read_terrain(path)
        np.testing.assert_allclose(surface.face_normals, expected, atol=1e-7)
        assert said(surface, f"Turned {turned.sum()} of 128 faces")


def test_degenerate_faces_and_loose_vertices_are_dropped_and_said(tmp_path):
    mesh = hill(3)
    vertices = np.concatenate([mesh.vertices, [mesh.vertices[0] + 50, (mesh.vertices[0] + mesh.vertices[1]) / 2]])
    faces = np.concatenate([mesh.faces, [[0, 0, 1], [0, 10, 1]]])
    path = write(tmp_path / "d.ply", ply_bytes(trimesh.Trimesh(vertices, faces, process=False), "binary_big_endian"))
    surface = read_terrain(path)
    assert (len(surface.vertices), len(surface.faces)) == (9, 8)
    assert said(surface, "Dropped 2 degenerate faces")
    assert said(surface, "Left out 2 points that no triangle uses")


ASC = "ncols 3\nnrows 2\nxllcorner 2600000\nyllcorner 1200000\ncellsize 2\nNODATA_value -9999\n{}"


def test_ascii_grid_places_heights_at_cell_centres(tmp_path):
    path = write(tmp_path / "a.asc", ASC.format("1 2 3\n4 5 6\n"))
    surface = read_terrain(path)
    expected = [[1, 3, 1], [3, 3, 2], [5, 3, 3], [1, 1, 4], [3, 1, 5], [5, 1, 6]]
    np.testing.assert_array_equal(surface.vertices, expected)
    assert surface.shift.vector.tolist() == [2_600_000, 1_200_000, 0]
    assert len(surface.faces) == 4
    assert surface.face_areas.sum() == pytest.approx(8 * np.sqrt(1 + 0.5**2 + 1.5**2))
    assert (surface.face_normals[:, 2] > 0).all()
    centred = write(tmp_path / "b.asc", path.read_text().replace("llcorner", "llcenter"))
    np.testing.assert_array_equal(read_terrain(centred).vertices, np.subtract(expected, [1, 1, 0]))


def test_grid_cells_split_along_the_shorter_diagonal_and_leave_holes(tmp_path):
    along = read_terrain(write(tmp_path / "a.asc", ASC.format("9 0 7\n5 9 0\n"))).faces.tolist()
    assert sorted(map(sorted, along)) == [[0, 1, 4], [0, 3, 4], [1, 2, 5], [1, 4, 5]]
    across = read_terrain(write(tmp_path / "a.asc", ASC.format("0 9 0\n9 5 7\n"))).faces.tolist()
    assert sorted(map(sorted, across)) == [[0, 1, 3], [1, 2, 5], [1, 3, 4], [1, 4, 5]]
    hole = read_terrain(write(tmp_path / "b.asc", ASC.format("1 2 3\n4 -9999 6\n")))
    assert (len(hole.vertices), len(hole.faces)) == (5, 2)
    assert hole.face_areas.sum() == pytest.approx(2 * 2 * np.sqrt(1 + 0.5**2 + 1.5**2))
    assert said(hole, "1 cells without data are holes")


def geotiff(path: Path, heights, tags, **options) -> Path:
    tifffile.imwrite(path, heights, extratags=[(c, t, len(v) if t != 2 else 0, v, True) for c, t, v in tags], **options)
    return path


def geokeys(*keys: tuple[int, int]) -> tuple[int, int, tuple[int, ...]]:
    return 34735, 3, (1, 1, 0, len(keys), *(n for key, value in keys for n in (key, 0, 1, value)))


SCALE, TIEPOINT = (33550, 12, (2.0, 2.0, 0.0)), (33922, 12, (0.0, 0.0, 0.0, 2600000.0, 1200004.0, 0.0))
HEIGHTS = np.array([[1, 2, 3], [4, 5, 6]], np.float32)


@pytest.mark.parametrize("compression", [None, "deflate"])
def test_geotiff_georeference_and_crs(tmp_path, compression):
    tags = [SCALE, TIEPOINT, geokeys((1024, 1), (1025, 1), (3072, 2056))]
    surface = read_terrain(geotiff(tmp_path / "a.tif", HEIGHTS, tags, compression=compression))
    expected = [[1, 3, 1], [3, 3, 2], [5, 3, 3], [1, 1, 4], [3, 1, 5], [5, 1, 6]]
    np.testing.assert_array_equal(surface.vertices, expected)
    assert surface.shift == GlobalShift(2600000, 1200000, 0, "EPSG:2056")
    assert said(surface, "EPSG:2056")
    with pytest.raises(InputError, match=r"EPSG:2056.*EPSG:21781"):
        read_terrain(tmp_path / "a.tif", shift=GlobalShift(crs="EPSG:21781"))


def wavy(rows: int, columns: int, kind: str) -> np.ndarray:
    """Heights that every kind of number holds exactly, but for the eighths of a metre that integers cut off."""
    i, j = np.mgrid[:rows, :columns]
    return (100 + (7 * i * i + 13 * j) % 101 / 8).astype(kind)


FIXTURES = sorted((DATA / "geotiff").glob("[!r]*.tif"))


@pytest.mark.parametrize("path", FIXTURES, ids=lambda path: path.stem)
def test_geotiff_variants_of_another_program_are_equal_in_every_value(path):
    """Compressions and predictors that tifffile alone can neither write nor read."""
    assert len(FIXTURES) == 13
    points = geotiff_module.read_geotiff(path).points
    kind = next(word for word in re.split("[_.]", path.name) if word in np.sctypeDict)
    np.testing.assert_array_equal(points[:, 2].reshape(19, 23), wavy(19, 23, kind))
    np.testing.assert_array_equal(points[[0, 23], :2], [[2600001, 1200037], [2600001, 1200035]])


INTEGERS = ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")


@pytest.mark.parametrize(
    ("kinds", "options"),
    [
        ((*INTEGERS, "f2", "f4", "f8"), {}),
        ((*INTEGERS, "f2", "f4", "f8"), {"byteorder": ">", "rowsperstrip": 7}),
        ((*INTEGERS, "f2", "f4", "f8"), {"tile": (16, 16), "bigtiff": True}),
        ((*INTEGERS, "f2", "f4", "f8"), {"compression": "deflate", "tile": (32, 16)}),
        (INTEGERS, {"compression": "deflate", "predictor": 2, "rowsperstrip": 5}),
    ],
    ids=["plain", "big endian", "BigTIFF", "deflated tiles", "differences"],
)
def test_plain_and_deflated_geotiffs_are_equal_in_every_value(tmp_path, kinds, options):
    for kind in kinds:
        heights = wavy(37, 41, kind)
        source = geotiff_module.read_geotiff(geotiff(tmp_path / "a.tif", heights, [SCALE, TIEPOINT], **options))
        np.testing.assert_array_equal(source.points[:, 2].reshape(37, 41), heights)


@pytest.mark.parametrize("layout", ["contig", "separate"])
def test_the_first_of_several_bands_of_a_geotiff_is_the_height(tmp_path, layout):
    first = wavy(5, 6, "f4")
    bands = np.stack([first, first * 0, first * 0 + 1], axis=0 if layout == "separate" else -1)
    options = {"planarconfig": layout, "photometric": "minisblack"}
    source = geotiff_module.read_geotiff(geotiff(tmp_path / "a.tif", bands, [SCALE, TIEPOINT], **options))
    np.testing.assert_array_equal(source.points[:, 2].reshape(5, 6), first)
    assert "The first of 3 bands is taken as the height." in source.notes


@pytest.mark.parametrize(
    ("trouble", "told"),
    [
        (
            PermissionError(13, "Permission denied"),
            "The terrain cannot be read .*Permission denied.*Check its permissions",
        ),
        (MemoryError(), "The terrain needs more memory than there is. Reduce it"),
    ],
)
def test_troubles_of_the_system_are_refusals_too(tmp_path, monkeypatch, trouble, told):
    def read(path):
        raise trouble

    monkeypatch.setitem(READERS, ".ply", read)
    path = write(tmp_path / "a.ply", "ply\n")
    with pytest.raises(InputError, match=rf"a\.ply: {told}"):
        read_terrain(path)


def test_a_nodata_value_of_a_geotiff_that_is_no_number_is_refused(tmp_path):
    geotiff(tmp_path / "a.tif", HEIGHTS, [SCALE, TIEPOINT, (42113, 2, "none")])
    with pytest.raises(InputError, match=r'a\.tif: The NODATA value "none" is not a number'):
        read_terrain(tmp_path / "a.tif")


def test_geotiff_pixel_is_point_nodata_and_transformation(tmp_path):
    tags = [SCALE, TIEPOINT, geokeys((1024, 1), (1025, 2), (3072, 2056)), (42113, 2, "-32768")]
    heights = np.array([[1, 2, 3], [4, -32768, 6]], np.int16)
    surface = read_terrain(geotiff(tmp_path / "p.tif", heights, tags))
    np.testing.assert_array_equal(surface.vertices, [[0, 4, 1], [2, 4, 2], [4, 4, 3], [0, 2, 4], [4, 2, 6]])
    # A quarter turn: columns run north, rows run east.
    matrix = (0.0, 2.0, 0.0, 100.0, 2.0, 0.0, 0.0, 200.0, *(0.0,) * 7, 1.0)
    turned = read_terrain(geotiff(tmp_path / "t.tiff", HEIGHTS, [(34264, 12, matrix)]))
    np.testing.assert_array_equal(turned.vertices[:4], [[101, 201, 1], [101, 203, 2], [101, 205, 3], [103, 201, 4]])
    assert (turned.face_normals[:, 2] > 0).all()


def test_geotiff_in_degrees_or_without_georeference_is_refused(tmp_path):
    with pytest.raises(InputError, match="in degrees"):
        read_terrain(geotiff(tmp_path / "g.tif", HEIGHTS, [SCALE, TIEPOINT, geokeys((1024, 2), (2048, 4326))]))
    with pytest.raises(InputError, match="no georeference"):
        read_terrain(geotiff(tmp_path / "n.tif", HEIGHTS, []))
    with pytest.raises(InputError, match="picture of 3 bands"):
        read_terrain(geotiff(tmp_path / "rgb.tif", np.zeros((4, 5, 3), np.uint8), [SCALE, TIEPOINT], photometric="rgb"))


def cloud_file(path: Path, classes, points=None) -> Path:
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    las.header.scales, las.header.offsets = [0.001] * 3, LV95
    points = hill().vertices if points is None else points
    las.x, las.y, las.z = points.T
    las.classification = classes
    las.write(path)
    return path


@pytest.mark.parametrize("extension", ["las", "laz"])
def test_las_cloud_and_its_ground_class(tmp_path, extension):
    points = hill().vertices
    classes = np.where(np.arange(81) % 3 == 0, 5, 2)
    path = cloud_file(tmp_path / f"a.{extension}", classes)
    ground, every = read_terrain(path), read_terrain(path, ground_only=False)
    assert (len(ground.vertices), len(every.vertices)) == (54, 81)
    survey = every.shift.to_survey(every.vertices)
    expected = points[np.lexsort((points[:, 1], points[:, 0]))]
    np.testing.assert_allclose(survey[np.lexsort((survey[:, 1], survey[:, 0]))], expected, atol=0.00051)
    assert said(ground, "the 54 points of the ground class (2)")
    assert said(every, "all classes, as asked")
    unclassified = cloud_file(tmp_path / f"b.{extension}", np.ones(81, int))
    assert said(read_terrain(unclassified), "no ground class")
    with pytest.raises(InputError, match=r"None of the 81 points is classified as ground \(class 2\)"):
        read_terrain(unclassified, ground_only=True)
    noisy = read_terrain(cloud_file(tmp_path / f"c.{extension}", np.where(np.arange(81) < 4, 7, 1)))
    assert said(noisy, "Left out 4 points classified as noise")
    info = inspect_terrain(path)
    assert (info.kind, info.point_count, info.face_count) == ("cloud", 81, 0)
    np.testing.assert_allclose(info.minimum, points.min(axis=0), atol=0.00051)


@pytest.mark.parametrize(
    "text",
    ["{0} {1} {2}\n", "{0},{1},{2}\n", "{0};{1};{2};77\n", "{0}\t{1}\t{2}\t12\t99\n", "  {0}   {1} {2}\r\n"],
)
def test_tables_of_coordinates(tmp_path, text):
    points = hill().vertices
    path = write(
        tmp_path / "a.txt", "# comment\n" + "".join(text.format(*map(repr, p)) for p in points.tolist()) + "\n"
    )
    surface = read_terrain(path)
    survey = surface.shift.to_survey(surface.vertices)
    np.testing.assert_array_equal(survey[np.lexsort(survey.T[::-1])], points[np.lexsort(points.T[::-1])])
    assert said(surface, "Meshed 81 points in plan")


def test_table_with_named_columns_and_prj_beside(tmp_path):
    points = hill().vertices.tolist()
    rows = "".join(f"{i},{z!r},{y!r},{x!r}\n" for i, (x, y, z) in enumerate(points))
    path = write(tmp_path / "a.csv", "id,Elevation,Northing,Easting\n" + rows)
    write(
        tmp_path / "a.prj",
        'PROJCS["CH1903+ / LV95",GEOGCS["CH1903+",AUTHORITY["EPSG","4150"]],AUTHORITY["EPSG","2056"]]',
    )
    surface = read_terrain(path)
    assert surface.shift.crs == "EPSG:2056"
    assert surface.vertices[:, 0].max() == pytest.approx(12.123456789)
    write(tmp_path / "a.prj", 'PROJCS["CH1903+_LV95",GEOGCS["GCS_CH1903+"]]')
    assert said(read_terrain(path, shift=surface.shift), "names its system CH1903+_LV95: check")


def test_maximum_edge_and_duplicates_of_clouds(tmp_path):
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    left = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    points = np.concatenate([left, np.add(left, [60, 0, 0]), np.add(left[:5], [0, 0, 7])])
    np.savetxt(tmp_path / "two.xyz", points)
    surface = read_terrain(tmp_path / "two.xyz")
    assert surface.face_areas.sum() == pytest.approx(2 * 19 * 19)
    assert surface.vertices[:, 2].max() == 0
    assert said(surface, "5 points above another")
    assert said(surface, "10 times the spacing")
    bridged = read_terrain(tmp_path / "two.xyz", max_edge_m=100)
    assert bridged.face_areas.sum() == pytest.approx(79 * 19)
    with pytest.raises(InputError, match=r"two\.xyz.*below 0.5 m"):
        read_terrain(tmp_path / "two.xyz", max_edge_m=0.5)


def test_a_given_shift_is_used_and_a_far_one_said(tmp_path):
    path = write(tmp_path / "a.ply", ply_bytes(hill(), "ascii"))
    shift = GlobalShift(2_600_010, 1_199_990, 1500, "EPSG:2056")
    surface = read_terrain(path, shift=shift)
    assert surface.shift == shift
    np.testing.assert_allclose(surface.vertices[0], [-9.876543211, 10.123456789, 0.12 + 0.003456789], atol=0.5)
    assert said(read_terrain(path, shift=GlobalShift()), "2,600 km from the project's origin")


def test_crs_names():
    def name_and_kind(system: CoordinateSystem) -> tuple[str, str]:
        return system.name, system.kind

    assert name_and_kind(system_from_geokeys({1024: 1, 3072: 2056})) == ("EPSG:2056", "plane")
    assert name_and_kind(system_from_geokeys({1024: 2, 2048: 4326})) == ("EPSG:4326", "geographic")
    assert name_and_kind(system_from_geokeys({1024: 1, 2048: 4150, 3072: 32767})) == ("", "plane")
    assert system_from_geokeys({}) == CoordinateSystem()
    lv95 = 'PROJCS["CH1903+ / LV95",GEOGCS["CH1903+",AUTHORITY["EPSG","4150"]],AUTHORITY["EPSG","2056"]]'
    assert name_and_kind(system_from_wkt(lv95)) == ("EPSG:2056", "plane")
    compound = f'COMPD_CS["LV95 + LN02",{lv95},VERT_CS["LN02",AUTHORITY["EPSG","5728"]],AUTHORITY["EPSG","6790"]]'
    assert name_and_kind(system_from_wkt(compound)) == ("EPSG:2056", "plane")
    assert name_and_kind(system_from_wkt('PROJCS["Local grid",GEOGCS["x"]]')) == ("Local grid", "plane")
    assert name_and_kind(system_from_wkt('GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]]')) == ("EPSG:4326", "geographic")
    assert name_and_kind(system_from_wkt('PROJCRS["a",BASEGEOGCRS["b"],ID["EPSG",2975]]')) == ("EPSG:2975", "plane")


def test_real_vegetated_tile_of_la_reunion():
    path = DATA / "sample_lareunion_epsg2975.laz"
    surface = read_terrain(path)
    assert said(surface, "59,712 points")
    assert said(surface, "no ground class")
    assert surface.shift == GlobalShift(377_000, 7_656_000, 0, "EPSG:2975")
    assert 59_600 < len(surface.vertices) <= 59_712
    # 24 points/m² in plan: 0.20 m apart, a little more on the slope.
    assert surface.mean_spacing_m == pytest.approx(0.21, abs=0.015)
    centred = surface.vertices - surface.vertices.mean(axis=0)
    slope = np.linalg.lstsq(centred[:, :2], centred[:, 2], rcond=None)[0]
    assert np.degrees(np.arctan(np.hypot(*slope))) == pytest.approx(32, abs=1.5)
    info = inspect_terrain(path)
    assert (info.point_count, info.crs, info.shift) == (59_712, "EPSG:2975", surface.shift)
    np.testing.assert_allclose(info.maximum - info.minimum, [50, 49.99, 61.84], atol=0.02)


def test_real_classified_tile_of_the_chablais():
    surface = read_terrain(DATA / "las_chablais3.laz")
    assert said(surface, "8,047 points of the ground class")
    assert surface.shift.crs == "EPSG:2154"
    assert len(surface.vertices) == 8_047
    assert surface.mean_spacing_m == pytest.approx(0.94, abs=0.03)
    every = read_terrain(DATA / "las_chablais3.laz", ground_only=False)
    assert said(every, "92,097 points")
    assert every.mean_spacing_m < surface.mean_spacing_m / 2


def test_real_grid_of_tschamut():
    surface = read_terrain(DATA / "tschamut_2014_terrain.asc")
    assert (len(surface.vertices), len(surface.faces)) == (43 * 46, 2 * 42 * 45)
    np.testing.assert_allclose(surface.bounds[:, :2], [[-32.5, 87.5], [177.5, 312.5]])
    np.testing.assert_array_equal(surface.vertices[0], [-32.5, 312.5, 125.494105])
    # The trend plane that the grid was made from: z falls 0.25 per metre in x, rises 0.41 in y.
    centred = surface.vertices - surface.vertices.mean(axis=0)
    slope = np.linalg.lstsq(centred[:, :2], centred[:, 2], rcond=None)[0]
    np.testing.assert_allclose(slope, [-0.2531, 0.4066], atol=0.05)


@pytest.mark.parametrize(
    "text",
    [
        "0,5;0;1,25\n4,5;0;2\n0,5;4;1\n",
        "x;y;z\n0,5;0;1,25\n4,5;0;2\n0,5;4;1\n",
        "0,5 0 1,25\n4,5 0 2\n0,5 4 1\n",
        "0,5\t0\t1,25\n4,5\t0\t2\n0,5\t4\t1\n",
        "0.5,0,1.25\n4.5,0,2\n0.5,4,1\n",
        "0.5, 0, 1.25\n4.5, 0, 2\n0.5, 4, 1\n",
    ],
)
def test_tables_with_decimal_commas_are_read(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text)
    vertices = read_terrain(path).vertices
    assert sorted(map(tuple, vertices.tolist())) == [(0.5, 0.0, 1.25), (0.5, 4.0, 1.0), (4.5, 0.0, 2.0)]


def test_a_cloud_in_which_y_points_up_is_noticed(tmp_path):
    x, y = np.meshgrid(np.arange(20.0), np.arange(30.0))
    z = 0.2 * x + np.sin(y)
    path = tmp_path / "a.xyz"
    for columns, noticed in (((x, y, z), False), ((x, z, -y), True)):
        np.savetxt(path, np.stack([column.ravel() for column in columns], axis=1))
        assert any("read it with Y up" in sentence for sentence in read_terrain(path).summary) == noticed
    assert not any("read it with Y up" in sentence for sentence in read_terrain(path, up="y").summary)


def test_how_much_of_a_cloud_is_ground_is_said_before_it_is_read() -> None:
    data = Path(__file__).parents[1] / "data"
    assert "8,047 of them (9 %) are classified as ground" in " ".join(
        inspect_terrain(data / "las_chablais3.laz").summary
    )
    said = " ".join(inspect_terrain(data / "sample_lareunion_epsg2975.laz").summary)
    assert "No point is classified as ground" in said


def test_ply_with_lists_at_its_vertices():
    """Lists of other lengths from vertex to vertex, before and behind the faces, of either byte order."""
    folder = DATA / "field_cases" / "14-ply-vertex-list"
    expected = [(352_000, 5_130_000), (352_020, 5_130_020)]
    for name in ("list_var.ply", "be_list.ply"):
        source = READERS[".ply"](folder / name)
        np.testing.assert_array_equal([source.points.min(axis=0)[:2], source.points.max(axis=0)[:2]], expected)
        assert (len(source.points), len(source.faces)) == (441, 800)
        assert np.unique(source.faces).size == 441
    assert (
        "Left out elements that are no vertices and no faces: edge (2)."
        in READERS[".ply"](folder / "be_list.ply").notes
    )


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_ply_lists_anywhere_leave_coordinates_colours_and_faces_where_they_are(tmp_path, order):
    form = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"ply\nformat {form} 1.0\nelement vertex 4\nproperty list uchar short tags\n"
    head += "property double x\nproperty uchar red\n"
    head += "property double y\nproperty uchar green\nproperty uchar blue\nproperty list int float weights\n"
    head += "property double z\nelement face 2\nproperty list uchar float uv\nproperty list ushort uint vertex_index\n"
    head += "property uchar kind\nend_header\n"
    points = [(0.0, 0.0, 0.5), (2.0, 0.0, 0.25), (2.0, 3.0, 1.5), (0.0, 3.0, 1.0)]
    faces = [(0, 1, 2), (0, 2, 3)]
    text, data = "", b""
    for i, (x, y, z) in enumerate(points):
        tags, weights = list(range(i)), [0.5] * (3 - i)
        text += " ".join(map(str, [i, *tags, x, 10 + i, y, 20 + i, 30 + i, 3 - i, *weights, z])) + "\n"
        data += struct.pack(
            f"{order or '<'}B{i}hdBdBBi{3 - i}fd", i, *tags, x, 10 + i, y, 20 + i, 30 + i, 3 - i, *weights, z
        )
    for i, face in enumerate(faces):
        text += " ".join(map(str, [2 * i, *[0.5] * (2 * i), 3, *face, 7])) + "\n"
        data += struct.pack(f"{order or '<'}B{2 * i}fH3IB", 2 * i, *[0.5] * (2 * i), 3, *face, 7)
    source = READERS[".ply"](write(tmp_path / "a.ply", head.encode() + (data if order else text.encode())))
    np.testing.assert_array_equal(source.points, points)
    np.testing.assert_array_equal(source.faces, faces)
    np.testing.assert_array_equal(source.colours, [[10 + i, 20 + i, 30 + i] for i in range(4)])


@pytest.mark.parametrize("size", [1, 7, 30, BLOCK_BYTES])
def test_obj_lines_go_on_behind_a_backslash(tmp_path, monkeypatch, size):
    """A face over three lines, a vertex over two; rows of messages stay those of the file."""
    text = "v 0 0 0\nv 2 0 \\\n0\nv 2 2 0\r\nv 0 2 0\nf 1 2 \\\n3 \\\n4\n"
    monkeypatch.setattr("rockfall.core.terrain.meshes.line_blocks", lambda path: line_blocks(path, size))
    source = read_obj(write(tmp_path / "a.obj", text))
    np.testing.assert_array_equal(source.points, [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    np.testing.assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3]])
    with pytest.raises(InputError, match="names a vertex that does not exist") as caught:
        read_obj(write(tmp_path / "b.obj", text + "f 1 2 \\\n9\n"))
    assert caught.value.row == 9


def test_obj_weights_and_decimal_commas(tmp_path):
    text = "v 0 0 0 1\nv 2 0 0 0.5\nv 2 2 0 1\nf 1 2 3\n"
    source = read_obj(write(tmp_path / "a.obj", text))
    np.testing.assert_array_equal(source.points, [[0, 0, 0], [2, 0, 0], [2, 2, 0]])
    assert source.notes[0].startswith("1 vertices have a fourth number, the weight in a curve")
    assert read_obj(write(tmp_path / "a.obj", text.replace("0.5", "1"))).notes == ()
    comma = DATA / "field_cases" / "13-asc-headers" / "comma.obj"
    with pytest.raises(InputError, match=r'"352000,000" has a decimal comma\. Write decimals with a point') as caught:
        read_terrain(comma)
    assert caught.value.row == 1


@pytest.mark.parametrize(
    ("header", "named"), [("units=mm", "units=mm"), ("STL Unit: INCH", "Unit: INCH"), ("plain", "")]
)
@pytest.mark.parametrize("binary", [True, False])
def test_an_stl_that_names_a_unit_is_said_to(tmp_path, header, named, binary):
    mesh = hill()
    mesh.apply_translation(-LV95)
    if binary:
        data = mesh.export(file_type="stl")
        data = header.encode().ljust(80, b" ") + data[80:]
    else:
        data = re.sub("^solid.*", f"solid {header}", mesh.export(file_type="stl_ascii")).encode()
    notes = READERS[".stl"](write(tmp_path / "a.stl", data)).notes
    assert [f'names a unit, "{named}"' in note for note in notes] == ([True] if named else [])


def gltf(tmp_path: Path, change) -> Path:
    """A triangle, its document changed before it is written."""
    data = np.array([[0, 0, 0], [4, 0, 0], [0, 0, -4]], "<f4").tobytes() + np.arange(3, dtype="<u4").tobytes()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": 48, "uri": "a.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
    }  # fmt: skip
    change(document)
    (tmp_path / "a.bin").write_bytes(data)
    return write(tmp_path / "a.gltf", json.dumps(document))


def test_gltf_nodes_turn_scale_and_nest(tmp_path):
    """Translation · rotation · scale of a node, within the matrix of another (glTF 2.0, 3.5.2); in metres."""

    def nest(document: dict) -> None:
        half = np.sqrt(0.5)
        matrix = np.eye(4)
        matrix[:3, 3] = [100, 10, 0]
        document["nodes"] = [
            {"children": [1], "matrix": matrix.T.ravel().tolist()},
            {"mesh": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half], "scale": [2, 1, 1]},
        ]

    surface = read_terrain(gltf(tmp_path, nest))
    # About y by 90°: (x, y, z) → (z, y, −x); the first two corners scaled by 2 along x before.
    y_up = np.array([[101, 12, 3], [101, 12, 3 - 8], [101 - 4, 12, 3]], dtype=float)
    expected = y_up[:, [0, 2, 1]] * [1, -1, 1]
    np.testing.assert_allclose(surface.shift.to_survey(surface.vertices), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (
            lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"]),
            "KHR_draco_mesh_compression, which is not",
        ),
        (
            lambda d: d.update(extensionsRequired=["EXT_meshopt_compression"]),
            "EXT_meshopt_compression, which is not read",
        ),
        (lambda d: d["accessors"][0].update(sparse={"count": 1}), "A mesh has sparse numbers, which are not read"),
        (lambda d: d["accessors"][0].update(normalized=True), "A mesh has normalised numbers, which are not read"),
        (lambda d: d["accessors"][0].pop("bufferView"), "A mesh has no numbers for its vertices"),
        (lambda d: d["meshes"][0]["primitives"][0].update(mode=6), "A mesh consists of triangle fans"),
    ],
)
def test_gltf_that_means_other_numbers_is_refused(tmp_path, change, match):
    with pytest.raises(InputError, match=match):
        read_terrain(gltf(tmp_path, change))


def test_gltf_whole_numbers_that_nodes_place_are_read(tmp_path):
    """KHR_mesh_quantization without normalisation."""

    def quantise(document: dict) -> None:
        document["extensionsRequired"] = ["KHR_mesh_quantization"]
        document["accessors"][0].update(componentType=5122)
        document["bufferViews"][0].update(byteLength=24, byteStride=8)
        document["nodes"][0]["scale"] = [0.5, 0.5, 0.5]

    path = gltf(tmp_path, quantise)
    corners = np.zeros((3, 4), "<i2")
    corners[:, :3] = [[0, 0, 0], [9, 0, 0], [0, 3, -8]]
    (tmp_path / "a.bin").write_bytes(corners.tobytes().ljust(36, b"\0") + np.arange(3, dtype="<u4").tobytes())
    surface = read_terrain(path)
    np.testing.assert_allclose(surface.vertices, [[0, 0, 0], [4.5, 0, 0], [0, 4, 1.5]])


def test_what_is_left_out_of_gltf_is_said(tmp_path):
    def add(document: dict) -> None:
        one = document["meshes"][0]["primitives"][0]
        document["meshes"].append({"primitives": [{**one, "mode": 0}, {**one, "mode": 1}]})
        document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
        document["scenes"].append({"nodes": [0]})

    said_of = "Left out: points (1), lines (1), shape keys (1), scenes other than the first (1)."
    assert said_of in read_terrain(gltf(tmp_path, add)).summary


@pytest.mark.parametrize(
    "comment", ["offset 352000 5130000 0", "Global shift: -2600000.0", "scale_x 0.001", "units: feet"]
)
def test_comments_that_change_what_numbers_mean_are_said(tmp_path, comment):
    mesh = hill()
    mesh.apply_translation(-LV95)
    ply = ply_bytes(mesh, "binary_little_endian")
    obj = mesh.export(file_type="obj", header=None)
    xyz = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist())
    for name, plain, marked in (
        ("a.ply", ply, ply.replace(b"comment by hand", f"comment {comment}".encode())),
        ("a.obj", f"# 81 vertices of a hill\n{obj}", f"# {comment}\n{obj}"),
        ("a.xyz", f"# x y z\n{xyz}", f"# {comment}\n{xyz}"),
    ):
        read = READERS[Path(name).suffix]
        assert not any("Comments in the file" in note for note in read(write(tmp_path / name, plain)).notes)
        notes = read(write(tmp_path / name, marked)).notes
        assert f'Comments in the file are not applied: "{comment}". Check shift, scale and unit.' in notes, name


@pytest.mark.parametrize("of", ["vertex", "face"])
def test_attributes_of_a_ply_with_lists_at_its_vertices(tmp_path, of):
    """Of vertices that have lists themselves, and of faces behind such vertices."""
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty list uchar short tags\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "property int soil\n" * (of == "vertex")
    head += "element face 1\nproperty list uchar int vertex_indices\n"
    head += "property int soil\n" * (of == "face") + "end_header\n"
    data = b""
    for i, place in enumerate(((0.0, 0.0, 0.5), (2.0, 0.0, 0.25), (2.0, 3.0, 1.5))):
        data += struct.pack(f"<B{i}h3d", i, *range(i), *place) + (struct.pack("<i", 7 + i) if of == "vertex" else b"")
    data += struct.pack("<B3i", 3, 0, 1, 2) + (struct.pack("<i", 5) if of == "face" else b"")
    found = read_ply_attribute(write(tmp_path / "a.ply", head.encode() + data), "soil")
    np.testing.assert_array_equal(found.values, [7, 8, 9] if of == "vertex" else [5])
