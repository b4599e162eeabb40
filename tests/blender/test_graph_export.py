# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs as files: what is drawn is written, as it is set up, without a graphics card."""

import csv
import errno
import re
from pathlib import Path
from xml.etree import ElementTree

import bpy
import numpy as np
import pytest

HEADER = "trajectory,time_s,x_m,y_m,z_m,kind,status,nx,ny,nz\n"
NORMAL = "0.5,0.0,0.8660254037844386"
TIMES = (0.0, 0.8, 1.6, 2.4, 3.2)
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def scene(rockfall, tmp_path: Path) -> bpy.types.Scene:
    """Two runs, of which three impacts each have a flight before and after."""
    rows = []
    for name, later in (("A", 0.0), ("B", 50.0)):
        for i, time in enumerate(TIMES):
            x, z = 6.0 * i + 0.3 * i * i, 40 - 3.4 * i
            rows.append(
                f"{name},{time + later!r},{x!r},{later / 10!r},{z!r},{'impact' if i else 'release'},ok,{NORMAL}"
            )
    path = tmp_path / "picks.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"FINISHED"}
    return bpy.context.scene


def picture(path: Path) -> ElementTree.Element:
    return ElementTree.fromstring(path.read_text(encoding="utf-8"))


def words(root: ElementTree.Element) -> list[str]:
    return [element.text or "" for element in root.iter(f"{SVG}text")]


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_graphs_of_impacts_are_written_as_they_are_set_up(scene, part, tmp_path: Path) -> None:
    scene.rockfall_graphs.count = 1
    graph = scene.rockfall_graphs.graph_1
    graph.x, graph.y = "vt1_mps", "vt2_mps"
    graph.x_limits, graph.x_fixed = (0.0, 40.0), True
    graph.y_limits, graph.y_fixed = (0.0, 40.0), True
    path = tmp_path / "graphs.svg"
    assert bpy.ops.rockfall.export_graphs(filepath=str(path), kind="IMPACTS", width=600, height=500) == {"FINISHED"}
    root = picture(path)
    assert (root.get("width"), root.get("height")) == ("600", "500")
    assert any("Restituted tangential speed" in text for text in words(root))
    impacts = part("rockfall_addon.scene.models.comparison").comparison_of(scene).impacts
    known = np.isfinite(impacts.vt1) & np.isfinite(impacts.vt2)
    discs = [p.get("d") for p in root.iter(f"{SVG}path") if "a" in p.get("d") and p.get("fill") == "#000000"]
    places = sorted(tuple(map(float, re.match(r"M(\S+) ([^a]+)a(\S+)", d).groups())) for d in discs)
    ticks = {
        e.text: float(e.get("x")) for e in root.iter(f"{SVG}text") if e.get("text-anchor") == "middle" and e.get("x")
    }
    numbers = sorted((float(text), x) for text, x in ticks.items() if text.isdecimal())
    (v0, x0), (v1, x1) = numbers[0], numbers[-1]
    drawn = np.array([(x + r - x0) / (x1 - x0) * (v1 - v0) + v0 for x, _, r in places])
    assert known.sum() == 6
    for value in impacts.vt1[known]:
        assert np.abs(drawn - value).min() < 0.05
    rows = [row for row in table_of(tmp_path, "IMPACTS") if row["series"] == "measured"]
    assert [float(row["x"]) for row in rows] == pytest.approx(impacts.vt1[known].tolist())
    assert {row["y_variable"] for row in rows} == {"vt2_mps"}


def table_of(folder: Path, kind: str) -> list[dict[str, str]]:
    path = folder / "numbers.csv"
    assert bpy.ops.rockfall.export_graphs(filepath=str(path), kind=kind) == {"FINISHED"}
    return table(path)


def test_motion_graphs_are_written_without_the_cursor(scene, part, tmp_path: Path) -> None:
    path = tmp_path / "motion.svg"
    assert bpy.ops.rockfall.export_graphs(filepath=str(path), kind="MOTION", colours="SCREEN") == {"FINISHED"}
    root = picture(path)
    texts = words(root)
    assert "Speed [m/s]" in texts
    assert "Kinetic energy [kJ]" in texts
    assert not any("frame" in text for text in texts)
    assert root.find(f"{SVG}rect").get("fill") != "#ffffff"
    rows = table_of(tmp_path, "MOTION")
    impacts = part("rockfall_addon.scene.models.comparison").comparison_of(scene).impacts
    here = [row for row in rows if row["trajectory"] == "B" and row["time_s"] == "50.800000"]
    assert [float(row["kinetic_J"]) for row in here] == pytest.approx(
        [impacts.kinetic1_j[4], impacts.kinetic2_j[4]], rel=1e-6
    )
    assert bpy.ops.rockfall.export_graphs(filepath=str(tmp_path / "motion"), kind="MOTION") == {"FINISHED"}
    assert (tmp_path / "motion.svg").exists()


