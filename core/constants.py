# SPDX-License-Identifier: GPL-3.0-or-later
"""Constants that several rooms use, and their sources."""

GRAVITY_MPS2 = 9.81
"""Acceleration of gravity [m/s²], as in Noël et al. 2018, eq. 5."""

AIR_DENSITY_KGPM3 = 1.2
"""Density of air [kg/m³], Noël et al. 2017 (EGU2017-16699)."""

DRAG_COEFFICIENT = 0.9
"""Drag coefficient C_D of a tumbling block [-], Noël et al. 2017 (EGU2017-16699)."""

ROCK_DENSITY_KGPM3 = 2650.0
"""Density of a limestone or crystalline block [kg/m³], the usual textbook value; a project gives its own."""

SAME_TIME_S = 1e-6
"""Times that are closer than this [s] are one: tables keep six decimals."""

IQR_PER_SD = 1.349
"""Interquartile range of a normal distribution in standard deviations."""

UNITS_M = {"m": 1.0, "mm": 0.001, "cm": 0.01, "km": 1000.0, "ft": 0.3048, "us-ft": 1200 / 3937}
"""Names of units of length of a file, and their lengths [m]."""
