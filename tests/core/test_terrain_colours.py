# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours that scans bring: each vertex of the terrain has that of its place, whatever the format and the meshing."""

import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import laspy
import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.film.composed.ground import coloured, lit_ground
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.joining import join
from rockfall.core.terrain.opening import HowToRead
from rockfall.core.terrain.readers import read_terrain, read_tiles
from rockfall.core.terrain.scan_colours import colours_of
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

SIDE = 14


def slope(x0: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a wavy slope, in an order of their own."""
    x, y = np.meshgrid(x0 + np.arange(SIDE) * 0.5, np.arange(SIDE) * 0.5)
    points = np.column_stack([x.ravel(), y.ravel(), (0.6 * x + 0.1 * np.sin(3 * y)).ravel()])
    i = np.arange(SIDE**2).reshape(SIDE, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    order = np.random.default_rng(1).permutation(SIDE**2)
    rank = np.argsort(order)
    return np.round(points[order], 3), rank[np.concatenate([lower, upper])]


def painted(points: np.ndarray) -> np.ndarray:
    """(n, 3) the colour of a place: red along x, green along y, blue by their sum."""
    x, y = np.round(points[:, 0] * 2), np.round(points[:, 1] * 2)
    return np.column_stack([5 * x + 10, 9 * y + 3, 255 - 4 * (x + y)]).astype(np.uint8)


def ply(path: Path, colour_type: str, of: object, *, binary: bool, faces: bool = True) -> Path:
    """A PLY as other programs write it, with a normal between place and colour."""
    points, corners = slope()
    numbers = of(painted(points).astype(float))  # type: ignore[operator]
    kind = {"uchar": "u1", "ushort": "<u2", "float": "<f4"}[colour_type]
    header = (
        f"ply\nformat {'binary_little_endian' if binary else 'ascii'} 1.0\nelement vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\nproperty float nx\n"
        + "".join(f"property {colour_type} {name}\n" for name in ("red", "green", "blue", "alpha"))
        + (f"element face {len(corners)}\nproperty list uchar int vertex_indices\n" if faces else "")
        + "end_header\n"
    )
    if binary:
        rows = np.zeros(len(points), [("p", "<f8", 3), ("n", "<f4"), ("c", kind, 4)])
        rows["p"], rows["c"][:, :3] = points, numbers
        triangles = np.zeros(len(corners), [("k", "u1"), ("v", "<i4", 3)])
        triangles["k"], triangles["v"] = 3, corners
        path.write_bytes(header.encode() + rows.tobytes() + (triangles.tobytes() if faces else b""))
        return path
    lines = [
        " ".join(map(str, [*p, 0.5, *(c if colour_type == "float" else c.astype(int)), 0]))
        for p, c in zip(points.tolist(), numbers, strict=True)
    ]
    lines += [f"3 {a} {b} {c}" for a, b, c in corners] if faces else []
    path.write_text(header + "\n".join(lines) + "\n")
    return path


def same(values: np.ndarray) -> np.ndarray:
    return values


def check(surface: Surface, within: int = 0) -> None:
    assert surface.colours is not None
    assert surface.colours.dtype == np.uint8
    survey = surface.shift.to_survey(surface.vertices)
    apart = surface.colours.astype(int) - painted(survey).astype(int)
    assert np.abs(apart).max() <= within
    assert any("colours" in sentence for sentence in surface.summary)


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("faces", [True, False], ids=["mesh", "cloud"])
@pytest.mark.parametrize(
    ("kind", "of"),
    [("uchar", same), ("ushort", lambda c: np.round(c * 257)), ("float", lambda c: np.round(c / 255, 6))],
)
def test_ply(tmp_path: Path, kind: str, of: object, faces: bool, binary: bool) -> None:
    check(read_terrain(ply(tmp_path / "slope.ply", kind, of, binary=binary, faces=faces)))


def test_obj(tmp_path: Path) -> None:
    points, corners = slope()
    for name, of in (("parts.obj", lambda c: c / 255), ("eight.obj", lambda c: c)):
        lines = [f"v {' '.join(map(str, p))} {' '.join(f'{v:.6g}' for v in of(c.astype(float)))}" for p, c in
                 zip(points.tolist(), painted(points), strict=True)]  # fmt: skip
        (tmp_path / name).write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in corners)]))
        check(read_terrain(tmp_path / name))


def textured(folder: Path) -> Path:
    """An OBJ with a texture whose pixel at the place of each vertex has the vertex's colour."""
    points, corners = slope()
    at = np.round(points[:, :2] * 2).astype(int)
    picture = np.zeros((SIDE, SIDE, 3), np.uint8)
    picture[SIDE - 1 - at[:, 1], at[:, 0]] = painted(points)  # v is up, rows are down
    assert cv2.imwrite(str(folder / "rock.png"), picture[:, :, ::-1])
    (folder / "slope.mtl").write_text("newmtl rock\nmap_Kd rock.png\n")
    lines = ["mtllib slope.mtl", *(f"v {' '.join(map(str, p))}" for p in points.tolist())]
    lines += [f"vt {(i + 0.5) / SIDE} {(j + 0.5) / SIDE}" for i, j in at]
    lines += ["usemtl rock", *(f"f {a + 1}/{a + 1} {b + 1}/{b + 1} {c + 1}/{c + 1}" for a, b, c in corners)]
    (folder / "slope.obj").write_text("\n".join(lines))
    return folder / "slope.obj"


def test_the_texture_of_an_obj_and_one_that_is_missing(tmp_path: Path) -> None:
    path = textured(tmp_path)
    check(read_terrain(path))
    for lost in ("rock.png", "slope.mtl"):
        (tmp_path / lost).unlink()
        surface = read_terrain(path)
        assert surface.colours is None
        assert any(f"{lost} is not beside it" in sentence for sentence in surface.summary)
    textured(tmp_path)
    (tmp_path / "rock.png").write_bytes(b"no picture")
    surface = read_terrain(path)
    assert surface.colours is None
    assert any("left out" in sentence for sentence in surface.summary)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a\x1b[31mb.mtl", "a\\x1b[31mb.mtl is not beside it"),
        ("x" * 5000, "x is not beside it"),
        (".", ". is not beside"),
    ],
)
def test_names_of_materials_and_pictures_that_no_file_has_leave_the_terrain(tmp_path, name, said) -> None:
    path, library = textured(tmp_path), tmp_path / "slope.mtl"
    library.write_text(f"newmtl rock\nmap_Kd {name}\n")
    found = [read_terrain(path)]
    path.write_text(path.read_text().replace("slope.mtl", name))
    found.append(read_terrain(path))
    for surface in found:
        assert surface.colours is None
        (sentence,) = (one for one in surface.summary if "left out" in one)
        assert said in sentence
        assert len(sentence) < 400
        assert "\x1b" not in sentence


def _header(side: int) -> bytes:
    """The beginning of a PNG of so many pixels, as far as its size is told."""
    parts = (b"IHDR" + struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0), b"IDAT" + zlib.compress(bytes(100)))
    sized = (struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(sized)


@pytest.mark.parametrize(
    ("side", "said"), [(1 << 20, "the texture needs 17592.2 GB of memory"), (14_000, "left out: ")]
)
def test_a_picture_that_promises_too_much_costs_the_colours_alone(tmp_path: Path, capfd, side, said) -> None:
    path = textured(tmp_path)
    (tmp_path / "rock.png").write_bytes(_header(side))
    surface = read_terrain(path)
    assert surface.colours is None
    assert any(said in sentence for sentence in surface.summary)
    assert capfd.readouterr() == ("", "")


def test_a_texture_may_have_more_pixels_than_pillow_takes_for_harmless(tmp_path: Path, monkeypatch, recwarn) -> None:
    from PIL import Image

    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 20)  # of 196: nine times that, and Pillow refuses
    check(read_terrain(textured(tmp_path)))
    assert Image.MAX_IMAGE_PIXELS == 20
    assert not [one for one in recwarn if "bomb" in str(one.message)]


