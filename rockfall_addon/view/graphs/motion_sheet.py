# SPDX-License-Identifier: GPL-3.0-or-later
"""The editor of motion graphs as it is drawn: one above the other over one time axis, the frame as a cursor."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import bpy
import numpy as np

from ....core.analysis.axes import Axis, Limits, Ticks
from ....core.analysis.graph_layout import Frame, Rectangle
from ....core.analysis.motion_graphs import RESIDUAL, MotionCourse, Quantity, shown_quantities
from ....core.analysis.stacked_graphs import fitting, quantity_axis, stacked, time_axis
from ...scene import next_step
from ...scene.footage import clocks, timing, videos
from ...scene.models import motion, motion_settings
from ...scene.picks import picks
from ...scene.storage import store
from . import drawing, empty
from .axes import draw_axes
from .editor import Canvas
from .look import Look, Rgb, alpha, mixed
from .motion_lines import REACH, Bundle, bundle, nearest_line

CURSOR: Rgb = (0.96, 0.77, 0.16)
ON_LIGHT: Rgb = (0.78, 0.45, 0.0)
ABOVE = 1.7
"""Room for the time of the cursor above all graphs, in heights of the text."""
MARK_PX = 7.0
"""How near to an impact's time the mouse points at it, at interface scale 1."""
MOST_MARKED = 40
"""Of more trajectories, only the selected ones have their impacts marked and smooth lines."""


class Hit(NamedTuple):
    """What is under the mouse: a trajectory, and the number of its impact whose time this is, 0 for none."""

    trajectory: str
    impact: int


@dataclass(eq=False)
class _Graph:
    """One graph as it was made: its whole axes, the lines of the others and of those that stand out."""

    x: Axis
    y: Axis
    colour: Rgb
    others: Bundle
    chosen: Bundle


@dataclass(eq=False)
class _Shown:
    """What there is to be drawn: trajectories, quantities, and axes that hold everything, the time in seconds."""

    courses: tuple[MotionCourse, ...] = ()
    quantities: tuple[Quantity, ...] = ()
    x: Axis = field(default_factory=lambda: Axis((0.0, 1.0)))
    ys: tuple[Axis, ...] = ()


@dataclass(eq=False)
class _Kept:
    """What was made for a scene, and what for."""

    shown_key: object = None
    shown: _Shown = field(default_factory=_Shown)
    graphs: dict[str, _Graph] = field(default_factory=dict)


_scenes: dict[int, _Kept] = {}


def forget() -> None:
    """Another file was opened, or the graphics card is left."""
    _scenes.clear()


def draw(context: bpy.types.Context, canvas: Canvas) -> None:
    """Draw the graphs of a scene, or what to do when there is nothing to be drawn."""
    scene, look = context.scene, canvas.look
    found = motion.motion_of(scene)
    chosen = chosen_trajectories(context)
    kept = _kept(scene)
    shown = _shown(scene, kept, found, chosen)
    courses, quantities = shown.courses, shown.quantities
    said = _nothing(scene, found, quantities)
    if said is not None:
        empty.draw(canvas, said)
        return
    limits = motion_settings.limits_of(scene)
    x = replace(shown.x, limits=limits.get(motion_settings.TIME, shown.x.limits))
    ys = [replace(y, limits=limits.get(q.name, y.limits)) for y, q in zip(shown.ys, quantities, strict=True)]
    room, above = canvas.room.shrunk(0.4 * look.text), ABOVE * look.text
    many = len(ys) if canvas.printed else fitting(len(ys), room.height, look.text, above)
    frames = stacked(room, _numbered(scene, x), ys[:many], look.text, look.measure, above)
    for number, frame in enumerate(frames):
        canvas.frames[number] = frame
        graph = _graph(kept, number, chosen, look)
        _draw_graph(canvas, number, graph, quantities[number], last=number == many - 1, some=bool(chosen))
    if many < len(ys):
        _draw_lacking(canvas, quantities[many - 1], len(ys) - many)
    _draw_impacts(canvas, scene, courses, chosen)
    if not canvas.printed:
        _draw_cursor(canvas, scene)
    if canvas.hit is not None and canvas.pointer is not None:
        _draw_card(canvas, scene, courses)


