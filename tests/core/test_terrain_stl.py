# SPDX-License-Identifier: GPL-3.0-or-later
"""STL is read some triangles at a time: what comes out does not depend on how many."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.terrain import meshes
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

CELLS = 4


def write_plane(path: Path, *, last: float = 0.0, text: bool = False) -> None:
    """4 × 4 squares of two triangles each; the last corner at the height `last`."""
    corners = np.array(
        [
            [(x + i, y + j, 0.0) for i, j in turn]
            for y in range(CELLS)
            for x in range(CELLS)
            for turn in (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1)))
        ],
        dtype=np.float32,
    )
    corners[-1, -1, 2] = last
    if text:
        lines = ["solid plane"]
        for triangle in corners.tolist():
            lines += ["facet normal 0 0 1", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in triangle)]
            lines += ["endloop", "endfacet"]
        path.write_text("\n".join([*lines, "endsolid plane", ""]))
        return
    rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = corners
    path.write_bytes(bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("block", [1, 5, 7, 1000])
def test_corners_of_all_parts_are_merged(
    block: int, text: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(meshes, "BLOCK_TRIANGLES", block)
    path = tmp_path / "plane.stl"
    write_plane(path, text=text)
    surface = read_terrain(path)
    expected = {(float(x), float(y), 0.0) for x in range(CELLS + 1) for y in range(CELLS + 1)}
    assert len(surface.vertices) == len(expected)
    assert set(map(tuple, surface.vertices.tolist())) == expected
    assert surface.vertices[0].tolist() == [0, 0, 0]
    assert surface.vertices[:4].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    a, b, c = (surface.vertices[surface.faces[:, k], :2] for k in range(3))
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert areas.tolist() == [0.5] * (2 * CELLS**2)
    stored = 6 * CELLS**2
    assert f"Mesh of {stored} vertices and {2 * CELLS**2} faces." in surface.summary
    assert f"Merged {stored - 25} vertices that were stored more than once." in surface.summary
    assert inspect_terrain(path).point_count == stored


@pytest.mark.parametrize("block", [5, 1000])
def test_a_corner_that_is_not_finite_is_named_by_its_number_in_the_file(
    block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(meshes, "BLOCK_TRIANGLES", block)
    write_plane(tmp_path / "plane.stl", last=float("nan"))
    with pytest.raises(InputError, match=r"The vertex 95 \(counted from 0\) is not finite"):
        read_terrain(tmp_path / "plane.stl")
