# SPDX-License-Identifier: GPL-3.0-or-later
"""What each stored value must be to be used: foreign add-ons, merged files and people write into a .blend, too.

A check takes the value as Blender gives it and says what is wrong with it, or nothing.
"""

import json
import math
from collections.abc import Callable, Collection
from difflib import get_close_matches
from functools import lru_cache

import numpy as np

from ....core.errors import RockfallError
from ....core.exchange.parameters import checked_parameters
from ....core.exchange.project import RenderPreset
from ....core.impact_models.registry import MODELS, find_model
from ....core.plausibility import GREATEST_M, OF_UNIT, limits
from ....core.reconstruction.block import Block
from ....core.reconstruction.picks import KINDS, STATUSES
from ....core.remarks import from_plain, from_text
from ....core.simulation.parameter_draws import ParameterDraws, check_draws
from ..picks import impact_numbers
from . import store

type Check = Callable[[object], str]

NO_NUMBER, NOT_FINITE, NO_TEXT, NO_JSON = "is no number", "is not finite", "is no text", "is no readable JSON"
BEYOND = "is beyond what can be"


def number(least: float = -math.inf, most: float = math.inf) -> Check:
    """A finite number between two, which are allowed."""

    def check(value: object) -> str:
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            return NO_NUMBER
        if not math.isfinite(value):
            return NOT_FINITE
        return "" if least <= value <= most else BEYOND

    return check


def numbers(many: int, least: float = -math.inf, most: float = math.inf) -> Check:
    """So many of them."""
    what = "is no list of 1 number" if many == 1 else f"is no list of {many} numbers"

    def check(value: object) -> str:
        if getattr(value, "typecode", "") not in ("d", "f", "i") or len(value) != many:
            return what
        values = value.to_list()
        if not all(map(math.isfinite, values)):
            return NOT_FINITE
        return "" if all(least <= each <= most for each in values) else BEYOND

    return check


def count(value: object) -> str:
    """A whole number from 0 on."""
    if not isinstance(value, int) or isinstance(value, bool):
        return "is no whole number"
    return "" if 0 <= value < 2**30 else BEYOND  # Blender keeps 32 bits, and some are counted up


def one_of(known: Collection[str]) -> Check:
    """One of some words."""

    def check(value: object) -> str:
        if value in known:
            return ""
        near = get_close_matches(value.lower(), known, n=1) if isinstance(value, str) else []
        return f"is none of {', '.join(known)}{f' (did you mean {near[0]}?)' if near else ''}"

    return check


def name(value: object) -> str:
    """A text that is not empty."""
    return "" if isinstance(value, str) and value else NO_TEXT if value != "" else "is empty"


def text(value: object) -> str:
    """A text, which may be empty."""
    return "" if isinstance(value, str) else NO_TEXT


def group(value: object) -> str:
    """Values by name."""
    return "" if hasattr(value, "to_dict") else "is no group of values"


def direction(value: object) -> str:
    """A vector that has a length."""
    return _vector(value) or ("" if any(value) else "has length zero")


def json_of(kind: type, inner: Callable[[object], object] | None = None) -> Check:
    """A text of JSON that holds an object (dict) or a list.

    inner : is given what it holds, and raises an error if that cannot be used.
    """
    what = "no JSON object" if kind is dict else "no JSON list"

    @lru_cache(maxsize=4096)  # the same texts are looked at after every undo
    def problem(value: str) -> str:
        try:
            found = json.loads(value)
        except (ValueError, RecursionError):
            return NO_JSON
        if not isinstance(found, kind):
            return f"is {what}"
        if inner is not None:
            try:
                inner(found)
            except (RockfallError, ArithmeticError, AttributeError, IndexError, KeyError, TypeError, ValueError):
                return "does not hold what it should"
        return ""

    return lambda value: problem(value) if isinstance(value, str) else NO_TEXT


def block_problem(values: object) -> str:
    """What is wrong with the diameters and the density of a block."""
    try:
        Block(*values)
    except RockfallError as error:
        return str(error)
    except TypeError:
        return "The block is not given by three diameters and a density."
    return ""


def model_problem(model: str, values: object) -> str:
    """What is wrong with the parameters of a model."""
    if not isinstance(values, dict):
        return f"{model} has no table of parameters."
    try:
        checked_parameters({model: values}, "")
    except (RockfallError, TypeError, ValueError) as error:
        return str(error)
    return ""


