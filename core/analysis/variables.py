# SPDX-License-Identifier: GPL-3.0-or-later
"""What can stand on an axis: the characteristics of an impact, measured and as a model has them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.parameters import suggestion
from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, norm
from .comparison import Predictions


@dataclass(frozen=True)
class Variable:
    """A column that can stand on an axis.

    Attributes
    ----------
    name : as in impacts.csv where it is a column there, with its unit.
    title : in words.
    symbol : the same in Unicode, for screens without mathematics.
    tex : the symbol in TeX, for print.
    unit : "" for a pure number.
    restituted : whether a model has a value of its own; else it is the measured one.
    """

    name: str
    title: str
    symbol: str
    tex: str
    unit: str = ""
    restituted: bool = False

    @property
    def label(self) -> str:
        """For an axis, in Unicode."""
        return f"{self.title} {self.symbol} [{self.unit or '–'}]".replace("  ", " ")

    @property
    def tex_label(self) -> str:
        """For an axis in print."""
        return f"{self.title} {self.tex} [{self.unit or '–'}]".replace("  ", " ")


VARIABLES: Mapping[str, Variable] = MappingProxyType(
    {
        variable.name: variable
        for variable in (
            Variable("theta1_deg", "Incident angle", "θ₁", r"$\theta_1$", "°"),
            Variable("v1_mps", "Incident speed", "|v₁|", r"$|v_1|$", "m/s"),
            Variable("vn1_mps", "Incident normal speed", "vɴ₁", r"$v_{N1}$", "m/s"),
            Variable("vt1_mps", "Incident tangential speed", "vᴛ₁", r"$v_{T1}$", "m/s"),
            Variable("v2_mps", "Restituted speed", "|v₂|", r"$|v_2|$", "m/s", restituted=True),
            Variable("vn2_mps", "Restituted normal speed", "vɴ₂", r"$v_{N2}$", "m/s", restituted=True),
            Variable("vt2_mps", "Restituted tangential speed", "vᴛ₂", r"$v_{T2}$", "m/s", restituted=True),
            Variable("rn", "Normal restitution", "Rɴ", r"$R_N$", restituted=True),
            Variable("rt", "Tangential restitution", "Rᴛ", r"$R_T$", restituted=True),
            Variable("r", "Total restitution", "R", r"$R$", restituted=True),
            Variable("theta_dev_deg", "Deviation", "θdev", r"$\theta_{dev}$", "°", restituted=True),
            Variable("kinetic1_j", "Incident kinetic energy", "E₁", r"$E_1$", "J"),
            Variable("kinetic2_j", "Restituted kinetic energy", "E₂", r"$E_2$", "J", restituted=True),
            Variable("diameter_m", "Block diameter", "d", r"$d$", "m"),
            Variable("mass_kg", "Block mass", "m", r"$m$", "kg"),
            Variable("bounce_height_m", "Bounce height", "h", r"$h$", "m"),
            Variable("time_s", "Time", "t", r"$t$", "s"),
            Variable("impact", "Impact number", "", ""),
        )
    }
)
"""Name → variable, in the order of menus."""


def find_variable(name: str) -> Variable:
    """The variable of a name.

    Raises
    ------
    InputError : there is none; the nearest is suggested.
    """
    if name in VARIABLES:
        return VARIABLES[name]
    raise InputError(f"There is no variable {name!r} to plot", advice=suggestion(name, VARIABLES))


def measured_values(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m,) measured values of some rows, in the variable's unit; NaN where undefined."""
    find_variable(name)
    if name in ("v1_mps", "v2_mps"):
        return norm(getattr(impacts, name.removesuffix("_mps"))[row])
    values = getattr(impacts, name.removesuffix("_mps").removesuffix("_deg"))[row]
    return np.degrees(values) if name.endswith("_deg") else np.asarray(values, dtype=np.float64)


def model_values(impacts: Impacts, predictions: Predictions, model: int, run: int, name: str) -> Array:
    """(m,) values of one model and run; the measured ones where the model does not change them."""
    row = predictions.row
    if not find_variable(name).restituted:
        return measured_values(impacts, row, name)
    if name in ("v2_mps", "kinetic2_j"):
        speed = norm(predictions.v2[model, run])
        return speed if name == "v2_mps" else 0.5 * impacts.mass_kg[row] * speed**2
    values: Array = getattr(predictions, name.removesuffix("_mps").removesuffix("_deg"))[model, run]
    return np.degrees(values) if name.endswith("_deg") else values
