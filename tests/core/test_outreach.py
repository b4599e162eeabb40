# SPDX-License-Identifier: GPL-3.0-or-later
"""What others look at: the page of a site is one whole file, and blocks are where the flights of the core are."""

import base64
import json
import re
import tomllib
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rockfall
from rockfall.core import blender_process, cli
from rockfall.core.camera.model import rotation_from_vector
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.exchange.project import Site, read_project
from rockfall.core.outreach.animation import animate, known_format, load_animation, save_animation
from rockfall.core.outreach.animator import write_animation
from rockfall.core.outreach.packing import Packing, in_reading_order, quantise
from rockfall.core.outreach.page import MOST_BYTES, make_page, thinned
from rockfall.core.outreach.show import Show, ShowRequest, open_show
from rockfall.core.reconstruction.flight import flight_states
from rockfall.core.workflow.opening import open_project

ROOT = Path(rockfall.__file__).resolve().parent
DEMO = ROOT / "assets" / "demo" / "project.toml"
RATE = 25.0


@pytest.fixture(scope="module")
def show() -> Show:
    return open_show(ShowRequest(DEMO))


def embedded(text: str, name: str) -> str:
    found = re.search(rf'<script type="[a-z/]+" id="{name}">(.*?)</script>', text, re.DOTALL)
    assert found
    return found[1]


def unpacked(text: str) -> tuple[dict, dict[str, np.ndarray]]:
    """The content of a page and its tables, read without the page's own code."""
    content = json.loads(embedded(text, "show"))
    data, at, tables = zlib.decompress(base64.b64decode(embedded(text, "tables"))), 0, {}
    for name, said in content["tables"].items():
        kind, count = np.dtype(said["kind"]), int(np.prod(said["shape"]))
        parts = np.frombuffer(data, np.uint8, count * kind.itemsize, at).reshape(kind.itemsize, count)
        at += count * kind.itemsize
        values = np.ascontiguousarray(parts.T).view(kind).reshape(said["shape"])
        tables[name] = np.cumsum(values, axis=0, dtype=kind) if said["differences"] else values
    assert at == len(data)
    return content, tables


def test_tables_come_back_as_they_were() -> None:
    random = np.random.default_rng(3)
    packing, faces = Packing(), random.integers(0, 900, (400, 3)).astype(np.int32)
    packing.add("faces", faces, "uint32", differences=True)
    packing.add("place", random.normal(size=(50, 3)), "float32")
    text = f'<script type="a" id="show">{json.dumps({"tables": packing.tables})}</script>'
    _, tables = unpacked(f'{text}<script type="a" id="tables">{packing.text()}</script>')
    np.testing.assert_array_equal(tables["faces"], faces)
    assert tables["place"].shape == (50, 3)


def test_triangles_keep_their_winding_in_reading_order() -> None:
    faces = np.array([[5, 2, 9], [1, 7, 3], [8, 4, 0]], dtype=np.int32)
    np.testing.assert_array_equal(in_reading_order(faces), [[0, 8, 4], [1, 7, 3], [2, 9, 5]])


def test_quantised_places_are_near() -> None:
    places = np.random.default_rng(1).uniform(-80, 300, (1000, 3))
    found = quantise(places)
    assert np.abs(found.low + found.step * found.number - places).max() <= 0.51 * 380 / 65535


def test_the_page_is_one_file_without_a_network(show: Show) -> None:
    page = make_page(show)
    assert page.size_bytes < MOST_BYTES
    assert page.blocks == len(show.falls) == 15
    assert re.findall(r'(?:src|href|action)\s*=\s*"(?!data:)[^"]*"', page.text) == []
    hosts = set(re.findall(r"https?://[^\s\"'`)]+", page.text))
    assert hosts == {"http://www.w3.org/1999/xhtml"}  # the name of a language, not an address
    assert "default-src 'none'" in page.text
    assert "three.js authors" in page.text  # the licence goes with the library


