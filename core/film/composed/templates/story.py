# SPDX-License-Identifier: GPL-3.0-or-later
"""The story: what the camera saw, where the block flew, the same impact by models, whole falls, all traces."""

import numpy as np

from ....errors import InputError
from ....impact_models.registry import find_model
from ....vectors import Array, norm
from ...framing import Margins
from ..canvas import Canvas
from ..envelope import envelope
from ..falls import Fall
from ..film_clock import FilmClock, Freeze, film_clock
from ..look import INK
from ..material import Material
from ..scenery import Key, draw_badge, draw_heading, draw_keys, draw_paths, keys_of
from ..shots import ComposedFilm, Shot
from ..sight import pixels
from ..stage import Plate, Stage, inset_of, slope_camera, whole_footage
from .cards import beside, draw_hit_card, end_card, title_card
from .footage import STANDS, path_shot
from .timing import hardest, lasting_clock, nice_rate

ENVELOPE = (0.86, 0.87, 0.88)
"""Of the legend's line, which stands for those of all models."""
FOOTAGE_S, PATH_S, MODELS_S, FALLS_S, ALL_S = 8.0, 12.0, 6.5, 8.0, 4.5
STOPS = 3
ABOVE_LEGEND = Margins(0.06, 0.06, 0.27, 0.14)
MODELS_STAND_S = 2.0
LATEST = 0.98
"""The falls' chapter ends when this part of the simulated blocks has come to its end."""


def story(material: Material) -> ComposedFilm:
    """About forty seconds, from the video to the simulation."""
    first = whole_footage(material).at(material.span_s[0])[0].picture
    shots = [title_card(material, first, material.words.say("story")), *_video(material)]
    shots += [shot for shot in (_models(material),) if shot is not None]
    shots += _falls(material)
    shots.append(end_card(material, first))
    return ComposedFilm(*material.size, material.request.fps, shots)


def _video(material: Material) -> list[Shot]:
    """The raw footage, and the same with the path growing over it."""
    words, span, fall = material.words, material.span_s, material.falls[0]
    backdrop, scene = whole_footage(material), material.scene(material.falls)
    raw_clock = film_clock(*span, rate=nice_rate(span[1] - span[0], FOOTAGE_S))
    raw = Stage(
        material, scene, solids=False, heading=words.say("chapter_footage"), note=material.title, paths=False,
        impacts=False, scale=False, numbers=False,
    )  # fmt: skip

    def draw_raw(film_s: float) -> Canvas:
        canvas, _ = backdrop.at(float(raw_clock.fall_at(film_s)[0]))
        look = canvas.look
        draw_heading(canvas, raw.heading, raw.note)
        draw_badge(canvas, [words.pace(raw_clock.rate_at(film_s))], look.width - look.margin, look.height - look.margin)
        return canvas

    clock = lasting_clock(material, fall, span, PATH_S, hardest(fall, STOPS, *span))
    stage = Stage(
        material, scene, solids=False, heading=words.say("chapter_path"), note=words.say("reconstruction"),
        inset=inset_of(material, material.size, material.falls),
    )  # fmt: skip
    return [Shot("footage", raw_clock.duration_s, draw_raw), path_shot(material, backdrop, stage, clock, "path")]


def _models(material: Material) -> Shot | None:
    """The block after one impact, and what models make of it, on one clock; None where no model can be asked."""
    chosen = _impact_to_compare(material)
    if chosen is None:
        material.remarks.append(
            "No impact is known well enough to be compared with models: the film has no such chapter."
        )
        return None
    fall, row, until = chosen
    assert fall.hits is not None
    words, start = material.words, float(fall.hits.time_s[row])
    models = material.predicted(fall.name, [int(fall.hits.number[row])])
    longest = max([until, *(float(one.time_s[-1]) for one in models)])
    begin, end = start - 0.5 * (until - start), min(longest, until + 0.6 * (until - start))
    clock = film_clock(begin, end, rate=nice_rate(end - begin, MODELS_S), freezes=[
        Freeze(start, material.request.freeze_s), Freeze(min(until, end), MODELS_STAND_S)
    ])  # fmt: skip
    near = _part(fall, begin, until)
    plate = Plate(material.ground, slope_camera(material, (near, *models), material.size, ABOVE_LEGEND))
    scene = material.scene((fall, *models))
    stage = Stage(
        material,
        scene,
        solids=True,
        heading=words.say("chapter_models"),
        note=words.say("before_impact"),
        numbers=False,
    )

    def draw(film_s: float) -> Canvas:
        moment, rate = float(clock.fall_at(film_s)[0]), clock.rate_at(film_s)
        seen = plate.at(moment)
        canvas = stage.draw(seen, moment, rate)
        if rate == 0.0 and abs(moment - start) < STANDS:
            draw_hit_card((canvas, seen[1]), material, fall, row)
        elif rate == 0.0:
            _draw_links(material, canvas, seen[1], fall, models, moment)
        return canvas

    return Shot("models", clock.duration_s, draw)