def test_e57(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    points, _ = slope()
    file = pye57.E57(str(tmp_path / "scan.e57"), mode="w")
    raw = {f"cartesian{axis}": np.ascontiguousarray(column) for axis, column in zip("XYZ", points.T, strict=True)}
    names = ("Red", "Green", "Blue")
    raw |= {f"color{name}": np.ascontiguousarray(c) for name, c in zip(names, painted(points).T, strict=True)}
    file.write_scan_raw(raw, rotation=np.array([1.0, 0, 0, 0]), translation=np.zeros(3))
    file.close()
    check(read_terrain(tmp_path / "scan.e57"))


@pytest.mark.parametrize("scale", [1, 257])
def test_las_of_eight_and_sixteen_bits_its_ground_class_and_filter(tmp_path: Path, scale: int) -> None:
    points, _ = slope()
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales = [0.001] * 3
    cloud = laspy.LasData(header)
    above = points[::9] + np.array([0.1, 0.1, 4.0])
    cloud.xyz = np.concatenate([points, above])
    numbers = np.concatenate([painted(points), np.full((len(above), 3), 7)]).astype(np.uint16) * scale
    cloud.red, cloud.green, cloud.blue = numbers.T
    cloud.write(str(tmp_path / "unclassed.las"))
    check(read_terrain(tmp_path / "unclassed.las", ground_filter_m=1.0))
    cloud.classification = np.r_[np.full(len(points), 2), np.full(len(above), 5)].astype(np.uint8)
    cloud.write(str(tmp_path / "classed.laz"))
    check(read_terrain(tmp_path / "classed.laz"))
    cloud.red[:] = cloud.green[:] = cloud.blue[:] = 0
    cloud.write(str(tmp_path / "black.las"))
    assert read_terrain(tmp_path / "black.las").colours is None


def test_tables_with_and_without_names_of_columns(tmp_path: Path) -> None:
    points, _ = slope()
    numbers = painted(points)
    plain = [f"{x} {y} {z} {r} {g} {b}" for (x, y, z), (r, g, b) in zip(points.tolist(), numbers, strict=True)]
    (tmp_path / "plain.xyz").write_text("\n".join(plain))
    check(read_terrain(tmp_path / "plain.xyz"))
    named = [f"{r};{x};{y};{z};{g};9;{b}" for (x, y, z), (r, g, b) in zip(points.tolist(), numbers, strict=True)]
    (tmp_path / "named.csv").write_text("\n".join(["Red;x;y;z;Green;intensity;Blue", *named]))
    check(read_terrain(tmp_path / "named.csv"))
    normals = [f"{x} {y} {z} 0 0 1" for x, y, z in points.tolist()]
    (tmp_path / "normals.xyz").write_text("\n".join(normals))
    assert read_terrain(tmp_path / "normals.xyz").colours is None


def test_ptx(tmp_path: Path) -> None:
    points, _ = slope()
    turned = np.column_stack([points[:, 1], -points[:, 0], points[:, 2]])
    head = [f"{len(points)}", "1", "0 0 0", "1 0 0", "0 1 0", "0 0 1", "0 1 0 0", "-1 0 0 0", "0 0 1 0", "0 0 0 1"]
    scanner = turned @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]).T
    assert scanner @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) == pytest.approx(turned)
    rows = [
        f"{x} {y} {z} 0.5 {r} {g} {b}" for (x, y, z), (r, g, b) in zip(scanner.tolist(), painted(turned), strict=True)
    ]
    rows[0] = "0 0 0 0.5 0 0 0"
    (tmp_path / "scan.ptx").write_text("\n".join([*head, *rows]))
    surface = read_terrain(tmp_path / "scan.ptx")
    survey = surface.shift.to_survey(surface.vertices)
    assert surface.colours is not None
    np.testing.assert_array_equal(surface.colours, painted(survey))


