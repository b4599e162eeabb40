# SPDX-License-Identifier: GPL-3.0-or-later
"""Published values for kinds of ground: each can be set, says where it is from, and does what its source says."""

import pytest
from rockfall.core.impact_models.presets import PRESETS, presets_of
from rockfall.core.impact_models.registry import MODELS


@pytest.mark.parametrize("preset", PRESETS, ids=lambda one: f"{one.model} {one.ground}")
def test_every_preset_can_be_set_and_names_its_source(preset) -> None:
    settings = MODELS[preset.model].settings(preset.values)
    assert all(settings[name] == value for name, value in preset.values.items())
    assert len(preset.source) > 20
    assert preset.verified == ("not checked" not in preset.source)


def test_rockyfor3d_has_its_eight_soils_with_their_mean_coefficients() -> None:
    found = [MODELS[one.model].settings(one.values)["rn"] for one in presets_of("dorren_2015")]
    assert found == [0, 0.23, 0.28, 0.33, 0.38, 0.43, 0.53, 0.35]


def test_harder_ground_of_crsp_gives_more_back() -> None:
    rows = [(one.values["rn"], one.values["rt"]) for one in presets_of("pfeiffer_bowen_1989")]
    assert rows == [(0.29, 0.815), (0.315, 0.835), (0.35, 0.85), (0.395, 0.895)]
    bedrock = MODELS["pfeiffer_bowen_1989"].settings()
    assert rows[2] == (bedrock["rn"], bedrock["rt"])


def test_a_model_without_published_grounds_has_none() -> None:
    assert presets_of("noel_2017") == ()