def point(context: bpy.types.Context, canvas: Canvas) -> Hit | None:
    """The line under the mouse."""
    kept = _kept(context.scene)
    if canvas.pointer is None or not 0 <= canvas.graph < len(kept.shown.quantities):
        return None
    graph, frame = kept.graphs.get(kept.shown.quantities[canvas.graph].name), canvas.frames[canvas.graph]
    if graph is None:
        return None
    best = np.inf, ""
    for each in (graph.chosen, graph.others):
        away, owner = nearest_line(each, frame, graph.x, graph.y, canvas.pointer, REACH * canvas.look.scale)
        if owner >= 0 and away < best[0]:
            best = away, each.courses[owner].trajectory
    if not best[1]:
        return None
    course = next(one for one in (*graph.chosen.courses, *graph.others.courses) if one.trajectory == best[1])
    return Hit(best[1], _impact_at(context.scene, course, frame, canvas.pointer[0], canvas.look.scale))


def shown_courses(context: bpy.types.Context) -> tuple[MotionCourse, ...]:
    """The trajectories that are shown."""
    scene = context.scene
    return _shown(scene, _kept(scene), motion.motion_of(scene), chosen_trajectories(context)).courses


def time_at(scene: bpy.types.Scene, canvas: Canvas, x: float) -> float:
    """Display time [s] at a pixel of the region; beyond the axis it goes on."""
    frame = next(iter(canvas.frames.values()))
    return _seconds(scene, float(frame.to_data(np.array([[x, frame.plot.bottom]]))[0, 0]))


def chosen_trajectories(context: bpy.types.Context) -> frozenset[str]:
    """Those of which something is selected: a pick, the block, the flights."""
    layer = context.view_layer
    objects = layer.objects.selected if layer is not None else ()
    return frozenset(obj[store.TRAJECTORY] for obj in objects if store.TRAJECTORY in obj)


def set_limits(scene: bpy.types.Scene, graph: int, x: Limits | None, y: Limits | None) -> None:
    """Give the common time axis, and that of a quantity, limits as they are shown."""
    kept, limits = _kept(scene), motion_settings.limits_of(scene)
    if x is not None:
        limits[motion_settings.TIME] = _seconds(scene, x[0]), _seconds(scene, x[1])
    if y is not None and graph < len(kept.shown.quantities):
        limits[kept.shown.quantities[graph].name] = y
    motion_settings.keep_limits(scene, limits)


def reset(scene: bpy.types.Scene, graph: int) -> None:
    """The usual limits again."""
    kept, limits = _kept(scene), motion_settings.limits_of(scene)
    limits.pop(motion_settings.TIME, None)
    if graph < len(kept.shown.quantities):
        limits.pop(kept.shown.quantities[graph].name, None)
    motion_settings.keep_limits(scene, limits)


def _kept(scene: bpy.types.Scene) -> _Kept:
    if scene.session_uid not in _scenes:
        for gone in _scenes.keys() - {one.session_uid for one in bpy.data.scenes}:
            del _scenes[gone]
        _scenes[scene.session_uid] = _Kept()
    return _scenes[scene.session_uid]


def _nothing(scene: bpy.types.Scene, found: motion.SceneMotion, quantities: tuple[Quantity, ...]) -> empty.Said | None:
    """Why there is no line to be drawn; None when there is one."""
    if quantities:
        return None
    if any(course.time_s.size for course in found.courses):
        asked = motion_settings.asked(scene)
        if not asked:
            return empty.Said("Nothing is chosen to be shown", "Choose quantities in the header.")
        lacking = ", ".join(one.title.lower() for one in asked)
        advice = "A residual needs an aligned video with a tracked block, a height needs a terrain, rotation a spin."
        return empty.Said(f"Nothing is known of: {lacking}", advice)
    if found.problems:
        return empty.Said("There is no motion to show", " ".join(found.problems))
    if store.has_role(scene, store.PICK_ROLE):
        return empty.Said("There is no motion yet", "It takes two picks of one block. Pick its next impact in step 4.")
    step = next_step.next_step(scene)
    return empty.Said(
        "There is no motion yet", step.sentence, tuple(one for one in step.actions if one in empty.BUTTONS)
    )


def _shown(scene: bpy.types.Scene, kept: _Kept, found: motion.SceneMotion, chosen: frozenset[str]) -> _Shown:
    """What there is to be drawn; found again when something of that has changed."""
    only = chosen if scene.rockfall_motion.only_selected and chosen else None
    asked = motion_settings.asked(scene)
    key = found.version, only, asked
    if kept.shown_key != key:
        courses = tuple(course for course in found.courses if only is None or course.trajectory in only)
        quantities = shown_quantities(courses, asked)
        ys = tuple(quantity_axis(courses, quantity) for quantity in quantities)
        kept.shown_key, kept.shown = key, _Shown(courses, quantities, time_axis(courses), ys)
    return kept.shown


