# SPDX-License-Identifier: GPL-3.0-or-later
"""Screens and barriers from lines and areas of a map, and screens.csv: what is known of them.

An area is a screen along its outline. Properties of a line or area, or further columns of a table of points, are
``height_m`` and ``capacity_kJ``: with both it is a barrier, which holds blocks; else it measures.
"""

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..formats.csv_cells import CellWriter
from ..georeference import GlobalShift
from ..hazard.design import DesignValues, design_of
from ..hazard.screen_tally import Known, ScreenFigures, ScreenTally
from ..hazard.screens import OUTCOMES, Screen
from ..output import output_stream
from ..reading import reader
from ..vectors import Array
from .map_shapes import MapShape, read_shapes
from .simulation_entry import ScreenEntry
from .zones import SHAPEFILE_LETTERS

HEIGHT, CAPACITY = "height_m", "capacity_kJ"
COLUMNS = (
    "screen", "model", "barriers", "height_m", "capacity_kJ", "length_m", "blocks", "reach", "share", "hits",
    *OUTCOMES[1:], "quantity", "unit", "mean", "median", "q95", "q95_low", "q95_high", "q99", "q99_low", "q99_high",
    "greatest", "worth", "factors", "verdict", "more_blocks",
)  # fmt: skip
"""Those of screens.csv."""
QUANTITIES = (("speed", "m/s", "speed_mps", 1.0), ("energy", "kJ", "energy_j", 1e-3), ("height", "m", "height_m", 1.0))


@reader("map of screens")
def read_screens(path: str | Path, shift: GlobalShift) -> tuple[Screen, ...]:
    """The lines of a file, and the outlines of its areas, as screens; those without a name have the file's.

    Raises
    ------
    InputError : see `read_shapes` and `Screen`; an area with a hole, a capacity without a height, a value that
        is no number.
    """
    path, shapes = Path(path), read_shapes(path, shift)
    found = []
    for number, shape in enumerate(shapes, start=1):
        name = shape.name or (path.stem if len(shapes) == 1 else f"{path.stem} {number}")
        height, capacity = (_number(shape, name, key, path) for key in (HEIGHT, CAPACITY))
        _refuse_nearly(shape, name, path)
        try:
            if capacity is not None and height is None:
                raise InputError(f"Barrier {name!r} has a capacity and no height", advice=f"Give it {HEIGHT} as well")
            height_m = np.inf if height is None else height
            capacity_j = None if capacity is None else 1000 * capacity
            found.append(Screen(name, _line_of(shape, name), height_m, capacity_j, shapes.remarks))
        except InputError as error:
            raise InputError(error.problem, file=path, advice=error.advice) from error
    return tuple(found)


def screens_of(entries: Sequence[ScreenEntry], shift: GlobalShift) -> tuple[Screen, ...]:
    """The screens that a project states, its maps read.

    Raises
    ------
    InputError : see `read_screens` and `Screen`.
    """
    found: list[Screen] = []
    for entry in entries:
        if entry.file is not None:
            found += read_screens(entry.file, shift)
            continue
        survey = np.array([(*point[:2], 0.0) for point in entry.points_m])
        capacity_j = None if entry.capacity_kj is None else 1000 * entry.capacity_kj
        height_m = np.inf if entry.height_m is None else entry.height_m
        found.append(Screen(entry.name, shift.to_local(survey)[:, :2].copy(), height_m, capacity_j))
    return tuple(found)


def entry_of(screen: Screen, shift: GlobalShift) -> ScreenEntry:
    """A screen as a project states it."""
    survey = shift.to_survey(np.column_stack([screen.line, np.zeros(len(screen.line))]))[:, :2]
    height_m = screen.height_m if np.isfinite(screen.height_m) else None
    capacity_kj = None if screen.capacity_j is None else screen.capacity_j / 1000
    points = tuple((x, y) for x, y in survey.tolist())
    return ScreenEntry(screen.name, None, points, height_m, capacity_kj)


