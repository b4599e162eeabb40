# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of Rockyfor3D v5.2, as data. Not verified against its manual except where it is said."""

SOILS = (
    ("river, swamp", 0.0),
    ("fine soil deeper than 1 m", 0.23),
    ("fine soil less than 1 m deep, sand or gravel", 0.28),
    ("scree, medium compact soil with small fragments, forest road", 0.33),
    ("talus, compact soil with large fragments", 0.38),
    ("bedrock with thin weathered material or soil cover", 0.43),
    ("bedrock", 0.53),
    ("asphalt road", 0.35),
)
"""Soil types 0…7 and their mean R_n. Names as in a published tool for Rockyfor3D; 0.43 of type 5: Noël et al. 2018."""

SHAPES = (("rectangular", 2.0 / 3.0), ("ellipsoid", 2.0 / 5.0), ("sphere", 2.0 / 5.0), ("disc", 1.0 / 2.0))
"""Block shapes 1…4 and c of I = c·m·r², for three equal diameters 2r: m(d²+d²)/12, m(d²+d²)/20, 2/5·m·r², 1/2·m·r²."""

OBSTACLE_SHARES = (0.70, 0.20, 0.10)
"""Probability that a rebound meets an obstacle of the height Rg70, Rg20, Rg10."""

DEVIATION_SPEEDS_MPS = (10.0, 15.0)
DEVIATION_SHARES = ((0.72, 0.24, 0.04), (0.77, 0.19, 0.04), (0.85, 0.14, 0.01))
"""Probability of the three classes of lateral deviation, for a speed before the rebound below, between, above."""
DEVIATION_LIMITS_DEG = (22.5, 45.0)
"""Upper limits of the first two classes; that of the third is a parameter."""