def _graph(kept: _Kept, number: int, chosen: frozenset[str], look: Look) -> _Graph:
    """A graph with its batches; of a changed trajectory that is selected, only its own lines are made again."""
    shown = kept.shown
    quantity, x, y = shown.quantities[number], shown.x, shown.ys[number]
    before = kept.graphs.get(quantity.name)
    others = tuple(course for course in shown.courses if course.trajectory not in chosen)
    front = tuple(course for course in shown.courses if course.trajectory in chosen)
    if before is None or (before.x, before.y, before.colour) != (x, y, look.measured):
        before = None
    made = before.others if before is not None and before.others.courses == others else None
    made_front = before.chosen if before is not None and before.chosen.courses == front else None
    kept.graphs[quantity.name] = _Graph(
        x,
        y,
        look.measured,
        made or bundle(others, quantity, x, y, look.measured),
        made_front or bundle(front, quantity, x, y, look.measured),
    )
    return kept.graphs[quantity.name]


def _draw_graph(canvas: Canvas, number: int, graph: _Graph, quantity: Quantity, *, last: bool, some: bool) -> None:
    look, frame = canvas.look, canvas.frames[number]
    bare = replace(frame, y=replace(frame.y, label="", symbol=""))
    if not last:
        ticks = Ticks(frame.x_ticks.values, ("",) * len(frame.x_ticks.values), frame.x_ticks.minor)
        bare = replace(bare, x_ticks=ticks, x=replace(frame.x, label="", symbol=""))
    draw_axes(bare, look)
    drawing.text(frame.plot.left, frame.plot.top + 0.45 * look.text, quantity.label, look.text, look.ink)
    pointed = canvas.hit.trajectory if canvas.hit is not None else ""
    x = _whole_x(graph.x, frame)
    with drawing.in_axes(frame, x, graph.y) as bounds, drawing.clipped(frame.plot):
        many = len(graph.others.courses)
        faint = 0.22 if some else max(0.35, min(0.9, (20 / max(many, 1)) ** 0.5))
        width = max(1.0, (0.9 if some else 1.2) * look.scale)
        graph.others.lines.draw(alpha(look.measured, faint), width, thin=many > MOST_MARKED)
        graph.chosen.lines.draw(alpha(look.measured), 2.0 * look.scale)
        if graph.chosen.points is not None:
            graph.chosen.points.draw(look.point, bounds)
        if graph.others.points is not None and not some and many <= MOST_MARKED:
            graph.others.points.draw(look.point, bounds)
        if pointed:
            for each in (graph.others, graph.chosen):
                owner = next((i for i, one in enumerate(each.courses) if one.trajectory == pointed), -1)
                if owner >= 0:
                    drawing.Lines(each.ends[each.owner == owner]).draw(alpha(look.chosen), 2.2 * look.scale)


def _draw_lacking(canvas: Canvas, lowest: Quantity, count: int) -> None:
    """That some graphs have no room, beside the title of the lowest one."""
    look, plot = canvas.look, canvas.frames[len(canvas.frames) - 1].plot
    free = plot.width - look.measure(lowest.label) - look.text
    for words in (f"{count} more in a higher view", f"{count} more", f"+{count}"):
        if look.measure(words) <= free:
            drawing.text(plot.right, plot.top + 0.45 * look.text, words, look.text, look.faint, (1.0, 0.0))
            return


def _whole_x(x: Axis, frame: Frame) -> Axis:
    """The whole time axis in the unit that the frame shows."""
    factor = _factor_of(frame)
    return replace(x, limits=(x.limits[0] * factor, x.limits[1] * factor))


def _numbered(scene: bpy.types.Scene, x: Axis) -> Axis:
    """The time axis in seconds, or in frames of the scene."""
    if not scene.rockfall_motion.in_frames:
        return x
    rate = timing.frame_rate(scene)
    return replace(x, limits=(x.limits[0] * rate, x.limits[1] * rate), label=FRAMES)


FRAMES = "Frame"


def _factor_of(frame: Frame) -> float:
    """Units of the frame's time axis in a second."""
    return timing.frame_rate(bpy.context.scene) if frame.x.label == FRAMES else 1.0


def _seconds(scene: bpy.types.Scene, shown: float) -> float:
    return shown / timing.frame_rate(scene) if scene.rockfall_motion.in_frames else shown


def _pixel(frame: Frame, time_s: float) -> float:
    """Where a display time lies [px]."""
    return float(frame.plot.left + frame.x.places(np.array([time_s * _factor_of(frame)]))[0] * frame.plot.width)


def _impact_at(scene: bpy.types.Scene, course: MotionCourse, frame: Frame, x: float, scale: float) -> int:
    """Number of the impact whose time is under the mouse, 0 for none."""
    if not course.impact_time_s.size:
        return 0
    away = np.array([abs(_pixel(frame, time) - x) for time in course.impact_time_s.tolist()])
    i = int(np.argmin(away))
    return int(course.impact[i]) if away[i] <= MARK_PX * scale else 0


