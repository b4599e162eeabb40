# SPDX-License-Identifier: GPL-3.0-or-later
"""One point of a block, marked in pictures of a flight, and the spin that this measures.

The marks are kept with each video's camera. What they measure is kept with the pick that ends the flight; its angular
velocity is the pick's own, so that tables, energies and models have it.
"""

import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core.errors import RockfallError
from ...core.footage.advice import uncountable as uncountable_at
from ...core.reconstruction.flight_spins import FlightSpin
from ...core.reconstruction.refinement.views import View
from ...core.reconstruction.sightings import joined
from ...core.reconstruction.spin_marks import AXES, Axis, MarkedVideo, SpinMarks
from ...core.reconstruction.trajectory import Reconstruction
from ...core.vectors import Array
from ...core.workflow.spins import MeasuredSpins, measure_spins
from . import camera_paths, clocks, named_rows, picks, pictures, places, reconstruction, store, videos

COLUMNS = 7  # frame, video time, u, v, sigma, number of the axis, turns per second that were counted
AXIS, COUNTED = 5, 6
SEEN_WITH = (store.SPIN_MARK_ROWS, store.POSES, store.POSE_TIMES, store.CLOCK, store.ROW_TIME, store.CAMERA)
"""What a measurement depends on, besides the picks."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured of the flight that ends at a pick; see `FlightSpin`. `point` : (3,) unit, at `point_s`."""

    flight: int
    marks: int
    start_s: float
    end_s: float
    verdict: str
    axis: Axis
    rate: float
    sigma_rate: float
    omega: Array
    energy_j: float
    sigma_energy_j: float
    others: tuple[float, ...]
    remarks: tuple[str, ...]
    point_s: float
    point: Array
    print: int

    @property
    def is_known(self) -> bool:
        """Whether there is a spin."""
        return math.isfinite(self.rate)


def uncountable(scene: bpy.types.Scene, camera: bpy.types.Object, name: str) -> str:
    """That the rate of a video does not tell how fast the block of a trajectory turns; empty where it does."""
    flights = [obj for obj in store.with_role(scene, store.FLIGHTS_ROLE) if obj.get(store.TRAJECTORY) == name]
    speed = max((float(obj.get(store.TOP_SPEED, 0.0)) for obj in flights), default=0.0)
    rate = videos.capture_rate_of(camera) or float(videos.facts_of(camera).get("rate_hz", math.inf))
    return uncountable_at(rate, speed, places.block_of(scene, name).radius_m)


def names(scene: bpy.types.Scene) -> list[str]:
    """The trajectories with marks and picks."""
    marked = {name for camera in videos.cameras(scene) for name in names_in(camera)}
    return sorted(marked and marked & {obj[store.TRAJECTORY] for obj in picks.objects_of(scene)})


def names_in(camera: bpy.types.Object) -> list[str]:
    """The trajectories of which points were marked in a video."""
    return list(_tables(camera))


def marks_in(camera: bpy.types.Object, name: str) -> SpinMarks:
    """The marks of a trajectory in a video, in the order of time."""
    rows = _tables(camera).get(name, np.zeros((0, COLUMNS)))
    axis = np.array([AXES[int(number)] for number in rows[:, AXIS]], dtype=np.str_)
    frame = rows[:, 0].astype(np.intp)
    return SpinMarks(np.full(len(rows), name), frame, rows[:, 1], rows[:, 2:4], rows[:, 4], axis, rows[:, COUNTED])


def keep_marks(camera: bpy.types.Object, marks: SpinMarks) -> None:
    """Keep the marks of a table instead of those that its trajectories have."""
    tables = _tables(camera)
    for name in dict.fromkeys(marks.trajectory.tolist()):
        own = marks.trajectory == name
        axis = [AXES.index(each) for each in marks.axis[own].tolist()]
        tables[name] = np.column_stack(
            [marks.frame[own], marks.time_s[own], marks.pixel[own], marks.sigma_px[own], axis, marks.about[own]]
        )
    _keep(camera, tables)


def all_marks(camera: bpy.types.Object) -> SpinMarks | None:
    """The marks of all trajectories in a video; None without any."""
    parts = [marks_in(camera, name) for name in names_in(camera)]
    return joined(SpinMarks, parts) if parts else None


def mark(camera: bpy.types.Object, name: str, frame: int, video_s: float, pixel: Array, sigma_px: float) -> None:
    """Keep a mark; another one of the trajectory in this picture is replaced. Its axis is that of the ones before."""
    tables = _tables(camera)
    rows = tables.get(name, np.zeros((0, COLUMNS)))
    axis = rows[0, AXIS] if len(rows) else 0.0
    there = rows[rows[:, 0] == frame]
    counted = there[0, COUNTED] if len(there) else np.nan
    new = [frame, video_s, *pixel, sigma_px, axis, counted]
    tables[name] = np.vstack([rows[rows[:, 0] != frame], new])
    _keep(camera, tables)


