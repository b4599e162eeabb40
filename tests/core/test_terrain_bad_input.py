# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged and unsuitable terrain files: a message that names the file, the place and what to do."""

import re
from pathlib import Path

import laspy
import numpy as np
import pytest
import tifffile
import trimesh
from rockfall.core.errors import InputError
from rockfall.core.terrain.opening import EXTENSIONS
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

DATA = Path(__file__).parents[1] / "data"
HEADER = "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
FACES = "element face {}\nproperty list uchar int vertex_indices\n"
TEXTURE = "property list uchar int texture\n"
ONE_FACE = HEADER.format(4) + FACES.format(1) + "end_header\n"
SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def refused(path: Path, match: str, **options) -> str:
    """What the refusal says after the file's path, which holds the name of the test."""
    with pytest.raises(InputError) as caught:
        read_terrain(path, **options)
    message = str(caught.value)
    assert message.startswith(str(path)), message
    said = message.removeprefix(str(path))
    assert re.search(match, said), said
    return said


TEXTS = (".obj", ".asc", ".xyz", ".txt", ".csv", ".ptx")
FOREIGN = {
    ".ply": 'Not a PLY file: it does not begin with "ply"',
    ".obj": "The OBJ file has no vertices",
    ".stl": "truncated or not STL|Not an STL file",
    ".gltf": "The glTF file cannot be read",
    ".glb": 'Not a GLB file: it does not begin with "glTF"',
    ".asc": "is no header line of an ESRI ASCII grid|The header has no ncols",
    ".xyz": "names no x, y and z|is not a number",
    ".tif": "The TIFF file cannot be read",
    ".tiff": "The TIFF file cannot be read",
    ".las": 'Not a LAS file: it does not begin with "LASF"',
    ".laz": 'Not a LAS file: it does not begin with "LASF"',
    ".ptx": "is no number of columns or rows",
    ".e57": 'Not an E57 file: it does not begin with "ASTM-E57"',
}


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_empty_or_foreign_files(tmp_path, extension):
    path = tmp_path / f"a{extension}"
    path.write_bytes(b"")
    refused(path, "^: The file is empty")
    for data in (b"\0\1\2\3" * 200, b"hello there\n" * 20, b"P", b"\xff" * 5000):
        path.write_bytes(data)
        binary = data.startswith(b"\0") and extension in TEXTS
        said = refused(path, "The file is not text" if binary else FOREIGN.get(extension, FOREIGN[".xyz"]))
        with pytest.raises(InputError, match=re.escape(said)):
            inspect_terrain(path)


def test_missing_file_folder_and_unknown_extension(tmp_path):
    refused(tmp_path / "no.ply", "no such file")
    (tmp_path / "folder.ply").mkdir()
    refused(tmp_path / "folder.ply", "folder")
    (tmp_path / "a.fbx").write_bytes(b"x")
    assert ".laz" in refused(tmp_path / "a.fbx", '"fbx"|".fbx"')
    (tmp_path / "plain").write_bytes(b"x")
    refused(tmp_path / "plain", "no terrain format")


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (HEADER.format(4) + "end_header\n0 0 0\n1 0 0\n", "truncated: its header promises 4 vertices, it holds 2"),
        (HEADER.format(4) + FACES.format(3) + "end_header\n" + SQUARE + "3 0 1 2\n", "promises 3 faces, it holds 1"),
        (ONE_FACE + SQUARE + "3 0 1 4\n", r"Face 0 names the vertices \[0, 1, 4\]"),
        (ONE_FACE + SQUARE + "3 0 -1 2\n", "Face 0"),
        (ONE_FACE + SQUARE + "3 0 1\n", "row 14.*no face"),
        (ONE_FACE + SQUARE.replace("1 1 0", "1 one 0") + "3 0 1 2\n", 'row 12: "one"'),
        (ONE_FACE + SQUARE.replace("1 1 0", "1 nan 0") + "3 0 1 2\n", "vertex 2 .*not finite"),
        (ONE_FACE + SQUARE.replace("1 1 0", "1 1") + "3 0 1 2\n", "row 12: 2 values"),
        (ONE_FACE + SQUARE + "3 0 1 1\n", "degenerate"),
        (HEADER.format(2) + "end_header\n0 0 0\n1 0 0\n", "2 points"),
        (HEADER.format(3) + "end_header\n0 0 0\n1 1 0\n2 2 5\n", "on a line"),
        (HEADER.format("x") + "end_header\n", "row 3"),
        (HEADER.format(-1) + "end_header\n", "row 3"),
        (HEADER.replace("double x", "quad x").format(1) + "end_header\n", "row 4"),
        (HEADER.format(4), "header has no end"),
        (HEADER.replace("ascii", "gzip").format(4) + "end_header\n", "row 2"),
        ("ply\nelement vertex 1\nend_header\n", "names no format"),
        (ONE_FACE.replace("vertex_indices", "corners") + SQUARE + "3 0 1 2\n", "The faces have no vertex_indices"),
        (ONE_FACE.replace("list uchar int", "int") + SQUARE + "3\n", "The faces have no vertex_indices"),
        (
            ONE_FACE.replace("property list", f"{TEXTURE}property list") + SQUARE + "2 7 3 0 1 2\n",
            'row 15: "2 7 3 0 1 2" is no face',
        ),
        (
            ONE_FACE.replace("element face", f"{TEXTURE}element face") + SQUARE,
            'row 11: "0 0 0" has not the numbers and lists',
        ),
        (ONE_FACE + SQUARE.replace("\n", " 7\n") + "3 0 1 2\n", "row 10: 4 values, where the header promises 3"),
        ("ply\nformat ascii 1.0\nelement face 1\nproperty float x\nend_header\n1\n", "no vertices"),
    ],
)  # fmt: skip
def test_bad_ply(tmp_path, text, match):
    path = tmp_path / "bad.ply"
    path.write_text(text)
    refused(path, match)


