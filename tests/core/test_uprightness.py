# SPDX-License-Identifier: GPL-3.0-or-later
"""A terrain with y up is turned, and what came with it: as if all had had z up from the beginning."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import Camera, project
from rockfall.core.camera.pairs import Pairs
from rockfall.core.camera.path import fixed
from rockfall.core.cli import main
from rockfall.core.exchange.cameras import write_camera
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.tables import read_impacts, read_picks
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.terrain.opening import HowToRead
from rockfall.core.terrain.readers import read_terrain, read_tiles
from rockfall.core.workflow.opening import open_project, read_project_camera
from rockfall.core.workflow.uprightness import turned_camera, turned_pairs, turned_picks

EAST, NORTH, UP = 2_600_000.0, 1_200_000.0, 500.0


def y_up(points):
    """What a program with y up writes: x stays, height comes second, north points towards the viewer's back."""
    x, y, z = np.asarray(points, dtype=float).T
    return np.column_stack([x, z, -y])


def write_picks(path, points):
    rows = [f"A,{0.5 * i},{x:.6f},{y:.6f},{z:.6f}" for i, (x, y, z) in enumerate(points)]
    path.write_text("trajectory,time_s,x_m,y_m,z_m\n" + "\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A slope of 50 × 50 m as a mesh and as a cloud, picks on it, each with z and with y up."""
    folder = tmp_path_factory.mktemp("site")
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 51, 2.0), np.arange(0, 51, 2.0)))
    ground = np.column_stack([x + EAST, y + NORTH, UP + 40 - 0.7 * x + np.sin(y / 4)])
    i = np.arange(26 * 26).reshape(26, 26)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4) + 1
    along = np.arange(5, 40, 6.0)
    picks = np.column_stack([along + EAST, 20 + NORTH + 0 * along, UP + 40 - 0.7 * along + np.sin(5.0)])
    for name, turn in (("z", np.asarray), ("y", y_up)):
        rows = [f"v {a:.6f} {b:.6f} {c:.6f}" for a, b, c in turn(ground)]
        rows += [f"f {a} {b} {c} {d}" for a, b, c, d in corners]
        (folder / f"{name}.obj").write_text("\n".join(rows) + "\n")
        np.savetxt(folder / f"{name}.xyz", turn(ground), fmt="%.6f")
        write_picks(folder / f"picks_{name}.csv", turn(picks))
    return folder


@pytest.mark.parametrize("terrain", ["y.obj", "y.xyz"])
@pytest.mark.parametrize("picks", ["picks_y.csv", "picks_z.csv"])
def test_impacts_are_those_of_z_up_whichever_way_the_picks_have(site, tmp_path, capsys, terrain, picks):
    found = {}
    for name, words in (("right", ["z" + terrain[1:], "picks_z.csv", "z"]), ("turned", [terrain, picks, "y"])):
        argv = ["reconstruct", str(site / words[1]), "--terrain", str(site / words[0]), "--up", words[2]]
        assert main([*argv, "--out", str(tmp_path / name)]) == 0
        found[name] = read_impacts(tmp_path / name / "impacts.csv")
    said = capsys.readouterr().out
    assert ("The picks were turned from Y up to Z up with the terrain" in said) == (picks == "picks_y.csv")
    for what in ("normal", "v1", "v2"):
        np.testing.assert_allclose(getattr(found["turned"], what), getattr(found["right"], what), atol=1e-5)
    places = [each.shift.to_survey(each.position) for each in found.values()]
    np.testing.assert_allclose(places[1], places[0], atol=1e-5)


def test_without_turning_the_picks_stay_as_they_are(site, tmp_path, capsys):
    argv = ["reconstruct", str(site / "picks_z.csv"), "--terrain", str(site / "z.obj"), "--out", str(tmp_path / "out")]
    assert main(argv) == 0
    assert "turned" not in capsys.readouterr().out
    assert not read_terrain(site / "z.obj").turned
    assert read_tiles([site / "y.obj", site / "y.obj"], HowToRead(up="y")).turned