def remove(camera: bpy.types.Object, name: str, frame: int | None = None) -> int:
    """Forget the mark in a picture, or all of the trajectory in this video; returns how many there were."""
    tables = _tables(camera)
    rows = tables.get(name, np.zeros((0, COLUMNS)))
    left = rows[rows[:, 0] != frame] if frame is not None else rows[:0]
    tables[name] = left
    _keep(camera, tables)
    return len(rows) - len(left)


def set_axis(scene: bpy.types.Scene, name: str, axis: str) -> None:
    """Assume another axis for all marks of a trajectory."""
    for camera in _with_marks(scene, name):
        tables = _tables(camera)
        tables[name][:, AXIS] = AXES.index(axis)
        _keep(camera, tables)


def set_counted(scene: bpy.types.Scene, name: str, start_s: float, end_s: float, turns_per_s: float) -> None:
    """Keep what was counted by eye with the marks of one flight, by its common times [s]; NaN forgets it."""
    for camera in _with_marks(scene, name):
        tables, marks = _tables(camera), marks_in(camera, name)
        time = _view(camera).exposed_at(marks.time_s, marks.pixel)
        tables[name][(time >= start_s) & (time <= end_s), COUNTED] = turns_per_s
        _keep(camera, tables)


def axis_of(scene: bpy.types.Scene, name: str) -> Axis:
    """The axis that is assumed for a trajectory."""
    return next((AXES[int(_tables(camera)[name][0, AXIS])] for camera in _with_marks(scene, name)), AXES[0])


def measure(scene: bpy.types.Scene, name: str) -> MeasuredSpins | None:
    """Measure the spins of a trajectory anew, and keep them with its picks; None without picks. `sync` shows them.

    Raises
    ------
    RockfallError : its flights cannot be computed.
    """
    members = picks.ordered(scene, picks.objects_of(scene, [name]))
    if not members:
        return None
    return _kept(scene, members, reconstruction.reconstruct_scene(scene, picks.read(scene, members)))


def measure_all(scene: bpy.types.Scene) -> list[FlightSpin]:
    """Measure the spins of all trajectories with marks whose flights can be computed."""
    flights: list[FlightSpin] = []
    for name in names(scene):
        try:
            measured = measure(scene, name)
        except RockfallError:
            continue  # the panel tells it
        flights += () if measured is None else measured.flights
    return flights


def follow(scene: bpy.types.Scene, members: Sequence[bpy.types.Object], result: Reconstruction) -> Reconstruction:
    """The reconstruction of one trajectory, with the spins that its marks measure on its flights as they are now.

    members : the objects of its picks.
    """
    name = str(result.picks.trajectory[0])
    if not _with_marks(scene, name) and not any(store.MEASURED_SPIN in obj for obj in members):
        return result
    before = [list(obj.get(store.SPIN, ())) for obj in members]
    _kept(scene, members, result)
    if before == [list(obj.get(store.SPIN, ())) for obj in members]:
        return result
    omega = np.array([list(obj.get(store.SPIN, (np.nan,) * 3)) for obj in members])
    return reconstruction.reconstruct_scene(scene, replace(result.picks, angular_velocity=omega))


def of(obj: bpy.types.Object) -> Measured | None:
    """What was measured of the flight that ends at a pick."""
    if store.MEASURED_SPIN not in obj:
        return None
    kept = store.read_json(obj, store.MEASURED_SPIN, {})
    for key in ("omega", "point"):
        kept[key] = np.array(kept[key], dtype=np.float64)
    return Measured(**kept | {key: tuple(kept[key]) for key in ("others", "remarks")})


def of_trajectory(scene: bpy.types.Scene, name: str) -> list[tuple[bpy.types.Object, Measured]]:
    """The picks of a trajectory that end a flight with marks, in the order of time, with what was measured."""
    found = [(obj, of(obj)) for obj in picks.objects_of(scene, [name])]
    return sorted(((obj, one) for obj, one in found if one is not None), key=lambda pair: pair[1].start_s)


def homeless(scene: bpy.types.Scene, name: str) -> list[str]:
    """Sentences on marks of a trajectory that are in no flight."""
    return store.read_json(scene, store.SPIN_REMARKS, {}).get(name, [])