def glb(path: Path, colours: np.ndarray, kind: int) -> Path:
    """A GLB written by hand: y up, colours as numbers of a component type."""
    points, corners = slope()
    blobs = [
        np.column_stack([points[:, 0], points[:, 2], -points[:, 1]]).astype("<f4").tobytes(),
        corners.astype("<u4").tobytes(),
        colours.tobytes(),
    ]
    starts = np.cumsum([0, *map(len, blobs)]).tolist()
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 2}, "indices": 1}]}],
        "buffers": [{"byteLength": starts[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(blob)}
            for start, blob in zip(starts, blobs, strict=False)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
             "min": [-9] * 3, "max": [9] * 3},
            {"bufferView": 1, "componentType": 5125, "count": corners.size, "type": "SCALAR"},
            {"bufferView": 2, "componentType": kind, "count": len(points), "type": "VEC4", "normalized": kind != 5126},
        ],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(blobs)
    size = 12 + 8 + len(text) + 8 + len(body)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") + text
        + struct.pack("<I4s", len(body), b"BIN\0") + body
    )  # fmt: skip
    return path


def test_gltf_whose_colours_are_linear(tmp_path: Path) -> None:
    """By the standard (3.7.2.1); the transfer function is that of IEC 61966-2-1."""
    value = painted(slope()[0]) / 255
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    four = np.column_stack([linear, np.ones(len(linear))])
    check(read_terrain(glb(tmp_path / "eight.glb", np.round(255 * four).astype(np.uint8), 5121)), within=7)