@pytest.mark.parametrize("cut", [1, 50, 13 * 320, 13 * 320 + 1, 13 * 320 + 400])
def test_truncated_binary_ply(tmp_path, cut):
    data = trimesh.creation.icosphere(2).export(file_type="ply")
    path = tmp_path / "cut.ply"
    path.write_bytes(data[:-cut])
    refused(path, "truncated")


def test_binary_ply_without_vertex_indices(tmp_path):
    path = tmp_path / "a.ply"
    mesh = trimesh.creation.icosphere(1).export(file_type="ply")
    assert mesh.count(b"vertex_indices") == 1
    path.write_bytes(mesh.replace(b"vertex_indices", b"vertex_corners"))
    refused(path, "The faces have no vertex_indices")


def test_ply_whose_first_face_claims_a_huge_list(tmp_path):
    head = (HEADER.format(3) + FACES.format(1)).replace("ascii", "binary_little_endian").replace("uchar", "int")
    body = np.zeros(9, "<f8").tobytes() + np.array([2**31 - 1, 0, 1, 2], "<i4").tobytes()
    path = tmp_path / "a.ply"
    path.write_bytes((head + "end_header\n").encode() + body)
    refused(path, "truncated")


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "row 4.*does not exist"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "row 4.*does not exist"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -5\n", "row 4.*does not exist"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "row 4.*does not exist"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf -1 -2 -3\nf -1 -2 -3 -4\n", "row 6.*does not exist"),
        ("v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\nf 1 2 3\n", "row 3.*does not exist"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "row 4.*three vertices"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf\t\nf 1 2 3\n", "row 5.*three vertices"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3.5\n", "row 4.*no face"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 inf\n", "row 4.*no face"),
        ("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "row 1: 2 coordinates, where 3 are needed"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 b 2\n", "row 4.*no face"),
        ("v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", 'row 2: "x"'),
        ("v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "row 2: 2 values"),
        ("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", "vertex 1"),
        ("vn 0 0 1\n", "no vertices"),
    ],
)
def test_bad_obj(tmp_path, text, match):
    path = tmp_path / "bad.obj"
    path.write_text(text)
    refused(path, match)