def is_stale(scene: bpy.types.Scene, name: str) -> bool:
    """Whether a camera or clock has changed since the spins were measured."""
    now = _print(scene, name)
    return any(one.print != now for _, one in of_trajectory(scene, name))


def words(obj: bpy.types.Object) -> list[tuple[str, str]]:
    """The spin before a pick, as names and values with units; nothing where it is not known."""
    one = of(obj)
    if one is not None and one.is_known:
        turns, sigma = one.rate / (2 * math.pi), one.sigma_rate / (2 * math.pi)
        return [
            ("Spin before ω", f"{one.rate:.1f} ± {one.sigma_rate:.1f} rad/s"),
            ("Turns per second", f"{turns:.2f} ± {sigma:.2f}"),
            ("Rotational energy", f"{one.energy_j / 1e3:.2f} ± {one.sigma_energy_j / 1e3:.2f} kJ"),
        ]
    if store.SPIN in obj:
        rate = math.hypot(*obj[store.SPIN])
        return [("Spin before ω", f"{rate:.1f} rad/s"), ("Turns per second", f"{rate / (2 * math.pi):.2f}")]
    return []


def _kept(scene: bpy.types.Scene, members: Sequence[bpy.types.Object], result: Reconstruction) -> MeasuredSpins:
    """Measure one trajectory, and write what was found into the objects of its picks."""
    name = str(result.picks.trajectory[0])
    cameras = [camera for camera in _with_marks(scene, name) if camera_paths.is_solved(camera)]
    seen = [MarkedVideo(_view(camera), marks_in(camera, name)) for camera in cameras]
    found = measure_spins(result, seen, reconstruction.ground(scene))
    mark_print, by_pick = _print(scene, name), {one.last_pick: one for one in found.flights}
    for i, obj in enumerate(members):
        before, now = of(obj), by_pick.get(i)
        if now is None or now.spin is None:
            if before is not None and before.is_known:
                obj.pop(store.SPIN, None)
        elif list(obj.get(store.SPIN, ())) != (omega := now.spin.angular_velocity.tolist()):
            obj[store.SPIN] = omega
        if now is None:
            obj.pop(store.MEASURED_SPIN, None)
        elif obj.get(store.MEASURED_SPIN) != (text := _text(now, mark_print)):
            obj[store.MEASURED_SPIN] = text
    said = store.read_json(scene, store.SPIN_REMARKS, {})
    said.pop(name, None)
    if found.remarks:
        said[name] = [str(remark) for remark in found.remarks]
    if said or store.SPIN_REMARKS in scene:
        scene[store.SPIN_REMARKS] = json.dumps(said, ensure_ascii=False)
    return found


def _text(one: FlightSpin, mark_print: int) -> str:
    spin = one.spin
    kept = {
        "flight": one.flight,
        "marks": int(one.mark_time_s.size),
        "start_s": one.start_time_s,
        "end_s": one.end_time_s,
        "verdict": one.verdict,
        "axis": one.axis,
        "rate": math.nan if spin is None else spin.rate,
        "sigma_rate": math.nan if spin is None else spin.sigma_rate,
        "omega": [math.nan] * 3 if spin is None else spin.angular_velocity.tolist(),
        "energy_j": one.energy_j,
        "sigma_energy_j": one.sigma_energy_j,
        "others": one.others,
        "remarks": [str(remark) for remark in one.remarks],
        "point_s": float(one.mark_time_s[0]) if one.mark_time_s.size else math.nan,
        "point": one.direction[0].tolist() if len(one.direction) else [math.nan] * 3,
        "print": mark_print,
    }
    return json.dumps(kept, ensure_ascii=False)


def _print(scene: bpy.types.Scene, name: str) -> int:
    """Of all that the spins of a trajectory were measured with, but for its picks."""
    code = 0
    for camera in _with_marks(scene, name):
        for key in SEEN_WITH:
            code = zlib.crc32(np.array(camera.get(key, ()), dtype=np.float64), code)
    return code


def _view(camera: bpy.types.Object) -> View:
    return View(camera.name, pictures.aligned_path(camera), clocks.clock_of(camera), videos.row_time_of(camera))


def _with_marks(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    return [camera for camera in videos.cameras(scene) if store.SPIN_MARK_NAMES in camera and name in names_in(camera)]


def _tables(camera: bpy.types.Object) -> dict[str, Array]:
    """Name → (m, 7) rows."""
    return named_rows.tables(camera, store.SPIN_MARK_NAMES, store.SPIN_MARK_ROWS, COLUMNS)


def _keep(camera: bpy.types.Object, tables: dict[str, Array]) -> None:
    named_rows.keep(camera, store.SPIN_MARK_NAMES, store.SPIN_MARK_ROWS, tables)
