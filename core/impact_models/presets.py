# SPDX-License-Identifier: GPL-3.0-or-later
"""Published values of the models' parameters for kinds of ground, as data; in the order of their sources."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .machinery.parameters import Value
from .rockyfor3d_tables import SOILS

CRSP = "CRSP 4.0 manual (Jones et al. 2000), the middle of its ranges R_n {}, R_t {}; not checked against it{}"
SECOND = "; a site study with CRSP 3 has the same ranges"
ROCKYFOR = "Rockyfor3D v5.2 (Dorren 2016), soil type {}{}"
UNCHECKED = "; its mean R_n not checked against the manual"
PAPER = "; Noël et al. 2018"


@dataclass(frozen=True)
class Preset:
    """Values for a kind of ground.

    Attributes
    ----------
    model : name.
    ground : what it is like.
    values : parameter → value; the others keep theirs.
    source : where the values are from, without a final full stop.
    verified : whether they were checked against a text that was read.
    """

    model: str
    ground: str
    values: Mapping[str, Value] = field(hash=False)
    source: str
    verified: bool = False


def _crsp(ground: str, rn: tuple[float, float], rt: tuple[float, float], more: str = "") -> Preset:
    middle = {"rn": round(sum(rn) / 2, 3), "rt": round(sum(rt) / 2, 3)}
    ranges = (f"{low:.2f}–{high:.2f}" for low, high in (rn, rt))
    return Preset("pfeiffer_bowen_1989", ground, middle, CRSP.format(*ranges, more))


PRESETS = (
    _crsp("soft soil", (0.28, 0.30), (0.80, 0.83)),
    _crsp("talus, firm soil", (0.30, 0.33), (0.82, 0.85), SECOND),
    _crsp("bedrock, boulders", (0.33, 0.37), (0.83, 0.87), SECOND),
    _crsp("hard or paved surface", (0.37, 0.42), (0.87, 0.92)),
    *(
        Preset(
            "dorren_2015",
            name,
            {"soil_type": str(number)},
            ROCKYFOR.format(number, PAPER if number == 5 else UNCHECKED),
            verified=number == 5,
        )
        for number, (name, _) in enumerate(SOILS)
    ),
)
"""All presets."""


def presets_of(model: str) -> tuple[Preset, ...]:
    """Those of a model; a model whose publication has no values for kinds of ground has none."""
    return tuple(preset for preset in PRESETS if preset.model == model)
