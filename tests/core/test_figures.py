# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures in print and the page of a comparison: what the files hold, and what is said when a library is missing."""

import re
import socket
import struct
import time
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from rockfall.core import extras
from rockfall.core.analysis.comparison import compare, thinned
from rockfall.core.analysis.courses import find_courses
from rockfall.core.analysis.graphs import GraphSpec, make_graph, make_sheet
from rockfall.core.analysis.scores import scores
from rockfall.core.cli import main
from rockfall.core.errors import DependencyError, InputError
from rockfall.core.exchange.parameters import read_parameters, write_parameters
from rockfall.core.exchange.tables import write_impacts
from rockfall.core.impact_models.registry import MODELS, find_model
from rockfall.core.progress import CancelledError
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

MODELS_SHOWN = ("noel_2017", "wyllie_2014")


@pytest.fixture(scope="module")
def impacts():
    """Impacts down a slope of 35°, one of them at R_N = 24.4."""
    rng = np.random.default_rng(5)
    step = rng.uniform(0.4, 1.2, 16)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(16, 3)) * 0.3, axis=0)
    normal = np.tile([0.57, 0, 0.82], (16, 1))
    names = np.repeat(["a<b>&", "b"], 8)
    found = reconstruct(make_picks(names, np.cumsum(step), position, normal=normal)).impacts
    rn = found.rn.copy()
    rn[3] = 24.4
    return replace(found, rn=rn)


@pytest.fixture(scope="module")
def predictions(impacts):
    return compare(impacts, MODELS_SHOWN, replicates=1)


@pytest.fixture(scope="module")
def figures(impacts, predictions, tmp_path_factory):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from rockfall.core.analysis.figures import save_figures

    folder = tmp_path_factory.mktemp("figures")
    save_figures(make_sheet(impacts, predictions), folder, ("png", "svg", "pdf"))
    return folder


@pytest.fixture(scope="module")
def page(impacts, predictions, tmp_path_factory):
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    from rockfall.core.analysis.report import write_report

    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(impacts, predictions, scores(impacts, predictions), path, "impacts <1>.csv")
    return path.read_text(encoding="utf-8")


def test_one_figure_for_each_model_and_the_sheet(figures) -> None:
    names = {"all_models", *MODELS_SHOWN}
    assert {path.name for path in figures.iterdir()} == {f"{n}.{kind}" for n in names for kind in ("svg", "png", "pdf")}
    for path in figures.glob("*.pdf"):
        assert path.read_bytes().startswith(b"%PDF-")


def test_print_quality(figures) -> None:
    """A page of 190 mm at 300 points per inch."""
    for path in figures.glob("*.png"):
        width, height = struct.unpack(">II", path.read_bytes()[16:24])
        assert width == round(7.48 * 300)
        assert 1000 < height < 3500


def test_text_stays_text_with_units_fits_and_outliers(figures) -> None:
    svg = (figures / "wyllie_2014.svg").read_text(encoding="utf-8")
    text = re.sub(r"\s+", "", re.sub(r"<[^>]+>", "", svg))  # letters of a formula stand one by one
    for part in ("Incident angle", "Normal restitution", "Restituted tangential speed", "[m/s]", "[°]", "Wyllie 2014"):
        assert part.replace(" ", "") in text
    assert text.count("R²") == text.count("ρ=") == 8  # measured and model in four graphs
    assert "Beyond,measured:" in text
    assert "24.4" in text


@pytest.mark.parametrize("many", [1, 3, 4])
def test_no_note_leaves_its_axes(impacts, predictions, many) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from rockfall.core.analysis.figures import model_figure, sheet_figure

    sheet = []
    for graphs in make_sheet(impacts, predictions):
        far = []
        for graph in graphs:
            points = graph.measured.copy()
            points[:many, 0] = np.mean(graph.x_limits)
            points[:many, 1] = -123456.7 * 1.1 ** np.arange(many)
            far.append(replace(graph, measured=points, modelled=points))
        sheet.append(far)
    listed = 0
    for figure in (model_figure(sheet[0]), sheet_figure(sheet)):
        figure.canvas.draw()
        for axes in figure.axes:
            box = axes.get_window_extent()
            for note in axes.texts:
                if note.get_transform() is figure.transFigure:  # the title of the figure
                    continue
                listed += "Beyond" in note.get_text()
                extent = note.get_window_extent()
                assert box.x0 - 1 < extent.x0, note.get_text()
                assert extent.x1 < box.x1 + 1, note.get_text()
    assert listed == 2 * 4 * (1 + len(sheet))