def test_what_cannot_be_written_is_told_and_leaves_nothing(scene, part, tmp_path: Path) -> None:
    errors, export = part("core.errors"), part("rockfall_addon.view.graphs.export")
    editor = part("rockfall_addon.view.graphs.editor")
    with pytest.raises(errors.InputError, match="svg, png, csv"):
        export.write(bpy.context, editor.MOTION, tmp_path / "a.pdf", (300, 200), 1.0, dark=False)
    for obj in [o for o in scene.objects if o.get("rockfall_role") == "pick"]:
        bpy.data.objects.remove(obj)
    part("rockfall_addon.scene.footage.sync").sync(scene)
    before = set(tmp_path.iterdir())
    for tree in (editor.MOTION, editor.IMPACTS):
        for kind in ("svg", "csv"):
            with pytest.raises(errors.InputError, match="There is no"):
                export.write(bpy.context, tree, tmp_path / f"a.{kind}", (300, 200), 1.0, dark=False)
    assert set(tmp_path.iterdir()) == before
    assert not bpy.ops.rockfall.export_graphs.poll()


def one_graph(scene: bpy.types.Scene, **settings: str) -> None:
    scene.rockfall_graphs.count = 1
    for name, value in {"x": "theta1_deg", "y": "rn", **settings}.items():
        setattr(scene.rockfall_graphs.graph_1, name, value)
    scene.rockfall_comparison.models = {"noel_2017"}


def exported(path: Path) -> str:
    assert bpy.ops.rockfall.export_graphs(filepath=str(path), kind="IMPACTS", width=900, height=700) == {"FINISHED"}
    return " | ".join(words(picture(path)))


def rmse(compared, rows: np.ndarray) -> float:
    """Of R_N, from the predicted velocities."""
    predicted = compared.predictions["A"]["noel_2017"]
    measured = compared.impacts.rn[predicted.row]
    counted = np.isfinite(measured) & np.isin(predicted.row, rows)
    return float(np.sqrt(np.mean((predicted.rn[0, 1:].mean(axis=0) - measured)[counted] ** 2)))


def test_a_score_stands_above_the_graph_with_filters_and_without_fits(scene, part, tmp_path: Path) -> None:
    one_graph(scene)
    compared = part("rockfall_addon.scene.models.comparison").comparison_of(scene)
    whole = rmse(compared, np.arange(len(compared.impacts)))
    assert f"RMSE {whole:.2f}" in exported(tmp_path / "whole.svg")
    scene.rockfall_graphs.fits = False
    assert f"RMSE {whole:.2f}" in exported(tmp_path / "bare.svg").split(" | ")
    row = scene.rockfall_graphs.filters.add()
    row.column, row.texts = "trajectory", "A"
    some = rmse(compared, np.flatnonzero(compared.impacts.trajectory == "A"))
    assert f"{some:.2f}" != f"{whole:.2f}"
    text = exported(tmp_path / "some.svg")
    assert f"RMSE {some:.2f} filtered" in text
    assert "measured (3, 4 filtered out)" in text
    (ranked,) = part("rockfall_addon.scene.models.comparison_scores").ranking(
        scene, compared, part("rockfall_addon.scene.models.comparison_scores").kept_of(scene, compared)
    )
    assert (ranked.score.n, ranked.score.rmse) == (3, pytest.approx(some))


def test_links_that_are_left_out_are_told(scene, part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one_graph(scene)
    assert "links" not in exported(tmp_path / "all.svg")
    monkeypatch.setattr(part("rockfall_addon.view.graphs.impact_graphs"), "MOST_LINKS", 2)
    scene.rockfall_graphs.fits = False
    assert "links: of selected impacts only" in exported(tmp_path / "some.svg")
    scene.rockfall_graphs.links = False
    assert "links" not in exported(tmp_path / "none.svg")


@pytest.mark.parametrize("kind", ["svg", "csv"])
def test_a_full_disk_leaves_the_old_file(scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    path = tmp_path / f"graphs.{kind}"
    path.write_bytes(b"old")
    opened = Path.open

    def full(self: Path, mode: str = "r", *rest: object, **more: object) -> object:
        if "w" in mode and self.suffix == f".{kind}":
            raise OSError(errno.ENOSPC, "No space left on device")
        return opened(self, mode, *rest, **more)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(RuntimeError, match=r"No space left on device.*Make room"):
        bpy.ops.rockfall.export_graphs(filepath=str(path), kind="IMPACTS")
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith("graphs")] == [path.name]
    assert path.read_bytes() == b"old"


def test_all_models_have_their_score_where_there_is_little_room(scene, part, tmp_path: Path) -> None:
    one_graph(scene)
    scene.rockfall_comparison.models = names = set(part("core.impact_models.registry").COMPARED)
    compared = part("rockfall_addon.scene.models.comparison").comparison_of(scene)
    rmse_of = part("rockfall_addon.scene.models.comparison_scores").rmse_of
    wanted = {f"{rmse_of(compared, 'A', name, 'rn'):.2f}" for name in names}
    path = tmp_path / "narrow.svg"
    assert bpy.ops.rockfall.export_graphs(filepath=str(path), kind="IMPACTS", width=420, height=500) == {"FINISHED"}
    texts = words(picture(path))
    assert wanted <= {text.removeprefix("RMSE ") for text in texts}
    assert sum(text.startswith("RMSE ") for text in texts) == 1
