# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of a site in a real browser, as a file without a network: what it draws, where blocks are, how it is used.

Needs what test_report.py needs. Screenshots are left in out/screenshots.
"""

import json
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rockfall
from rockfall.core.camera.model import rotation_from_vector
from rockfall.core.outreach.page import make_page
from rockfall.core.outreach.show import Show, ShowRequest, open_show
from rockfall.core.terrain.raycast import heights_above

pytest.importorskip("selenium", reason="selenium is not installed: pip install 'rockfall[dev]'")

from selenium import webdriver
from selenium.webdriver import ActionChains, Keys
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

ROOT = Path(rockfall.__file__).resolve().parent
SHOTS = ROOT / "out" / "screenshots"
ARGUMENTS = (
    "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
SIZES = {"desktop": (1440, 900, 1.0, False), "phone": (390, 844, 2.0, True), "lying_phone": (844, 390, 2.0, True)}
PATIENCE_S = 60
MOMENTS = (0.0, 0.5, 1.23, 2.0, 3.7, 6.1, 12.0)


@pytest.fixture(scope="module")
def show() -> Show:
    demo = ROOT / "assets" / "demo" / "project.toml"
    return open_show(ShowRequest(demo, simulate=("noel_2017",), number=3))


@pytest.fixture(scope="module")
def page(show: Show, tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("page") / "site.html"
    file.write_text(make_page(show).text, encoding="utf-8")
    return file.as_uri()


def driver(folder: Path, size: str) -> webdriver.Chrome:
    chromium, found = shutil.which("chromium") or shutil.which("google-chrome"), shutil.which("chromedriver")
    if not (chromium and found):
        pytest.skip("no chromium and chromedriver on this machine; test_report.py says how to install them")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    width, height, ratio, touch = SIZES[size]
    for argument in (*ARGUMENTS, f"--user-data-dir={folder}", f"--window-size={width},{height}"):
        options.add_argument(argument)
    if touch:
        metrics = {"width": width, "height": height, "pixelRatio": ratio, "touch": True}
        options.add_experimental_option("mobileEmulation", {"deviceMetrics": metrics})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    SHOTS.mkdir(parents=True, exist_ok=True)
    return webdriver.Chrome(options=options, service=Service(found))


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    chrome = driver(tmp_path_factory.mktemp("profile"), "desktop")
    yield chrome
    chrome.quit()


def opened(browser: webdriver.Chrome, url: str) -> None:
    browser.get("about:blank")
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(url)
    WebDriverWait(browser, PATIENCE_S, 0.1).until(lambda b: b.execute_script("return window.rockfall?.ready === true"))


def until(browser: webdriver.Chrome, condition) -> None:
    """What is done shows with the next picture."""
    WebDriverWait(browser, PATIENCE_S, 0.05).until(lambda _browser: condition())


def said(browser: webdriver.Chrome, name: str) -> str:
    return browser.find_element(By.ID, name).text


def colours(browser: webdriver.Chrome) -> int:
    """How many different colours the drawing has."""
    return browser.execute_script(
        "rockfall.setTime(rockfall.time());"
        "const c = document.getElementById('canvas'), pen = document.createElement('canvas').getContext('2d');"
        "pen.canvas.width = c.width; pen.canvas.height = c.height; pen.drawImage(c, 0, 0);"
        "const all = new Set(new Uint32Array(pen.getImageData(0, 0, c.width, c.height).data.buffer)); return all.size;"
    )


def test_it_loads_without_errors_and_asks_the_network_for_nothing(browser, page: str) -> None:
    opened(browser, page + "#t=2")
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = {m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"}
    assert {url.partition("#")[0] for url in asked if not url.startswith(("data:", "blob:", "about:"))} == {page}
    assert colours(browser) > 500  # terrain in light and shade, not an empty picture


def test_blocks_are_where_the_core_says(browser, page: str, show: Show) -> None:
    opened(browser, page + "#t=0")
    assert browser.execute_script("return rockfall.names") == [fall.name for fall in show.falls]
    compared = 0
    for moment in MOMENTS:
        places, turns = browser.execute_script(
            "return [rockfall.placesAt(arguments[0]), rockfall.turnsAt(arguments[0])]", moment
        )
        for fall, place, turn in zip(show.falls, places, turns, strict=True):
            state = fall.state(moment)
            if state is None:
                assert place is None or moment > fall.time_s[-1]
                continue
            np.testing.assert_allclose(place, state[0], atol=1e-3)
            if fall.is_measured:
                axis = np.array(turn[:3])
                angle = 2 * np.arctan2(np.linalg.norm(axis), turn[3])
                axis = axis / max(np.linalg.norm(axis), 1e-12)
                between = rotation_from_vector(axis * angle).T @ fall.turn(moment)
                assert np.arccos(np.clip((np.trace(between) - 1) / 2, -1, 1)) < 0.1
            compared += 1
    assert compared > 150


def test_what_is_drawn_is_the_moment_of_the_slider(browser, page: str, show: Show) -> None:
    opened(browser, page + "#t=0")
    for moment in (1.5, 4.0):
        browser.execute_script("rockfall.setTime(arguments[0])", moment)
        drawn = np.array(browser.execute_script("return rockfall.drawn()")).reshape(-1, 4, 4)
        for fall, matrix in zip(show.falls, drawn, strict=True):
            state = fall.state(moment)
            if state is not None:
                np.testing.assert_allclose(matrix[3, :3], state[0], atol=2e-3)
                size = np.sort(np.linalg.norm(matrix[:3, :3], axis=1))
                np.testing.assert_allclose(size, np.sort(fall.diameters_m), rtol=1e-3)
        assert float(browser.execute_script("return document.getElementById('slider').value")) == pytest.approx(moment)
    grown = browser.execute_script(
        "return [1, 3].map((t) => { rockfall.setTime(t); return rockfall.segments()[0][0]; })"
    )
    assert 0 < grown[0] < grown[1]


def test_it_plays_at_the_rate_that_is_chosen_and_pauses(browser, page: str) -> None:
    opened(browser, page + "#t=0")
    buttons = browser.find_elements(By.CSS_SELECTOR, "#rates button")
    assert [button.text for button in buttons] == ["¼×", "½×", "1×"]
    buttons[0].click()
    until(browser, lambda: "slow motion" in said(browser, "clock"))
    browser.find_element(By.ID, "play").click()
    WebDriverWait(browser, PATIENCE_S, 0.05).until(lambda b: b.execute_script("return rockfall.time()") > 0.1)
    browser.find_element(By.ID, "play").click()
    at = browser.execute_script("return [rockfall.time(), rockfall.playing()]")
    time.sleep(0.3)
    assert browser.execute_script("return [rockfall.time(), rockfall.playing()]") == at
    assert at[1] is False
    ActionChains(browser).send_keys(Keys.ESCAPE).perform()


def test_it_always_says_what_is_measured_and_what_simulated(browser, page: str) -> None:
    opened(browser, page + "#t=1")
    legend = browser.find_element(By.ID, "legend").text.split("\n")
    assert legend == ["Measured", "15 blocks", "Simulated", "Noël et al. 2017 · 45 blocks"]
    for number, word in ((0, "Measured"), (20, "Simulated: Noël et al. 2017")):
        browser.execute_script("rockfall.choose(arguments[0]); rockfall.setTime(1)", number)
        assert said(browser, "card-kind") == word
        assert "m/s" in said(browser, "card-motion")
    browser.find_elements(By.CSS_SELECTOR, "#legend button")[1].click()
    WebDriverWait(browser, PATIENCE_S, 0.1).until(lambda b: not b.find_element(By.ID, "card").is_displayed())
    browser.find_elements(By.CSS_SELECTOR, "#legend button")[1].click()


def test_a_click_on_a_block_tells_about_it(browser, page: str, show: Show) -> None:
    opened(browser, page + "#t=3")
    place = show.falls[0].state(3.0)[0].tolist()
    x, y = browser.execute_script("return rockfall.screen(arguments[0])", place)
    chosen = browser.execute_script("return rockfall.nearest(arguments[0], arguments[1])", x, y)
    canvas = browser.find_element(By.ID, "canvas")
    box = canvas.size
    ActionChains(browser).move_to_element_with_offset(
        canvas, x - box["width"] / 2, y - box["height"] / 2
    ).click().perform()
    until(browser, lambda: said(browser, "card-name") == show.falls[chosen].name.partition(",")[0])


def test_zooming_does_not_pass_through_the_ground(browser, page: str, show: Show) -> None:
    """However far one scrolls in, the camera stays above the terrain."""
    opened(browser, page + "#t=3")
    canvas = browser.find_element(By.ID, "canvas")
    x, y = browser.execute_script("return rockfall.screen(arguments[0])", show.falls[1].position[-1].tolist())
    origin = ScrollOrigin.from_element(canvas, int(x - canvas.size["width"] / 2), int(y - canvas.size["height"] / 2))
    for _ in range(25):
        ActionChains(browser).scroll_from_origin(origin, 0, -400).perform()
    time.sleep(1.0)
    place = np.array(browser.execute_script("return rockfall.camera()"))
    assert np.linalg.norm(place - show.falls[1].position[-1]) < 30  # it came near
    assert heights_above(show.surface, place[None])[0] > 0


def test_it_speaks_three_languages(browser, page: str) -> None:
    opened(browser, page + "#t=1&lang=de")
    assert "Gemessen" in said(browser, "legend")
    until(browser, lambda: "Echtzeit" in said(browser, "clock"))
    Select(browser.find_element(By.ID, "language")).select_by_value("fr")
    assert "Mesuré" in said(browser, "legend")
    until(browser, lambda: "temps réel" in said(browser, "clock"))
    browser.find_element(By.ID, "info").click()
    about = said(browser, "about")
    assert "Synthetic gully" in about
    assert "three.js" in about
    browser.find_element(By.ID, "close").click()


def touch(chrome: webdriver.Chrome, kind: str, *points: tuple[float, float]) -> None:
    fingers = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
    chrome.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})
    time.sleep(0.03)


def test_fingers_turn_pinch_and_tap(page: str, show: Show, tmp_path: Path) -> None:
    chrome = driver(tmp_path / "profile", "phone")
    try:
        opened(chrome, page + "#t=3")
        x, y = chrome.execute_script("return rockfall.screen(arguments[0])", show.falls[0].state(3.0)[0].tolist())
        touch(chrome, "touchStart", (x, y))
        touch(chrome, "touchEnd")
        WebDriverWait(chrome, PATIENCE_S, 0.1).until(lambda b: b.find_element(By.ID, "card").is_displayed())
        assert said(chrome, "card-kind")

        def camera() -> np.ndarray:
            time.sleep(1.0)  # the motion ends softly
            return np.array(chrome.execute_script("return rockfall.camera()"))

        before = camera()
        touch(chrome, "touchStart", (180, 480))
        for i in range(1, 9):
            touch(chrome, "touchMove", (180 + 10 * i, 480))
        touch(chrome, "touchEnd")
        turned = camera()
        assert np.linalg.norm(turned - before) > 5
        assert abs(turned[2] - before[2]) < 5  # it went round, not up
        touch(chrome, "touchStart", (190, 470), (210, 490))
        for i in range(1, 9):
            touch(chrome, "touchMove", (190 - 9 * i, 470 - 9 * i), (210 + 9 * i, 490 + 9 * i))
        touch(chrome, "touchEnd")
        middle = show.falls[0].position.mean(axis=0)
        assert np.linalg.norm(camera() - middle) < 0.6 * np.linalg.norm(turned - middle)
    finally:
        chrome.quit()


@pytest.mark.parametrize("size", SIZES)
def test_all_is_inside_the_picture_at_any_size(size: str, page: str, show: Show, tmp_path: Path) -> None:
    chrome = driver(tmp_path / "profile", size)
    try:
        for language in ("en", "fr", "de"):
            opened(chrome, f"{page}#t=3&lang={language}")
            time.sleep(0.5)
            width, height = chrome.execute_script("return [innerWidth, innerHeight]")
            boxes = chrome.execute_script(
                "return ['title', 'legend', 'corner', 'play', 'slider', 'clock', 'rates', 'north', 'scale']"
                ".map((id) => {"
                "const b = document.getElementById(id).getBoundingClientRect();"
                "return [id, b.left, b.top, b.right, b.bottom] })"
            )
            for name, left, top, right, bottom in boxes:
                assert 0 <= left < right <= width, (name, language)
                assert 0 <= top < bottom <= height, (name, language)
            header = chrome.execute_script("return document.querySelector('header').getBoundingClientRect().right")
            assert header <= next(box[1] for box in boxes if box[0] == "corner")
            touched = chrome.execute_script(
                "return [...document.querySelectorAll('footer button, #corner > *')]"
                ".map((b) => Math.min(b.offsetWidth, b.offsetHeight))"
            )
            assert min(touched) >= 32
            foot = chrome.execute_script("return document.querySelector('footer').getBoundingClientRect().top")
            for fall in (fall for fall in show.falls if fall.is_measured):
                x, y = chrome.execute_script("return rockfall.screen(arguments[0])", fall.position[-1].tolist())
                assert 0 < x < width
                assert 0 < y < foot + 1
            chrome.save_screenshot(str(SHOTS / f"site_page_{size}_{language}.png"))
    finally:
        chrome.quit()


def test_without_a_terrain_there_are_the_paths_alone(browser, show: Show, tmp_path: Path) -> None:
    file = tmp_path / "bare.html"
    file.write_text(make_page(replace(show, surface=None)).text, encoding="utf-8")
    opened(browser, file.as_uri() + "#t=3")
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    assert not browser.find_element(By.ID, "person").is_displayed()
    assert colours(browser) > 20
    ActionChains(browser).move_to_element(browser.find_element(By.ID, "canvas")).click().perform()


def test_a_browser_that_cannot_draw_says_so(page: str, tmp_path: Path) -> None:
    text = Path(page.removeprefix("file://")).read_text(encoding="utf-8")
    file = tmp_path / "blind.html"
    blind = "<script>HTMLCanvasElement.prototype.getContext = () => null</script>"
    file.write_text(
        text.replace('<script type="application/json"', blind + '<script type="application/json"', 1), encoding="utf-8"
    )
    chrome = driver(tmp_path / "profile", "desktop")
    try:
        chrome.get(file.as_uri())
        WebDriverWait(chrome, PATIENCE_S, 0.1).until(lambda b: b.find_element(By.ID, "problem").is_displayed())
        assert "WebGL" in said(chrome, "problem")
        assert said(chrome, "title") == "Synthetic gully"
    finally:
        chrome.quit()
