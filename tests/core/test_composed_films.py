# SPDX-License-Identifier: GPL-3.0-or-later
"""Composed films: what is drawn stands where the camera model of another library puts it, at the right moment."""

import csv
import errno
import os
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at
from rockfall.core.errors import InputError
from rockfall.core.film.composed.blocks import Pose, draw_block, draw_shadow, sun_direction
from rockfall.core.film.composed.canvas import Canvas, text_width
from rockfall.core.film.composed.catalogue import FILMS, PICTURES, compose
from rockfall.core.film.composed.envelope import envelope
from rockfall.core.film.composed.falls import Fall, Hits
from rockfall.core.film.composed.frame_store import frame_store
from rockfall.core.film.composed.ground import ground_picture, lit_ground
from rockfall.core.film.composed.kinds import KINDS, NAMES, find_kind
from rockfall.core.film.composed.look import MEASURED
from rockfall.core.film.composed.material import open_material
from rockfall.core.film.composed.photographs import Photograph
from rockfall.core.film.composed.request import FilmRequest
from rockfall.core.film.composed.scenery import Scene, draw_paths, keys_of
from rockfall.core.film.composed.shots import ComposedFilm, Shot
from rockfall.core.film.composed.sight import whole
from rockfall.core.film.composed.solids import SOLIDS, solid
from rockfall.core.film.composed.stage import Plate, slope_camera
from rockfall.core.film.composed.templates import story
from rockfall.core.film.composed.templates.cards import restitution_of, speeds_of
from rockfall.core.film.composed.templates.stills import median_picture
from rockfall.core.film.composed.texts import languages, texts
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import find_model
from rockfall.core.terrain.surface import Surface

DEMO = Path(__file__).parents[2] / "assets" / "demo" / "footage"
SIZE = (640, 360)
SUN = sun_direction(315.0, 50.0)


def plane(z: float = 0.0, half: float = 60.0) -> Surface:
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "plane")


def bent_camera() -> Camera:
    """With a lens that bends by some 12 px at the border, looking at the origin from 20 m."""
    seen = look_at(*SIZE, [2.0, -20.0, 9.0], [0.5, 0.3, 0.0], focal_px=700.0)
    return replace(seen, k1=-0.18, k2=0.05, p1=1.5e-3, p2=-8e-4, cx=331.0, cy=172.5)


def opencv_pixels(camera: Camera, points: np.ndarray) -> np.ndarray:
    """The same camera by OpenCV, from the corner of the picture."""
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    turn = cv2.Rodrigues(camera.rotation)[0]
    lens = np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])
    return cv2.projectPoints(points, turn, -camera.rotation @ camera.position, matrix, lens)[0].reshape(-1, 2)


def flight(name: str = "a", group: str = "", start: float = 0.0, colour: tuple[float, float, float] = MEASURED) -> Fall:
    """A parabola through (−4, 0, 1) with 6 m/s across and 5 m/s up."""
    time = np.linspace(0.0, 1.0, 121)
    at = np.array([-4.0, 0.0, 1.0]) + time[:, None] * [6.0, 0.0, 5.0] - 4.905 * (time**2)[:, None] * [0, 0, 1]
    velocity = np.array([6.0, 0.0, 5.0]) - 9.81 * time[:, None] * [0, 0, 1]
    return Fall(name, group, colour, start + time, at, velocity, np.zeros(121, np.intp), np.full(3, 0.8), 700.0)


