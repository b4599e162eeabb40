# SPDX-License-Identifier: GPL-3.0-or-later
"""The report and the live page in a real browser: what is drawn, selected, moved and said on the console.

    apt-get install -y --no-install-recommends chromium chromium-driver fonts-inter-variable
    python3.13 scripts/run.py setup                          # brings Bokeh, Matplotlib and Selenium
    .venv/bin/python -m pytest tests/browser

Skipped where Chromium, its driver or one of the libraries is missing. Screenshots are left in out/screenshots.
"""

import ctypes
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rockfall
from rockfall.core.cli import main

for library in ("bokeh", "matplotlib", "selenium"):
    pytest.importorskip(library, reason=f"{library} is not installed: pip install 'rockfall[figures,explore,dev]'")

from selenium import webdriver  # noqa: E402
from selenium.webdriver import ActionChains, Keys  # noqa: E402
from selenium.webdriver.chrome.service import Service  # noqa: E402
from selenium.webdriver.support.ui import Select, WebDriverWait  # noqa: E402

ROOT = Path(rockfall.__file__).resolve().parent
SHOTS = ROOT / "out" / "screenshots"
GRAPHS = ("rn_theta1", "rn_vn1", "vt2_vt1", "r_theta_dev")
ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1440,1000",
)
PATIENCE_S = 60
PR_SET_PDEATHSIG = 1  # linux/prctl.h

MODEL = "return Bokeh.documents[0].get_model_by_name(arguments[0])"
ELEMENT = """
const model = Bokeh.documents[0].get_model_by_name(arguments[0]);
const element = Bokeh.index.find_one(model).el;
if (!arguments[1]) return element;
const inside = element.shadowRoot.querySelector(arguments[1]);
inside?.scrollIntoView({ block: "nearest", behavior: "instant" });
return inside;
"""
INK = """
// drawn pixels of one graph that are far from white, and those that are faint
const element = Bokeh.index.find_one(Bokeh.documents[0].get_model_by_name(arguments[0]));
let strong = 0, faint = 0;
for (const canvas of element.canvas.el.shadowRoot.querySelectorAll("canvas")) {
  if (!canvas.width || canvas.classList.contains("bk-events")) continue;
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  for (let i = 0; i < data.length; i += 4) {
    const dark = (255 - Math.min(data[i], data[i + 1], data[i + 2])) * data[i + 3] / 255;
    if (dark > 150) strong++; else if (dark > 4) faint++;
  }
}
return [strong, faint];
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    chromium, driver = shutil.which("chromium") or shutil.which("google-chrome"), shutil.which("chromedriver")
    if not (chromium and driver):
        pytest.skip("no chromium and chromedriver on this machine; the top of this file says how to install them")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (*ARGUMENTS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    chrome = webdriver.Chrome(options=options, service=Service(driver))
    SHOTS.mkdir(parents=True, exist_ok=True)
    yield chrome
    chrome.quit()


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The impacts of the demo site, and their comparison."""
    folder, demo = tmp_path_factory.mktemp("tables"), ROOT / "assets" / "demo"
    picks, terrain = str(demo / "picks.csv"), str(demo / "terrain.ply")
    assert main(["reconstruct", picks, "--terrain", terrain, "--out", str(folder)]) == 0
    assert main(["compare", str(folder / "impacts.csv"), "--replicates", "4", "--out", str(folder)]) == 0
    return folder


def with_us() -> None:
    """In the new process: heed Ctrl-C, as a shell's background jobs do not, and end with the tests."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def explored(tables: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process of the live page, and the page's address."""
    command = [sys.executable, "-m", "rockfall.core.cli", "explore", str(tables / "impacts.csv"), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tables, preexec_fn=with_us) as process:
        try:
            yield process, process.stdout.readline().split()[-1]
        finally:
            process.kill()


@pytest.fixture(scope="module")
def address(tables: Path) -> Iterator[str]:
    """Of the live page."""
    with explored(tables) as (_, address):
        yield address


