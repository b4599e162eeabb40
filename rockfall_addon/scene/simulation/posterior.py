# SPDX-License-Identifier: GPL-3.0-or-later
"""What a back-analysis has found, kept with the scene: simulated blocks draw their parameters from it if asked to."""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....core.analysis.likelihood_free import weighted_quantiles
from ....core.analysis.posterior_checks import doubts_of
from ....core.exchange.posterior_tables import read_posterior, write_posterior
from ....core.remarks import Remark, from_plain
from ....core.simulation.parameter_draws import ParameterDraws
from ..storage import store

OF_SCENE = ("SCENE", "", "", "", ";;")
"""The measured trajectories of the scene."""
INTERVAL = np.array([0.025, 0.5, 0.975])


@dataclass(frozen=True)
class Row:
    """One parameter: its median and 95 % interval, what was thought possible before, what it is worth, what is left."""

    name: str
    unit: str
    median: float
    low: float
    high: float
    prior: str
    remarks: tuple[Remark, ...]
    left: str = ""


@dataclass(frozen=True, eq=False)
class Kept:
    """What the scene keeps.

    Attributes
    ----------
    model : whose parameters. draws : of them.
    rows : one for each.
    said : of how many runs it is; empty when read from a table.
    remarks : what it is worth, the gravest first.
    print : of all that it was computed from; empty when read from a table.
    observed : where the runs came from: the scene, or which kind of tables, and their files.
    """

    model: str
    draws: ParameterDraws
    rows: tuple[Row, ...]
    said: str
    remarks: tuple[Remark, ...]
    print: str
    observed: tuple[str, ...]


def kept_of(scene: bpy.types.Scene) -> Kept | None:
    """What the scene keeps; None without."""
    if store.BACK_ANALYSIS not in scene:
        return None
    return _kept(str(scene[store.BACK_ANALYSIS]))


@lru_cache(maxsize=4)
def _kept(text: str) -> Kept:
    found = json.loads(text)  # checked when the file was opened
    rows = tuple(Row(*each[:6], tuple(from_plain(each[6], "note")), *each[7:]) for each in found["rows"])
    return Kept(
        found["model"], draws_in(found), rows, found["said"], tuple(from_plain(found["remarks"], "note")),
        found["print"], tuple(found.get("observed", OF_SCENE)),
    )  # fmt: skip


def draws_in(found: Mapping[str, Any]) -> ParameterDraws:
    """The draws of what is kept as text."""
    told = {row[0]: f"{row[5]}: {row[7]}" for row in found["rows"] if len(row) > 7 and row[5]}
    before = tuple(told[name] for name in found["names"]) if set(told) >= set(found["names"]) else ()
    values, doubts = np.array(found["values"], dtype=float), doubts_of(from_plain(found["remarks"], "note"))
    return ParameterDraws(tuple(found["names"]), values, np.array(found["weight"]), before=before, doubts=doubts)


def keep(scene: bpy.types.Scene, model: str, draws: ParameterDraws, **more: object) -> None:
    """Keep a posterior; `rows`, `said`, `remarks`, `print` and `observed` where they are known."""
    ends = [weighted_quantiles(column, draws.weight, INTERVAL).tolist() for column in draws.values.T]
    plain = [[name, "", mid, low, high, "", []] for name, (low, mid, high) in zip(draws.names, ends, strict=True)]
    content = {"rows": plain, "said": "", "remarks": [], "print": ""} | more
    scene[store.BACK_ANALYSIS] = json.dumps(
        {"model": model, "names": draws.names, "values": draws.values.tolist(), "weight": draws.weight.tolist()}
        | content
    )


def forget(scene: bpy.types.Scene) -> None:
    """Keep none any more."""
    scene.pop(store.BACK_ANALYSIS, None)


def in_use(scene: bpy.types.Scene, models: Collection[str]) -> Kept | None:
    """What blocks of one of these models draw from; None where they have the parameters of the panels."""
    if store.BACK_ANALYSIS not in scene or not scene.rockfall_back_analysis.draw:
        return None
    kept = kept_of(scene)
    return kept if kept is not None and kept.model in models else None


def fingerprint(scene: bpy.types.Scene, models: Collection[str]) -> str:
    """Of what blocks draw from."""
    if in_use(scene, models) is None:
        return ""
    return hashlib.sha1(str(scene[store.BACK_ANALYSIS]).encode(), usedforsecurity=False).hexdigest()


def write(kept: Kept, path: Path) -> None:
    """Write posterior.csv."""
    write_posterior(kept.model, kept.draws, path)


def read(scene: bpy.types.Scene, path: Path) -> None:
    """Keep what posterior.csv says, and let blocks draw from it.

    Raises
    ------
    InputError : see `read_posterior`.
    """
    model, draws = read_posterior(path)
    keep(scene, model, draws)
    scene.rockfall_back_analysis.draw = True
