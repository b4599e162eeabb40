# SPDX-License-Identifier: GPL-3.0-or-later
"""What every column of impacts.csv means, for people and programs that have never heard of us."""

import re
from dataclasses import dataclass

import numpy as np

from ..reconstruction.impact import FLAGS


@dataclass(frozen=True)
class Field:
    """A column.

    Attributes
    ----------
    kind : "string", "integer" or "number".
    unit : "" for none.
    minimum, maximum : of a number; NaN for no limit.
    """

    kind: str
    unit: str
    description: str
    minimum: float = np.nan
    maximum: float = np.nan
    required: bool = False


def _axes(stem: str, unit: str, suffix: str, what: str, limit: float = np.nan) -> dict[str, Field]:
    return {
        f"{stem}{axis}{suffix}": Field("number", unit, f"{what}, {axis} component", -limit, limit) for axis in "xyz"
    }


FIELDS: dict[str, Field] = {
    "site": Field("string", "", "Name of the site", required=True),
    "trajectory": Field("string", "", "Name of the block's run; unique within the site", required=True),
    "impact": Field("integer", "", "Number of the impact within its trajectory, from 1; 0 when not known", 0),
    "time_s": Field("number", "s", "Time on the common clock of the site"),
    **{f"{a}_m": Field("number", "m", f"Position of the block, {a}, in survey coordinates, z up") for a in "xyz"},
    **_axes("n", "", "", "Unit normal of the terrain, out of the ground", 1.001),
    "normal_radius_m": Field("number", "m", "Radius over which the normal was fitted; empty when it was given", 0),
    **_axes("v1", "m/s", "_mps", "Incident velocity"),
    **_axes("v2", "m/s", "_mps", "Restituted velocity"),
    "vn1_mps": Field("number", "m/s", "Norm of the normal part of the incident velocity", 0),
    "vt1_mps": Field("number", "m/s", "Norm of the tangential part of the incident velocity", 0),
    "vn2_mps": Field("number", "m/s", "Norm of the normal part of the restituted velocity", 0),
    "vt2_mps": Field("number", "m/s", "Norm of the tangential part of the restituted velocity", 0),
    "rn": Field("number", "", "Apparent normal coefficient of restitution, vn2/vn1", 0),
    "rt": Field("number", "", "Apparent tangential coefficient of restitution, vt2/vt1", 0),
    "r": Field("number", "", "Apparent total coefficient of restitution, |v2|/|v1|", 0),
    "theta1_deg": Field("number", "°", "Incident angle between velocity and ground; 90 is perpendicular", 0, 90.001),
    "theta_dev_deg": Field("number", "°", "Deviation angle between incident and restituted velocity", 0, 180.001),
    "diameter_m": Field("number", "m", "Mean diameter of the block", 0),
    "mass_kg": Field("number", "kg", "Mass of the block", 0),
    "flags": Field("string", "", f"Joined by ';', of: {', '.join(FLAGS)}"),
    **_axes("omega1", "rad/s", "_radps", "Angular velocity just before the impact, right-handed"),
    "normal_spread_deg": Field("number", "°", "Root mean square angle between the terrain there and its plane", 0),
    "kinetic1_J": Field("number", "J", "Translational energy before the impact", 0),
    "kinetic2_J": Field("number", "J", "Translational energy after the impact", 0),
    "rotational1_J": Field("number", "J", "Rotational energy before the impact", 0),
    "rotational2_J": Field("number", "J", "Rotational energy after the impact", 0),
    "bounce_height_m": Field("number", "m", "Greatest height above the terrain of the flight that follows"),
    "chord_height_m": Field("number", "m", "Greatest distance of the flight that follows from its chord"),
    **{f"{a}2_m": Field("number", "m", f"Where the block takes off, {a}; empty: where it lands") for a in "xyz"},
    "time2_s": Field("number", "s", "When the block takes off; empty: when it lands"),
    "source": Field("integer", "", "Number, from 1, of the entry of 'sources' that the row is from", 1, required=True),
}
"""Name → what it is. An empty cell means: not defined."""


END = re.compile(r"(rn|rt|r|theta1_deg|theta_dev_deg)_(low|high)")
"""A column with an end of an interval."""


def field_of(name: str) -> Field:
    """What a column is; unknown ones are text."""
    if name in FIELDS:
        return FIELDS[name]
    if (match := END.fullmatch(name)) is not None:
        column, end = match.groups()
        of = FIELDS[column]
        what = f"{end.capitalize()} end of the 95 % interval of {column}"
        if end == "high":
            what += "; empty beside a low end: no limit"
        return Field("number", of.unit, what, of.minimum, of.maximum)
    if (value := FIELDS.get(name.removeprefix("sigma_"))) is not None:
        return Field("number", value.unit, f"Standard deviation of {name.removeprefix('sigma_')}", 0)
    return Field("string", "", "As in the table that the row is from")