def opened(browser: webdriver.Chrome, url: str) -> None:
    browser.get_log("browser")
    browser.get(url)
    until(browser, lambda: "R² =" in text(browser, "rn_theta1_note"))


def until(browser: webdriver.Chrome, condition) -> None:
    WebDriverWait(browser, PATIENCE_S, 0.1, ignored_exceptions=[Exception]).until(lambda _browser: condition())


def text(browser: webdriver.Chrome, name: str) -> str:
    return browser.execute_script(MODEL + "?.text ?? ''", name).replace("\xa0", " ")


def values(browser: webdriver.Chrome, column: str) -> list:
    return browser.execute_script(MODEL + f".data['{column}'].length ? Array.from({_data(column)}) : []", "points")


def _data(column: str) -> str:
    return f"Bokeh.documents[0].get_model_by_name('points').data['{column}']"


def selected(browser: webdriver.Chrome) -> list[int]:
    return browser.execute_script(MODEL + ".selected.indices", "points")


def element(browser: webdriver.Chrome, name: str, inside: str = ""):
    return browser.execute_script(ELEMENT, name, inside)


def shown_alone(browser: webdriver.Chrome, model: str) -> None:
    browser.execute_script("document.querySelector(`#model-${arguments[0]} button`).click()", model)


def picked(browser: webdriver.Chrome, menu: str, column: str) -> None:
    """A column in the page's menu of colours or of filters."""
    Select(browser.find_element("id", menu)).select_by_value(column)


def choose(browser: webdriver.Chrome, name: str, value: str) -> None:
    names = [option for option, _ in browser.execute_script(MODEL + ".options", name)]
    Select(element(browser, name, "select")).select_by_index(names.index(value))


def ink(browser: webdriver.Chrome, graph: str) -> tuple[int, int]:
    return tuple(browser.execute_script(INK, graph))


def drag(browser: webdriver.Chrome, graph: str) -> None:
    """A box over the lower left quarter of a graph."""
    plot = element(browser, graph)
    width, height = plot.size["width"], plot.size["height"]
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    time.sleep(0.3)
    chain = ActionChains(browser).move_to_element_with_offset(plot, -int(0.35 * width), int(0.25 * height))
    chain.click_and_hold().move_by_offset(40, -30).move_by_offset(int(0.2 * width), -int(0.2 * height))
    chain.release().perform()


