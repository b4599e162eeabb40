# SPDX-License-Identifier: GPL-3.0-or-later
"""Terrains with faults: how blocks meet them, and that they are counted and said."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import ENDS, IMPACT, Settings, Simulation, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.ground_faults import ground_faults
from rockfall.core.simulation.holes import rims_of_holes
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.results import fell_through, run_figures
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.simulation import remarks_of

SETTINGS = Settings("azimi_desvarreux_1977", {"rn": 0.4, "rt": 0.9})


def sheet(vertices: np.ndarray | None = None, faces: np.ndarray | None = None) -> Surface:
    """A bumpy slope of 20 × 20 squares of 2 m, or what is made of its arrays."""
    line = np.arange(0.0, 41.0, 2.0)
    x, y = np.meshgrid(line, line)
    z = -0.7 * x + 0.2 * np.sin(x) * np.cos(y)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    return Surface(
        np.column_stack([x.ravel(), y.ravel(), z.ravel()]) if vertices is None else vertices,
        np.concatenate([lower, upper]).astype(np.int32) if faces is None else faces,
        GlobalShift(),
        "sheet",
    )


def vertex_at(surface: Surface, x: float, y: float) -> int:
    return int(np.flatnonzero((np.abs(surface.vertices[:, :2] - [x, y]) < 0.1).all(axis=1))[0])


def fall(ground: Ground) -> Simulation:
    start = np.column_stack([np.full(60, 6.0), np.linspace(4, 36, 60), np.full(60, 0.0)])
    return simulate(ground, make_releases(start, diameter_m=0.5), SETTINGS)


def same(one: Simulation, other: Simulation, alike: float = 1.0) -> None:
    """The same falls, but for what rounding grows to on the way down: 2 mm when the start is moved by 1e-12 m.

    alike : the part of the blocks of which that is true.
    """
    np.testing.assert_array_equal(one.end, other.end)
    first = [np.flatnonzero((run.records.what == IMPACT) & (run.records.time_s < 1.5)) for run in (one, other)]
    assert len(first[0]) == len(first[1]) >= 60
    np.testing.assert_allclose(one.records.position[first[0]], other.records.position[first[1]], atol=1e-6)
    apart = np.linalg.norm(one.position - other.position, axis=1)
    assert (apart < 0.02).mean() >= alike
    assert apart.max() < (0.02 if alike == 1.0 else 0.5)


def texts(simulation: Simulation) -> list[str]:
    return [remark.text for remark in remarks_of([simulation])]


def test_a_good_surface_has_no_faults() -> None:
    faults = ground_faults(sheet())
    assert (faults.triangles, faults.border_edges) == (800, 80)
    assert (faults.twice, faults.opposed_edges, faults.branching_edges, faults.spikes) == (0, 0, 0, 0)
    said = texts(fall(make_ground(sheet())))
    assert not any(
        what in text for text in said for what in ("Triangles", "triangles of", "Edges between", "Edges of", "Spikes")
    )


def test_triangles_without_area_are_left_out() -> None:
    surface = sheet()
    flat = np.array([[5, 5, 6], [7, 8, 9], [30, 30, 30]], np.int32)  # two corners in one place, on a line, in a point
    level = surface.vertices * [1.0, 1.0, 0.0]
    ground = make_ground(sheet(level, np.concatenate([flat, surface.faces])))
    assert (ground.flat, len(ground.faces)) == (3, 800)
    run = simulate(ground, make_releases(np.array([[20.0, 20.0, 3.0]]), diameter_m=0.5), SETTINGS)
    assert run.position[0, 2] == pytest.approx(0.25, abs=1e-6)
    assert "Triangles without area: 3; they were left out." in texts(run)


def test_both_sides_of_a_triangle_stop_a_block() -> None:
    """Every triangle of a closed-form count is turned: 5 in the middle, none a neighbour of another: 15 edges."""
    surface = sheet()
    faces = surface.faces.copy()
    for place in (21, 65, 109, 153, 197):
        faces[place] = faces[place, ::-1]
    turned = sheet(faces=faces)
    assert ground_faults(turned).opposed_edges == 15
    run = fall(make_ground(turned))
    same(run, fall(make_ground(surface)))
    np.testing.assert_allclose(
        run_figures(run).height_max_m, run_figures(fall(make_ground(surface))).height_max_m, atol=0.05
    )
    assert "Edges between triangles of opposite winding: 15; blocks meet both sides alike." in texts(run)
    same(fall(make_ground(sheet(faces=surface.faces[:, ::-1].copy()))), run)


def test_triangles_that_are_there_twice_are_met_as_one() -> None:
    surface = sheet()
    again = sheet(
        faces=np.concatenate([surface.faces, surface.faces[100:107, [1, 2, 0]], surface.faces[300:303, ::-1]])
    )
    assert ground_faults(again).twice == 10
    run = fall(make_ground(again))
    # Edges of three triangles are none that a block is taken over: it rolls there in steps.
    same(run, fall(make_ground(surface)), 0.95)
    assert "Triangles that are there twice: 10; blocks meet them as one." in texts(run)


def test_a_wall_on_an_edge_of_the_terrain_is_met() -> None:
    """A third triangle at an edge: three edges have three triangles, and blocks stop at the wall that they carry."""
    surface = sheet()
    edge = [
        np.flatnonzero((np.abs(surface.vertices[:, :2] - [24.0, y]) < 0.1).all(axis=1))[0] for y in range(14, 22, 2)
    ]
    top = surface.vertices[edge] + [0.0, 0.0, 4.0]
    new = len(surface.vertices) + np.arange(4)
    wall = [(edge[k], edge[k + 1], new[k + 1]) for k in range(3)] + [(edge[k], new[k + 1], new[k]) for k in range(3)]
    faces = np.concatenate([surface.faces, np.array(wall, np.int32)])
    branching = sheet(np.concatenate([surface.vertices, top]), faces)
    assert ground_faults(branching).branching_edges == 3
    start = np.array([[10.0, 17.0, -4.0]])
    smooth = replace(SETTINGS, friction=0.2)
    run = simulate(make_ground(branching), make_releases(start, diameter_m=0.5), smooth)
    assert run.position[0, 0] < 24.0
    assert simulate(make_ground(surface), make_releases(start, diameter_m=0.5), smooth).position[0, 0] > 39.0
    assert "Edges of more than two triangles: 3; blocks meet each of them." in texts(run)


def test_spikes_are_counted_and_met() -> None:
    surface = sheet()
    vertices = surface.vertices.copy()
    for x, height in ((12.0, 30.0), (24.0, -30.0)):
        vertices[vertex_at(surface, x, 20.0), 2] += height
    spiky = sheet(vertices)
    assert ground_faults(spiky).spikes == 2
    cliff = sheet(np.column_stack([0.05 * surface.vertices[:, 0], surface.vertices[:, 1], -7 * surface.vertices[:, 0]]))
    assert ground_faults(cliff).spikes == 0
    run = simulate(
        make_ground(spiky), make_releases(np.array([[8.0, 20.0, 5.0]]), velocity=np.array([[9.0, 0, 0]])), SETTINGS
    )
    assert run.impacts[0] > 0
    first = run.records.position[np.flatnonzero(run.records.what == IMPACT)[0]]
    assert first[0] < 12.0
    assert "Spikes in the terrain: 2; blocks meet them as they are." in texts(run)


def test_a_block_falls_through_a_hole_that_is_larger_and_rides_over_a_smaller_one() -> None:
    surface = sheet()
    middle = surface.vertices[surface.faces].mean(axis=1)
    open_ = (np.abs(middle[:, 0] - 21.0) < 1.1) & (np.abs(middle[:, 1] - 21.0) < 1.1)
    holed = sheet(faces=surface.faces[~open_])
    assert ground_faults(holed).border_edges == 80 + 4
    for diameter, falls in ((0.4, True), (6.0, False)):
        start, drift = np.array([[20.4, 21.0, -0.7 * 21 + 4.0]]), np.array([[1.0, 0.0, 0.0]])
        run = simulate(make_ground(holed), make_releases(start, velocity=drift, diameter_m=diameter), SETTINGS)
        assert any("fell through the terrain" in text for text in texts(run)) == falls
        assert (run.impacts[0] == 0) == falls


@pytest.mark.parametrize("winding", ["alike", "mixed"])
def test_a_block_that_ends_below_a_hole_fell_through_and_one_beyond_the_outline_did_not(winding: str) -> None:
    """Straight down through two holes of one square each, and over each side of the outline."""
    surface = sheet()
    middle = surface.vertices[surface.faces].mean(axis=1)
    open_ = np.zeros(len(middle), np.bool_)
    for x in (21.0, 31.0):
        open_ |= (np.abs(middle[:, 0] - x) < 1.1) & (np.abs(middle[:, 1] - 21.0) < 1.1)
    faces = surface.faces[~open_]
    if winding == "mixed":
        faces[::7] = faces[::7, ::-1]
    ground = make_ground(sheet(faces=faces))
    assert len(ground.rims) == 8
    plan = np.array([[21.0, 21.0], [31.0, 21.0], [39.5, 20.0], [20.0, 39.5], [20.0, 0.5], [0.5, 20.0]])
    velocity = 6.0 * np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0.5], [0, 1, 0.5], [0, -1, 0.5], [-1, 0, 0.5]])
    start = np.column_stack([plan, 3.0 - 0.7 * plan[:, 0]])
    run = simulate(ground, make_releases(start, velocity=velocity, diameter_m=0.4), SETTINGS)
    assert (run.end == ENDS.index("left_terrain")).all()
    assert np.isnan(ground.heights_above(run.position[:2])).all()  # nothing above them tells
    assert fell_through(run).tolist() == [True, True, False, False, False, False]
    assert any(text.startswith("2 of 6 blocks") and "fell through the terrain" in text for text in texts(run))


def test_a_surface_without_a_hole_or_a_border_has_no_rims() -> None:
    assert len(make_ground(sheet()).rims) == 0
    corners = np.array([[0.0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]])
    closed = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)
    assert rims_of_holes(Surface(corners, closed, GlobalShift(), "closed")).shape == (0, 4)


def test_a_structure_that_no_block_meets_is_said() -> None:
    corners = np.array([[30.0, 0, -30], [30, 40, -30], [30, 40, -10], [30, 0, -10]])
    fence = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "fence")
    hut = Surface(corners * [0.01, 0.1, 1.0] + [2, 0, 20], fence.faces, GlobalShift(), "hut")
    run = fall(make_ground(sheet(), {"fence": fence, "hut": hut}))
    assert "No block meets hut." in texts(run)
    assert "No block meets fence." not in texts(run)


def test_vertices_that_are_no_numbers_are_refused() -> None:
    vertices = sheet().vertices.copy()
    vertices[[5, 9]] = np.nan
    with pytest.raises(InputError, match="2 vertices whose coordinates are no numbers"):
        make_ground(sheet(vertices))
