# SPDX-License-Identifier: GPL-3.0-or-later
"""Refusals that no other test reaches: each says what is wrong, of what, and what to do."""

import json
from collections.abc import Callable
from dataclasses import replace
from errno import ENOSPC
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rockfall.core.analysis.priors import make_priors
from rockfall.core.analysis.sections import axis_of
from rockfall.core.cli import main
from rockfall.core.errors import DependencyError, InputError, RockfallError
from rockfall.core.exchange.geotiff_maps import _place
from rockfall.core.exchange.partial_factors import open_factors
from rockfall.core.exchange.simulation_entry import TreesEntry
from rockfall.core.exchange.trees import open_trees
from rockfall.core.film.composed.templates.timing import hit_times
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.cells import Cells
from rockfall.core.hazard.design import design_values
from rockfall.core.hazard.face_tally import FaceTally
from rockfall.core.hazard.screen_tally import ScreenTally
from rockfall.core.hazard.screens import Screen
from rockfall.core.outreach.photographs import Filmed, photographs_of
from rockfall.core.simulation.blocks import block_of
from rockfall.core.simulation.distributions import Distribution
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.parameter_draws import ParameterDraws
from rockfall.core.simulation.polygons import Polygon
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.release_sources import on_line, on_points, steeper_than
from rockfall.core.simulation.run_lines import lines_of
from rockfall.core.simulation.tree_hits import tree_hits_of
from rockfall.core.terrain.cloud import Cloud, build_point_index, nearest_points
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.design_sheet import design_sheet
from rockfall.core.workflow.ensembles import HereAlone, Work, run_ensemble
from rockfall.core.workflow.following import follow_background
from rockfall.core.workflow.maps import map_models
from rockfall.core.workflow.whole_runs import stated_sections

FLAT = Surface(
    np.array([(0.0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)]), np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    GlobalShift(), "flat",
)  # fmt: skip
GROUND = make_ground(FLAT)
SETTINGS = Settings("noel_2017", seed=1)
ONE = make_releases(np.array([[10.0, 10.0, 3.0]]))
STONE = block_of("sphere", 0.4, 0.4, 0.4)
BOULDER = block_of("sphere", 9.0, 9.0, 9.0)
LINE = np.array([[5.0, 0.0], [5.0, 20.0]])
NAN = float("nan")


def slot() -> Ground:
    """Two walls that stand a metre apart, leaning towards each other, on a strip of ground."""
    profile = [(-9.0, 9.0), (-0.2, 9.0), (-0.5, 0.0), (0.5, 0.0), (0.2, 9.0), (9.0, 9.0)]
    vertices = np.array([(x, y, z) for x, z in profile for y in (0.0, 10.0)])
    faces = [f for i in range(0, 10, 2) for f in ((i, i + 2, i + 3), (i, i + 3, i + 1))]
    return make_ground(Surface(vertices, np.array(faces, np.int32), GlobalShift(), "slot"))


def thin_cloud() -> Ground:
    return make_ground(Cloud(np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), GlobalShift(), "three.xyz"))


def dense_cloud() -> Ground:
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 4, 0.08), np.arange(0, 4, 0.08)))
    return make_ground(Cloud(np.column_stack([x, y, 0 * x]), GlobalShift(), "lattice.xyz"))


def stops() -> Any:
    return simulate(GROUND, ONE, SETTINGS, record="ends")


def fell() -> Any:
    return simulate(GROUND, ONE, SETTINGS)


def drawn(names: tuple[str, ...], shape: tuple[int, int]) -> ParameterDraws:
    return ParameterDraws(names, np.ones(shape), np.ones(2))


def hits(number: list[int] | None) -> Any:
    known = None if number is None else SimpleNamespace(number=np.array(number), time_s=np.arange(len(number)) * 1.0)
    return SimpleNamespace(name="B10", hits=known)