def test_bad_stl_and_glb(tmp_path):
    sphere = trimesh.creation.icosphere(1)
    path = tmp_path / "a.stl"
    for cut in (1, 50, 1000):
        path.write_bytes(sphere.export(file_type="stl")[:-cut])
        refused(path, "truncated")
    ascii_ = sphere.export(file_type="stl_ascii")
    path.write_text(ascii_[: len(ascii_) // 2])
    refused(path, "truncated|values")
    path.write_text(ascii_.replace("vertex 0.", "vertex o.", 1))
    refused(path, "row .*not a number")
    path.write_text(re.sub(r"(vertex \S+ \S+) \S+", r"\1", ascii_))
    refused(path, r"row \d+: A corner needs three coordinates")
    path.write_bytes(b"\0" * 84)
    refused(path, "The mesh has no faces")
    glb = sphere.export(file_type="glb")
    path = tmp_path / "a.glb"
    path.write_bytes(glb[:-10])
    refused(path, "truncated")
    path.write_bytes(glb[:20] + b"{" * 40 + glb[60:])
    refused(path, "cannot be read")
    path.write_bytes(trimesh.Scene(trimesh.PointCloud(sphere.vertices)).export(file_type="glb"))
    refused(path, "The mesh has no faces")
    path = tmp_path / "a.gltf"
    path.write_bytes(sphere.export(file_type="gltf")["model.gltf"])
    refused(path, "cannot be read")


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (("ncols 3\n", ""), "no ncols"),
        (("ncols 3", "ncols three"), 'row 1: "three"'),
        (("ncols 3", "ncols 2.5"), "ncols is 2.5"),
        (("ncols 3", "ncols 0"), "ncols is 0"),
        (("cellsize 2", "cellsize -2"), "positive cellsize"),
        (("cellsize 2", "cellsize nan"), "positive cellsize"),
        (("xllcorner 0\n", ""), "no xllcorner"),
        (("cellsize 2", "cell 2"), "row 5.*no header line"),
        (("4 5 6", "4 5"), "5 heights, where 2 rows of 3 need 6"),
        (("4 5 6", "4 5 6 7"), "7 heights"),
        (("4 5 6", "4.0 5,5 6"), 'row 8: "5,5"'),
        (("1 2 3\n4 5 6\n", ""), "no heights"),
        (("1 2 3\n4 5 6\n", "-9999 -9999 -9999 -9999 1 2"), "2 points"),
    ],
)
def test_bad_ascii_grid(tmp_path, change, match):
    good = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 2\nNODATA_value -9999\n1 2 3\n4 5 6\n"
    assert change[0] in good
    path = tmp_path / "bad.asc"
    path.write_text(good.replace(*change))
    refused(path, match)


def test_truncated_tiff(tmp_path):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.zeros((200, 200), np.float32), compression="deflate", rowsperstrip=10)
    data = path.read_bytes()
    for part in (4, 9, 100, len(data) // 2, len(data) - 4):
        path.write_bytes(data[:part])
        refused(path, "cannot be read|georeference")


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("zstd", "The TIFF's compression (ZSTD) cannot be read"),
        ("lerc", "The TIFF's compression (LERC) cannot be read"),
        ("lzw_two_bands", "The TIFF's 2 bands cannot be read with this compression (LZW)"),
        ("lzw_float16", "The heights cannot be decoded"),
    ],
)
def test_what_cannot_be_decoded_of_a_tiff_is_refused_in_words(name, problem):
    message = refused(DATA / "geotiff" / f"refused_{name}.tif", re.escape(problem))
    assert "Export the heights alone, uncompressed or with LZW or deflate" in message


def test_tiff_of_odd_bits(tmp_path):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.zeros((20, 20), np.uint16))
    with tifffile.TiffFile(path, mode="r+") as tiff:
        tiff.pages.first.tags["BitsPerSample"].overwrite(12)
    refused(path, "The TIFF has heights of 12 bits. Export the heights alone")


def test_damaged_compressed_tiff(tmp_path, capfd):
    path = tmp_path / "a.tif"
    for name in ("lzw_float32", "lzw_float32_tiles", "deflate_predictor3_float32", "packbits_int16"):
        data = (DATA / "geotiff" / f"{name}.tif").read_bytes()
        for part in range(60, len(data) - 2, 40):
            path.write_bytes(data[:part])
            refused(path, "cannot be read|cannot be decoded|no georeference|no grid of heights")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("heights", "problem"),
    [
        (np.zeros((1, 20), np.float32), "The TIFF holds no grid of heights (1 × 20)"),
        (np.zeros((20, 1), np.float32), "The TIFF holds no grid of heights (20 × 1)"),
        (np.zeros((20, 20), bool), "The TIFF holds no grid of heights (20 × 20)"),
        (np.zeros((20, 20), np.complex64), "The TIFF holds no grid of heights (20 × 20)"),
    ],
)
def test_tiff_without_a_grid_of_heights(tmp_path, heights, problem):
    tifffile.imwrite(tmp_path / "a.tif", heights)
    refused(tmp_path / "a.tif", re.escape(problem))