def test_a_block_is_drawn_where_opencv_projects_it_and_as_large() -> None:
    camera, body = bent_camera(), solid("sphere", np.full(3, 1.2))
    for place in ([0.0, 0.0, 0.0], [-7.0, 3.0, 2.0], [7.5, -2.0, -1.0]):
        canvas = Canvas(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
        draw_block(canvas, camera, None, body, [Pose(np.array(place), np.eye(3))], (1.0, 1.0, 1.0), SUN)
        # Light falls from the side: what counts is where anything is drawn.
        cover = (canvas.picture.max(axis=2) > 60).astype(float)
        rows, columns = np.indices(cover.shape)
        found = np.array([(columns * cover).sum(), (rows * cover).sum()]) / cover.sum() + 0.5
        expected = opencv_pixels(camera, np.array([place]))[0]
        assert np.hypot(*(found - expected)) < 0.5
        away = np.linalg.norm(camera.position - place)
        assert np.sqrt(cover.sum() / np.pi) == pytest.approx(700 * 0.6 / away, rel=0.06)


def test_terrain_hides_blocks_and_their_paths() -> None:
    camera = bent_camera()
    wall = Surface(
        np.array([[-9.0, -6, -9], [9, -6, -9], [9, -6, 9], [-9, -6, 9]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        GlobalShift(), "wall",
    )  # fmt: skip
    canvas = Canvas(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    body = solid("sphere", np.full(3, 1.0))
    draw_block(canvas, camera, wall, body, [Pose(np.zeros(3), np.eye(3))], (1, 1, 1), SUN)
    assert not canvas.picture.any()
    draw_block(canvas, camera, wall, body, [Pose(np.array([0.0, -8.0, 2.0]), np.eye(3))], (1, 1, 1), SUN)
    assert canvas.picture.any()
    hidden = Canvas(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    draw_paths(hidden, camera, Scene(wall, [flight("b", "Model", colour=(0.9, 0.6, 0.0))]), 1.0)
    assert not hidden.picture.any()


def test_a_path_is_drawn_where_opencv_projects_it_in_the_colour_of_the_legend() -> None:
    camera, colour = bent_camera(), (0.0, 0.62, 0.45)
    scene = Scene(None, [flight("b", "Model", colour=colour)])
    canvas = Canvas(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    draw_paths(canvas, camera, scene, 0.6)
    drawn = np.argwhere(canvas.picture[:, :, 1] > 60)[:, ::-1]
    time = np.linspace(0, 0.6, 4000)[:, None]
    true = opencv_pixels(camera, np.array([-4.0, 0, 1]) + time * [6.0, 0, 5] - 4.905 * time**2 * [0, 0, 1])
    apart = np.sqrt(((drawn[:, None] + 0.5 - true[None]) ** 2).sum(axis=2))
    assert apart.min(axis=1).max() < 2.5  # a line of two pixels with soft edges and round ends
    assert apart.min(axis=0).max() < 1.0  # none of the true path is missing
    middle = []
    for column in range(int(true[:, 0].min()) + 4, int(true[:, 0].max()) - 4):
        light = canvas.picture[:, column, 1].astype(float)
        middle.append((light @ (np.arange(len(light)) + 0.5)) / light.sum() - np.interp(column + 0.5, *true.T))
    assert np.abs(middle).max() < 0.5
    assert abs(np.mean(middle)) < 0.1
    later = (
        opencv_pixels(camera, np.array([[-4.0 + 6 * 0.8, 0.0, 1.0 + 5 * 0.8 - 4.905 * 0.64]]))[0].round().astype(int)
    )
    assert not canvas.picture[later[1] - 3 : later[1] + 4, later[0] - 3 : later[0] + 4].any()
    full = canvas.picture[tuple(drawn[canvas.picture[drawn[:, 1], drawn[:, 0], 1].argmax()][::-1])]
    legend = keys_of(scene, texts("en"))[0]
    assert full[::-1] / 255 == pytest.approx(np.array(legend.colour) * 0.9, abs=0.12)
    assert legend.text == "Simulated: Model"


def test_a_shadow_lies_where_the_sun_throws_it() -> None:
    camera = look_at(*SIZE, [0.0, -0.01, 40.0], [0.0, 0.0, 0.0], focal_px=700.0)
    canvas = Canvas(np.full((SIZE[1], SIZE[0], 3), 200, np.uint8))
    sun = sun_direction(270.0, 45.0)  # in the west: the shadow of a block at 3 m lies 3 m east of it
    draw_shadow(canvas, camera, plane(), solid("sphere", np.ones(3)), Pose(np.array([0.0, 0.0, 3.0]), np.eye(3)), sun)
    dark = 200.0 - canvas.picture[:, :, 0]
    rows, columns = np.indices(dark.shape)
    found = np.array([(columns * dark).sum(), (rows * dark).sum()]) / dark.sum() + 0.5
    assert np.hypot(*(found - opencv_pixels(camera, np.array([[3.0, 0.0, 0.0]]))[0])) < 0.5


def test_solids_have_the_volume_of_the_block() -> None:
    from scipy.spatial import ConvexHull

    def volume(kind: str, diameters: list[float]) -> float:
        return float(ConvexHull(solid(kind, np.array(diameters)).vertices).volume)

    assert volume("box", [1.0, 2.0, 0.5]) == pytest.approx(1.0)
    assert volume("sphere", [2.0, 2.0, 2.0]) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert volume("ellipsoid", [1.0, 2.0, 3.0]) == pytest.approx(np.pi, rel=0.02)
    for kind in ("eota_111", "eota_221"):
        assert volume(kind, [1.0, 1.0, 1.0]) == pytest.approx(np.pi / 6, rel=1e-9)
    sizes = np.ptp(solid("eota_221", np.ones(3)).vertices, axis=0)
    assert sizes / sizes[0] == pytest.approx([1.0, 1.0, 0.5])
    # A cube of side 1 without 12 prisms along its edges, of 1/54 each, and 8 corners, of 1/27 − 1/162 each.
    side = np.ptp(solid("eota_111", np.ones(3)).vertices, axis=0)[0]
    assert np.pi / 6 / side**3 == pytest.approx(1 - 12 / 54 - 8 * (1 / 27 - 1 / 162))
    first, again, other = (solid("rock", np.ones(3), seed).vertices for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert np.ptp(first, axis=0) == pytest.approx([1, 1, 1])
    with pytest.raises(InputError, match="no solid 'cube'"):
        solid("cube", np.ones(3))
    assert len(SOLIDS) == 6


def test_a_fall_follows_its_parabola_and_rolls_or_spins() -> None:
    fall = flight()
    for t in (0.0, 0.123456, 0.7771, 1.0):
        place, velocity = fall.state(t)
        assert place == pytest.approx([-4 + 6 * t, 0, 1 + 5 * t - 4.905 * t * t], abs=1e-12)
        assert velocity == pytest.approx([6, 0, 5 - 9.81 * t], abs=1e-12)
    assert fall.state(-0.01) is None
    assert fall.state(1.01) is None
    # Rolling east at 6 m/s on a radius of 0.4 m: about +y, 15 rad/s.
    turn = fall.turn(0.1)
    angle = np.arccos((np.trace(turn) - 1) / 2)
    assert angle == pytest.approx(1.5)
    assert turn @ [0, 1.0, 0] == pytest.approx([0, 1, 0])
    from dataclasses import replace

    spun = replace(fall, spin=np.tile([0.0, 0.0, 2.0], (121, 1)))
    assert spun.turn(0.25) @ [1.0, 0, 0] == pytest.approx([np.cos(0.5), np.sin(0.5), 0])
    assert spun.has_known_spin
    assert not fall.has_known_spin


def test_the_ground_is_as_far_as_it_is_and_has_the_colours_of_a_photograph() -> None:
    camera = look_at(160, 90, [0.0, -30.0, 8.0], [0.0, 0.0, 0.0], fov_deg=50.0)
    side = np.linspace(-60, 60, 81)
    x, y = np.meshgrid(side, side)
    index = np.arange(81 * 81).reshape(81, 81)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    surface = Surface(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), faces, GlobalShift(), "grid")
    plain = lit_ground(surface, SUN)
    picture, distance = ground_picture(plain, camera)
    rows = np.array([40, 60, 80])
    down = (
        camera.rotation.T
        @ np.column_stack([np.full(3, 0.5 / camera.fx), (rows + 0.5 - camera.cy) / camera.fy, np.ones(3)]).T
    )
    down /= np.linalg.norm(down, axis=0)
    assert distance[rows, 80] == pytest.approx(-8.0 / down[2], rel=1e-4)
    assert np.isinf(distance[0]).all()
    assert picture[80, 80, 0] < picture[80, 80, 2]  # warm rock under a blue sky
    assert picture[0, 80, 0] > picture[0, 80, 2]
    red = np.zeros((90, 160, 3), np.uint8)
    red[..., 2] = 200
    shown, _ = ground_picture(lit_ground(surface, SUN, (Photograph(red, camera),) * 3), camera)
    assert shown[60, 80] == pytest.approx([0, 0, 200], abs=6)


def test_the_median_of_pictures_leaves_out_what_moves_and_what_is_not_known() -> None:
    shown = np.full((5, 4, 6, 3), 90, np.uint8)
    for i in range(5):
        shown[i, 1, i] = 250  # a block that moves on
    shown[:4, 2, 2] = 0  # seen once only
    shown[4, 2, 2] = 77
    shown[:, 3, 3] = 0
    made = median_picture(shown)
    assert (made[1] == 90).all()
    assert (made[2, 2] == 77).all()
    assert (made[3, 3] == 0).all()


def test_the_corridor_holds_95_percent_of_straight_paths() -> None:
    random = np.random.default_rng(4)
    angles = np.radians(5.0) * random.standard_normal(4000)
    time = np.linspace(0, 1, 12)
    falls = [
        Fall(str(i), "M", (0, 0, 0), time, 50 * time[:, None] * [np.cos(a), np.sin(a), 0.0], np.zeros((12, 3)),
             np.zeros(12, np.intp), np.ones(3), 1.0)
        for i, a in enumerate(angles)
    ]  # fmt: skip
    outline = envelope(falls, plane(z=-3.0))
    assert outline is not None
    assert outline[:, 2] == pytest.approx(-3.0)
    near = outline[np.abs(outline[:, 0] - 30.0) < 1.0]
    assert np.abs(near[:, 1]) == pytest.approx(np.abs(near[:, 0] * np.tan(1.96 * np.radians(5.0))), rel=0.08)
    assert envelope(falls[:5], plane()) is None


def test_numbers_of_unknown_error_are_approximate_and_others_have_theirs() -> None:
    said = texts("en")
    assert said.about(16.62, 0.7) == "16.6 ± 0.7"
    assert said.about(12.246, 0.081) == "12.25 ± 0.08"
    assert said.about(12.246, np.nan) == "≈ 12"
    assert texts("de").about_energy(3220.0, 90.0) == "3,22 ± 0,09 kJ"
    one = np.ones(1)
    hits = Hits(np.ones(1, np.intp), one, np.zeros((1, 3)), 8 * one, 5 * one, one, one, 0.51 * one,
                0.1 * one, 0.2 * one, one, one, np.array([[0.44, 0.59]]))  # fmt: skip
    assert speeds_of(hits, 0, said) == "8.0 ± 0.1 → 5.0 ± 0.2 m/s"
    assert restitution_of(hits, 0, said) == "R_N 0.51 (0.44–0.59, 95 %)"
    unknown = replace(
        hits, speed1_sigma_mps=np.nan * one, speed2_sigma_mps=np.nan * one, rn_ends=np.full((1, 2), np.nan)
    )
    assert speeds_of(unknown, 0, said) == "≈ 8.0 → ≈ 5.0 m/s"
    assert restitution_of(unknown, 0, said) == "R_N ≈ 0.51"


def test_a_film_of_impacts_that_were_not_refined_calls_them_approximate() -> None:
    """The demo's footage has no picks: its errors are those of times alone, and are not shown."""
    material = open_material(FilmRequest("overlay", DEMO / "project.toml"))
    assert material.is_unrefined
    assert material.words.say("measured") == "Measured approximately, not refined"
    assert [key.text for key in keys_of(material.scene(material.falls), material.words)] == [
        "Measured approximately, not refined"
    ]
    hits = material.falls[0].hits
    assert hits is not None
    assert np.isnan(hits.speed1_sigma_mps).all()
    assert np.isnan(hits.rn_ends).all()


def test_each_model_with_chance_has_its_own_corridor(monkeypatch: pytest.MonkeyPatch) -> None:
    """None is drawn about the blocks of several models, or about those of a model without chance."""
    models = ("azimi_desvarreux_1977", "dorren_2015", "noel_2017")
    material = open_material(FilmRequest("story", DEMO / "project.toml", width=320, height=180, models=models))
    time, groups = np.linspace(0, 1, 5), []
    start = material.falls[0].position[0]
    falls = tuple(
        Fall(f"B {i}", name, (0, 0, 0), time, start + time[:, None] * [i % 7, -9.0, -1.0], np.zeros((5, 3)),
             np.zeros(5, np.intp), np.ones(3), 1.0)
        for name in ("Azimi & Desvarreux 1977, without chance", *(find_model(one).title for one in models[1:]))
        for i in range(25)
    )  # fmt: skip
    kept = story.envelope
    monkeypatch.setattr(
        story, "envelope", lambda own, surface: groups.append({fall.group for fall in own}) or kept(own, surface)
    )
    plate = Plate(material.ground, slope_camera(material, material.falls, material.size, story.ABOVE_LEGEND))
    story.all_traces(material, plate, (*material.falls, *falls))
    assert groups == [{find_model(name).title} for name in models[1:]]


def test_texts_say_the_same_in_every_language() -> None:
    import re

    known = {language: texts(language).words for language in languages()}
    assert set(known) == {"en", "fr", "de"}
    for words in known.values():
        assert set(words) == set(known["en"])
        for key, text in words.items():
            assert sorted(re.findall(r"{\w+}", text)) == sorted(re.findall(r"{\w+}", known["en"][key])), key
    assert texts("en").number(12345.6) == "12\N{NARROW NO-BREAK SPACE}300"
    assert texts("fr").number(0.04567, 2) == "0,046"
    assert texts("de").energy(4567.0) == "4,6 kJ"
    assert texts("en").mass(1500.0) == "1.5 t"
    assert texts("en").pace(0.25) == "4× slower"
    assert texts("en").pace(1.0) == "1× real time"
    with pytest.raises(InputError, match="do not speak 'it'"):
        texts("it")


def test_type_is_as_wide_as_is_said() -> None:
    for text in ("Measured", "R_N 0.51", "vɴ₁ [m/s]", "my_video_2.mp4", "écart 12 m"):
        canvas = Canvas(np.zeros((200, 900, 3), np.uint8))
        box = canvas.text(text, 100, 120, 40, (1.0, 1.0, 1.0))
        columns = np.flatnonzero(canvas.picture.any(axis=(0, 2)))
        assert columns[0] >= 98
        assert columns[-1] + 1 == pytest.approx(100 + text_width(text, 40), abs=4)
        assert box.right == 100 + text_width(text, 40)


def test_graphs_speak_the_language_of_the_film_and_every_letter_is_there() -> None:
    from rockfall.core.analysis.graphs import PAPER_GRAPHS
    from rockfall.core.analysis.variables import find_variable
    from rockfall.core.film.composed.canvas import _pieces_of

    def drawn(text: str) -> bytes:
        canvas = Canvas(np.zeros((80, 80, 3), np.uint8))
        canvas.text(text, 20, 60, 40)
        return canvas.picture.tobytes()

    labels = {find_variable(name).label.partition(" [")[0] for spec in PAPER_GRAPHS for name in (spec.x, spec.y)}
    labels |= {"Speed", "Height above ground", "Kinetic energy", "Time"}
    unknown = drawn("?")
    for language in languages():
        words = texts(language).words
        assert {f"axis {label}" for label in labels} <= set(words)
        letters = {letter for text in words.values() for piece, _, _ in _pieces_of(text, 40) for letter in piece}
        for letter in letters - {"?", " "}:
            assert drawn(letter) != unknown, letter


def test_shots_fade_through_black_and_every_frame_can_be_asked_for() -> None:
    def shot(level: int) -> Shot:
        return Shot(str(level), 2.0, lambda _: Canvas(np.full((4, 4, 3), level, np.uint8)))

    film = ComposedFilm(4, 4, 10.0, [shot(100), shot(200)], fade_s=0.4)
    assert film.frames == 36  # 2 + 2 s less the fade
    levels = [int(film.canvas(k).picture[0, 0, 0]) for k in range(36)]
    assert levels[:17] == [100] * 17
    assert levels[20:] == [200] * 16
    assert levels[18] == 0
    assert levels[17] == pytest.approx(50, abs=2)
    assert levels[19] == pytest.approx(100, abs=2)


def test_a_killed_render_goes_on_and_gives_the_same_frames(tmp_path: Path) -> None:
    drawn: list[int] = []

    def draw(frame: int) -> np.ndarray:
        drawn.append(frame)
        return np.full((5, 7, 3), 10 * frame, np.uint8)

    def killed(frame: int) -> np.ndarray:
        if frame == 4:
            raise KeyboardInterrupt
        return draw(frame)

    quiet = lambda *_: None  # noqa: E731
    with frame_store(tmp_path / "whole", {"film": "a"}) as store:
        assert store.fill(range(8), draw, quiet) == 0
    drawn.clear()
    with pytest.raises(KeyboardInterrupt) as ended, frame_store(tmp_path / "cut", {"film": "a"}) as store:
        store.fill(range(8), killed, quiet)
    said = f"4 frames are finished and kept in {tmp_path / 'cut'}; the same command goes on with the others"
    assert str(ended.value) == said
    with pytest.raises(KeyboardInterrupt) as ended, frame_store(tmp_path / "none", {"film": "a"}):
        raise KeyboardInterrupt
    assert not ended.value.args  # nothing was written
    assert drawn == [0, 1, 2, 3]
    with frame_store(tmp_path / "cut", {"film": "a"}) as store:
        assert store.fill(range(8), draw, quiet) == 4
    assert drawn == list(range(8))
    for k in range(8):
        assert (tmp_path / "cut" / f"{k:06d}.png").read_bytes() == (tmp_path / "whole" / f"{k:06d}.png").read_bytes()
    with frame_store(tmp_path / "cut", {"film": "b"}) as store:  # another film: none of the old frames
        assert store.fill(range(2), draw, quiet) == 0
        with pytest.raises(InputError, match="Another run"), frame_store(tmp_path / "cut", {"film": "b"}):
            pass
        store.remove()
    assert not (tmp_path / "cut").exists()
    notes = tmp_path / "whole" / "1-annotated.png"
    notes.write_bytes(b"a person's own")
    with frame_store(tmp_path / "whole", {"film": "b"}) as store:
        assert store.fill(range(2), draw, quiet) == 0
        store.remove()
    assert [file.name for file in notes.parent.iterdir()] == [notes.name]


def test_frames_that_a_power_cut_has_spoilt_are_drawn_again(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (40, 60, 3), np.uint8)
    with frame_store(tmp_path / "f", {}) as store:
        store.fill(range(4), lambda _: noise, lambda *_: None)
        drawn = [store.file(k).read_bytes() for k in range(4)]
        good = drawn[3]
        store.file(1).write_bytes(good[: len(good) // 2])
        store.file(2).write_bytes(b"")
        store.file(3).write_bytes(good[:-4] + bytes(4))
        assert store.fill(range(4), lambda _: noise, lambda *_: None) == 1
        assert [store.file(k).read_bytes() for k in range(4)] == drawn
        assert store.differing == [1, 2, 3]
        assert store.remarks == [
            "3 kept frames were not as drawn, and drawn again: 000001.png, 000002.png, 000003.png."
        ]


@pytest.mark.parametrize("how", ["another frame", "another film", "one bit"])
def test_a_kept_frame_that_is_not_the_one_is_drawn_again(tmp_path: Path, how: str) -> None:
    def draw(frame: int) -> np.ndarray:
        return np.full((5, 7, 3), 10 * frame, np.uint8)

    with frame_store(tmp_path / "other", {"film": "b"}) as store:
        store.fill(range(3), draw, lambda *_: None)
    with frame_store(tmp_path / "f", {"film": "a"}) as store:
        store.fill(range(3), draw, lambda *_: None)
        drawn = [store.file(k).read_bytes() for k in range(3)]
        put = {"another frame": drawn[0], "another film": (tmp_path / "other" / "000001.png").read_bytes()}
        store.file(1).write_bytes(put.get(how, drawn[1][:-20] + bytes([drawn[1][-20] ^ 1]) + drawn[1][-19:]))
    with frame_store(tmp_path / "f", {"film": "a"}) as store:
        assert store.fill(range(3), draw, lambda *_: None) == 2
        assert [store.file(k).read_bytes() for k in range(3)] == drawn
    picture = cv2.imread(str(tmp_path / "f" / "000001.png"))
    np.testing.assert_array_equal(picture, draw(1))


@pytest.mark.parametrize("named", ["film.json", ".lock", "000001.png", "notes.txt"])
@pytest.mark.parametrize("ours", [False, True])
def test_pictures_and_files_of_somebody_else_are_never_removed(tmp_path: Path, named: str, ours: bool) -> None:
    """A sequence of pictures has such names, too."""
    folder, draw = tmp_path / "f", lambda _: np.zeros((5, 7, 3), np.uint8)
    folder.mkdir()
    if ours:
        with frame_store(folder, {"film": "a"}) as store:
            store.fill(range(2), draw, lambda *_: None)
    (folder / named).write_bytes(cv2.imencode(".png", draw(0))[1].tobytes())
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    allowed = ours and named == "notes.txt"
    refused = nullcontext() if allowed else pytest.raises(InputError, match="holds other files")
    with refused, frame_store(folder, {"film": "b"}) as store:
        store.fill(range(2), draw, lambda *_: None)
    after = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert after[named] == before[named]
    assert allowed or {**after, ".lock": before.get(".lock")} == {**before, ".lock": before.get(".lock")}


def test_a_full_disk_is_said_and_finished_frames_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rockfall.core.film.composed import frame_store as module

    write = module.write_bytes

    def full(path: Path, data: bytes) -> None:
        if path.name == "000002.png":
            raise InputError("The file cannot be written (No space left on device)", file=path, advice="Make room")
        write(path, data)

    monkeypatch.setattr(module, "write_bytes", full)
    with (
        frame_store(tmp_path / "f", {}) as store,
        pytest.raises(InputError, match=r"No space left.*2 of 5 frames are finished and kept"),
    ):
        store.fill(range(5), lambda _: np.zeros((2, 2, 3), np.uint8), lambda *_: None)
    assert sorted(file.name for file in (tmp_path / "f").glob("*.png")) == ["000000.png", "000001.png"]


def test_a_folder_of_frames_that_another_run_has_just_removed_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rockfall.core.film.composed import frame_store as module

    lock, ended = module.try_lock, []

    def other_run_ends(descriptor: int) -> bool:
        if not ended:
            ended.append((tmp_path / "f" / ".lock").unlink())
            (tmp_path / "f").rmdir()
        return lock(descriptor)

    monkeypatch.setattr(module, "try_lock", other_run_ends)
    with frame_store(tmp_path / "f", {}) as store:
        assert store.fill(range(2), lambda _: np.zeros((2, 2, 3), np.uint8), lambda *_: None) == 0
        with pytest.raises(InputError, match="Another run"), frame_store(tmp_path / "f", {}):
            pass
    assert ended


@pytest.mark.parametrize("how", ["full", "a file", "below a file", "read-only"])
@pytest.mark.parametrize("frames", [False, True])
def test_frames_and_stills_that_cannot_be_written_leave_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, frames: bool
) -> None:
    """As on a full or read-only disk, or where a file is in the way of the folder; the old picture stays."""
    from rockfall.core.film.composed import making

    file, out = tmp_path / "a file", tmp_path / "new" / "film"
    file.write_text("a person's")
    wanted = {
        "a file": (file, "This is a file, not a folder"),
        "below a file": (file / "x", os.strerror(errno.ENOTDIR)),
    }
    out, words = wanted.get(how, (out, os.strerror(errno.ENOSPC if how == "full" else errno.EROFS)))

    def refuse(*_unused: object, **_also: object) -> None:
        number = errno.ENOSPC if how == "full" else errno.EROFS
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(making, "open_material", lambda request, progress: type("M", (), {"remarks": []})())
    monkeypatch.setattr(making, "_states", lambda request: {})
    picture = type("P", (), {"picture": np.zeros((8, 8, 3), np.uint8)})
    film = type("F", (), {"frames": 3, "width": 8, "height": 8, "fps": 25.0, "canvas": lambda self, frame: picture})()
    monkeypatch.setattr(making, "compose", lambda kind, material: film)
    if how in ("full", "read-only"):
        monkeypatch.setattr(os, "fsync" if how == "full" else "mkdir", refuse)
    with pytest.raises(InputError) as refused:
        making.make_film(FilmRequest("turntable", tmp_path / "p.toml"), out, still=not frames, images=frames)
    assert words in refused.value.problem
    assert refused.value.advice
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    assert file.read_text() == "a person's"


def test_films_are_found_by_name_and_the_nearest_is_named() -> None:
    assert [kind.name for kind in KINDS if kind.is_picture] == list(PICTURES)
    assert {*FILMS, *PICTURES} == set(NAMES)
    with pytest.raises(InputError, match="Did you mean side_by_side"):
        find_kind("side-by-side2")


def test_the_overlay_is_registered_on_the_demos_footage() -> None:
    """The block's true places, through the film's camera, lie within a pixel of where the rendered footage has it."""
    material = open_material(FilmRequest("overlay", DEMO / "project.toml", width=1280, height=720))
    assert material.footage is not None
    assert material.surface is not None
    window = whole(material.footage.size, (1280, 720))
    with (DEMO / "truth" / "block.csv").open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["visible"] == "1"]
    apart = []
    for row in rows:
        moment = material.footage.moment(int(row["frame"]))
        survey = np.array([[float(row[column]) for column in ("x_m", "y_m", "z_m")]])
        camera = window.camera(material.footage.camera(moment))
        seen = opencv_pixels(camera, material.surface.shift.to_local(survey))[0]
        apart.append(np.hypot(*(seen - [float(row["u_px"]), float(row["v_px"])])))
    assert len(apart) > 200
    assert max(apart) < 1.0


@pytest.mark.parametrize("language", ["en", "fr", "de"])
@pytest.mark.parametrize(
    ("film", "size"), [("story", (640, 360)), ("vertical", (360, 640)), ("contact_sheet", (640, 360))]
)
def test_texts_stand_inside_the_picture(film: str, size: tuple[int, int], language: str) -> None:
    request = FilmRequest(
        film, DEMO / "project.toml", *size, language=language, number=2, graphs="motion" if film == "story" else ""
    )
    made = compose(find_kind(film), open_material(request))
    for k in range(0, made.frames, max(made.frames // 24, 1)):
        canvas = made.canvas(k)
        assert canvas.picture.shape == (made.height, made.width, 3)
        for one in canvas.written:
            assert one.box.left >= 0, (k, one)
            assert one.box.top >= 0, (k, one)
            assert one.box.right <= made.width, (k, one)
            assert one.box.bottom <= made.height, (k, one)


@pytest.mark.parametrize("size", [(32, 18), (120, 68), (400, 30)])
def test_a_picture_too_small_for_its_impacts_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match=rf"{size[0]} × {size[1]} pixels is too small for \d+ impacts.*--preset"):
        compose(find_kind("contact_sheet"), open_material(FilmRequest("contact_sheet", DEMO / "project.toml", *size)))


def test_simulated_blocks_keep_to_their_parabolas_up_to_the_impact() -> None:
    """Between two records of a run, as the engine wrote them, a block is where gravity alone brings it."""
    from rockfall.core.film.composed.falls import simulated_falls
    from rockfall.core.simulation.engine import FLIES_OFF, IMPACT, RELEASED, Settings, simulate
    from rockfall.core.simulation.ground import make_ground
    from rockfall.core.simulation.release import make_releases

    slope = plane(half=200.0)
    turn = np.radians(35.0)
    tilted = np.column_stack([slope.vertices[:, 0], slope.vertices[:, 1], -np.tan(turn) * slope.vertices[:, 0]])
    surface = Surface(tilted, slope.faces, GlobalShift(), "slope")
    assert surface.face_normals[0, 2] > 0
    ground = make_ground(surface)
    releases = make_releases(np.array([[-150.0, 0.0, 150.0 * np.tan(turn) + 6.0]]))
    simulation = simulate(ground, releases, Settings("noel_2017"), record="all")
    fall = simulated_falls(simulation, {}, "M", (1.0, 0.0, 0.0))[0]
    records, checked = simulation.records, 0
    for k in range(len(records) - 1):
        if records.what[k] not in (RELEASED, IMPACT, FLIES_OFF) or records.what[k + 1] != IMPACT:
            continue
        length = records.time_s[k + 1] - records.time_s[k]
        for share in (0.3, 0.9, 0.999):
            t = share * length
            state = fall.state(float(records.time_s[k] + t))
            true = records.position[k] + t * records.v2[k] - 0.5 * 9.81 * t * t * np.array([0, 0, 1])
            assert state is not None
            assert np.abs(state[0] - true).max() < 1e-6
            checked += 1
    assert checked >= 9
