# SPDX-License-Identifier: GPL-3.0-or-later
"""The model `observed` among the models beside the real blocks: from the scene's own impacts."""

import bpy
import numpy as np
import pytest


@pytest.fixture
def demo(part) -> bpy.types.Scene:
    assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    return bpy.context.scene


def test_measured_rebounds_are_shown_beside_the_real_blocks(demo: bpy.types.Scene, part) -> None:
    assert bpy.ops.rockfall.show_models(models={"observed", "noel_2017"}) == {"FINISHED"}
    blocks = [obj for obj in demo.objects if obj.get("rockfall_role") == "twin" and obj["rockfall_model"] == "observed"]
    assert {obj["rockfall_trajectory"] for obj in blocks} == {f"B{i:02}" for i in range(1, 16)}
    result = part("rockfall_addon.scene.picks.reconstruction").reconstruct_scene(demo)
    shown = part("rockfall_addon.scene.models.models").find_predictions(demo, result, ("observed",))
    compared = part("core.analysis.comparison").compare(result.impacts, ["observed"])
    assert compared.measured is not None
    assert len(compared.measured) == 83
    assert shown.model.size == np.isfinite(compared.v2[0, 0]).all(axis=1).sum()


def test_a_scene_with_too_few_impacts_says_so_and_keeps_what_is_shown(demo: bpy.types.Scene, part) -> None:
    bpy.ops.rockfall.show_models(models={"noel_2017"})
    picks = [obj for obj in demo.objects if obj.get("rockfall_role") == "pick"]
    for obj in picks:
        if obj["rockfall_trajectory"] not in ("B02",):
            bpy.data.objects.remove(obj)
    with pytest.raises(RuntimeError, match="measured impacts can be drawn from"):
        bpy.ops.rockfall.show_models(models={"observed", "noel_2017"})
    assert demo["rockfall_twin_models"] == "noel_2017"
