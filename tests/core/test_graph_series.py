# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of graphs by source, columns that colour and filter them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rockfall
from rockfall.core.analysis.colouring import MODEL_SHAPES, colour_by, group_colour, model_colours, model_shape
from rockfall.core.analysis.columns import Filter, column_titles, find_column, passing
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.graph_series import (
    beyond,
    measured_series,
    model_series,
    pair_links,
    usual_limits,
    whole_limits,
)
from rockfall.core.analysis.graphs import PAPER_GRAPHS, GraphSpec
from rockfall.core.analysis.variable_sigma import measured_sigma
from rockfall.core.errors import InputError
from rockfall.core.exchange.tables import read_impacts
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.reconstruction.impact import Impacts

TABLE = """site,trajectory,impact,time_s,v1_x_mps
"""


@pytest.fixture(scope="module")
def impacts() -> Impacts:
    from rockfall.core.exchange.project import read_project  # noqa: F401 - the demo is a project

    raise NotImplementedError