def _impact_to_compare(material: Material) -> tuple[Fall, int, float] | None:
    """The impact whose flight after it is the longest of those that models can be asked about, and when that ends."""
    best: tuple[Fall, int, float] | None = None
    asked = {
        (str(t), int(i)) for t, i in zip(material.predictions.trajectory, material.predictions.impact, strict=True)
    }
    for fall in material.falls:
        if fall.hits is None:
            continue
        for row in range(len(fall.hits.time_s) - 1):
            if (fall.name, int(fall.hits.number[row])) not in asked or not np.isfinite(fall.hits.rn[row]):
                continue
            start, until = float(fall.hits.time_s[row]), float(fall.hits.time_s[row + 1])
            if fall.state((start + until) / 2) is not None and (
                best is None or until - start > best[2] - float(_hit(best))
            ):
                best = fall, row, until
    return best


def _hit(chosen: tuple[Fall, int, float]) -> float:
    hits = chosen[0].hits
    assert hits is not None
    return float(hits.time_s[chosen[1]])


def _part(fall: Fall, begin_s: float, end_s: float) -> Fall:
    """The rows of a stretch of time."""
    from dataclasses import replace

    rows = (fall.time_s >= begin_s) & (fall.time_s <= end_s)
    if not rows.any():
        return fall
    return replace(fall, time_s=fall.time_s[rows], position=fall.position[rows], velocity=fall.velocity[rows],
                   chain=fall.chain[rows], hits=None, spin=None if fall.spin is None else fall.spin[rows])  # fmt: skip


def _draw_links(
    material: Material, canvas: Canvas, camera: object, fall: Fall, models: tuple[Fall, ...], moment: float
) -> None:
    """From the real block to those of models, with how far they are apart."""
    from ....camera.model import Camera

    assert isinstance(camera, Camera)
    state, look, words = fall.state(moment), canvas.look, material.words
    if state is None:
        return
    here = pixels(camera, state[0][None])[0]
    lines: list[str] = []
    for model in models:
        place = _last_place(model, moment)
        there = pixels(camera, place[None])[0]
        if not np.isfinite([here, there]).all():
            continue
        canvas.dashes(np.array([here, there]), INK, look.line + 2 * look.thin, 4.0 * look.line, 0.6)
        canvas.dashes(np.array([here, there]), model.colour, look.line, 4.0 * look.line)
        apart = float(norm(place - state[0]))
        lines.append(words.say("off_by", model=model.group, distance=words.number(apart, 2)))
    if lines:
        beside(canvas, here, [words.say("measured"), *lines])


def _last_place(fall: Fall, moment: float) -> Array:
    state = fall.state(min(max(moment, float(fall.time_s[0])), float(fall.time_s[-1])))
    return fall.position[-1] if state is None else state[0]


def _falls(material: Material) -> list[Shot]:
    """The whole simulated falls, and the still of all traces."""
    words, simulated = material.words, material.simulated
    if not simulated:
        raise InputError("No block could be simulated", file=material.request.project, advice="See rockfall simulate")
    falls = (*material.falls, *simulated)
    begin = min(float(fall.time_s[0]) for fall in falls)
    end = float(np.quantile([float(fall.time_s[-1]) for fall in simulated], LATEST))
    end = max(end, max(float(fall.time_s[-1]) for fall in material.falls))
    clock: FilmClock = film_clock(begin, end, rate=nice_rate(end - begin, FALLS_S))
    plate = Plate(material.ground, slope_camera(material, falls, material.size, ABOVE_LEGEND))
    scene = material.scene(falls)
    note = words.say("blocks", number=words.whole(len(simulated)))
    stage = Stage(
        material, scene, solids=True, heading=words.say("chapter_falls"), note=note, impacts=False, numbers=False
    )

    def draw(film_s: float) -> Canvas:
        moment = float(clock.fall_at(film_s)[0])
        return stage.draw(plate.at(moment), moment, clock.rate_at(film_s))

    last = all_traces(material, plate, falls)
    return [Shot("falls", clock.duration_s, draw), Shot("traces", ALL_S, lambda _: Canvas.copied(last))]


def all_traces(material: Material, plate: Plate, falls: tuple[Fall, ...]) -> Canvas:
    """All that was measured and simulated, with the corridor of 95 % of the paths of each model with chance."""
    words = material.words
    canvas, camera = plate.at(0.0)
    look = canvas.look
    scene = material.scene(falls)
    keys, outlined = list(keys_of(scene, words)), False
    for model in [find_model(name) for name in material.models]:
        own = [fall for fall in falls if fall.group == model.title]
        outline = envelope(own, material.terrain) if model.is_random else None
        if outline is None:
            continue
        where = pixels(camera, outline)
        where = where[np.isfinite(where).all(axis=1)]
        colour = own[0].colour
        canvas.area([where], colour, 0.12)
        canvas.lines([np.vstack([where, where[:1]])], INK, look.line + look.thin, 0.4)
        canvas.dashes(np.vstack([where, where[:1]]), colour, look.line, 5.0 * look.line)
        outlined = True
    if outlined:
        keys.append(Key(ENVELOPE, words.say("envelope")))
    draw_paths(canvas, camera, scene, np.inf)
    stage = Stage(material, scene, solids=True)
    stage.draw_size(canvas, camera)
    number = words.say("blocks", number=words.whole(sum(not fall.is_measured for fall in falls)))
    draw_heading(canvas, words.say("chapter_all"), f"{material.title}. {number}")
    draw_keys(canvas, keys, look.margin, look.height - look.margin)
    credit = " · ".join([*material.credit_lines, words.say("made_with")])
    draw_badge(canvas, [credit], look.width - look.margin, look.height - look.margin, strong=False)
    return canvas
