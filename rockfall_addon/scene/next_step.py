# SPDX-License-Identifier: GPL-3.0-or-later
"""What to do next, from what the scene holds: a sentence, and the operators or tools for it."""

from dataclasses import dataclass

import bpy

from . import alignment, camera_paths, migration, places, proposal, sightings, store, terrain, videos

PICK_TOOL = "rockfall.pick_tool"


@dataclass(frozen=True)
class NextStep:
    """One sentence, and the identifiers of operators and tools, the likeliest first."""

    sentence: str
    actions: tuple[str, ...] = ()


def next_step(scene: bpy.types.Scene) -> NextStep:
    """What a person may do next."""
    if migration.is_newer(scene):
        return NextStep(migration.warning(scene))
    camera = videos.active_camera(scene)
    picks = store.with_role(scene, store.PICK_ROLE)
    if not store.has_role(scene, store.TERRAIN_ROLE) and not picks:
        demos = ("rockfall.load_footage_demo", "rockfall.load_demo")
        own = ("rockfall.import_terrain", "rockfall.open_project")
        return NextStep("Import your scan, or begin with a demo.", (*demos, *own))
    if terrain.displaced(scene):
        sentence = "The scan was moved, so nothing on it fits any more. Put it back; panel Terrain says how far it is."
        return NextStep(sentence, ("rockfall.put_terrain_back",))
    if camera is None and not picks:
        if store.has_role(scene, store.SIMULATED_BLOCKS_ROLE):
            sentence = "Play the simulated fall; step 7 has the numbers of each run."
            return NextStep(sentence, ("screen.animation_play", "rockfall.select_run"))
        sentence = "Add the videos of the fall, or import a table of timed picks. Without either, simulate in step 7."
        return NextStep(sentence, ("rockfall.add_video", "rockfall.import_picks", "rockfall.draw_release"))
    if camera is not None and not camera_paths.is_solved(camera):
        hint = alignment.hint(scene, camera)
        sentence = hint or "Align the camera: mark the same places in the footage and on the terrain."
        return NextStep(sentence, ("rockfall.align_views",))
    if not picks:
        if len(sightings.seen_in(camera, places.trajectory(scene))):
            sentence = "The block is tracked. Propose its impacts, or click the block at each (step with ← →)."
            return NextStep(sentence, ("rockfall.propose_impacts", PICK_TOOL))
        sentence = "Step to an impact with ← →, and click the block there. Each further impact adds a flight."
        return NextStep(sentence, (PICK_TOOL,))
    found = proposal.read(scene)
    if found is not None:
        return NextStep(
            f"Refined: {found.before_px:.2f} px from the tracked pixels before, {found.after_px:.2f} px after. "
            "The new flights are light blue in the free view; step 5 has the numbers.",
            ("rockfall.apply_refinement", "rockfall.discard_refinement"),
        )
    if camera is not None and not proposal.is_applied(scene) and not proposal.lacking(scene):
        sentence = "Look at each pick and correct it. Refine fits them all to the tracked pixels."
        return NextStep(sentence, (PICK_TOOL, "rockfall.refine"))
    sentence = "Play the fall; then models, simulation, film and tables: steps 6 to 10."
    return NextStep(sentence, ("screen.animation_play", "rockfall.export_tables"))