def test_blocks_of_the_page_are_where_the_flights_are(show: Show) -> None:
    content, tables = unpacked(make_page(show).text)
    _, result = open_project(read_project(DEMO))
    flights, shift = result.flights, result.picks.shift
    origin = np.array([content["origin"][axis] for axis in "xyz"])
    for block in content["blocks"]:
        first, end = block["rows"]
        own = np.flatnonzero(flights.trajectory == block["name"])
        time = tables["time"][first:end].astype(float) + flights.start_time_s[own[0]]
        inside = [
            np.flatnonzero((time > flights.start_time_s[i] + 1e-3) & (time < flights.end_time_s[i] - 1e-3)) for i in own
        ]
        for flight, rows in zip(own, inside, strict=True):
            place, _ = flight_states(flights, np.full(rows.size, flight), time[rows])
            found = tables["place"][first:end][rows] + origin - shift.vector
            assert np.abs(found - place).max(initial=0.0) < 1e-3


def test_the_page_holds_the_survey_origin_and_what_rests(show: Show) -> None:
    content, _ = unpacked(make_page(show, "fr").text)
    assert content["language"] == "fr"
    assert content["origin"]["crs"] == "EPSG:2154"
    _, result = open_project(read_project(DEMO))
    last = dict(zip(result.picks.trajectory.tolist(), result.picks.kind.tolist(), strict=True))
    assert {block["name"] for block in content["blocks"] if block["rests"]} == {
        n for n, k in last.items() if k == "stop"
    }


def test_words_of_a_site_cannot_break_the_page(show: Show) -> None:
    evil = Site("</script><b>&", 'say "<!--"', {"credits": "<i>", "doi": "https://doi.org/10.1234/x"})
    page = make_page(replace(show, site=evil))
    content, _ = unpacked(page.text)
    assert content["title"] == evil.name
    assert (content["credits"], content["doi"]) == ("<i>", "10.1234/x")
    assert "<title>&lt;/script&gt;&lt;b&gt;&amp;</title>" in page.text


def test_a_finer_terrain_gives_way_to_the_size_of_the_file(show: Show) -> None:
    whole = make_page(show)
    small = make_page(show, most_bytes=1_400_000)
    assert small.size_bytes <= 1_400_000
    assert small.faces < whole.faces
    with pytest.raises(InputError, match=r"would have .* MB.*Show fewer simulated blocks"):
        make_page(show, most_bytes=700_000)


def test_the_page_says_the_same_in_all_languages() -> None:
    said = tomllib.loads((ROOT / "assets" / "page" / "texts.toml").read_text(encoding="utf-8"))
    assert list(said) == ["en", "fr", "de"]
    braces = {
        lang: {key: set(re.findall(r"\{\w+\}", text)) for key, text in words.items()} for lang, words in said.items()
    }
    assert braces["en"] == braces["fr"] == braces["de"]
    viewer = (ROOT / "assets" / "page" / "viewer.js").read_text(encoding="utf-8")
    assert set(re.findall(r'say\("(\w+)"', viewer)) <= set(said["en"])


def test_frames_are_where_the_flights_are(show: Show) -> None:
    animation = animate(show, RATE)
    _, result = open_project(read_project(DEMO))
    flights, shift = result.flights, result.picks.shift
    for b, name in enumerate(animation.names):
        own = np.flatnonzero(flights.trajectory == name)
        start = flights.start_time_s[own[0]]
        moments = np.arange(animation.frames) / RATE
        for i in own:
            frames = np.flatnonzero(
                (moments + start > flights.start_time_s[i] + 1e-6) & (moments + start < flights.end_time_s[i] - 1e-6)
            )
            place, _ = flight_states(flights, np.full(frames.size, i), moments[frames] + start)
            survey = animation.place[b, frames] + animation.origin.vector
            assert np.abs(survey - shift.vector - place).max(initial=0.0) < 1e-6
    assert np.abs(animation.place).max() < 500  # near the origin: single precision is a hundredth of a millimetre


def test_turns_follow_the_spin_and_do_not_jump(show: Show) -> None:
    animation = animate(show, RATE)
    np.testing.assert_allclose(np.linalg.norm(animation.turn, axis=2), 1.0, atol=1e-12)
    assert np.einsum("bfk,bfk->bf", animation.turn[:, 1:], animation.turn[:, :-1]).min() >= 0
    fall = show.falls[0]
    w, x, y, z = animation.turn[0, 10]
    axis, angle = np.array([x, y, z]), 2 * np.arctan2(np.linalg.norm([x, y, z]), w)
    matrix = rotation_from_vector(axis / np.linalg.norm(axis) * angle)
    np.testing.assert_allclose(matrix, fall.turn(10 / RATE), atol=1e-9)


