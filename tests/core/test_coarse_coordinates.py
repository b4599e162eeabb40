# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates that are stored more coarsely than points are apart are said with their step; exact surfaces never."""

import json
import struct
from pathlib import Path

import laspy
import numpy as np
import pytest
import trimesh
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.coordinate_step import coarse_places_sentence, coarse_sentence, spacing_of
from rockfall.core.terrain.opening import HowToRead, read_placed
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
COARSE = DATA / "field_cases" / "07-coarse-coordinates"
UTM = np.array([352_000.0, 5_130_000.0, 1_200.0])


def said(path: Path, **how) -> str:
    """The sentence on the step, or nothing; the dialog of an import has the same."""
    notes = [each for each in read_placed(path, HowToRead(**how)).notes if "in steps of" in each]
    if not how:
        assert [each for each in inspect_terrain(path).summary if "in steps of" in each] == notes
    return notes[0] if notes else ""


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("f32utm.ply", "0.0312 m (x) and 0.5 m (y)"),  # single precision: 2⁻⁵ m from 2¹⁸ m on, 2⁻¹ m from 2²² m on
        ("utm.stl", "0.0312 m (x) and 0.5 m (y)"),
        ("sixdigits.obj", "1 m (x) and 10 m (y)"),
        ("scale1.las", "1 m (x), 1 m (y) and 1 m (z)"),
    ],
)
def test_the_step_of_each_format_is_said_in_metres(name, steps):
    path = COARSE / name
    notes = [each for each in read_terrain(path).summary if "in steps of" in each]
    assert len(notes) == 1
    assert notes[0].startswith(f"Coordinates are stored in steps of {steps}, where points are about ")
    assert [each.split(", where")[0] for each in inspect_terrain(path).summary if "in steps of" in each] == [
        notes[0].split(", where")[0]
    ]


def test_the_sentence_says_what_a_step_does():
    """A step as large as the spacing turns a slope by 45°."""
    assert "wrong by up to 45°" in coarse_sentence(np.array([0.0, 0.0, 2.0]), 2.0)
    assert coarse_sentence(np.array([0.0, 0.0, 0.2]), 2.0) == ""


