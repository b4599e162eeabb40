# SPDX-License-Identifier: GPL-3.0-or-later
"""What can stand on an axis: the characteristics of an impact, measured and as a model has them."""

from collections.abc import Mapping
from contextlib import suppress
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
            Variable("kinetic_n1_j", "Incident normal energy", "Eɴ₁", r"$E_{N1}$", "J"),
            Variable("kinetic_t1_j", "Incident tangential energy", "Eᴛ₁", r"$E_{T1}$", "J"),
            Variable("kinetic_n2_j", "Restituted normal energy", "Eɴ₂", r"$E_{N2}$", "J", restituted=True),
            Variable("kinetic_t2_j", "Restituted tangential energy", "Eᴛ₂", r"$E_{T2}$", "J", restituted=True),
            Variable("rotational1_j", "Incident rotational energy", "Eω₁", r"$E_{\omega 1}$", "J"),
            Variable("rotational2_j", "Restituted rotational energy", "Eω₂", r"$E_{\omega 2}$", "J", restituted=True),
            Variable("omega1_radps", "Incident angular speed", "|ω₁|", r"$|\omega_1|$", "rad/s"),
            Variable("slope_deg", "Slope of the ground", "β", r"$\beta$", "°"),
            Variable("normal_spread_deg", "Roughness of the ground", "σₙ", r"$\sigma_n$", "°"),
            Variable("diameter_m", "Block diameter", "d", r"$d$", "m"),
            Variable("mass_kg", "Block mass", "m", r"$m$", "kg"),
            Variable("bounce_height_m", "Bounce height", "h", r"$h$", "m"),
            Variable("chord_height_m", "Height above the chord", "f", r"$f$", "m"),
            Variable("scar_depth_m", "Depth of the scar", "", "", "m"),
            Variable("scar_length_m", "Length of the scar", "", "", "m"),
            Variable("time_s", "Time", "t", r"$t$", "s"),
            Variable("impact", "Impact number", "", ""),
        )
    }
)
"""Name → variable, in the order of menus."""

APPARENT = tuple(VARIABLES)[: tuple(VARIABLES).index("theta_dev_deg") + 1]
"""Those of eq. 7–10, which every table of impacts has."""


def find_variable(name: str) -> Variable:
    """The variable of a name.

    Raises
    ------
    InputError : there is none; the nearest is suggested.
    """
    if name in VARIABLES:
        return VARIABLES[name]
    raise InputError(f"There is no variable {name!r} to plot", advice=suggestion(name, VARIABLES))


def known_variables(impacts: Impacts) -> tuple[str, ...]:
    """The variables that a table has anything of, in the order of menus."""
    row = np.arange(len(impacts))
    return tuple(
        name for name in VARIABLES if name in APPARENT or np.isfinite(measured_values(impacts, row, name)).any()
    )


def measured_values(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m,) measured values of some rows, in the variable's unit; NaN where undefined.

    Depth and length of the scar are further columns of the table that was read, when it has them.
    """
    find_variable(name)
    if name in ("v1_mps", "v2_mps"):
        return norm(getattr(impacts, name.removesuffix("_mps"))[row])
    if name.startswith("scar_"):
        return _numbers(impacts, row, name)
    if name == "omega1_radps":
        return norm(impacts.angular_velocity[row])
    if name == "slope_deg":
        normal = impacts.normal[row]
        return np.degrees(np.arctan2(np.hypot(normal[:, 0], normal[:, 1]), normal[:, 2]))
    if name in _ENERGY_OF:
        return 0.5 * impacts.mass_kg[row] * getattr(impacts, _ENERGY_OF[name])[row] ** 2
    values = getattr(impacts, name.removesuffix("_mps").removesuffix("_deg"))[row]
    return np.degrees(values) if name.endswith("_deg") else np.asarray(values, dtype=np.float64)


def model_values(impacts: Impacts, predictions: Predictions, model: int, run: int, name: str) -> Array:
    """(m,) values of one model and run; the measured ones where the model does not change them.

    Rotational energy needs the moment of inertia, which the measured spin and its energy give.
    """
    row = predictions.row
    if not find_variable(name).restituted:
        return measured_values(impacts, row, name)
    if name in ("v2_mps", "kinetic2_j"):
        speed = norm(predictions.v2[model, run])
        return speed if name == "v2_mps" else 0.5 * impacts.mass_kg[row] * speed**2
    if name in _ENERGY_OF:
        part: Array = getattr(predictions, _ENERGY_OF[name])[model, run]
        return 0.5 * impacts.mass_kg[row] * part**2
    if name == "rotational2_j":
        spin, incident = norm(predictions.omega2[model, run]), norm(impacts.angular_velocity[row])
        ratio = np.divide(spin, incident, out=np.full_like(spin, np.nan), where=incident > 0)
        return impacts.rotational1_j[row] * ratio**2
    values: Array = getattr(predictions, name.removesuffix("_mps").removesuffix("_deg"))[model, run]
    return np.degrees(values) if name.endswith("_deg") else values


_ENERGY_OF = {f"kinetic_{part}_j": f"v{part}" for part in ("n1", "t1", "n2", "t2")}
"""Energy of a part of the velocity → that part."""


def _numbers(impacts: Impacts, row: Indices, name: str) -> Array:
    """(m,) numbers of a further column; NaN without the column, and where its cell is no number."""
    numbers = np.full(row.size, np.nan)
    for i, cell in enumerate(impacts.extra[name][row].tolist() if name in impacts.extra else ()):
        with suppress(ValueError):
            numbers[i] = float(cell)
    return numbers