def _numbers_by_name(found: dict) -> None:
    if any(number()(value) for value in found.values()):
        raise ValueError


def _texts_by_name(found: dict) -> None:
    if not all(isinstance(value, str) for value in found.values()):
        raise TypeError


def _remarks_by_name(found: dict) -> None:
    for values in found.values():
        _ = [remark.text + remark.severity for remark in from_plain(values)]


def _pairs_by_name(found: dict) -> None:
    for low, high in found.values():
        if number()(low) or number()(high):
            raise ValueError


def _lists_by_name(found: dict) -> None:
    if not all(isinstance(value, list) for value in found.values()):
        raise TypeError


def _having(*names: str) -> Callable[[dict], object]:
    return lambda found: [found[name] for name in names]


def _rows_of_keys(found: list) -> None:
    for frame, x, y, z, identifier, state in found:
        if any(number()(value) for value in (frame, x, y, z)) or not isinstance(identifier, str):
            raise ValueError
        for key, value in state.items():
            many = 0 if key == store.TIME else 3  # what `block_keys.STATE` has
            if (many and len(value) != many) or any(number()(one) for one in (value if many else [value])):
                raise ValueError


def _presets(found: list) -> None:
    for values in found:
        RenderPreset(**values)


def _remarks(value: object) -> str:
    try:
        _ = [remark.text + remark.severity for remark in from_text(value)]
    except (AttributeError, TypeError, ValueError):
        return "is no list of remarks"
    return ""


def _default_block(value: object) -> str:
    return numbers(4)(value) or block_problem(value)


def _models(value: object) -> str:
    known = isinstance(value, str) and all(each in MODELS for each in value.split())
    return "" if known else "names no models"


def _impact(value: object) -> str:
    """The numbers of an impact, which may be unknown but for its own."""
    if getattr(value, "typecode", "") != "d" or len(value) != impact_numbers.WIDTH:
        return f"is no list of {impact_numbers.WIDTH} numbers"
    return "" if value[0].is_integer() and value[0] >= 0 else "is of no impact"


_vector = numbers(3, -GREATEST_M, GREATEST_M)
_finite_vector = numbers(3)
_sigma = numbers(1, 0.0)
_second = number(-OF_UNIT["s"], OF_UNIT["s"])
_rate = number(0.0, OF_UNIT["hz"])
_frame = number(-1e9, 1e9)

OF_A_PICK: dict[str, Check] = {
    store.TRAJECTORY: name,
    store.TIME: _second,
    store.POSITION: _vector,
    store.KIND: one_of(KINDS),
    store.STATUS: one_of(STATUSES),
}
"""What no pick can be without."""

OF_A_SPIN = (
    "flight", "marks", "start_s", "end_s", "verdict", "axis", "rate", "sigma_rate", "omega", "energy_j",
    "sigma_energy_j", "others", "remarks", "point_s", "point", "print",
)  # fmt: skip
BESIDE_A_PICK: dict[str, Check] = {
    store.ID: name,
    store.NORMAL: direction,
    store.SPIN: _finite_vector,
    store.SIGMA_TIME: _sigma,
    store.SIGMA_POSITION: _sigma,
    store.ROW: count,
    store.EXTRA: group,
    store.KEY_FRAME: _frame,
    store.PICK_SHIFT: _vector,
    store.SEEN: group,
    store.RESULT: _impact,
    store.FLAGS: text,
    store.MEASURED_SPIN: json_of(dict, _having(*OF_A_SPIN)),
    store.WRITTEN: count,
}
"""What a pick can be without; where it is missing, nothing is wrong."""

OF_KEYS: dict[str, Check] = {store.WRITTEN: count, store.BLOCK_KEYS: json_of(list, _rows_of_keys)}
"""Of the action of a block."""


def _results_at_screens(value: object) -> None:
    """What a simulation has found at screens, if there were any."""
    for result in value.get(store.AT_SCREENS, []):
        for known in (result[key] for key in ("energy_kj", "height_m", "speed_mps")):
            if known is not None:
                _first, _low, _high = known
        if not all(isinstance(result[key], int) for key in ("blocks", "reach", "reach_with_barriers", "hits")):
            raise ValueError(result)
        if "verdict" in result and not (
            result["verdict"] in ("enough", "not_enough", "not_known")
            and isinstance(result["more"], str)
            and isinstance(result["barrier"], list)
        ):
            raise ValueError(result)


