# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of a simulation: releases.csv in; runs.csv, hits.csv and summary.json out."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from importlib import import_module
from pathlib import Path
from shutil import copyfileobj
from types import MappingProxyType
from typing import Any

import numpy as np

from ..analysis.likelihood_free import weighted_quantiles
from ..errors import InputError
from ..formats.shapefile import parts_beside
from ..georeference import GlobalShift
from ..hazard.screen_tally import ScreenTally
from ..hazard.screens import HELD
from ..impact_models.registry import find_model
from ..output import write_text
from ..reading import reader
from ..remarks import Remark, to_plain
from ..simulation.blocks import Blocks, draw_blocks
from ..simulation.convergence import Convergence, convergence
from ..simulation.engine import Settings, Simulation
from ..simulation.ground import Ground
from ..simulation.hits import hits_of
from ..simulation.parameter_draws import ParameterDraws
from ..simulation.release import Releases, make_releases, overlapping, placed_on, stated_places
from ..simulation.release_sources import check_number, check_size
from ..simulation.results import fell_through, release_names, run_figures
from ..simulation.tree_hits import tree_hits_of
from ..simulation.trees import LAW, NOT_KNOWN, Trees
from ..terrain.cloud import Cloud
from ..terrain.misplaced import unit_hint
from ..vectors import Array, Mask, norm
from .csv_text import read_table
from .decimal_tables import DecimalColumns, Words, write_decimal_table
from .simulation_parts import all_digits, in_parts
from .tables import POSITION, VELOCITY, vector_columns

SPIN = ("omegax_radps", "omegay_radps", "omegaz_radps")
NO_SCREENS: Mapping[str, ScreenTally] = MappingProxyType({})
DIAMETERS = ("d1_m", "d2_m", "d3_m")
RELEASES_REQUIRED = ("x_m", "y_m")
RELEASES_KNOWN = (
    *RELEASES_REQUIRED, "z_m", "release", *VELOCITY, *SPIN, *DIAMETERS, "diameter_m", "density_kgpm3", "number",
)  # fmt: skip
DEEP = 0.01
"""A release may be in the ground by this part of its radius, as rounded tables put it there."""


@reader("table of releases")
def read_releases(path: str | Path, ground: Ground, blocks: Blocks, number: int = 1, seed: int = 0) -> Releases:
    """Read releases.csv: places of blocks' centres in survey coordinates.

    Parameters
    ----------
    blocks, number : where the table does not say. Three diameters in a row make an ellipsoid where blocks are spheres.
    seed : of blocks that are drawn, each for itself.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row; a release beside the terrain or in the ground.

    Notes
    -----
    A release without z lies on the terrain, touching it.
    """
    table = read_table(path, RELEASES_REQUIRED, RELEASES_KNOWN)
    counts = table.numbers("number")
    counts = np.where(np.isnan(counts), number, counts)
    sizes = np.column_stack([table.numbers("diameter_m"), table.vectors(DIAMETERS)])
    density = table.numbers("density_kgpm3")
    for what, values in (("diameter", sizes), ("density", density[:, None])):
        for i in np.flatnonzero((values <= 0).any(axis=1))[:1].tolist():
            raise table.error(i, f"The {what} is {np.nanmin(values[i]):g}", "Give a number above zero")
    for i in np.flatnonzero(~((counts >= 1) & (counts == np.round(counts))))[:1].tolist():
        raise table.error(i, f"The number of blocks is {counts[i]:g}", "Give a whole number above zero")
    try:
        check_number(int(counts.sum()))
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error

    row = np.repeat(np.arange(len(table)), counts.astype(np.intp))
    drawn, drawn_density = draw_blocks(blocks, row.size, seed)
    one, three = sizes[row, :1], sizes[row, 1:]
    given: Mask = np.asarray(np.isfinite(three).all(axis=1))
    axes = np.where(given[:, None], three, np.where(np.isnan(one), drawn, one * drawn / drawn.mean(axis=1)[:, None]))
    density = np.where(np.isnan(density[row]), drawn_density, density[row])
    diameter = axes.mean(axis=1)
    check_size(ground, diameter)

    shift = ground.terrain.shift
    survey = np.column_stack(
        [table.numbers("x_m", required=True), table.numbers("y_m", required=True), table.numbers("z_m")]
    )
    placed = np.isnan(survey[row, 2])
    position = shift.to_local(np.where(np.isnan(survey), 0.0, survey))[row]
    if placed.any():
        position[placed] = placed_on(ground, position[placed, :2], diameter[placed])
        for i in np.flatnonzero(np.isnan(position[:, 2]))[:1].tolist():
            beside = unit_hint(shift.to_local(survey)[:, :2], ground.terrain)
            raise table.error(
                int(row[i]),
                "There is no terrain under this release",
                beside or "Correct it, or give a larger terrain",
            )
    velocity, spin = table.vectors(VELOCITY), table.vectors(SPIN)
    releases = make_releases(
        position,
        name=np.array(table.text("release"), dtype=np.str_)[row],
        velocity=np.where(np.isnan(velocity), 0.0, velocity)[row],
        angular_velocity=np.where(np.isnan(spin), 0.0, spin)[row],
        axes_m=axes,
        shape=np.where(given & (blocks.shape == "sphere"), "ellipsoid", blocks.shape),
        density_kgpm3=density,
        place=stated_places(survey)[row],
    )
    depth = overlapping(ground, releases)
    for i in np.flatnonzero(depth > DEEP * releases.radius_m)[:1].tolist():
        raise table.error(
            int(row[i]),
            f"This release is {depth[i]:.3g} m deep in the ground",
            "Raise z_m, or leave it empty to put it there",
        )
    return releases


