# SPDX-License-Identifier: GPL-3.0-or-later
"""A terrain with y up: noticed before it is imported, turned when asked, and picks that came with it too."""

import bpy
import numpy as np
import pytest


def y_up(points):
    x, y, z = points.T
    return np.column_stack([x, z, -y])


@pytest.fixture
def files(tmp_path):
    """A mesh of a slope in which y points up, and picks on it with y up and with z up."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 41, 4.0), np.arange(0, 41, 4.0)))
    ground = np.column_stack([x, y, 30 - 0.7 * x])
    i = np.arange(121).reshape(11, 11)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4) + 1
    rows = [f"v {a} {b} {c}" for a, b, c in y_up(ground)] + [f"f {a} {b} {c} {d}" for a, b, c, d in corners]
    (tmp_path / "slope.obj").write_text("\n".join(rows) + "\n")
    along = np.arange(4, 36, 6.0)
    picks = np.column_stack([along, 0 * along + 20, 30 - 0.7 * along])
    for name, points in (("y", y_up(picks)), ("z", picks)):
        lines = [f"A,{0.5 * k},{a},{b},{c}" for k, (a, b, c) in enumerate(points)]
        (tmp_path / f"picks_{name}.csv").write_text("trajectory,time_s,x_m,y_m,z_m\n" + "\n".join(lines) + "\n")
    return tmp_path, picks


def test_it_is_noticed_before_the_import(part, files):
    inspect = part("core.terrain.readers").inspect_terrain
    assert inspect(files[0] / "slope.obj").y_up
    assert not inspect(files[0] / "slope.obj", up="y").y_up


def test_a_shift_that_was_proposed_for_z_up_does_not_serve_y_up(part, tmp_path):
    x, z = (each.ravel() for each in np.meshgrid(np.arange(0, 41, 4.0), np.arange(0, 41, 4.0)))
    points = np.column_stack([2_600_000 + x, 500 + 0.2 * x, -1_200_000 - z])
    np.savetxt(tmp_path / "upright.xyz", points, fmt="%.3f")
    told = {"shift_x": "2600000.0", "shift_y": "0.0", "shift_z": "-1200000.0"}
    told |= {"asked": True, "proposed": " ".join(told.values())}
    assert bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "upright.xyz"), up="y", **told) == {"FINISHED"}
    shift = part("rockfall_addon.scene.terrain.georeference").read_shift(bpy.context.scene)
    assert (shift.x, shift.y, shift.z) == (2_600_000, 1_200_000, 0)


@pytest.mark.parametrize("picks", ["picks_y.csv", "picks_z.csv"])
def test_picks_that_came_with_it_are_turned_too(part, scene, files, picks):
    folder, right = files
    assert bpy.ops.rockfall.import_terrain(filepath=str(folder / "slope.obj"), up="y") == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "site.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "site.blend"))
    part("rockfall_addon.scene.terrain.terrain")._surfaces.clear()
    assert bpy.ops.rockfall.import_picks(filepath=str(folder / picks)) == {"FINISHED"}
    found = part("rockfall_addon.scene.picks.picks").picks_of(bpy.context.scene)
    np.testing.assert_allclose(found.shift.to_survey(found.position), right, atol=1e-5)