def test_an_animation_is_handed_over_whole(show: Show, tmp_path: Path) -> None:
    animation = animate(show, 10.0)
    save_animation(animation, tmp_path / "a.npz")
    found = load_animation(tmp_path / "a.npz")
    np.testing.assert_array_equal(found.place, animation.place)
    assert (found.names, found.about, found.origin) == (animation.names, animation.about, animation.origin)
    assert [len(path) for path in found.paths] == [len(path) for path in animation.paths]


def with_footage(folder: Path, video: Path) -> Path:
    """The demo's project, with the footage of one of its blocks."""
    demo = DEMO.parent
    text = DEMO.read_text(encoding="utf-8")
    for name in ("terrain.ply", "picks.csv"):
        text = text.replace(f'file = "{name}"', f'file = "{(demo / name).as_posix()}"')
    camera = (demo / "footage" / "camera.toml").as_posix()
    text += f'\n[[videos]]\nname = "film"\nfile = "{video.as_posix()}"\ncamera = "{camera}"\noffset_s = 465.499\n'
    (folder / "project.toml").write_text(text, encoding="utf-8")
    return folder / "project.toml"


def test_the_terrain_has_the_colours_of_the_footage(tmp_path: Path) -> None:
    """Truth: OpenCV's own projection of the terrain into a frame of the video."""
    import cv2

    footage = DEMO.parent / "footage"
    show = open_show(ShowRequest(with_footage(tmp_path, footage / "footage.mp4")))
    content, tables = unpacked(make_page(show).text)
    _, plain = unpacked(make_page(replace(show, photographs=())).text)
    np.testing.assert_array_equal(tables["vertices"], plain["vertices"])
    changed = np.abs(tables["colours"].astype(int) - plain["colours"]).max(axis=1) > 8
    assert 0.05 < changed.mean() < 0.9
    said = tomllib.loads((footage / "camera.toml").read_text(encoding="utf-8"))
    vertices = np.array(content["terrain"]["low"]) + np.array(content["terrain"]["step"]) * tables["vertices"]
    survey = vertices[changed] + [content["origin"][axis] for axis in "xyz"] - np.array(said["position"])
    matrix = np.array([[said["fx"], 0, said["cx"]], [0, said["fy"], said["cy"]], [0, 0, 1]])
    lens = np.array([said.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3")])
    turn, _ = cv2.Rodrigues(np.array(said["rotation"]))
    pixels = cv2.projectPoints(survey, turn, np.zeros(3), matrix, lens)[0][:, 0]
    video = cv2.VideoCapture(str(footage / "footage.mp4"))
    frame = cv2.GaussianBlur(video.read()[1], (0, 0), 1.5)
    video.release()
    inside = ((pixels > 20) & (pixels < [said["width"] - 20, said["height"] - 20])).all(axis=1)
    assert inside.sum() > 3000  # the others are in other frames: the camera turns
    at = pixels[inside].astype(int)
    seen = frame[at[:, 1], at[:, 0], ::-1].astype(float)
    shown = tables["colours"][changed][inside].astype(float)
    assert np.median(np.abs(seen - shown)) < 12
    assert np.corrcoef(seen.mean(axis=1), shown.mean(axis=1))[0, 1] > 0.7


def test_a_video_that_is_not_there_is_told_and_the_page_is_made(tmp_path: Path) -> None:
    show = open_show(ShowRequest(with_footage(tmp_path, tmp_path / "gone.mp4")))
    assert show.photographs == ()
    assert any("without the colours of the video film" in remark for remark in show.remarks)


def test_simulated_blocks_begin_where_the_measured_do() -> None:
    show = open_show(ShowRequest(DEMO, simulate=("noel_2017",), number=2))
    simulated = [fall for fall in show.falls if not fall.is_measured]
    assert len(simulated) == 30
    assert len({fall.name for fall in show.falls}) == 45
    assert all(fall.time_s[0] == 0.0 for fall in show.falls)
    content, _ = unpacked(make_page(show).text)
    assert [(group["measured"], group["count"]) for group in content["groups"]] == [(True, 15), (False, 30)]


def test_simulated_blocks_fly_parabolas_up_to_their_impacts() -> None:
    """Truth: two rows of one impact, and between rows without another one p + v t − g t²/2."""
    show = open_show(ShowRequest(DEMO, simulate=("noel_2017",), number=1))
    compared = 0
    for fall in (fall for fall in show.falls if not fall.is_measured):
        twice = np.flatnonzero(np.diff(fall.time_s) == 0)
        for first, last in zip(twice[:-1] + 1, twice[1:], strict=True):
            seconds = fall.time_s[last] - fall.time_s[first]
            start, velocity = fall.position[first], fall.velocity[first]
            if seconds < 0.05 or np.abs(fall.velocity[last] - velocity + [0, 0, 9.81 * seconds]).max() > 1e-6:
                continue  # not one free flight
            for since in np.linspace(0.01, 0.99, 7) * seconds:
                place = start + velocity * since - [0, 0, 0.5 * 9.81 * since**2]
                found = fall.state(float(fall.time_s[first] + since))
                assert found is not None
                assert np.abs(found[0] - place).max() < 1e-5
                compared += 1
    assert compared > 300


def test_thinned_paths_keep_their_places() -> None:
    show = open_show(ShowRequest(DEMO, simulate=("noel_2017",), number=1))
    for fall in show.falls:
        few = thinned(fall, 0.1)
        assert few.time_s.size < fall.time_s.size
        for moment in np.linspace(fall.time_s[0], fall.time_s[-1], 60)[1:-1]:
            one, other = fall.state(float(moment)), few.state(float(moment))
            assert (one is None) == (other is None)
            assert one is None or np.abs(one[0] - other[0]).max() < 1e-3


def test_blocks_as_observed_start_one_after_the_other() -> None:
    show = open_show(ShowRequest(DEMO, together=False))
    starts = np.array([fall.time_s[0] for fall in show.falls])
    assert starts.min() == 0.0
    assert np.ptp(starts) > 600


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["web", str(DEMO), "--language", "en-GB"], r"does not speak 'en-GB'.*Did you mean en\?"),
        (["web", "nowhere.toml"], "nowhere.toml"),
        (["web", str(DEMO), "--simulate", "noel"], "noel_2017"),
        (["web", str(DEMO), "--number", "3"], "Add --simulate"),
        (["export", str(DEMO), "--format", "gltb"], r"no format 'gltb'.*Did you mean gl"),
        (["export", str(DEMO), "--format", "fbx"], r"no format 'fbx'.*Known: glb"),
        (["export", str(DEMO), "--block", "bx"], r"no solid 'bx'.*Did you mean box\?"),
        (["export", str(DEMO), "--rate", "5000"], "5000 frames per second cannot be written"),
        (["export", str(DEMO), "--as-observed", "--rate", "100"], r"frames, and 20000 are the most.*lower"),
    ],
)
def test_bad_input_is_refused_in_words(arguments, said, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*arguments, "--out", str(tmp_path / "out")]) == 1
    assert re.search(said, capsys.readouterr().err)
    assert not (tmp_path / "out").exists()


def test_formats_have_their_usual_names() -> None:
    assert [known_format(text) for text in ("glTF", ".GLB", "usd", "usda", "Alembic")] == [
        "glb",
        "glb",
        "usdc",
        "usda",
        "abc",
    ]


def test_a_blender_that_fails_leaves_the_old_files(show: Show, tmp_path: Path) -> None:
    import sys

    animation, old = animate(show, 5.0), tmp_path / "a.glb"
    old.write_bytes(b"old")
    for script in ("import sys; sys.exit(3)", "pass", "print('rockfall error the disk is full')"):
        with pytest.raises(RockfallError):
            write_animation(animation, [old, tmp_path / "a.usdc"], [sys.executable, "-c", script])
        assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]
        assert old.read_bytes() == b"old"


def test_without_blender_it_is_said_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blender_process.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RockfallError, match=r"^They are written by Blender, .* pip install rockfall\[blender\]"):
        blender_process.blender_command("They are written")
