# SPDX-License-Identifier: GPL-3.0-or-later
"""What LAS and LAZ say of their points: marks, scales, the levels of cloud-optimised files."""

import io
import re
import struct
from pathlib import Path

import laspy
import lazrs
import numpy as np
import pytest
from laspy.copc import CopcReader
from rockfall.core.errors import InputError
from rockfall.core.terrain.opening import HowToRead, open_terrain_file
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

CASES = Path(__file__).parents[1] / "data" / "field_cases"
PLACE = np.array([352_000.0, 5_130_000.0, 1_200.0])


def cloud(path: Path, n: int = 60, point_format: int = 6, scale: float = 0.001, **marks: list[int]) -> np.ndarray:
    """A cloud whose marked points are 1 000 m too high; the true points."""
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales, header.offsets = [scale] * 3, PLACE
    las = laspy.LasData(header)
    points = PLACE + np.random.default_rng(1).uniform(0, 20, (n, 3)).round(3)
    wrong = points.copy()
    for name, rows in marks.items():
        if name in ("withheld", "synthetic"):
            wrong[rows, 2] += 1000
    las.x, las.y, las.z = wrong.T
    for name, rows in marks.items():
        values = np.zeros(n, np.uint8)
        values[rows] = 1
        setattr(las, name, values)
    las.write(path)
    return points


def survey_points(path: Path) -> np.ndarray:
    opened = open_terrain_file(path, HowToRead(), None)
    return opened.shift.to_survey(opened.source.points)


@pytest.mark.parametrize("point_format", [0, 3, 6, 7])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_withheld_and_synthetic_points_are_left_out_and_said(tmp_path, point_format, suffix):
    path = tmp_path / f"a{suffix}"
    points = cloud(path, point_format=point_format, withheld=[3, 8], synthetic=[8, 20, 21])
    kept = np.delete(points, [3, 8, 20, 21], axis=0)
    np.testing.assert_allclose(survey_points(path), kept, rtol=0, atol=6e-4)
    said = "2 points marked as withheld and 2 marked as synthetic (not measured)"
    assert f"Left out {said}." in open_terrain_file(path, HowToRead(), None).notes
    assert any(f"Left out: {said}." in sentence for sentence in inspect_terrain(path).summary)


def test_withheld_points_of_the_ground_class_are_not_ground():
    path = CASES / "05-las-withheld" / "withheld.las"
    surface = read_terrain(path)
    assert "Left out 2 points marked as withheld." in surface.summary
    assert "Used the 441 points of the ground class (2)." in surface.summary
    assert np.ptp(surface.vertices[:, 2]) < 30, "with the two it is 2 200 m"


@pytest.mark.parametrize("mark", ["key_point", "overlap"])
def test_key_points_and_overlap_are_measured_points(tmp_path, mark):
    path = tmp_path / "a.las"
    points = cloud(path, **{mark: [0, 5, 9]})
    np.testing.assert_allclose(survey_points(path), points, rtol=0, atol=6e-4)


def test_returns_channels_and_times_change_no_place(tmp_path):
    path = tmp_path / "a.las"
    points = cloud(path)
    las = laspy.read(path)
    las.return_number, las.number_of_returns = np.tile([1, 2, 3], 20), np.full(60, 3)
    las.scanner_channel, las.gps_time = np.tile([0, 1, 2], 20), np.linspace(1e9, 2e9, 60)
    las.write(path)
    np.testing.assert_allclose(survey_points(path), points, rtol=0, atol=6e-4)


def test_a_cloud_of_withheld_points_alone_is_refused(tmp_path):
    cloud(tmp_path / "a.las", withheld=list(range(60)))
    with pytest.raises(InputError, match="All 60 points are marked as withheld or synthetic"):
        read_terrain(tmp_path / "a.las")


