# SPDX-License-Identifier: GPL-3.0-or-later
"""Screens across the slope: drawn lines at which passing blocks are measured, and barriers that hold them.

A screen is an object that is a line; its height and capacity are those of the object. What was found at the screens is
stored with the simulation that is shown.
"""

import uuid
from collections.abc import Mapping, Sequence
from itertools import pairwise

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.hazard.design import DesignValues, Verdict, design_of
from ....core.hazard.screen_tally import Known, ScreenFigures, ScreenTally
from ....core.hazard.screens import HELD, OUTCOMES, OVER, THROUGH, Screen
from ....core.impact_models.registry import MODELS
from ....core.terrain.raycast import cast_rays
from ....core.terrain.surface import Surface
from ....core.vectors import Array
from ....core.workflow.barrier_verdicts import more_words
from ..storage import store
from ..terrain import terrain
from . import drawn_releases

COLLECTION = "Screens"
MOST_POSTS = 400
"""Places along a screen at which its foot is looked for."""
SPACING_M = 1.0
VERDICTS: dict[str, str] = {
    "enough": "enough, without partial factors", "not_enough": "not enough", "not_known": "not known yet: {more}",
}  # fmt: skip


def objects_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The screens, by name."""
    return store.with_role(scene, store.SCREEN_ROLE)


def make(scene: bpy.types.Scene, points: Sequence[Array], name: str = "Screen") -> bpy.types.Object:
    """A screen through points (n, 3) of the terrain.

    Raises
    ------
    RockfallError : they are too few.
    """
    if len(points) < 2:
        raise RockfallError(f"A screen needs two points or more, and {len(points)} are there. Click along it.")
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, point)) for point in points], [(i, i + 1) for i in range(len(points) - 1)], [])
    obj = bpy.data.objects.new(name, mesh)
    obj[store.ROLE], obj[store.ID] = store.SCREEN_ROLE, uuid.uuid4().hex
    obj.hide_render = True
    store.link(store.collection(scene, COLLECTION), obj)
    return obj


def keep(scene: bpy.types.Scene, screen: Screen, surface: Surface) -> bpy.types.Object:
    """A screen of a project as an object: its points stand on the terrain, at half its height where there is none."""
    low, high = surface.bounds
    above = np.column_stack([screen.line, np.full(len(screen.line), high[2] + 1.0)])
    z = cast_rays(surface, above, (0, 0, -1)).point[:, 2]
    obj = make(scene, np.column_stack([screen.line, np.where(np.isnan(z), (low[2] + high[2]) / 2, z)]), screen.name)
    settings = obj.rockfall_screen
    if np.isfinite(screen.height_m):
        settings.height_m = screen.height_m
    if screen.capacity_j is not None:
        settings.holds, settings.capacity_kj = True, screen.capacity_j / 1000
    return obj


def line_of(obj: bpy.types.Object) -> Array:
    """(p, 3) the points of a screen, local [m].

    Raises
    ------
    RockfallError : the object is no single open line any more.
    """
    kind, points = drawn_releases.read(obj)
    if kind != drawn_releases.LINE:
        raise RockfallError(f"The screen {obj.name} is no open line. Draw it again.")
    return points


def problem(scene: bpy.types.Scene) -> str:
    """What is wrong with the screens, in a sentence; empty when nothing is."""
    try:
        screens_of(scene)
    except RockfallError as error:
        return str(error)
    return ""


def screens_of(scene: bpy.types.Scene) -> tuple[Screen, ...]:
    """The screens for the core.

    Raises
    ------
    RockfallError : one is no line.
    """
    return tuple(screen_of(obj) for obj in objects_of(scene))


def screen_of(obj: bpy.types.Object) -> Screen:
    """A screen for the core.

    Raises
    ------
    RockfallError : it is no line.
    """
    settings = obj.rockfall_screen
    capacity_j = 1000 * store.double(settings.capacity_kj) if settings.holds else None
    return Screen(obj.name, line_of(obj)[:, :2].copy(), store.double(settings.height_m), capacity_j)


def fence(scene: bpy.types.Scene, obj: bpy.types.Object) -> Array:
    """(q, 3) the foot of a screen on the terrain, at places so near one another that it follows it; z is NaN beside."""
    line = line_of(obj)
    length = float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())
    spacing = max(SPACING_M, length / MOST_POSTS)
    parts = [line[:1]]
    for a, b in pairwise(line):
        count = max(int(np.ceil(np.hypot(*(b - a)[:2]) / spacing)), 1)
        parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    places, surface = np.vstack(parts), terrain.surface_of_scene(scene)
    if surface is None:
        return places
    down, up = cast_rays(surface, places, (0, 0, -1)), cast_rays(surface, places, (0, 0, 1))
    places[:, 2] = np.where(down.distance <= up.distance, down.point[:, 2], up.point[:, 2])
    return places


def fingerprint(scene: bpy.types.Scene) -> list[object]:
    """Of the screens' names, lines and what they hold."""
    found: list[object] = []
    for obj in objects_of(scene):
        settings = obj.rockfall_screen
        places = [round(vertex, 5) for row in obj.matrix_world for vertex in row]
        line = [tuple(round(value, 5) for value in vertex.co) for vertex in getattr(obj.data, "vertices", ())]
        barrier = (store.double(settings.height_m), store.double(settings.capacity_kj)) if settings.holds else ()
        found.append((obj.name, places, line, barrier))
    return found