def assert_quiet_console(browser: webdriver.Chrome) -> None:
    assert [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_the_report_draws_four_graphs_and_selects_in_all(browser, tables) -> None:
    opened(browser, (tables / "report.html").as_uri())
    before = {graph: ink(browser, graph) for graph in GRAPHS}
    assert min(strong for strong, _ in before.values()) > 1000
    browser.save_screenshot(str(SHOTS / "report.png"))

    drag(browser, "vt2_vt1")
    until(browser, lambda: 0 < len(selected(browser)) < len(values(browser, "m_rn")))
    until(browser, lambda: f"{len(selected(browser))} selected" in text(browser, "selection"))
    until(browser, lambda: all(ink(browser, graph)[0] < before[graph][0] for graph in GRAPHS))
    browser.save_screenshot(str(SHOTS / "report_selection.png"))
    assert_quiet_console(browser)


def test_the_report_shows_another_model_and_other_variables(browser, tables) -> None:
    opened(browser, (tables / "report.html").as_uri())
    shown_alone(browser, "azimi_desvarreux_1977")
    until(browser, lambda: "= 0.350" in text(browser, "rn_theta1_note"))
    choose(browser, "rn_vn1_y", "kinetic2_j")
    until(browser, lambda: "kinetic energy" in browser.execute_script(MODEL + ".left[0].axis_label", "rn_vn1"))
    assert ink(browser, "rn_vn1")[0] > 1000
    element(browser, "rn_theta1_log", "button:nth-child(2)").click()
    until(browser, lambda: browser.execute_script(MODEL + ".y_range.start", "rn_theta1") > 0)
    assert ink(browser, "rn_theta1")[0] > 1000
    browser.save_screenshot(str(SHOTS / "report_variables.png"))
    assert_quiet_console(browser)


def test_the_other_run_is_shown_and_the_first_again(browser, tables) -> None:
    from rockfall.core.analysis.variables import model_values

    impacts, predictions = compared(tables)
    wyllie = predictions.models.index("wyllie_2014")
    opened(browser, (tables / "report.html").as_uri())
    for run in (0, 1, 0):
        browser.find_elements("css selector", "#run input")[run].click()
        truth = model_values(impacts, predictions, wyllie, run, "rn")
        until(browser, lambda truth=truth: np.allclose(values(browser, f"p{wyllie}_rn"), truth, rtol=1e-6))
    assert_quiet_console(browser)


def compared(tables):
    """What the report was made of."""
    from rockfall.core.analysis.comparison import compare
    from rockfall.core.exchange.tables import read_impacts

    impacts = read_impacts(tables / "impacts.csv")
    return impacts, compare(impacts, replicates=4)


def numbers_of(words: str) -> str:
    """R², rank correlation and number of points of a fit in words."""
    return words.partition(" R² = ")[2]


@pytest.mark.parametrize(("x", "y"), [("vn1_mps", "kinetic2_j"), ("theta1_deg", "rn"), ("v1_mps", "theta_dev_deg")])
def test_any_pair_has_its_fit(browser, tables, x, y) -> None:
    """With the numbers that the core finds, on axes of every kind."""
    from rockfall.core.analysis.graphs import GraphSpec, make_graph

    impacts, predictions = compared(tables)
    opened(browser, (tables / "report.html").as_uri())
    shown_alone(browser, "noel_2017")
    choose(browser, "r_theta_dev_y", y)
    choose(browser, "r_theta_dev_x", x)
    now = (False, False)
    for log in ((False, False), (True, False), (True, True), (False, True)):
        for number, (wanted, has) in enumerate(zip(log, now, strict=True), 1):
            if wanted != has:
                element(browser, "r_theta_dev_log", f"button:nth-child({number})").click()
        now = log
        graph = make_graph(impacts, GraphSpec("any", x, y, *log), predictions, "noel_2017", run=1)
        for curve in (graph.measured_curve, graph.modelled_curve):
            truth = numbers_of(curve.text("", ""))
            until(browser, lambda truth=truth: truth in text(browser, "r_theta_dev_note"))
    assert_quiet_console(browser)


def test_fits_and_scores_of_what_the_filters_leave(browser, tables) -> None:
    """As the core finds them for those impacts alone."""
    from rockfall.core.analysis.columns import Filter, passing
    from rockfall.core.analysis.curves import fit_curve
    from rockfall.core.analysis.graph_scores import graph_scores
    from rockfall.core.analysis.graphs import PAPER_GRAPHS, make_graph
    from rockfall.core.reconstruction.impact import fall_numbers

    impacts, predictions = compared(tables)
    falls = frozenset(sorted(set(impacts.trajectory.tolist()))[1:7])
    kept = passing(impacts, [Filter("theta1_deg", low=10.0, high=30.0), Filter("trajectory", texts=falls)])
    opened(browser, (tables / "report.html").as_uri())
    shown_alone(browser, "noel_2017")
    picked(browser, "filter", "theta1_deg")
    low, high = browser.find_elements("css selector", ".range input")
    low.send_keys("10", Keys.TAB)
    high.send_keys("30", Keys.TAB)
    picked(browser, "filter", "trajectory")
    for label in browser.find_elements("css selector", ".texts label"):
        if label.text in falls:
            label.click()
    here = kept[predictions.row]
    until(browser, lambda: browser.find_element("id", "left").text.startswith(f"{here.sum()} of {here.size} impacts"))
    browser.save_screenshot(str(SHOTS / "report_filtered.png"))
    for spec in PAPER_GRAPHS:
        whole = make_graph(impacts, spec, predictions, "noel_2017", run=1)
        graph = replace(whole, row=whole.row[here], measured=whole.measured[here], modelled=whole.modelled[here])
        shown = text(browser, f"{spec.name}_note")
        for _, points in graph.series:
            points = points[np.isfinite(points).all(axis=1)]
            assert numbers_of(fit_curve(spec.fitted, points, graph.x_limits, graph.y_limits).text("", "")) in shown
        for score in graph_scores(graph, fall_numbers(impacts)):
            assert score.text() in shown
    browser.find_element("css selector", ".filter button").click()
    browser.find_element("css selector", ".filter button").click()
    until(browser, lambda: browser.find_element("id", "left").text == "")
    assert_quiet_console(browser)


def test_points_have_the_colours_of_a_column(browser, tables) -> None:
    impacts, predictions = compared(tables)
    trajectory = predictions.trajectory.tolist()
    opened(browser, (tables / "report.html").as_uri())
    picked(browser, "colours", "trajectory")
    first = browser.find_element("css selector", "#colours-legend li").text.split()
    assert first == [trajectory[0], str(trajectory.count(trajectory[0]))]
    picked(browser, "colours", "normal_spread_deg")
    low, high = (float(end.text) for end in browser.find_elements("css selector", ".ends span"))
    spread = np.degrees(impacts.normal_spread[predictions.row])
    assert (low, high) == pytest.approx(np.quantile(spread[np.isfinite(spread)], [0.02, 0.98]), rel=5e-3)
    assert_quiet_console(browser)


def test_several_models_at_once_in_the_dark(browser, tables) -> None:
    """Each with its colour, its fit and its score; on a dark page the canvas is dark, too."""
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    opened(browser, (tables / "report.html").as_uri())
    try:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": dark})
        for box in browser.find_elements("css selector", "#models input"):
            box.click() if not box.is_selected() else None
        until(browser, lambda: text(browser, "vt2_vt1_note").count("RMSE") == 6)
        assert "Wyllie 2014: " in text(browser, "vt2_vt1_note")
        colours = browser.execute_script(MODEL + ".data.colour", "vt2_vt1_lines")
        assert len(set(colours)) == 7
        paper = browser.execute_script(MODEL + ".background_fill_color", "vt2_vt1")
        assert browser.execute_script("return getComputedStyle(document.body).backgroundColor") == "rgb(22, 25, 29)"
        assert paper == "#16191d"
        browser.save_screenshot(str(SHOTS / "report_dark.png"))
        assert_quiet_console(browser)
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize(("rows", "said"), [(1, "too few points for a fit, n = 1"), (0, "no impact has both points")])
def test_a_page_of_one_impact_and_of_none_with_a_rebound(browser, tables, tmp_path, rows, said) -> None:
    from rockfall.core.analysis.comparison import compare
    from rockfall.core.analysis.report import write_report
    from rockfall.core.exchange.selection import rows_of
    from rockfall.core.exchange.tables import read_impacts

    impacts = read_impacts(tables / "impacts.csv")
    impacts = rows_of(impacts, np.flatnonzero(impacts.complete)[:1] if rows else impacts.flags["last"])
    write_report(impacts, compare(impacts), (), tmp_path / "report.html")
    browser.get((tmp_path / "report.html").as_uri())
    until(browser, lambda: said in text(browser, "rn_theta1_note"))
    assert_quiet_console(browser)


def test_what_lies_beyond_is_listed(browser, tables) -> None:
    opened(browser, (tables / "report.html").as_uri())
    browser.execute_script(
        "const points = Bokeh.documents[0].get_model_by_name('points');"
        "const rn = Array.from(points.data.m_rn); rn[5] = 24.4; points.data = {...points.data, m_rn: rn}"
    )
    until(browser, lambda: "24.4 at" in text(browser, "rn_theta1_note") and "24.4 at" in text(browser, "rn_vn1_note"))


def test_moving_a_slider_moves_the_model(browser, address) -> None:
    opened(browser, address)
    scores, curve = text(browser, "scores"), text(browser, "rn_theta1_note")
    handle = element(browser, "azimi_desvarreux_1977.rn", ".noUi-handle")
    handle.send_keys(Keys.ARROW_RIGHT * 10)
    until(browser, lambda: {round(value, 6) for value in values(browser, "p0_rn")} == {0.45})
    until(browser, lambda: text(browser, "scores") != scores and text(browser, "rn_theta1_note") != curve)
    browser.save_screenshot(str(SHOTS / "explore.png"))
    element(browser, "reset", "button").click()
    until(browser, lambda: {round(value, 6) for value in values(browser, "p0_rn")} == {0.35})
    until(browser, lambda: text(browser, "scores") == scores)
    assert_quiet_console(browser)


def test_another_model_a_draw_and_saved_parameters(browser, address, tables) -> None:
    from rockfall.core.exchange.parameters import read_parameters

    opened(browser, address)
    choose(browser, "model", "noel_2017")
    until(browser, lambda: browser.execute_script(MODEL + ".visible", "run"))
    mean = values(browser, "p2_rn")
    element(browser, "run", "button:nth-child(2)").click()
    until(browser, lambda: values(browser, "p2_rn") != mean)
    field = element(browser, "noel_2017.rt.field", "input")
    field.send_keys(Keys.END, Keys.BACKSPACE * 8, "0.5", Keys.ENTER)
    until(browser, lambda: browser.execute_script(MODEL + ".value", "noel_2017.rt") == 0.5)
    element(browser, "save", "button").click()
    until(browser, lambda: "Saved to" in text(browser, "status"))
    assert read_parameters(tables / "parameters.toml")["noel_2017"]["rt"] == 0.5
    browser.save_screenshot(str(SHOTS / "explore_draw.png"))
    assert_quiet_console(browser)


@pytest.mark.parametrize(("name", "status", "said"), [("SIGINT", 0, "\nStopped.\n"), ("SIGTERM", 143, "")])
def test_the_live_page_stops_when_asked(tables, name, status, said) -> None:
    """Ctrl+C is how it is left, as its page says; another signal ends it as it ends every command."""
    with explored(tables) as (process, _):
        process.send_signal(signal.Signals[name])
        rest, _ = process.communicate(timeout=PATIENCE_S)
    assert rest.endswith(said)
    assert process.returncode == status


def test_calibrate(browser, address) -> None:
    opened(browser, address)
    choose(browser, "model", "pfeiffer_bowen_1989")
    time.sleep(0.5)
    scores = text(browser, "scores")
    element(browser, "calibrate", "button").click()
    until(browser, lambda: element(browser, "calibrate", "button").text == "Cancel")
    until(browser, lambda: element(browser, "calibrate", "button").text == "Calibrate")
    until(browser, lambda: text(browser, "scores") != scores)
    beginnings = (
        "warning", "rn: It ended at the upper limit of its range, 1: the best value may lie beyond.",
        "note", "On impacts it was not fitted to, the model is ",
        "note", "The model is 21 % nearer than one and the same outcome for all impacts ",
    )  # fmt: skip
    said = text(browser, "status").split('<div class="remark ')[1:]
    for severity, beginning, remark in zip(beginnings[::2], beginnings[1::2], said, strict=True):
        assert remark.startswith(f'{severity}">{beginning}')
    lines = element(browser, "status", ".bk-clearfix").find_elements("css selector", ".remark")
    first, second, third = (line.value_of_css_property("color") for line in lines)
    assert first != second == third
    browser.execute_script("window.scrollTo(0, 0)")
    browser.save_screenshot(str(SHOTS / "explore_calibrated.png"))
    assert_quiet_console(browser)