MATERIAL: Any = SimpleNamespace(request=SimpleNamespace(project=Path("site.toml")))
REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "a law": (
        lambda: Distribution("nromal", 1.0),  # type: ignore[arg-type]
        "There is no law 'nromal'. Did you mean normal?",
    ),
    "a shape": (
        lambda: make_releases(np.zeros((1, 3)), shape="cbue"),  # type: ignore[arg-type]
        "There is no shape 'cbue'. Did you mean cube?",
    ),
    "no blocks": (
        lambda: simulate(GROUND, ONE.take(np.empty(0, np.intp)), SETTINGS),
        "There is nothing to simulate: no block is released. Give at least one release.",
    ),
    "a cloud as a surface": (
        lambda: thin_cloud().surface,
        "three.xyz: The terrain is a cloud of points, where a surface is needed. "
        "Let blocks meet the surface (contact: mesh).",
    ),
    "zones beside the terrain": (
        lambda: make_ground(FLAT, zone=np.zeros(3, np.int32)),
        "The zones do not fit the terrain. Give each triangle or point the number of one of the zones.",
    ),
    "a zone that is not there": (
        lambda: make_ground(FLAT, zone=np.array([0, 1], np.int32)),
        "The zones do not fit the terrain. Give each triangle or point the number of one of the zones.",
    ),
    "draws of another shape": (
        lambda: drawn(("rn",), (3, 1)),
        "The drawn parameters have the shape (3, 1), not (2, 1). "
        "Give a parameter or more, with a row of values for each weight.",
    ),
    "a draw twice": (lambda: drawn(("rn", "rn"), (2, 2)), "The drawn parameter rn is there twice. Give it once."),
    "a polygon": (
        lambda: Polygon("wood", (np.array([[0.0, 0], [1, 0], [NAN, 1]]),)),
        "The polygon wood has a coordinate that is not finite. Correct it.",
    ),
    "a line": (
        lambda: on_line(GROUND, [np.array([[0.0, 0, 0], [NAN, 1, 0]])], STONE, 1, names=["edge"]),
        "The line edge has a coordinate that is not finite. Correct it.",
    ),
    "a slot": (
        lambda: on_points(slot(), np.array([[0.0, 5.0, 0.0]]), BOULDER),
        "A block of 9 m is too large for the ground at",
    ),
    "a thin cloud": (
        lambda: steeper_than(thin_cloud(), 0.0, STONE, 1),
        "The points are too few to know how steep the terrain is. Give a denser cloud.",
    ),
    "lines of runs": (
        lambda: lines_of(fell(), 0.0),
        "The deviation of lines from parabolas must be positive [m], not 0.0.",
    ),
    "trees": (lambda: tree_hits_of(fell()), "The simulation has no trees."),
    "a place": (
        lambda: nearest_points(Cloud(np.zeros((1, 3)), GlobalShift(), "c"), np.array([[0.0, NAN, 1.0]])),
        "The place 0 is not finite: [0.0, nan, 1.0]. Leave it out.",
    ),
    "faces": (
        lambda: FaceTally(2).add(stops()),
        "Contacts with faces need the whole motion of the blocks. Record all of it.",
    ),
    "other screens": (
        lambda: ScreenTally([Screen("road", LINE)]).merge(ScreenTally([Screen("rail", LINE)])),
        "Hits of other screens cannot be added. Add those of one simulation.",
    ),
    "no points": (
        lambda: build_point_index(np.empty((0, 3))),
        "A cloud without points has no spatial index.",
    ),
    "beside a cloud": (
        lambda: on_points(dense_cloud(), np.array([[500.0, 500.0, 0.0]]), STONE),
        "There is no terrain at 500.00, 500.00, 0.00. Correct the coordinates, or give a terrain that reaches so far.",
    ),
    "runs that go nowhere": (
        lambda: axis_of(
            SimpleNamespace(  # type: ignore[arg-type]
                first_piece=np.array([0, 1]), start=np.zeros((1, 3)), end=np.array([[0.0, 0.0, -9.0]]),
                stop=np.full((1, 3), NAN),
            )
        ),
        "The observed runs go nowhere, in plan. Give picks of blocks that move.",
    ),
    "no cells": (lambda: Cells(0.0, 0.0, 1.0, 0, 4), "The maps have 0 × 4 cells. Give at least one."),
    "cells that are nowhere": (
        lambda: _place(Cells(1e308, 0.0, 1.0, 1, 1), GlobalShift(x=1e308), Path("map.tif")),
        "map.tif: The cells of the map have no finite place. Give metres.",
    ),
    "a shift": (
        lambda: GlobalShift(x=NAN),
        "The global shift (nan, 0.0, 0.0) m is not finite. Write metres, like 2600000.0.",
    ),
    "both kinds of trees": (
        lambda: open_trees(TreesEntry(Path("trees.csv"), stems_per_hectare=300.0), FLAT, 0),
        "Trees have both a table and a density. Give the table, or stems per hectare with dbh.",
    ),
    "a chunk": (
        lambda: run_ensemble(Work(GROUND, SETTINGS, {}), ONE, HereAlone(), size=0),
        "A chunk of 0 runs is none. Give at least one.",
    ),
    "no models": (
        lambda: map_models(GROUND, ONE, [], 1.0),
        "There is no model to simulate with. Give at least one impact model.",
    ),
    "an impact that is not there": (
        lambda: hit_times(hits([1, 2, 3]), (2, 7), MATERIAL),
        "site.toml: Trajectory B10 has no impact 7. Its impacts: 1 to 3.",
    ),
    "no impacts": (
        lambda: hit_times(hits(None), (2,), MATERIAL),
        "site.toml: Trajectory B10 has no impact 2. It has no impacts.",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_and_what_to_do(name: str) -> None:
    make, said = REFUSED[name]
    with pytest.raises(RockfallError) as caught:
        make()
    assert str(caught.value).startswith(said)


def test_clouds_in_two_systems(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import laspy
    from laspy.vlrs.known import WktCoordinateSystemVlr

    for name, code in (("a.las", 2056), ("b.las", 25832)):
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.vlrs.append(WktCoordinateSystemVlr(f'PROJCS["system {code}",AUTHORITY["EPSG","{code}"]]'))
        header.global_encoding.wkt = True
        data = laspy.LasData(header)
        data.x, data.y, data.z = np.array([0.0, 1, 0]), np.array([0.0, 0, 1]), np.array([0.0, 0, 0])
        data.write(tmp_path / name)
    words = ["terrain", str(tmp_path / "a.las"), str(tmp_path / "b.las"), "--out", str(tmp_path / "out")]
    assert main(words) == 1
    said = capsys.readouterr().err.splitlines()[-1].removeprefix(f"rockfall: {tmp_path / 'b.las'}: ")
    assert "EPSG:25832" in said
    assert "the files before it in EPSG:2056" in said
    assert not (tmp_path / "out").exists()


def test_a_ground_filter_on_a_mesh(tmp_path: Path) -> None:
    file = tmp_path / "a.obj"
    file.write_text("v 0 0 0\nv 9 0 0\nv 0 9 1\nf 1 2 3\n")
    with pytest.raises(InputError) as caught:
        read_terrain(file, ground_filter_m=1.0)
    assert str(caught.value) == f"{file}: This is a mesh, and the ground filter works on clouds. Read it without."


def test_a_camera_that_walks_without_a_terrain() -> None:
    video: Any = SimpleNamespace(frames=9)
    with pytest.raises(InputError, match="A camera that walks needs the terrain"):
        follow_background(video, SimpleNamespace(keys={}), mode="full")  # type: ignore[arg-type]


def test_a_camera_of_another_picture_leaves_the_terrain_without_its_colours() -> None:
    file = Path(__file__).parents[1] / "data" / "videos" / "constant.mp4"
    path: Any = SimpleNamespace(reference=SimpleNamespace(width=1280, height=720))
    found, said = photographs_of([Filmed("side", file, path)], None)
    assert found == ()
    assert said == (
        "The terrain is shown without the colours of the video side: its camera is of a picture of 1280 × 720 pixels, "
        "and it has 64 × 48.",
    )


def test_a_parameter_that_a_zone_has_of_its_own_is_not_fitted() -> None:
    from rockfall.core.impact_models.registry import find_model
    from rockfall.core.workflow.back_analysis import back_analyse

    settings = replace(SETTINGS, zones={"wood": {"rt": 0.5}})
    priors = make_priors(find_model("noel_2017"), ["rt"], {})
    ground = make_ground(FLAT, zone=np.array([0, 1], np.int32), zones=("terrain", "wood"))
    with pytest.raises(InputError) as caught:
        back_analyse(ground, SimpleNamespace(), ONE, settings, priors)  # type: ignore[arg-type]
    assert str(caught.value) == "The zone wood has a rt of its own. Leave it out there to fit it."


def test_a_zone_with_two_frictions(tmp_path: Path) -> None:
    from rockfall.core.exchange.zones import read_zones

    ring = [[1.0, 1.0], [9.0, 1.0], [9.0, 9.0], [1.0, 1.0]]
    features = [
        {
            "type": "Feature",
            "properties": {"name": "wood", "friction": friction},
            "geometry": {"type": "Polygon", "coordinates": [ring]},
        }
        for friction in (0.4, 0.5)
    ]
    file = tmp_path / "zones.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    with pytest.raises(InputError) as caught:
        read_zones(file, FLAT, ["noel_2017"])
    said = str(caught.value)
    assert said.startswith(f"{file}: ")
    assert "wood" in said.removeprefix(str(file))
    assert "friction" in said.removeprefix(str(file))


def test_nothing_to_design_for() -> None:
    factors = open_factors("none")
    road = Screen("road", LINE)
    with pytest.raises(InputError) as caught:
        design_sheet(GROUND, ONE, [SETTINGS], [], factors)
    assert str(caught.value) == "There is no screen to design for. Draw a line across the slope, and name it."
    with pytest.raises(InputError) as caught:
        design_values(road, [], factors, 20)  # type: ignore[arg-type]
    assert str(caught.value) == (
        "None of 20 blocks comes to 'road': there is nothing to design for. "
        "Draw the screen where blocks pass, or release more."
    )


def test_films_need_the_newer_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    from rockfall.core.film.composed import canvas

    monkeypatch.setattr(canvas, "opencv", lambda: SimpleNamespace(__version__="4.11.0"))
    with pytest.raises(
        DependencyError, match=r"lettered by OpenCV 5, and 4\.11\.0 is installed.*pip install --upgrade"
    ):
        canvas._face.__wrapped__()


def test_a_video_that_does_not_show_the_block() -> None:
    from rockfall.core.film.composed.templates.stills import stroboscopic

    filmed, fall = (
        SimpleNamespace(name="side", span_s=(0.0, 2.0)),
        SimpleNamespace(name="B10", time_s=np.array([3.0, 9])),
    )
    material: Any = SimpleNamespace(filmed=filmed, falls=[fall], words={})
    with pytest.raises(InputError, match=r"^The video 'side' does not show B10\. Name another one with --video\.$"):
        stroboscopic(material)


def test_a_temporary_folder_that_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rockfall.core.outreach import animator

    def save(*_: object) -> None:
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr(animator, "save_animation", save)
    with pytest.raises(InputError) as caught:
        animator.write_animation(SimpleNamespace(), [tmp_path / "a.glb"], ["none"])  # type: ignore[arg-type]
    assert str(caught.value).endswith(
        ": The temporary folder cannot be written (No space left on device). "
        "Make room there, or set TMPDIR to a folder with room."
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("share", ["0", "1", "1.5", "nan", "-0.2"])
def test_a_share_is_between_nothing_and_all(tmp_path: Path, capsys: pytest.CaptureFixture[str], share: str) -> None:
    words = ["simulate", "r.csv", "--terrain", "t.ply", "--until-known", share, "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert f"{share} is not a number between 0 and 1" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--terrain", "--stops", "--zone-attribute"])
def test_what_a_project_says_is_not_said_again(tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str) -> None:
    (tmp_path / "project.toml").write_text("")
    words = ["compare-runs", str(tmp_path / "project.toml"), option, "a", "--out", str(tmp_path / "out")]
    assert main(words) == 1
    assert capsys.readouterr().err.endswith(f"{option} is what a project says itself. Write it into the project.\n")


def test_workers_leave_no_paths_for_a_geopackage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed")
    (tmp_path / "slope.obj").write_text("v 0 0 50\nv 90 0 0\nv 90 60 0\nv 0 60 50\nf 1 2 3\nf 1 3 4\n")
    (tmp_path / "r.csv").write_text("release,x_m,y_m,z_m,diameter_m,number\na,10,30,,0.4,2\n")
    words = ["simulate", str(tmp_path / "r.csv"), "--terrain", str(tmp_path / "slope.obj"), "--workers", "1"]
    assert main([*words, "--geopackage", "--model", "noel_2017", "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.endswith(
        "Blocks on workers leave no paths and impacts for a GeoPackage. Give --record none, for one with the releases, "
        "stops and screens, or leave out --workers.\n"
    )
    assert not (tmp_path / "out").exists()


def test_a_drop_is_finite() -> None:
    with pytest.raises(InputError, match=r"^One of the drops is 'inf'\. Give finite numbers between commas\.$"):
        stated_sections(GROUND, drops="10, inf")