@pytest.mark.parametrize("name", ["sample_lareunion_epsg2975.laz", "las_chablais3.laz"])
def test_truncated_laz(tmp_path, name):
    data = (DATA / name).read_bytes()
    path = tmp_path / "a.laz"
    for part in (60, 200, 360, 500, 3000, len(data) // 2, len(data) - 3):
        path.write_bytes(data[:part])
        assert "copy or export it again" in refused(path, "truncated|cannot be read").lower()
    damaged = bytearray(data)
    damaged[5000:5400] = b"\xff" * 400
    path.write_bytes(damaged)
    refused(path, "The cloud cannot be read")


class PanicException(BaseException):
    """What the decoder of LAZ raises where it cannot go on."""


@pytest.mark.parametrize(("raised", "expected"), [(PanicException, InputError), (KeyboardInterrupt, KeyboardInterrupt)])
def test_a_decoder_in_panic_is_told_from_a_person_who_stops_it(monkeypatch, raised, expected):
    def iterate(*_):
        raise raised("stopped")

    monkeypatch.setattr(laspy.LasReader, "chunk_iterator", iterate)
    with pytest.raises(expected, match="stopped"):
        read_terrain(DATA / "las_chablais3.laz")


def test_a_decoder_that_ends_early(monkeypatch):
    monkeypatch.setattr(laspy.LasReader, "chunk_iterator", lambda reader, _: iter([reader.read_points(1000)]))
    refused(DATA / "las_chablais3.laz", "truncated: its header promises 92097 points, it holds 1000")


def test_truncated_las_also_at_the_end_of_a_record(tmp_path):
    las = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    las.x, las.y, las.z = np.random.default_rng(0).uniform(0, 50, (3, 100))
    las.write(tmp_path / "whole.las")
    data = (tmp_path / "whole.las").read_bytes()
    path = tmp_path / "a.las"
    for cut, held in ((20, 99), (200, 90), (7, 99), (2000, 0)):
        path.write_bytes(data[:-cut])
        refused(path, f"promises 100 points, it holds {held}")
    empty = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    empty.write(path)
    refused(path, "no points")


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("1 2 3\n4 five 6\n7 8 9\n", 'row 2: "five"'),
        ("1 2 3\n4 5\n7 8 9 1\n", "row 2: 2 values"),
        ("1 2\n3 4\n5 6\n", "2 columns"),
        ("x,y\n1,2\n", "names no x, y and z"),
        ("# only\n# comments\n", "no points"),
        ("1 2 3\n4 5 6\n", "2 points"),
        ("0 0 0\n1 2 5\n2 4 1\n3 6 0\n", "on a line"),
        ("0 0 0\n0 0 1\n0 0 2\n", "1 points in plan"),
        ("0 0 0\n1 0 nan\n0 1 0\n", "point 1 .*not finite"),
    ],
)
def test_bad_table(tmp_path, text, match):
    path = tmp_path / "bad.xyz"
    path.write_text(text)
    refused(path, match)


def test_ground_only_needs_classes(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("0 0 0\n1 0 0\n0 1 0\n")
    refused(path, "Only LAS and LAZ", ground_only=True)


def test_a_laz_whose_points_have_no_size(tmp_path, capfd):
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales = [0.001] * 3
    las = laspy.LasData(header)
    las.x = las.y = las.z = np.arange(50.0)
    path = tmp_path / "a.laz"
    las.write(str(path))
    data = bytearray(path.read_bytes())
    inspect_terrain(path)
    items = data.index(b"laszip encoded") - 2 + 54 + 32  # behind the record's own header, as the specification has it
    assert data[items : items + 2] == b"\2\0"  # the point, and its time
    for count in (b"\0\0", b"\1\0"):
        data[items : items + 2] = count
        path.write_bytes(data)
        for read in (read_terrain, inspect_terrain):
            with pytest.raises(InputError, match=r"packs points of (0|20) bytes, and they have 28\. Copy or export"):
                read(path)
    assert capfd.readouterr() == ("", "")