@pytest.mark.parametrize(
    ("numbers", "told"),
    [(np.full((4, 3), -1.0), "-1"), (np.array([[0.1, np.nan, 0.2]]), "nan"), (np.full((2, 3), 1e9), "1e+09")],
)
def test_numbers_that_are_no_colours_are_left_out_and_named(numbers: np.ndarray, told: str) -> None:
    found, said = colours_of(numbers)
    assert found is None
    assert told in said


def test_a_damaged_colour_leaves_the_terrain(tmp_path: Path) -> None:
    path = ply(tmp_path / "slope.ply", "float", lambda c: -c, binary=True)
    surface = read_terrain(path)
    assert surface.colours is None
    assert len(surface.vertices) == SIDE**2
    assert any("left out" in sentence for sentence in surface.summary)


def test_tiles_keep_theirs_and_say_when_one_has_none(tmp_path: Path) -> None:
    points, corners = slope()
    first = read_terrain(ply(tmp_path / "a.ply", "uchar", same, binary=True))
    right, faces = slope(x0=(SIDE - 1) * 0.5)
    other = Surface(right, faces.astype(np.int32), GlobalShift(), "b.ply", colours=painted(right))
    joined = join([first, other])
    assert len(joined.vertices) == 2 * SIDE**2 - SIDE
    assert joined.colours is not None
    np.testing.assert_array_equal(joined.colours, painted(joined.shift.to_survey(joined.vertices)))
    bare = join([first, replace(other, colours=None)])
    assert bare.colours is None
    assert "b.ply have none" in bare.summary[-1]
    del points, corners


def test_several_clouds_are_one_in_colour_too(tmp_path: Path) -> None:
    for name, x0 in (("a.xyz", 0.0), ("b.xyz", SIDE * 0.5)):
        points, _ = slope(x0)
        rows = [f"{x} {y} {z} {r} {g} {b}" for (x, y, z), (r, g, b) in
                zip(points.tolist(), painted(points), strict=True)]  # fmt: skip
        (tmp_path / name).write_text("\n".join(rows))
    check(read_tiles([tmp_path / "a.xyz", tmp_path / "b.xyz"], HowToRead()))


def test_written_and_read_again(tmp_path: Path) -> None:
    surface = read_terrain(ply(tmp_path / "slope.ply", "uchar", same, binary=False))
    write_ply(surface, tmp_path / "again.ply")
    check(read_terrain(tmp_path / "again.ply"))


def test_the_ground_is_drawn_in_them() -> None:
    """Without a shadow, red ground is red by its light; without its colours it is grey rock."""
    points, corners = slope()
    surface = Surface(points, corners.astype(np.int32), GlobalShift(), "slope", colours=painted(points))
    drawn = lit_ground(surface, np.array([0.0, 0.0, 1.0])).colours
    share = drawn / np.maximum(painted(points) / 255, 1e-9)
    known = (painted(points) > 20).all(axis=1) & (drawn < 1).all(axis=1)
    assert known.sum() > 50
    np.testing.assert_allclose(share[known], share[known][:, :1].repeat(3, axis=1), rtol=1e-6)
    assert 0.8 < np.median(share[known]) < 1.2
    plain = lit_ground(coloured(surface, "none"), np.array([0.0, 0.0, 1.0])).colours
    assert np.ptp(plain[:, 0] / plain[:, 2]) < 1e-9
    assert coloured(surface, "auto") is surface
    with pytest.raises(InputError, match="has no colours"):
        coloured(replace(surface, colours=None), "scan")