def drawn_names(settings: Sequence[Settings]) -> tuple[str, ...]:
    """What blocks draw for themselves, with any of some models."""
    return tuple(dict.fromkeys(name for one in settings if one.draws is not None for name in one.draws.names))


def write_runs(simulations: Sequence[Simulation], path: str | Path, drawn: Sequence[str] | None = None) -> None:
    """Write runs.csv: one row per block and model; sizes and masses with all digits, other numbers with 6 decimals.

    Parameters
    ----------
    drawn : the parameters that have a column; None for those of the simulations, see `drawn_names`.

    Raises
    ------
    OSError : the file cannot be written.
    """
    names = drawn_names([one.settings for one in simulations]) if drawn is None else drawn
    parts = in_parts(simulations, lambda one: np.ones(len(one), np.intp), partial(_run_columns, names))
    write_decimal_table(path, parts, {"run": 0, "impacts": 0, "tree_hits": 0})


def _run_columns(drawn: Sequence[str], simulation: Simulation) -> DecimalColumns:
    releases, figures = simulation.releases, run_figures(simulation)
    shift, each = simulation.ground.shift, np.arange(len(simulation))
    return {
        "run": simulation.number,
        "release": Words(each, tuple(release_names(simulation).tolist())),
        "model": Words(np.zeros_like(each), (simulation.settings.model,)),
        "diameter_m": all_digits(each, releases.diameter_m),
        "mass_kg": all_digits(each, releases.mass_kg),
        **vector_columns(("x0_m", "y0_m", "z0_m"), shift.to_survey(releases.position)),
        **vector_columns(POSITION, shift.to_survey(simulation.position)),
        "time_s": simulation.time_s,
        "length_m": simulation.length_m,
        "impacts": simulation.impacts,
        "end": Words(simulation.end, simulation.ends),
        "v_max_mps": simulation.v_max_mps,
        "kinetic_max_J": figures.kinetic_max_j,
        "height_max_m": figures.height_max_m,
        "energy_line_deg": np.degrees(figures.energy_line),
        **({} if simulation.settings.trees is None else {"tree_hits": simulation.tree_hits}),
        **{f"drawn_{name}": _drawn(simulation, name) for name in drawn},
    }


def _drawn(simulation: Simulation, name: str) -> Array:
    """(n,) what each block drew of a parameter; NaN where its model draws none."""
    draws = simulation.settings.draws
    if draws is None or name not in draws.names:
        return np.full(len(simulation), np.nan)
    which = draws.set_of(simulation.settings.seed, simulation.number - 1)
    values: Array = draws.values[which, draws.names.index(name)]
    return values


def write_tree_hits(simulations: Sequence[Simulation], path: str | Path) -> None:
    """Write tree_hits.csv, 6 decimals: each time that a block meets a stem, and where its centre is then.

    Raises
    ------
    OSError : the file cannot be written.
    """
    parts = in_parts(simulations, lambda one: one.tree_hits, _tree_hit_columns)
    write_decimal_table(path, parts, {"run": 0})