def test_pairs_and_cameras_are_turned_so_that_they_see_the_same(site):
    surface = read_terrain(site / "y.obj", up="y")
    rng = np.random.default_rng(2)
    shown = surface.shift.to_survey(surface.vertices[rng.choice(len(surface.vertices), 12, replace=False)])
    camera = Camera(1920, 1080, 1500, 1500, 960, 540, position=np.array([20.0, -60.0, 60.0]))
    own = GlobalShift(EAST, UP, -NORTH)
    pixel = rng.uniform(0, 1000, (12, 2))
    nothing = np.full(12, np.nan)
    pairs = Pairs(
        pixel, own.to_local(y_up(shown)), np.arange(12).astype(str), np.full(12, -1), nothing, nothing,
        np.ones(12, bool), own,
    )  # fmt: skip
    turned, said = turned_pairs(pairs, surface)
    np.testing.assert_allclose(turned.shift.to_survey(turned.point), shown, atol=1e-6)
    assert said
    again, said = turned_pairs(turned, surface)
    assert again is turned
    assert not said
    # The camera of a world with y up, made by hand: its place and its axes are those of that world.
    there = replace(camera, position=y_up(camera.position[None])[0], rotation=y_up(camera.rotation))
    local = surface.vertices[:200]
    np.testing.assert_allclose(project(turned_camera(there), local), project(camera, local), atol=1e-8)
    np.testing.assert_allclose(project(there, y_up(local)), project(camera, local), atol=1e-8)


@pytest.mark.parametrize("kept", ["y", "z"])
def test_a_project_reads_its_picks_and_cameras_as_upright_as_its_terrain(site, tmp_path, kept):
    """All of a project with y up, and one whose terrain alone has it, are what they are with z up."""
    camera = Camera(1280, 720, 900, 900, 640, 360, shift=GlobalShift(EAST, NORTH, UP))
    camera = replace(camera, position=np.array([70.0, 20.0, 30.0]), rotation=looking_west())
    there = replace(camera, shift=GlobalShift(EAST, UP, -NORTH))
    there = replace(there, position=y_up(camera.position[None])[0], rotation=y_up(camera.rotation))
    spread = np.diag([1e-6, 2e-6, 3e-6, 1e-2, 4e-2, 9e-2])
    turn = np.eye(6)
    turn[3:, 3:] = y_up(np.eye(3)).T
    for name, each, covariance in (("z", camera, spread), ("y", there, turn @ spread @ turn.T)):
        write_camera(tmp_path / f"camera_{name}.toml", fixed(each), pose_covariance=covariance)
    (tmp_path / "project.toml").write_text(
        f'schema = 1\n[terrain]\nfile = "{(site / "y.obj").as_posix()}"\nup = "y"\n'
        f'[picks]\nfile = "{(site / f"picks_{kept}.csv").as_posix()}"\n'
    )
    read = read_project(tmp_path / "project.toml")
    surface, made = open_project(read)
    right = read_terrain(site / "z.obj")
    picks = read_picks(site / "picks_z.csv", right.shift)
    np.testing.assert_allclose(
        made.picks.shift.to_survey(made.picks.position), picks.shift.to_survey(picks.position), atol=1e-6
    )
    assert any("The picks were turned" in remark.text for remark in made.remarks) == (kept == "y")
    found, said = read_project_camera(tmp_path / f"camera_{kept}.toml", surface)
    assert bool(said) == (kept == "y")
    pixel = project(found.path.reference, surface.vertices)
    expected = project(camera, camera.shift.to_local(surface.shift.to_survey(surface.vertices)))
    assert np.isfinite(pixel).all()
    np.testing.assert_allclose(pixel, expected, atol=1e-6)
    np.testing.assert_allclose(found.pose_covariance, spread, atol=1e-12)


def looking_west():
    """(3, 3) from the world to a camera that looks along −x, with z up in the picture."""
    return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


def test_picks_that_are_stored_coarsely_are_said_wherever_picks_are_read():
    survey = np.array([352_000.0, 5_130_000.0, 1_200.0]) + np.random.default_rng(4).uniform(0, 90, (12, 3))
    for places, expected in ((survey, ()), (survey.astype(np.float32).astype(float), ("steps of 0.5 m (y)",))):
        shift = GlobalShift(352_000.0, 5_130_000.0, 0.0)
        picks = make_picks(["a"] * 12, np.arange(12.0), shift.to_local(places), shift=shift)
        said = turned_picks(picks, None)[1]
        assert len(said) == len(expected)
        assert all(words in sentence for words, sentence in zip(expected, said, strict=True))