def results_of(tallies: Mapping[str, ScreenTally]) -> list[dict[str, object]]:
    """What a file keeps of the hits: of each screen and model, counts and 95 % values with their intervals.

    Parameters
    ----------
    tallies : model → hits.
    """
    found = []
    for model, tally in tallies.items():
        values = design_of(tally)
        for without, behind in zip(tally.figures(), tally.figures(with_barriers=True), strict=True):
            found.append(_result(model, without, behind) | _verdict(values.get(without.screen.name), without.screen))
    return found


def _verdict(values: DesignValues | None, screen: Screen) -> dict[str, object]:
    """Whether a barrier is enough for the 95 % values, and for which barrier that was found; nothing of a screen."""
    if not screen.holds:
        return {}
    said = "no block comes" if values is None else more_words(values)
    verdict = "not_known" if values is None else values.verdict
    return {"verdict": verdict, "more": said, "barrier": _barrier(screen)}


def _barrier(screen: Screen) -> list[float]:
    """Height, capacity and corners, as a file keeps them."""
    return np.round([screen.height_m, (screen.capacity_j or 0.0) / 1000, *screen.line.ravel()], 3).tolist()


def verdict_of(results: Sequence[Mapping[str, object]], screen: Screen) -> Verdict | None:
    """The worst verdict of all models on a barrier, as it stands now; None where it is another or nothing was found."""
    found = [one["verdict"] for one in results if one["screen"] == screen.name and "verdict" in one]
    now = _barrier(screen)
    if any(one["barrier"] != now for one in results if one["screen"] == screen.name and "verdict" in one):
        return None
    return next((verdict for verdict in ("not_enough", "not_known", "enough") if verdict in found), None)


def _result(model: str, without: ScreenFigures, behind: ScreenFigures) -> dict[str, object]:
    screen = without.screen
    counts = {OUTCOMES[place]: behind.outcomes[OUTCOMES[place]] for place in (HELD, OVER, THROUGH)}
    return {
        "screen": screen.name,
        "model": model,
        "blocks": without.blocks,
        "reach": without.reach,
        "reach_with_barriers": behind.reach,
        "hits": behind.hits,
        **(counts if screen.holds else {}),
        "energy_kj": _ninety_five(without.energy_j, 1e-3),
        "height_m": _ninety_five(without.height_m),
        "speed_mps": _ninety_five(without.speed_mps),
    }


def _ninety_five(known: Known | None, factor: float = 1.0) -> list[float | None] | None:
    """A 95 % value and its interval; None where nothing is known."""
    if known is None:
        return None
    q95 = known.quantile(0.95)
    values = (q95.value, q95.low, q95.high)
    return [None if value != value else factor * value for value in values]


def result_rows(results: Sequence[Mapping[str, object]], name: str) -> list[tuple[str, list[tuple[str, str]]]]:
    """Title of each model, and names and values of what it does at a screen, for people."""
    found = []
    for one in results:
        if one.get("screen") != name or one.get("model") not in MODELS:
            continue
        blocks, reach = one["blocks"], one["reach"]
        rows = [("Blocks that come", f"{reach} of {blocks} ({_percent(reach, blocks)})")]
        if one["reach_with_barriers"] != reach:
            again = one["reach_with_barriers"]
            rows.append(("behind the barriers", f"{again} of {blocks} ({_percent(again, blocks)})"))
        if "held" in one:
            rows += [("Held", str(one["held"])), ("Over it, through it", f"{one['over']}, {one['through']}")]
            beyond = one["over"] + one["through"]
            rows.append(("Passes", f"{beyond} of {one['hits']} hits"))
        for key, text, unit in (
            ("energy_kj", "Energy, 95 %", "kJ"), ("height_m", "Height, 95 %", "m"), ("speed_mps", "Speed, 95 %", "m/s"),
        ):  # fmt: skip
            if one[key] is not None:
                rows.append((text, _with_interval(one[key], unit)))
        if one.get("verdict") in VERDICTS:
            more = str(one.get("more", ""))
            rows.append(("Verdict (95 %)", VERDICTS[one["verdict"]].format(more=more)))
        found.append((MODELS[one["model"]].title, rows))
    return found


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.3g} %" if whole else "–"


def _with_interval(values: Sequence[float | None], unit: str) -> str:
    value, low, high = values
    match low is None, high is None:
        case False, False:
            return f"{value:.3g} {unit} ({low:.3g}–{high:.3g})"
        case False, True:
            return f"{value:.3g} {unit} ({low:.3g} to ?)"
    return f"{value:.3g} {unit} (too few blocks)"