def _draw_impacts(
    canvas: Canvas, scene: bpy.types.Scene, courses: tuple[MotionCourse, ...], chosen: frozenset[str]
) -> None:
    """Lines at the impacts of what is selected; of few trajectories, short marks at all impacts."""
    look, frames = canvas.look, list(canvas.frames.values())
    strong, faint = [], []
    for course in courses:
        selected = course.trajectory in chosen
        if not selected and (len(courses) > MOST_MARKED):
            continue
        for time in course.impact_time_s.tolist():
            x = _pixel(frames[0], time)
            if not frames[0].plot.left <= x <= frames[0].plot.right:
                continue
            for frame in frames:
                plot = frame.plot
                high = plot.top if selected else plot.bottom + 0.35 * look.text
                (strong if selected else faint).append(((x, plot.bottom), (x, high)))
    if faint:
        drawing.lines(np.array(faint), alpha(look.faint, 0.8), look.line)
    if strong:
        drawing.lines(np.array(strong), alpha(look.faint, 0.55), look.line)


def _draw_cursor(canvas: Canvas, scene: bpy.types.Scene) -> None:
    """The scene's frame through all graphs, and what it is above them."""
    look, frames = canvas.look, list(canvas.frames.values())
    first, colour = frames[0].plot, CURSOR if look.dark else ON_LIGHT
    frame = clocks.current_frame(scene)
    x = _pixel(frames[0], frame / timing.frame_rate(scene))
    words = _moment(scene, frame)
    wide = look.measure(words)
    top = canvas.room.top - 0.4 * look.text
    if first.left <= x <= first.right:
        low = frames[-1].plot.bottom
        drawing.lines(np.array([(x, low), (x, top - 1.3 * look.text)]), alpha(colour), 1.6 * look.scale)
    left = min(max(x - wide / 2 - 0.5 * look.text, first.left), max(first.right - wide - look.text, first.left))
    area = Rectangle(round(left), round(top - 1.35 * look.text), round(wide + look.text), round(1.45 * look.text))
    drawing.fill(area, alpha(colour))
    drawing.text(
        area.left + area.width / 2, area.bottom + area.height / 2, words, look.text, mixed(look.plot, colour, 0.05)
        if look.dark else (1.0, 1.0, 1.0), (0.5, 0.5),
    )  # fmt: skip


def _moment(scene: bpy.types.Scene, frame: float) -> str:
    """Time and frame; the number of the picture where a video is shown."""
    text = (
        f"{frame / timing.frame_rate(scene):.2f} s, frame {frame:.4g}"
        if frame % 1
        else (f"{frame / timing.frame_rate(scene):.2f} s, frame {frame:.0f}")
    )
    camera = videos.active_camera(scene)
    if camera is None:
        return text
    return f"{text}, picture {clocks.true_frame(scene, camera)} of {camera.name}"


def _draw_card(canvas: Canvas, scene: bpy.types.Scene, courses: tuple[MotionCourse, ...]) -> None:
    """What is known of the trajectory under the mouse at that time."""
    hit: Hit = canvas.hit
    course = next((one for one in courses if one.trajectory == hit.trajectory), None)
    if course is None or canvas.pointer is None:
        return
    time_s = time_at(scene, canvas, canvas.pointer[0])
    title = f"{hit.trajectory}, impact {hit.impact}" if hit.impact else hit.trajectory
    if hit.impact:
        time_s = float(course.impact_time_s[course.impact == hit.impact][0])
    rows = [title, f"{time_s:.3f} s, frame {time_s * timing.frame_rate(scene):.1f}"]
    leaves_s = float(course.leaves_s[course.impact == hit.impact][0]) if hit.impact else time_s
    for quantity in _kept(scene).shown.quantities:
        value = course.at(quantity, time_s if quantity == RESIDUAL else leaves_s)
        if np.isfinite(value):
            after = " (after)" if hit.impact and quantity != RESIDUAL else ""
            rows.append(f"{quantity.title}: {value:.3g} {quantity.unit}{after}")
    drawing.card(canvas.pointer, rows, canvas.look, canvas.room)


def pick_of(scene: bpy.types.Scene, trajectory: str, impact: int) -> bpy.types.Object | None:
    """The pick of an impact, by its number within the trajectory."""
    found = [obj for obj in picks.objects_of(scene, [trajectory]) if obj.get(store.KIND) == "impact"]
    found.sort(key=lambda obj: float(obj[store.TIME]))
    return found[impact - 1] if 0 < impact <= len(found) else None
