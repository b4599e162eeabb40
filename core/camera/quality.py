# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solved camera rests on, kept with it, so that whatever is measured with the camera can say so."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..remarks import Remark
from ..vectors import Array
from .model import INTRINSICS

POSE = ("rx", "ry", "rz", "x", "y", "z")
"""The pose's parameters: turns about the camera's own axes [rad], and the position [m]."""
PARAMETERS = (*POSE, *INTRINSICS)

FEW_SPARE = 6
"""With so few observations more than unknowns neither a wrong pair nor a wrong lens shows."""


@dataclass(frozen=True, eq=False)
class CameraQuality:
    """From what a camera was solved.

    Attributes
    ----------
    pairs : how many it rests on.
    redundancy : observations more than unknowns.
    left_out : names of the pairs that were left out as wrong.
    asked : names of pairs that are used, and that should be looked at again: the camera hangs on them.
    sigma_position_m : of the position, in the direction in which it was known worst [m]; infinite where it was not.
    covariance : (15, 15) of `PARAMETERS`, pose and lens together, 0 for what was known; with what was assumed of the
        lens. It is for pixels and rays: of the pose alone it tells less than `pose_covariance`. None when unknown.
    """

    pairs: int
    redundancy: int
    left_out: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    sigma_position_m: float = float("nan")
    covariance: Array | None = None

    @property
    def of_pose_alone(self) -> "CameraQuality":
        """The same for a pose that has been moved since, whose covariance is another one."""
        return replace(self, covariance=None)

    def turned(self, turn: Array) -> "CameraQuality":
        """The same for a world whose axes were turned, by (3, 3)."""
        if self.covariance is None:
            return self
        whole = np.eye(len(self.covariance))
        whole[3:6, 3:6] = turn
        return replace(self, covariance=whole @ self.covariance @ whole.T)


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


def to_plain(quality: CameraQuality) -> dict[str, Any]:
    """For files: what is not known is left out."""
    values: dict[str, Any] = {"pairs": quality.pairs, "redundancy": quality.redundancy}
    values |= {"left_out": list(quality.left_out)} if quality.left_out else {}
    values |= {"asked": list(quality.asked)} if quality.asked else {}
    if quality.covariance is not None:
        known = np.flatnonzero(np.diagonal(quality.covariance))
        values["covariance_of"] = [PARAMETERS[i] for i in known]
        values["covariance"] = quality.covariance[np.ix_(known, known)].tolist()
    return values | ({} if np.isnan(quality.sigma_position_m) else {"sigma_position_m": quality.sigma_position_m})


def from_plain(values: Mapping[str, Any]) -> CameraQuality:
    """From what `to_plain` gave.

    Raises
    ------
    InputError : names and covariance do not fit each other.
    """
    return CameraQuality(
        int(values["pairs"]),
        int(values["redundancy"]),
        tuple(values.get("left_out", ())),
        tuple(values.get("asked", ())),
        float(values.get("sigma_position_m", float("nan"))),
        whole_covariance(values["covariance_of"], values["covariance"]) if "covariance" in values else None,
    )


def whole_covariance(names: Sequence[str], matrix: ArrayLike) -> Array:
    """(15, 15) of all `PARAMETERS` from that of some.

    Raises
    ------
    InputError : a name is none of them or comes twice, or the matrix has another size.
    """
    some = np.asarray(matrix, dtype=np.float64)
    if not set(names) <= set(PARAMETERS) or len(set(names)) < len(names) or some.shape != (len(names), len(names)):
        raise InputError(
            f"The covariance of {', '.join(names) or 'nothing'} is not a matrix with a row and a column for each",
            advice=f"Parameters are {', '.join(PARAMETERS)}; remove it, or solve the camera again",
        )
    rows = [PARAMETERS.index(name) for name in names]
    whole = np.zeros((len(PARAMETERS), len(PARAMETERS)))
    whole[np.ix_(rows, rows)] = some
    return whole


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _named(names: tuple[str, ...]) -> str:
    return f"pair {names[0]}" if len(names) == 1 else f"pairs {', '.join(names)}"
