# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans of a terrestrial scanner: PTX and E57, several in a file, each with its own place."""

import numpy as np
import pytest
from rockfall.core import extras
from rockfall.core.errors import DependencyError, InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.readers import inspect_terrain, read_points

EAST, NORTH, UP = 2_600_000.0, 1_200_000.0, 500.0
TURN = np.radians(30.0)
# A scanner looks along its own x; turned by 30°, that is (cos, sin) in the survey.
SCANNER = np.array([[np.cos(TURN), np.sin(TURN), 0], [-np.sin(TURN), np.cos(TURN), 0], [0, 0, 1]])


def ptx(columns, rows, matrix, shift, lines):
    head = [str(columns), str(rows), "0 0 0", "1 0 0", "0 1 0", "0 0 1"]
    head += [" ".join(f"{v:.9f}" for v in row) + " 0" for row in matrix]
    return "\n".join([*head, " ".join(f"{v:.4f}" for v in shift) + " 1", *lines]) + "\n"


@pytest.fixture
def own():
    """Points as two scanners see them."""
    rng = np.random.default_rng(1)
    return [rng.uniform(-20, 20, (60, 3)).round(4) for _ in range(2)]


def survey(own):
    return np.vstack([own[0] @ SCANNER, own[1] + np.array([10, 0, 0])]) + np.array([EAST, NORTH, UP])


def write_ptx(path, own):
    lines = [[f"{x} {y} {z} 0.5 10 20 30" for x, y, z in part] for part in own]
    lines[0] += ["0 0 0 0.5 0 0 0"] * 20
    first = ptx(8, 10, SCANNER, (EAST, NORTH, UP), lines[0])
    path.write_text(first + ptx(6, 10, np.eye(3), (EAST + 10, NORTH, UP), lines[1]))


def test_all_scans_of_a_ptx_file_are_put_in_their_places(tmp_path, own):
    write_ptx(tmp_path / "a.ptx", own)
    cloud = read_points(tmp_path / "a.ptx")
    np.testing.assert_allclose(cloud.shift.to_survey(cloud.points), survey(own), atol=1e-6)
    assert cloud.summary[0] == "Cloud of 120 points in 2 scans; 20 directions without a point."
    found = inspect_terrain(tmp_path / "a.ptx")
    assert (found.kind, found.point_count) == ("cloud", 120)
    np.testing.assert_allclose(found.minimum, survey(own).min(axis=0), atol=1e-6)


ROW = "1 2 3 0.5"


@pytest.mark.parametrize(
    ("text", "row", "problem"),
    [
        (ptx(2, 3, np.eye(3), (0, 0, 0), [ROW] * 5), 1, "promises 6 points, 5 rows follow"),
        (ptx(99_999, 99_999, np.eye(3), (0, 0, 0), [ROW] * 5), 1, "promises 9,999,800,001 points"),
        (ptx(2, 2, np.eye(3), (0, 0, 0), [ROW, ROW, "1 two 3 0.5", ROW]), 13, '"two" is not a number'),
        (ptx(2, 2, np.eye(3), (0, 0, 0), [ROW] * 5), 15, '"1 2 3 0.5" is no number of columns or rows'),
        (ptx("-2", 2, np.eye(3), (0, 0, 0), [ROW] * 4), 1, "is no number of columns or rows"),
        (ptx(2, 2, np.zeros((3, 3)), (0, 0, 0), [ROW] * 4), 7, "no rotation, shift and scale"),
        (ptx(2, 2, np.diag([1.0, 1.0, 2.0]), (0, 0, 0), [ROW] * 4), 7, "no rotation, shift and scale"),
        (ptx(2, 2, np.diag([1.0, np.nan, 1.0]), (0, 0, 0), [ROW] * 4), 7, "four rows of four numbers"),
        ("2\n2\n0 0 0\n1 0 0\n", 7, "four rows of four numbers"),
        (ptx(2, 2, np.eye(3), (0, 0, 0), ["1 2"] * 4), 11, "2 values, where x, y and z are needed"),
        (ptx(2, 2, np.eye(3), (0, 0, 0), ["0 0 0 0.5"] * 4), None, "Nothing was measured"),
    ],
)
def test_bad_ptx(tmp_path, text, row, problem):
    (tmp_path / "a.ptx").write_text(text)
    with pytest.raises(InputError, match=problem) as refused:
        read_points(tmp_path / "a.ptx")
    assert refused.value.row == row
    assert refused.value.advice