def hill(n: int = 25, spacing: float = 1.0, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Points of a rough hill at places that are no lattice, and triangles of them."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(n) * spacing, np.arange(n) * spacing)
    plan = np.stack([x, y], axis=-1).reshape(-1, 2) + rng.uniform(-0.3, 0.3, (n * n, 2)) * spacing
    z = 0.4 * plan[:, 0] + rng.normal(0, 0.1 * spacing, n * n)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    return np.column_stack([plan, z]), np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def ply(path: Path, points: np.ndarray, faces: np.ndarray, type_: str = "double") -> Path:
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property {type_} {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.zeros(len(faces), [("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, faces
    dtype = {"double": "<f8", "float": "<f4", "int": "<i4"}[type_]
    path.write_bytes(head.encode() + points.astype(dtype).tobytes() + rows.tobytes())
    return path


def test_double_precision_is_fine_and_single_is_said_also_where_doubles_hold_it(tmp_path):
    points, faces = hill()
    assert said(ply(tmp_path / "a.ply", points + UTM, faces)) == ""
    single = (points + UTM).astype(np.float32).astype(np.float64)
    for path in (ply(tmp_path / "b.ply", points + UTM, faces, "float"), ply(tmp_path / "c.ply", single, faces)):
        assert "steps of 0.5 m (y), where points are about 1 m apart" in said(path), path.name
    assert said(ply(tmp_path / "d.ply", points, faces, "float")) == "", "about the origin single precision is enough"
    assert "1 m (x), 1 m (y) and 1 m (z)" in said(ply(tmp_path / "e.ply", points, faces, "int"))


def test_units_and_axes_turn_the_step_with_the_points(tmp_path):
    points, faces = hill()
    path = ply(tmp_path / "a.ply", (points + UTM)[:, [0, 2, 1]] * [1, 1, -1] / 0.3048, faces, "float")
    assert "steps of 0.61 m (y)" in said(path, up="y", unit_m=0.3048), "from 2²⁴ feet on: two feet"


@pytest.mark.parametrize("text", ["xyz", "obj"])
def test_six_digits_in_text_are_said_and_a_regular_grid_is_not(tmp_path, text):
    points, faces = hill(25, 0.5)
    grid = np.round(points * 2) / 2
    grid[:, 2] = points[:, 2].round(3)

    def write(name: str, rows: np.ndarray, form: str) -> Path:
        lines = [" ".join(form % value for value in row) for row in rows.tolist()]
        if text == "obj":
            lines = [f"v {line}" for line in lines] + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
        path = tmp_path / f"{name}.{text}"
        path.write_text("\n".join(lines))
        return path

    assert "1 m (x) and 10 m (y)" in said(write("six", points + UTM, "%.6g"))
    assert said(write("all", points + UTM, "%.3f")) == ""
    assert said(write("grid", grid + UTM, "%.3f")) == ""


def test_whole_metres_of_height_are_said_and_planes_are_not(tmp_path):
    x, y = (each.ravel() for each in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    rough = 0.6 * x + 0.3 * np.sin(y) + np.random.default_rng(1).normal(0, 0.2, 900)
    for name, z, expected in (
        ("rounded", np.round(rough), "steps of 1 m (z)"),
        ("rough", rough.round(3), ""),
        ("plane", 0.5 * x, ""),
        ("valley", np.abs(x - 15), ""),
        ("flat", 0 * x, ""),
        ("gentle", np.round(0.03 * rough + 0.2 * x), "steps of 1 m (z)"),
    ):
        path = tmp_path / f"{name}.xyz"
        np.savetxt(path, np.column_stack([x, y, z]), fmt="%.3f")
        assert (expected in said(path)) if expected else said(path) == "", name
    grid = tmp_path / "a.asc"
    rows = "\n".join(" ".join(f"{value:.0f}" for value in row) for row in rough.reshape(30, 30))
    grid.write_text(f"ncols 30\nnrows 30\nxllcorner 0\nyllcorner 0\ncellsize 1\n{rows}\n")
    assert "steps of 1 m (z)" in said(grid)


def test_a_wall_of_blocks_is_exact_though_its_points_share_places(tmp_path):
    y, z = (each.ravel() for each in np.meshgrid(np.arange(20.0), np.arange(20.0)))
    faces = np.stack([np.arange(398), np.arange(1, 399), np.arange(2, 400)], axis=1)
    assert said(ply(tmp_path / "wall.ply", np.column_stack([0 * y, y, z]) + UTM, faces)) == ""


def test_gltf_is_held_against_its_single_precision_after_its_nodes(tmp_path):
    points, faces = hill()
    y_up = points[:, [0, 2, 1]] * [1, 1, -1]
    trimesh.Trimesh(y_up, faces, process=False).export(tmp_path / "near.glb")
    far = trimesh.Trimesh(y_up + UTM[[0, 2, 1]] * [1, 1, -1], faces, process=False)
    far.export(tmp_path / "far.glb")
    assert said(tmp_path / "near.glb") == ""
    assert "0.5 m (y)" in said(tmp_path / "far.glb")
    data = (tmp_path / "near.glb").read_bytes()
    length = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + length])
    node = next(each for each in document["nodes"] if "mesh" in each)
    node["translation"] = (UTM[[0, 2, 1]] * [1, 1, -1]).tolist()
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    size = 20 + len(text) + len(rest)
    (tmp_path / "placed.glb").write_bytes(struct.pack("<4s4I", b"glTF", 2, size, len(text), 0x4E4F534A) + text + rest)
    assert said(tmp_path / "placed.glb") == "", "a node that shifts is in double precision"


def test_las_scales_are_held_against_the_spacing(tmp_path):
    points, _ = hill()
    for scale, expected in ((0.01, ""), (0.25, "0.25 m (x), 0.25 m (y) and 0.25 m (z)")):
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales, header.offsets = [scale] * 3, UTM
        las = laspy.LasData(header)
        las.x, las.y, las.z = (points + UTM).T
        las.write(tmp_path / "a.las")
        notes = [each for each in read_terrain(tmp_path / "a.las").summary if "in steps of" in each]
        assert (expected in notes[0]) if expected else notes == []


@pytest.mark.parametrize(
    "path",
    [
        ROOT / "assets" / "demo" / "terrain.ply",
        DATA / "las_chablais3.laz",
        DATA / "sample_lareunion_epsg2975.laz",
        DATA / "tschamut_2014_terrain.asc",
    ],
    ids=lambda path: path.name,
)
def test_real_terrains_and_the_demo_are_fine(path):
    assert not [each for each in read_placed(path, HowToRead()).notes if "in steps of" in each]


def test_the_spacing_is_that_of_points_on_a_tilted_rectangle():
    plane = np.stack(np.meshgrid(np.arange(60.0), np.arange(40.0)), axis=-1).reshape(-1, 2)
    rotation, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    assert spacing_of(np.column_stack([plane, 0 * plane[:, 0]]) @ rotation.T) == pytest.approx(1.0, rel=0.02)


def test_picks_that_are_stored_coarsely_are_said():
    places = UTM + np.random.default_rng(4).uniform(0, 200, (20, 3))
    assert coarse_places_sentence(places.round(2)) == ""
    assert "steps of 0.5 m (y)" in coarse_places_sentence(places.astype(np.float32).astype(np.float64))
    six = np.array([[float(f"{value:.6g}") for value in place] for place in places])
    assert "steps of 1 m (x) and 10 m (y)" in coarse_places_sentence(six)
    marks = np.column_stack([2.0 * np.arange(20), np.repeat([0.0, 6.0, 8, 12, 20], 4), places[:, 2]])
    assert coarse_places_sentence(marks + np.array([352_000, 5_130_000, 0])) == "", "set out on purpose"
    shift = GlobalShift.proposed(places.min(axis=0), places.max(axis=0))
    coarse = places.round(0)
    assert coarse_places_sentence(shift.to_survey(shift.to_local(coarse))) == coarse_places_sentence(coarse) != ""