def _tree_hit_columns(simulation: Simulation) -> DecimalColumns:
    hits, records, trees = tree_hits_of(simulation), simulation.records, simulation.settings.trees
    assert trees is not None
    run = records.run[hits.record]
    met, which = np.unique(hits.tree, return_inverse=True)
    return {
        "tree": Words(which, trees.labels(met)),
        "dbh_cm": 100 * trees.dbh_m[hits.tree],
        "run": simulation.number[run],
        "model": Words(np.zeros_like(run), (simulation.settings.model,)),
        "time_s": records.time_s[hits.record],
        **vector_columns(POSITION, simulation.ground.shift.to_survey(records.position[hits.record])),
        "up_m": hits.up_m,
        "offset": hits.offset,
        "v1_mps": norm(records.v1[hits.record]),
        "v2_mps": norm(records.v2[hits.record]),
        "kinetic1_J": hits.kinetic1_j,
        "kinetic2_J": hits.kinetic2_j,
        "loss_max_J": trees.energy_j[hits.tree],
        "deviation_deg": np.degrees(hits.deviation),
        "stands": Words(hits.stands.astype(np.intp), ("0", "1")),
    }


def write_hits(
    simulations: Sequence[Simulation], path: str | Path, at_screens: Mapping[str, ScreenTally] = NO_SCREENS
) -> None:
    """Write hits.csv, 6 decimals: each time that a block meets a structure or a screen, and where its centre is then.

    Parameters
    ----------
    at_screens : model → what passes screens. A hit passes unless a barrier holds the block. Hits of blocks that a
        barrier has held before are left out.

    Raises
    ------
    OSError : the file cannot be written.
    """
    parts = in_parts(simulations, lambda one: one.impacts, _hit_columns)
    parts += _screen_hits(at_screens, simulations[0].ground.shift)
    write_decimal_table(path, parts, {"run": 0})


def append_screen_hits(at_screens: Mapping[str, ScreenTally], shift: GlobalShift, path: Path) -> None:
    """Write what `write_hits` writes of screens behind the rows of a table, which is made where there is none.

    Raises
    ------
    OSError : the file cannot be written.
    """
    own = path.with_name(f"{path.name}.screens")
    write_decimal_table(own, _screen_hits(at_screens, shift), {"run": 0})
    if not path.exists():
        own.replace(path)
        return
    with own.open("rb") as rows, path.open("ab") as table:
        rows.readline()  # the header
        copyfileobj(rows, table)
    own.unlink()


def _screen_hits(at_screens: Mapping[str, ScreenTally], shift: GlobalShift) -> list[Callable[[], DecimalColumns]]:
    return [partial(_screen_hit_columns, model, tally, shift) for model, tally in at_screens.items()]


def _screen_hit_columns(model: str, tally: ScreenTally, shift: GlobalShift) -> DecimalColumns:
    hits = tally.hits
    hits = hits.take(hits.reaches)
    return {
        "structure": Words(hits.screen.astype(np.intp), tuple(screen.name for screen in tally.screens)),
        "run": hits.number,
        "model": Words(np.zeros(len(hits), np.intp), (model,)),
        "time_s": hits.time_s,
        **vector_columns(POSITION, shift.to_survey(hits.position)),
        "along_m": hits.along_m,
        "up_m": hits.up_m,
        "v_mps": norm(hits.velocity),
        "angle_deg": np.degrees(hits.angle),
        "kinetic_J": hits.kinetic_j,
        "rotational_J": hits.rotational_j,
        "passes": Words((hits.outcome != HELD).astype(np.intp), ("0", "1")),
    }


def _hit_columns(simulation: Simulation) -> DecimalColumns:
    records, hits = simulation.records, hits_of(simulation)
    run = records.run[hits.record]
    place = simulation.ground.shift.to_survey(records.position[hits.record])
    return {
        "structure": Words(hits.structure, simulation.ground.structures),
        "run": simulation.number[run],
        "model": Words(np.zeros_like(run), (simulation.settings.model,)),
        "time_s": records.time_s[hits.record],
        **vector_columns(POSITION, place),
        "along_m": hits.along_m,
        "up_m": hits.up_m,
        "v_mps": norm(records.v1[hits.record]),
        "angle_deg": np.degrees(hits.angle),
        "kinetic_J": hits.kinetic_j,
        "rotational_J": hits.rotational_j,
        "passes": Words(hits.passes.astype(np.intp), ("0", "1")),
    }