def test_a_scaled_ptx_is_scaled(tmp_path):
    (tmp_path / "a.ptx").write_text(
        ptx(2, 2, 0.001 * np.eye(3), (5, 6, 7), ["1000 0 0 1", "0 2000 0 1", "0 0 3000 1", ROW])
    )
    points = read_points(tmp_path / "a.ptx", shift=GlobalShift()).points
    np.testing.assert_allclose(points[:3], [[6, 6, 7], [5, 8, 7], [5, 6, 10]])


@pytest.fixture
def e57(tmp_path, own):
    pye57 = pytest.importorskip("pye57")
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    poses = (([np.cos(TURN / 2), 0, 0, np.sin(TURN / 2)], [EAST, NORTH, UP]), ([1, 0, 0, 0], [EAST + 10, NORTH, UP]))
    for part, (rotation, translation) in zip(own, poses, strict=True):
        raw = {f"cartesian{axis}": np.ascontiguousarray(column) for axis, column in zip("XYZ", part.T, strict=True)}
        raw["cartesianInvalidState"] = np.where(np.arange(len(part)) < 55, 0, 2).astype(np.int8)
        file.write_scan_raw(raw, rotation=np.array(rotation, dtype=float), translation=np.array(translation))
    file.close()
    return tmp_path / "a.e57"


def test_all_scans_of_an_e57_file_are_put_in_their_places(e57, own):
    cloud = read_points(e57)
    np.testing.assert_allclose(cloud.shift.to_survey(cloud.points), survey([part[:55] for part in own]), atol=1e-6)
    assert cloud.summary[0] == "Cloud of 110 points in 2 scans. Left out 10 that the scanner marked as invalid."


def test_a_damaged_e57_is_refused_and_stays_where_it_is(e57):
    whole = e57.read_bytes()
    for damaged in (whole[:3000], whole[:2000] + b"\xff" * 3000 + whole[5000:], whole[:100]):
        e57.write_bytes(damaged)
        with pytest.raises(InputError) as refused:
            read_points(e57)
        assert refused.value.file == e57
        assert refused.value.advice
        assert e57.read_bytes() == damaged


def test_without_the_library_it_is_said_what_to_do(tmp_path, monkeypatch):
    (tmp_path / "a.e57").write_bytes(b"ASTM-E57" + bytes(100))
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match=r'pip install "rockfall\[e57\]".*convert the file to LAZ'):
        read_points(tmp_path / "a.e57")


def test_an_e57_of_distances_and_angles(tmp_path):
    """Azimuth from x towards y, elevation from the horizontal: ASTM E2807, 8.4.4. The library writes x, y, z alone."""
    pye57 = pytest.importorskip("pye57")
    from pye57 import libe57

    rng = np.random.default_rng(3)
    distance, azimuth, elevation = rng.uniform(5, 50, 60), rng.uniform(-3, 3, 60), rng.uniform(-0.5, 1, 60)
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    image = file.image_file
    scan, row = libe57.StructureNode(image), libe57.StructureNode(image)
    scan.set("guid", libe57.StringNode(image, "{1}"))
    fields = {"sphericalRange": distance, "sphericalAzimuth": azimuth, "sphericalElevation": elevation}
    for name, values in fields.items():
        row.set(name, libe57.FloatNode(image, values[0], libe57.E57_DOUBLE, values.min(), values.max()))
    arrays, buffers = file.make_buffers(list(fields), 60)
    points = libe57.CompressedVectorNode(image, row, libe57.VectorNode(image, True))
    scan.set("points", points)
    file.data3d.append(scan)
    for name, values in fields.items():
        arrays[name][:] = values
    writer = points.writer(buffers)
    writer.write(60)
    writer.close()
    file.close()
    flat = distance * np.cos(elevation)
    expected = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation)], axis=1)
    cloud = read_points(tmp_path / "a.e57")
    np.testing.assert_allclose(cloud.shift.to_survey(cloud.points), expected, atol=1e-9)