def _texts(found: list) -> None:
    if not all(isinstance(value, str) for value in found):
        raise TypeError


def _posterior(value: dict) -> None:
    """Draws that the model can have, and a row for each parameter."""
    draws = ParameterDraws(tuple(value["names"]), np.array(value["values"], float), np.array(value["weight"], float))
    check_draws(draws, find_model(value["model"]))
    if not all(isinstance(value[key], str) for key in ("said", "print")):
        raise TypeError
    for row in value["rows"]:
        called, unit, median, low, high, prior, remarks, *left = row
        if any(number()(each) for each in (median, low, high)) or len(left) > 1:
            raise ValueError(row)
        _texts([called, unit, prior, *left])
        _ = [remark.text + remark.severity for remark in from_plain(remarks)]
    _ = [remark.text + remark.severity for remark in from_plain(value["remarks"])]
    if (observed := value.get("observed")) is not None:
        kinds, _picks, _releases, _stops, _sections = observed
        _texts(observed)
        if not kinds or not set(kinds.split()) <= {"SCENE", "PICKS", "STOPS"}:
            raise ValueError(observed)


AGAIN = "it was computed again"
OF_A_FIT = ("model", "imitated", "names", "print", "rows", "set_b", "sets", "models")
OF_THE_SCENE: dict[str, tuple[Check, str]] = {
    store.SHIFT: (_vector, "the survey coordinates of the origin are not known"),
    store.GRAVITY: (number(0.0, limits(store.GRAVITY.removeprefix("rockfall_"))[1]), "gravity is the usual one"),
    store.NORMAL_RADIUS: (number(0.0, GREATEST_M), "the radius that the panel shows is used"),
    store.DEFAULT_BLOCK: (_default_block, "the block that the panel shows is used"),
    store.BLOCKS: (json_of(dict), "all trajectories have the block that the panel shows, and its mass and energies"),
    store.DRAG: (numbers(2, 0.0, limits("air_density_kgpm3")[1]), "the usual drag of air is used"),
    store.TIME_ORIGIN: (_second, "the timeline begins with the first pick"),
    store.OFFSETS: (json_of(dict, _numbers_by_name), AGAIN),
    store.KEYED_RATE: (_rate, AGAIN),
    store.TICK_RATE: (_rate, AGAIN),
    store.SHOWN: (json_of(dict, _texts_by_name), AGAIN),
    store.PROBLEM: (_remarks, AGAIN),
    store.TRAJECTORY_PROBLEMS: (json_of(dict, _remarks_by_name), AGAIN),
    store.SPIN_REMARKS: (json_of(dict, _lists_by_name), AGAIN),
    store.SHOWN_MODELS: (_models, "no models are shown"),
    store.MODEL_PARAMETERS: (json_of(dict), "the models have their defaults"),
    store.OTHER_PARAMETERS: (json_of(dict), "the second set of parameters has the defaults"),
    store.GRAPH_CHOSEN: (json_of(dict, _lists_by_name), "no impacts of other sites are selected"),
    store.FIT: (json_of(dict, _having(*OF_A_FIT)), "nothing is proposed: fit again"),
    store.MOTION_LIMITS: (json_of(dict, _pairs_by_name), "the axes of the motion graphs have no limits of their own"),
    store.SIMULATION: (json_of(dict, _results_at_screens), "simulate again to know what is shown"),
    store.BACK_ANALYSIS: (json_of(dict, _posterior), "blocks have the parameters of the panels: analyse again"),
    store.KNOWN_VIDEOS: (json_of(dict, _texts_by_name), "videos that were deleted before are not missed"),
    store.PROPOSAL: (json_of(dict, _having("ids", "names", "prints")), "nothing is proposed: refine again"),
    store.SITE_MORE: (json_of(dict, _texts_by_name), "credits and DOI are not known: open the project again"),
    store.RENDER_PRESETS: (json_of(list, _presets), "the project has no films of its own"),
}  # fmt: skip
"""Key → how it is checked, and what holds as long as it cannot be used."""