def summary(
    simulations: Sequence[Simulation], inputs: Mapping[str, Path], remarks: Sequence[Remark] = ()
) -> dict[str, Any]:
    """What summary.json says: inputs with their hashes, what all models share, then of each its counts and rate."""
    first = simulations[0]
    settings = first.settings
    return {
        "version": str(import_module((__package__ or "").partition(".core")[0]).__version__),
        "inputs": inputs_with_digests(inputs),
        "rolling": settings.rolling,
        "friction": settings.friction,
        "gravity_mps2": settings.gravity_mps2,
        "drag": settings.drag is not None,
        "seed": settings.seed,
        "first_run": first.first_run + 1,
        "blocks_wanted": first.wanted,
        "contact": "points" if isinstance(first.ground.terrain, Cloud) else "mesh",
        "point_spacing_m": {name: round(spacing, 6) for name, spacing in first.ground.spacing_m.items()},
        "triangles_without_area": first.ground.flat,
        "terrain": None if first.ground.faults is None else asdict(first.ground.faults),
        **({} if settings.trees is None else {"trees": _tree_summary(settings.trees)}),
        "models": {simulation.settings.model: _model_summary(simulation) for simulation in simulations},
        "remarks": to_plain(remarks),
    }


def _model_summary(simulation: Simulation) -> dict[str, Any]:
    settings, n = simulation.settings, len(simulation)
    run_out = np.hypot(*(simulation.position - simulation.releases.position)[:, :2].T)
    ends = np.bincount(simulation.end, minlength=len(simulation.ends))
    measured = settings.measured if find_model(settings.model).draws_from_impacts else None
    drawn = {} if measured is None else {"measured_impacts": len(measured), "left_out": dict(measured.left_out)}
    return {
        "parameters": dict(settings.parameters),
        **({} if settings.draws is None else {"drawn_parameters": _drawn_summary(settings.draws)}),
        **drawn,
        "zones": {name: dict(values) for name, values in settings.zones.items()},
        "zone_friction": dict(settings.zone_friction),
        "blocks": n,
        "ends": {name: int(count) for name, count in zip(simulation.ends, ends, strict=True)},
        "fell_through": int(fell_through(simulation).sum()),
        "impacts": int(simulation.impacts.sum()),
        **({} if settings.trees is None else {"tree_hits": int(simulation.tree_hits.sum())}),
        "seconds": round(simulation.seconds, 3),
        "blocks_per_s": round(n / simulation.seconds, 1),
        "run_out_m": _known(convergence(run_out, simulation.releases.place)),
        "v_max_mps": _known(convergence(simulation.v_max_mps, simulation.releases.place)),
    }


def _tree_summary(trees: Trees) -> dict[str, Any]:
    return {
        "number": len(trees),
        "dbh_mean_cm": round(float(100 * trees.dbh_m.mean()), 6),
        "dbh_sd_cm": round(float(100 * trees.dbh_m.std()), 6),
        "law": LAW,
        "not_known": NOT_KNOWN,
    }


def _drawn_summary(draws: ParameterDraws) -> dict[str, dict[str, float]]:
    """Of each parameter that blocks draw: how many sets, the mean, and where 95 % of the draws are."""
    ends = np.array([0.025, 0.975])
    return {
        name: {"sets": len(draws), "mean": round(draws.mean()[name], 6), "low": round(low, 6), "high": round(high, 6)}
        for i, name in enumerate(draws.names)
        for low, high in [weighted_quantiles(draws.values[:, i], draws.weight, ends).tolist()]
    }


def _known(values: Convergence) -> dict[str, float | None]:
    """For JSON, which has no NaN."""
    return {name: None if np.isnan(value) else round(value, 6) for name, value in asdict(values).items()}


def write_summary(values: dict[str, Any], path: str | Path) -> None:
    """Write summary.json."""
    write_text(path, json.dumps(values, indent=2, ensure_ascii=False) + "\n")


def inputs_with_digests(inputs: Mapping[str, Path]) -> dict[str, dict[str, str]]:
    """The files that decided a result, by what they are, and what belongs to them and stands beside them."""
    files: dict[str, Path] = {}
    for name, path in inputs.items():
        files |= {name: path, **{f"{name}{suffix}": file for suffix, file in parts_beside(path).items()}}
    return {name: {"file": path.name, "sha256": _digest(path)} for name, path in files.items()}


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
