# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solved camera rests on, kept with it, so that whatever is measured with the camera can say so."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..remarks import Remark

FEW_SPARE = 6
"""With so few observations more than unknowns neither a wrong pair nor a wrong lens shows."""


@dataclass(frozen=True)
class CameraQuality:
    """From what a camera was solved.

    Attributes
    ----------
    pairs : how many it rests on.
    redundancy : observations more than unknowns.
    left_out : names of the pairs that were left out as wrong.
    asked : names of pairs that are used, and that should be looked at again: the camera hangs on them.
    sigma_position_m : of the position, in the direction in which it was known worst [m]; infinite where it was not.
    """

    pairs: int
    redundancy: int
    left_out: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    sigma_position_m: float = float("nan")


def remarks_on_quality(quality: CameraQuality | None, camera: str) -> tuple[Remark, ...]:
    """What whoever uses the camera should know: nothing where it is well checked, or not known.

    Parameters
    ----------
    camera : its name, or that of its file.
    """
    if quality is None or not (quality.redundancy <= FEW_SPARE or quality.asked):
        return ()
    text = f"All that is measured with the camera {camera} rests on {_counted(quality.pairs, 'pair')}"
    if quality.left_out:
        text += f", after {_named(quality.left_out)} {'was' if len(quality.left_out) == 1 else 'were'} left out"
    text += f" ({_counted(quality.redundancy, 'observation')} more than unknowns)"
    if quality.sigma_position_m > 0:
        known = f"to {quality.sigma_position_m:.2g} m" if np.isfinite(quality.sigma_position_m) else "not at all"
        text += f": its position is known {known} (standard deviation)"
    text += "."
    if quality.asked:
        text += f" It hangs on {_named(quality.asked)}: look at {'it' if len(quality.asked) == 1 else 'them'} again."
    if quality.redundancy <= FEW_SPARE:
        text += " A wrong pair would hardly show. Add pairs (10 or more are good), near and far, out to the edges."
    return (Remark(text, "warning", f"camera {camera}"),)


def to_plain(quality: CameraQuality) -> dict[str, int | float | list[str]]:
    """For files: what is not known is left out."""
    values: dict[str, int | float | list[str]] = {"pairs": quality.pairs, "redundancy": quality.redundancy}
    values |= {"left_out": list(quality.left_out)} if quality.left_out else {}
    values |= {"asked": list(quality.asked)} if quality.asked else {}
    return values | ({} if np.isnan(quality.sigma_position_m) else {"sigma_position_m": quality.sigma_position_m})


def from_plain(values: Mapping[str, object]) -> CameraQuality:
    """From what `to_plain` gave."""
    names = {key: tuple(str(name) for name in _list(values.get(key))) for key in ("left_out", "asked")}
    numbers = {key: _number(values.get(key)) for key in ("pairs", "redundancy", "sigma_position_m")}
    return CameraQuality(
        int(numbers["pairs"]), int(numbers["redundancy"]), **names, sigma_position_m=numbers["sigma_position_m"]
    )


def _list(value: object) -> list[object]:
    return list(value) if isinstance(value, (list, tuple)) else []


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) else float("nan")


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _named(names: tuple[str, ...]) -> str:
    return f"pair {names[0]}" if len(names) == 1 else f"pairs {', '.join(names)}"
