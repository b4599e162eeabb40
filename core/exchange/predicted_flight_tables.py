# SPDX-License-Identifier: GPL-3.0-or-later
"""predicted_flights.csv: how the block would have flown on from each measured impact, had a model been right."""

from pathlib import Path

import numpy as np

from ..analysis.predicted_flights import PredictedFlights
from .tables import POSITION, V2, Columns, vector_columns, write_columns

DERIVED = ("length_m", "duration_difference_s", "length_difference_m", "height_difference_m", "landing_offset_m")
FLAGS = ("into_ground", "left_terrain")


def write_predicted_flights(flights: PredictedFlights, path: str | Path) -> None:
    """Write predicted_flights.csv: differences are predicted − measured, positions are survey coordinates.

    The flight of a row can be computed again from its start, v2, gravity and drag.
    """
    start, survey = flights.launches, flights.shift.to_survey
    marks = zip(*(getattr(flights, name).tolist() for name in FLAGS), strict=True)
    columns: Columns = {
        **{name: getattr(flights, name) for name in ("model", "replicate", "site", "trajectory", "impact", "time_s")},
        **vector_columns(POSITION, survey(start.position)),
        **vector_columns(V2, start.velocity),
        "gravity_mps2": np.full(len(flights), start.gravity_mps2),
        "drag_per_m": start.drag_per_m,
        "duration_s": flights.duration_s,
        **vector_columns(("landing_x_m", "landing_y_m", "landing_z_m"), survey(flights.landing)),
        **vector_columns(("landing_vx_mps", "landing_vy_mps", "landing_vz_mps"), flights.landing_velocity),
        "height_m": flights.height_m,
        "measured_duration_s": flights.measured_duration_s,
        **vector_columns(("measured_x_m", "measured_y_m", "measured_z_m"), survey(flights.measured_landing)),
        "measured_height_m": flights.measured_height_m,
        **{name: getattr(flights, name) for name in DERIVED},
        "flags": [";".join(name for name, here in zip(FLAGS, row, strict=True) if here) for row in marks],
        **flights.runs,
    }
    write_columns(path, columns)
