# SPDX-License-Identifier: GPL-3.0-or-later
"""How quickly graphs and blocks follow a slider of a model: what is computed, and what Blender is told.

Blender as a module is needed: the bpy wheel. Drawing is not in it. In a window the blocks of more than 1 000 impacts
wait until the slider rests: for what follows each move then, take --no-blocks.
"""

import argparse
import cProfile
import importlib
import itertools
import pstats

import bpy
from live import make_picks, make_terrain, said, timed

MODEL = "noel_2017"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trajectories", type=int, default=15)
    parser.add_argument("--impacts", type=int, default=7)
    parser.add_argument("--triangles", type=int, default=300_000)
    parser.add_argument("--moves", type=int, default=30)
    parser.add_argument("--no-blocks", action="store_true", help="graphs alone: no blocks in the 3-D view")
    parser.add_argument("--profile", action="store_true")
    options = parser.parse_args()

    bpy.ops.wm.read_factory_settings(use_empty=True)
    importlib.import_module("rockfall").register()
    part = {
        name: importlib.import_module(f"rockfall.{name}")
        for name in (
            "core.impact_models.registry", "core.terrain.shading", "rockfall_addon.scene.comparison",
            "rockfall_addon.scene.comparison_scores", "rockfall_addon.scene.models",
            "rockfall_addon.scene.reconstruction", "rockfall_addon.scene.terrain",
        )
    }  # fmt: skip
    scene, scenes = bpy.context.scene, part["rockfall_addon.scene.reconstruction"]
    surface = make_terrain(options.triangles)
    part["rockfall_addon.scene.terrain"].add_terrain(scene, surface, part["core.terrain.shading"].shade(surface))
    result = scenes.reconstruct_scene(scene, make_picks(options.trajectories, options.impacts))
    scenes.show(scene, result)
    six = part["core.impact_models.registry"].COMPARED
    scene.rockfall_comparison.models = set(six)
    if not options.no_blocks:
        part["rockfall_addon.scene.models"].show_models(scene, result, six)
    comparison = part["rockfall_addon.scene.comparison"]
    scores = part["rockfall_addon.scene.comparison_scores"]
    slider, values = scene.rockfall_parameters.noel_2017, itertools.cycle([0.3 + 0.01 * i for i in range(60)])

    def move() -> None:
        slider.rt = next(values)

    def follow() -> None:
        move()
        comparison.comparison_of(scene)

    def scored() -> None:
        follow()
        scores.ranking(scene, comparison.comparison_of(scene))

    def evaluated() -> None:
        follow()
        bpy.context.view_layer.update()

    blocks = sum(obj.get("rockfall_role") == "twin" for obj in scene.objects)
    print(f"{len(result.impacts)} impacts, six models, {blocks} blocks; one model's slider moves:")
    follow()
    print(f"parameter, and blocks if any  {said(timed(move, options.moves))}")
    print(f"and what the graphs show      {said(timed(follow, options.moves))}")
    print(f"and the scores                {said(timed(scored, options.moves))}")
    print(f"and Blender's evaluation      {said(timed(evaluated, options.moves))}")
    if options.profile:
        profile = cProfile.Profile()
        profile.runcall(timed, follow, options.moves)
        pstats.Stats(profile).sort_stats("tottime").print_stats(20)


if __name__ == "__main__":
    main()