def test_graphs_of_a_sheet_stand_in_rows_and_columns_without_touching(impacts, predictions) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from rockfall.core.analysis.figures import sheet_figure

    sheet = make_sheet(impacts, predictions)
    figure = sheet_figure(sheet)
    figure.canvas.draw()
    places = np.array([axes.get_position().bounds for axes in figure.axes]).reshape(len(sheet), -1, 4)
    np.testing.assert_allclose(places[:, :, [0, 2]], np.broadcast_to(places[:1, :, [0, 2]], places[..., :2].shape))
    np.testing.assert_allclose(places[:, :, [1, 3]], np.broadcast_to(places[:, :1, [1, 3]], places[..., :2].shape))
    grid = np.array(figure.axes).reshape(len(sheet), -1)
    for row in grid:
        for left, right in pairwise(row):
            assert left.get_window_extent().x1 < right.yaxis.get_tightbbox().x0
    for above, below in pairwise(grid):
        # of the row above the lowest is its axis, without a name; of the row below the highest is its heading
        assert above[0].get_window_extent().y0 > below[0].get_tightbbox().y1
    assert grid[-1, 0].get_tightbbox().y0 >= 0.0
    assert grid[0, 0].yaxis.get_tightbbox().x0 >= 0.0


def test_the_same_figure_is_the_same_file(figures, impacts, predictions, tmp_path) -> None:
    from rockfall.core.analysis.figures import model_figure, save_figure

    graphs = make_sheet(impacts, predictions)[0]
    save_figure(model_figure(graphs), tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_bytes() == (figures / "noel_2017.svg").read_bytes()


def test_a_logarithmic_graph_of_measured_impacts(impacts, tmp_path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from rockfall.core.analysis.figures import model_figure, save_figure

    graph = make_graph(impacts, GraphSpec("energy", "kinetic1_j", "kinetic2_j", x_log=True, y_log=True))
    save_figure(model_figure([graph]), tmp_path / "energy.svg")
    assert "Incident kinetic energy" in (tmp_path / "energy.svg").read_text(encoding="utf-8")


def test_a_cloud_of_impacts_is_a_picture_within_the_drawing(impacts, predictions, tmp_path) -> None:
    """Its file does not grow with the points, and it says that the links are left out."""
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from rockfall.core.analysis.figures import model_figure, save_figure

    graph = make_graph(impacts, GraphSpec("any", "vn1_mps", "vn2_mps"), predictions, "noel_2017")
    times = 3000 // graph.row.size + 1
    many = replace(
        graph,
        row=np.tile(graph.row, times),
        measured=np.tile(graph.measured, (times, 1)),
        modelled=np.tile(graph.modelled, (times, 1)),
    )
    sizes = []
    for name, each in (("few", graph), ("many", many)):
        save_figure(model_figure([each]), tmp_path / f"{name}.svg")
        sizes.append((tmp_path / f"{name}.svg").read_text(encoding="utf-8"))
    few, cloud = sizes
    assert ("<image" in few, "<image" in cloud) == (False, True)
    assert ("no links" in few, "more than 2000 impacts: no links" in cloud) == (False, True)
    assert cloud.count("<use") <= few.count("<use")


@pytest.mark.parametrize(("shape", "marker"), [("circle", "o"), ("diamond", "D")])
def test_a_cloud_is_as_dark_as_markers_drawn_one_by_one(shape, marker) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from rockfall.core.analysis.drawn_clouds import PointCloud

    points = np.random.default_rng(2).normal(size=(3000, 2))
    pictures = []
    for counted in (True, False):
        figure = Figure(figsize=(4, 4), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-3, 3), ylim=(-3, 3), axisbelow=True)
        axes.set_axis_off()
        if counted:
            axes.add_artist(PointCloud(points, shape, 4.0, "black", 0.2, zorder=2))
        else:
            axes.plot(*points.T, marker, markersize=4.0, color="black", alpha=0.2, markeredgewidth=0)
        canvas.draw()
        darkness = 255.0 - np.asarray(canvas.buffer_rgba())[:, :, 0]
        pictures.append(darkness.reshape(20, 20, 20, 20).mean(axis=(1, 3)))
    counted, drawn = pictures
    assert drawn.max() > 100.0
    assert counted.mean() == pytest.approx(drawn.mean(), rel=0.03)
    np.testing.assert_allclose(counted, drawn, atol=0.06 * drawn.max())


def test_every_model_has_its_own_points_and_title(figures, impacts, predictions, tmp_path) -> None:
    from rockfall.core.analysis.figures import model_figure, save_figure

    for graphs in make_sheet(impacts, predictions):
        name = graphs[0].model
        save_figure(model_figure(graphs), tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").read_bytes() == (figures / f"{name}.png").read_bytes()


class Links(HTMLParser):
    """What a page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        self.found += [value for name, value in attrs if name in ("src", "href") and value]


def test_the_page_loads_nothing(page) -> None:
    links = Links()
    links.feed(page)
    assert [link for link in links.found if not link.startswith("data:")] == []
    assert "http" not in re.sub(r"<script.*?</script>|http-equiv", "", page, flags=re.DOTALL)
    assert "Content-Security-Policy" in page  # so that the library cannot load anything either
    policy = page.split("Content-Security-Policy", 1)[1].split(">", 1)[0]
    assert "unsafe-eval" not in policy  # no text becomes code later: the page's callback is compiled with the page
    assert len(page) < 10e6


def test_the_page_says_what_and_how(page, predictions) -> None:
    assert "Noël et al. 2017" in page
    assert "rn_exponent = -1.08" in page
    assert "Provenance" in page
    assert "impacts &lt;1&gt;.csv" in page
    body = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert "<1>" not in body
    assert "<b>&" not in body


def test_a_page_shows_some_of_many_impacts_and_says_so(impacts, predictions, monkeypatch, tmp_path) -> None:
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    from rockfall.core.analysis import report

    monkeypatch.setattr(report, "MOST_SHOWN", 5)
    report.write_report(impacts, predictions, scores(impacts, predictions), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert f"{predictions.row.size} of {len(impacts)} impacts" in page
    assert "The graphs, their fits and scores show 5 of them, evenly spaced." in page
    few = thinned(predictions, 5)
    every = [list(predictions.row).index(row) for row in few.row]
    assert (every[0], every[-1], len(every)) == (0, predictions.row.size - 1, 5)
    np.testing.assert_array_equal(few.v2, predictions.v2[:, :, every])
    np.testing.assert_array_equal(few.rn, predictions.rn[:, :, every])
    assert thinned(predictions, predictions.row.size) is predictions


def test_what_is_missing_is_named_with_its_command(monkeypatch, impacts, predictions, tmp_path, capsys) -> None:
    from rockfall.core.analysis.figures import save_figures
    from rockfall.core.analysis.report import write_report

    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match=r'pip install "rockfall\[figures\]"'):
        save_figures(make_sheet(impacts, predictions), tmp_path)
    with pytest.raises(DependencyError, match=r'pip install "rockfall\[explore\]"'):
        write_report(impacts, predictions, (), tmp_path / "report.html")
    assert list(tmp_path.iterdir()) == []
    write_impacts(impacts, tmp_path / "impacts.csv")
    assert main(["explore", str(tmp_path / "impacts.csv"), "--no-browser"]) == 1
    assert main(["compare", str(tmp_path / "impacts.csv"), "--out", str(tmp_path / "out")]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"predictions.csv", "scores.csv"}
    output = capsys.readouterr()
    assert 'Install it: pip install "rockfall[explore]"' in output.err
    assert 'Install it: pip install "rockfall[figures]"' in output.out


def test_compare_leaves_figures_and_the_page(impacts, tmp_path, capsys) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    write_impacts(impacts, tmp_path / "impacts.csv")
    write_parameters({"wyllie_2014": {"inertia": "sphere"}}, tmp_path / "parameters.toml")
    argv = ["compare", str(tmp_path / "impacts.csv"), "--model", "wyllie_2014", "--out", str(tmp_path / "out")]
    argv += ["--title", "Quarry <north>"]
    assert main([*argv, "--parameters", str(tmp_path / "parameters.toml")]) == 0
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == {"all_models.png", "wyllie_2014.png"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h1>Quarry &lt;north&gt;</h1>" in page
    assert "inertia = sphere" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "figures, report.html" in capsys.readouterr().out


def test_the_live_page_calibrates_with_the_spin_and_the_radius_that_it_shows(impacts, monkeypatch) -> None:
    """Also where the table has no diameters, and only --radius says how large the blocks are."""
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    from bokeh.document import Document
    from bokeh.events import ButtonClick
    from rockfall.core.analysis import calibration
    from rockfall.core.analysis.explorer import Exploration, open_page

    bare = replace(impacts, diameter_m=np.full(len(impacts), np.nan))
    shown = find_courses(bare, "zero", 0.21)
    fitted = []

    def calibrate(impacts, model, parameters, fixed, options, *, progress):
        fitted.append(find_courses(impacts, options.spin, options.radius_m))
        raise CancelledError

    monkeypatch.setattr(calibration, "calibrate", calibrate)
    document = Document()
    open_page(document, Exploration(bare, shown, ["wyllie_2014"], str))
    button = document.get_model_by_name("calibrate")
    button._trigger_event(ButtonClick(button))
    for _ in range(1000):
        if document.session_callbacks:
            break
        time.sleep(0.01)
    (courses,) = fitted
    for name in ("radius_m", "angular_velocity"):
        np.testing.assert_array_equal(getattr(courses.incident, name), getattr(shown.incident, name), err_msg=name)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--model", "noel_2071"], "Did you mean noel_2017"),
        (["--port", "70000"], "65535"),
        (["--parameters", "missing.toml"], "missing.toml: There is no such file"),
        (["--spin", "table"], "impacts.csv: No impact can be compared: "),
    ],
)
def test_explore_refuses_bad_input(impacts, tmp_path, capsys, options, words) -> None:
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    write_impacts(impacts, tmp_path / "impacts.csv")
    assert main(["explore", str(tmp_path / "impacts.csv"), "--no-browser", *options]) == 1
    assert words in capsys.readouterr().err


def test_a_port_that_is_taken_is_named(impacts, tmp_path, capsys) -> None:
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    write_impacts(impacts, tmp_path / "impacts.csv")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["explore", str(tmp_path / "impacts.csv"), "--no-browser", "--port", str(port)]) == 1
    assert f"Port {port} cannot be used (" in capsys.readouterr().err


def test_parameters_come_back_from_their_file(tmp_path) -> None:
    settings = {name: model.settings() for name, model in MODELS.items()}
    write_parameters(settings, tmp_path / "parameters.toml")
    assert read_parameters(tmp_path / "parameters.toml") == settings
    with pytest.raises(InputError, match=": A folder is where a file should be written"):
        write_parameters(settings, tmp_path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("rn = ", "not valid TOML"),
        ("seed = 1", "no parameters"),
        ("[models.noel_2017]\nrn_limit = 1000", "outside its range"),
        ("[models.noel_2017]\nrn_limits = 1", "Did you mean rn_limit"),
        ("[models.noel]\nrt = 1", "Did you mean noel_2017"),
    ],
)
def test_a_wrong_parameter_file_is_refused(tmp_path, content, words) -> None:
    (tmp_path / "wrong.toml").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=words) as caught:
        read_parameters(tmp_path / "wrong.toml")
    assert "wrong.toml" in str(caught.value)


def test_sliders_hold_the_default_and_stay_in_range() -> None:
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    from rockfall.core.impact_models.machinery.sliders import slider_range

    for name in MODELS:
        for spec in find_model(name).parameters:
            if not spec.choices:
                start, end, step = slider_range(spec)
                assert spec.minimum == start <= spec.default <= end <= spec.maximum, (name, spec.name)
                assert (end - start) / 1000 <= step <= (end - start) / 100