def write_screens(
    tallies: Mapping[str, ScreenTally],
    path: str | Path,
    values: Mapping[str, Mapping[str, DesignValues]] | None = None,
) -> None:
    """Write screens.csv: a row for each screen, model and quantity, without barriers and, where there are any, with.

    Parameters
    ----------
    tallies : model → what passes the screens.
    values : model → screen → what a barrier there must have, with the verdict on the one that stands there; None for
        that of the 95 % values without partial factors.
    """
    if values is None:
        values = {model: design_of(tally) for model, tally in tallies.items()}
    with output_stream(path) as stream:
        writer = CellWriter(stream)
        writer.writerow(COLUMNS)
        for model, tally in tallies.items():
            for barriers in (False, True) if any(screen.holds for screen in tally.screens) else (False,):
                for figures in tally.figures(with_barriers=barriers):
                    own = values.get(model, {}).get(figures.screen.name) if barriers else None
                    writer.writerows(_rows(model, barriers, figures, own))


def _rows(model: str, barriers: bool, figures: ScreenFigures, values: DesignValues | None) -> Iterable[list[object]]:
    screen = figures.screen
    outcomes = [figures.outcomes[name] if screen.holds else "" for name in OUTCOMES[1:]]
    capacity = "" if screen.capacity_j is None else screen.capacity_j / 1000
    height = screen.height_m if np.isfinite(screen.height_m) else ""
    first = [
        screen.name, model, int(barriers), height, capacity, f"{screen.length_m:.3f}", figures.blocks, figures.reach,
        f"{figures.share:.6f}", figures.hits, *outcomes,
    ]  # fmt: skip
    for name, unit, attribute, factor in QUANTITIES:
        known: Known | None = getattr(figures, attribute)
        if known is None:
            yield [*first, name, unit, *[""] * 10, *_verdict(values)]
            continue
        median, q95, q99 = known.quantiles
        cells = (
            known.mean, median.value, q95.value, q95.low, q95.high, q99.value, q99.low, q99.high, known.greatest,
        )  # fmt: skip
        numbers = ("" if value != value else f"{factor * value:.6f}" for value in cells)
        yield [*first, name, unit, *numbers, f"{q95.effective:.1f}", *_verdict(values)]


def _verdict(values: DesignValues | None) -> list[object]:
    """The table of partial factors, the verdict on a barrier with them, and how many more blocks would tell."""
    if values is None or values.verdict is None:
        return ["", "", ""]
    more = values.more
    return [values.factors.title, values.verdict, "" if more is None else more.blocks]


def _line_of(shape: MapShape, name: str) -> Array:
    """(k, 2) of a line; of an area its outline, closed."""
    if len(shape.parts) > 1:
        raise InputError(
            f"The area of screen {name!r} has holes", advice="Give each outline as an area, or a line, of its own"
        )
    line = shape.parts[0][:, :2]
    return np.ascontiguousarray(line if shape.kind == "line" else np.vstack([line, line[:1]]))


def _number(shape: MapShape, name: str, key: str, path: Path) -> float | None:
    value = shape.properties.get(key, shape.properties.get(key[:SHAPEFILE_LETTERS]))
    if value is None or value == "":
        return None
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(f"{key} of screen {name!r} is {value!r}", file=path, advice="Give a number") from None


def _refuse_nearly(shape: MapShape, name: str, path: Path) -> None:
    """A property that is nearly one of ours must not be passed over."""
    ours = {HEIGHT.lower(): HEIGHT, CAPACITY.lower(): CAPACITY}
    for key in shape.properties:
        near = get_close_matches(key.lower(), ours, n=1, cutoff=0.75)
        if near and key not in (HEIGHT, CAPACITY, CAPACITY[:SHAPEFILE_LETTERS]):
            raise InputError(
                f"Screen {name!r} has {key}",
                file=path,
                advice=f"Call it {ours[near[0]]} if that is meant, or take it out",
            )