def copc(path: Path, levels: list[np.ndarray], pages: int = 1) -> None:
    """A cloud-optimised file (COPC 1.0), a part for each level; the deepest level in a page of its own for two."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, PLACE
    vlr = lazrs.LazVlr.new_for_compression(6, 0, True)
    record = vlr.record_data()
    begin = 375 + 54 + 160 + 54 + len(record)
    body = io.BytesIO(b"\0" * begin)
    body.seek(begin)
    compressor = lazrs.LasZipCompressor(body, vlr)
    compressor.reserve_offset_to_chunk_table()
    starts = []
    for points in levels:
        starts.append(body.tell())
        part = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
        part.x, part.y, part.z = points.T
        compressor.compress_many(np.frombuffer(part.array.tobytes(), np.uint8))
        compressor.finish_current_chunk()
    ends = [*starts[1:], body.tell()]
    compressor.done()
    data = bytearray(body.getvalue())
    all_points = np.concatenate(levels)
    low, high = all_points.min(axis=0), all_points.max(axis=0)
    entry = struct.Struct("<4iQ2i")
    entries = [
        entry.pack(level, 0, 0, 0, starts[level], ends[level] - starts[level], len(points))
        for level, points in enumerate(levels)
    ]
    evlr, hierarchy = len(data), len(data) + 60
    first = b"".join(entries)
    if pages == 2:
        first = b"".join(entries[:-1])
        at = hierarchy + len(first) + entry.size
        first += entry.pack(len(levels) - 1, 0, 0, 0, at, entry.size, -1)
    page = first + (entries[-1] if pages == 2 else b"")
    info = struct.pack("<5d2Q2d", *(low + high) / 2, 10.0, 1.0, hierarchy, len(first), 0.0, 1.0) + b"\0" * 88
    data += struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(page), b"") + page
    head = bytearray(375)
    head[:4] = b"LASF"
    head[24:26], head[94:96] = b"\x01\x04", struct.pack("<H", 375)
    head[96:107] = struct.pack("<IIBH", begin, 2, 6 | 0x80, 30)
    head[131:227] = struct.pack("<12d", *[0.001] * 3, *PLACE, high[0], low[0], high[1], low[1], high[2], low[2])
    head[235:247], head[247:255] = struct.pack("<QI", evlr, 1), struct.pack("<Q", len(all_points))
    data[:375] = head
    data[375:429] = struct.pack("<H16sHH32s", 0, b"copc", 1, 160, b"")
    data[429:589] = info
    data[589:643] = struct.pack("<H16sHH32s", 0, b"laszip encoded", 22204, len(record), b"")
    data[643:begin] = record
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("pages", [1, 2])
def test_a_cloud_optimised_file_is_read_at_full_resolution_and_nothing_twice(tmp_path, pages):
    rng = np.random.default_rng(7)
    levels = [PLACE + rng.uniform(0, 20, (n, 3)).round(3) for n in (5, 30, 200)]
    path = tmp_path / "a.copc.laz"
    copc(path, levels, pages)
    with CopcReader.open(path) as reader:  # as laspy finds them by the hierarchy
        read = reader.query()
        by_levels = np.stack([np.asarray(read[axis]) for axis in "xyz"], axis=1)
    assert len(by_levels) == 235
    found = survey_points(path)
    order = [np.lexsort(each.round(3).T) for each in (found, by_levels)]
    np.testing.assert_allclose(found[order[0]], by_levels[order[1]], rtol=0, atol=1e-6)
    said = "A cloud-optimised file (COPC): all points of all its levels were read."
    assert said in open_terrain_file(path, HowToRead(), None).notes


def test_a_hierarchy_that_counts_other_points_is_said_and_one_without_an_end_refused(tmp_path):
    path = tmp_path / "a.copc.laz"
    levels = [PLACE + np.random.default_rng(7).uniform(0, 20, (n, 3)).round(3) for n in (5, 30)]
    copc(path, levels, pages=2)
    data = bytearray(path.read_bytes())
    at = data.rfind(struct.pack("<i", 30))
    data[at : at + 4] = struct.pack("<i", 29)
    path.write_bytes(bytes(data))
    notes = open_terrain_file(path, HowToRead(), None).notes
    assert any("whose levels count 34 points: all 35 were read" in said for said in notes)
    data[429 + 48 : 429 + 56] = struct.pack("<Q", 2**40)
    path.write_bytes(bytes(data))
    with pytest.raises(InputError, match=re.escape("The hierarchy of the cloud-optimised file is damaged")):
        read_terrain(path)
