# SPDX-License-Identifier: GPL-3.0-or-later
"""What to do next, from what the scene holds: a sentence, and the operators or tools for it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.remarks import Remark
from ...core.workflow.noticed import moved_on, tracked_beyond, tracks_off_the_motion
from . import problems
from .footage import alignment, camera_paths, clocks, pictures, sightings, video_times, videos
from .models import motion
from .picks import places, proposal
from .storage import migration, set_aside_words, store
from .terrain import terrain

ALIGN_TOOL, PICK_TOOL = "rockfall.align_tool", "rockfall.pick_tool"
MILLIMETRE_M = 0.001


@dataclass(frozen=True)
class NextStep:
    """One sentence, and the identifiers of operators and tools, the likeliest first.

    Attributes
    ----------
    video : id of the camera that is to be looked through, where that is an action.
    tile : id of the terrain that is to be read again, where importing is an action.
    unit_m : the unit that its file may have [m]; 0 where it is to be read with the ground filter.
    """

    sentence: str
    actions: tuple[str, ...] = ()
    video: str = ""
    tile: str = ""
    unit_m: float = 0.0


def next_step(scene: bpy.types.Scene) -> NextStep:
    """What a person may do next."""
    if migration.is_left_alone(scene):
        return NextStep(migration.warning(scene))
    camera = videos.active_camera(scene)
    picks = store.with_role(scene, store.PICK_ROLE)
    if not store.has_role(scene, store.TERRAIN_ROLE) and not picks:
        demos = ("rockfall.load_footage_demo", "rockfall.load_demo")
        own = ("rockfall.import_terrain", "rockfall.open_project")
        if camera is not None:
            return NextStep("Now import the scan of the slope that the video shows.", own)
        return NextStep("Import your scan, or begin with a demo.", (*demos, *own))
    if terrain.displaced(scene):
        sentence = "The scan was moved, so nothing on it fits any more. Put it back; panel Terrain says how far it is."
        return NextStep(sentence, ("rockfall.put_terrain_back",))
    said = [remark for remark in problems.remarks(scene) if remark.about == set_aside_words.ABOUT]
    apart = [remark for remark in said if remark.severity == "problem"]
    if apart:
        actions = ("rockfall.recover_picks", "rockfall.select_set_aside", "rockfall.remove_set_aside")
        return NextStep(apart[0].text, actions)
    oversized, wooded = terrain.of_impossible_size(scene), terrain.with_trees(scene)
    if (oversized or wooded) and not picks and (camera is None or not camera_paths.is_solved(camera)):
        tile = (oversized or wooded)[0]
        sentence = " ".join(said for said in terrain.warnings(scene) if said.startswith(f"{tile.name} "))
        rest = "rockfall.add_video" if camera is None else "rockfall.align_views"
        unit_m = MILLIMETRE_M if oversized else 0.0
        return NextStep(sentence, ("rockfall.import_terrain", rest), tile=str(tile.get(store.ID, "")), unit_m=unit_m)
    if camera is None and not picks:
        if store.has_role(scene, store.SIMULATED_BLOCKS_ROLE):
            sentence = "Play the simulated fall; step 7 has the numbers of each run."
            return NextStep(sentence, ("screen.animation_play", "rockfall.select_run"))
        sentence = "Add the videos of the fall, or import a table of timed picks. Without either, simulate in step 7."
        return NextStep(sentence, ("rockfall.add_video", "rockfall.import_picks", "rockfall.draw_release"))
    if camera is not None and not camera_paths.is_solved(camera):
        for remark in alignment.background_remarks(camera):
            return NextStep(remark.text, ("rockfall.align_views",))
        hint = alignment.hint(scene, camera) or alignment.solution_of(camera).problem
        sentence = hint or "Align the camera: mark the same places in the footage and on the terrain."
        return NextStep(sentence, ("rockfall.align_views",))
    for one in filter(alignment.is_to_be_followed, videos.cameras(scene)):
        sentence = f"{one.name} moves, but has the pose of one frame so far: follow its background through the video."
        action = "rockfall.follow_background" if one == camera else "rockfall.look_through"
        return NextStep(sentence, (action,), str(one[store.ID]))
    waiting = next((one for one in videos.cameras(scene) if not camera_paths.is_solved(one)), None)
    if waiting is not None and not picks:
        sentence = (
            f"{waiting.name} is not aligned yet: look through it and mark pairs there, too. Or pick with one video."
        )
        return NextStep(sentence, ("rockfall.look_through", PICK_TOOL), str(waiting[store.ID]))
    unset = None if proposal.is_applied(scene) else video_times.never_synchronised(scene)
    if unset is not None and all(map(camera_paths.is_solved, videos.cameras(scene))):
        return _on_clocks(scene, unset, camera)
    for one in videos.cameras(scene):
        for remark in alignment.background_remarks(one):
            return NextStep(remark.text, ("rockfall.align_views",))
    return _with_cameras(scene, camera, picks)


def _on_clocks(scene: bpy.types.Scene, unset: bpy.types.Object, active: bpy.types.Object) -> NextStep:
    """A video whose clock nobody has set: which event is to be marked, and in which video."""
    pair = (video_times.reference_camera(scene), unset)
    events = {camera: video_times.events_of(camera) for camera in pair}
    event = scene.rockfall_videos.event
    if set(events[pair[0]]) & set(events[unset]):
        return NextStep("An event is marked in both videos: synchronise them.", ("rockfall.synchronise_videos",))
    marked = [camera for camera in pair if event in events[camera]]
    to_do = active if active in pair and active not in marked else next(one for one in pair if one not in marked)
    what = "an event that both show: a block leaves a ledge, or hits a boulder"
    sentence = f"{unset.name} is not synchronised: both videos begin together until it is."
    if marked:
        what = f"the same event as at {events[marked[0]][event]:.2f} s of {marked[0].name}"
        sentence = f"Event {event} is marked in {marked[0].name}."
    if to_do != active:
        sentence = f"{sentence} Look through {to_do.name}, and find {what}."
        return NextStep(sentence, ("rockfall.look_through",), str(to_do[store.ID]))
    return NextStep(f"{sentence} Step to {what}, and press Event Here.", ("rockfall.mark_event",))


def _with_cameras(scene: bpy.types.Scene, camera: bpy.types.Object | None, picks: list[bpy.types.Object]) -> NextStep:
    """Once the cameras stand: pick, refine, look at it."""
    weak = " ".join(remark.text for remark in problems.of_cameras(scene))
    if not picks:
        first = ("rockfall.align_views",) if weak else ()
        if len(sightings.seen_in(camera, places.trajectory(scene))):
            sentence = "The block is tracked. Propose its impacts, or click the block at each (step with ← →)."
            return NextStep(f"{weak} {sentence}".strip(), (*first, "rockfall.propose_impacts", PICK_TOOL))
        sentence = "Step to an impact with ← →, and click the block there. Each further impact adds a flight."
        if camera is not None and alignment.is_taken_for_a_tripod(camera):
            sentence += " Was the camera held by hand? Then follow the background first (step 3, Hand-held)."
        return NextStep(f"{weak} {sentence}".strip(), (*first, PICK_TOOL))
    found = proposal.read(scene)
    if found is not None:
        return _on_proposal(found, weak)
    if not store.has_role(scene, store.FLIGHTS_ROLE) and not _grave(problems.remarks(scene)):
        where = "Step to" if camera is not None else "Move the timeline to the time of"
        sentence = f"{where} the next impact, and click there: a flight is between two picks of a run."
        return NextStep(sentence, (PICK_TOOL,))
    lacking = camera is None or proposal.lacking(scene)
    refined = proposal.is_applied(scene)
    worries = [*_grave(problems.remarks(scene)), *(() if lacking else _grave(tracks_off(scene)))]
    if worries:
        return NextStep(worries[0], (PICK_TOOL,) if lacking or refined else (PICK_TOOL, "rockfall.refine"))
    if not lacking and not refined:
        sentence = "Look at each pick and correct it. Refine fits them all to the tracked pixels."
        sentence = next((remark.text for remark in _beyond(scene, picks)), sentence)
        return NextStep(sentence, (PICK_TOOL, "rockfall.refine"))
    sentence = "Play the fall; then models, simulation, film and tables: steps 6 to 10."
    sentence += f" {weak}" if weak else ""
    return NextStep(sentence, ("screen.animation_play", "rockfall.export_tables"))


def _on_proposal(found: proposal.Proposal, weak: str) -> NextStep:
    """What speaks against it comes before the numbers, and it is not offered first then.

    weak : what is to be known of the cameras.
    """
    if found.stale:
        sentence = "The picks were changed since they were refined: refine again."
        return NextStep(sentence, ("rockfall.refine", "rockfall.discard_refinement"))
    numbers = (
        f"{found.before_px:.2f} px from the tracked pixels before, {found.after_px:.2f} px after. "
        "The new flights are light blue in the free view; step 5 has the numbers."
    ) + (f" {weak}" if weak else "")
    decide = ("rockfall.apply_refinement", "rockfall.discard_refinement")
    worries = _grave(found.remarks)
    if worries:
        return NextStep(f"{worries[0]} Otherwise: {numbers}", (PICK_TOOL, "rockfall.discard_refinement", decide[0]))
    return NextStep(f"Refined: {numbers}", decide)


def _grave(remarks: Iterable[Remark]) -> list[str]:
    return [remark.text for remark in remarks if remark.severity in ("warning", "problem")]


def _beyond(scene: bpy.types.Scene, picks: list[bpy.types.Object]) -> Iterator[Remark]:
    """Blocks that were tracked for long after their last pick, unless that is where they stopped."""
    last = {pick[store.TRAJECTORY]: pick for pick in sorted(picks, key=lambda pick: pick[store.TIME])}
    for camera in filter(camera_paths.is_solved, videos.cameras(scene)):
        clock = clocks.clock_of(camera)
        for name in sightings.names_in(camera):
            if name in last and last[name][store.KIND] != "stop":
                seen, last_s = sightings.seen_in(camera, name), float(last[name][store.TIME])
                later = np.flatnonzero(clock.to_common(seen.time_s) > last_s)
                if later.size:
                    ends = later[[np.argmin(seen.time_s[later]), np.argmax(seen.time_s[later])]]
                    (one, other), (a, b) = (
                        (pictures.posed(camera, float(s)) for s in seen.time_s[ends]),
                        seen.pixel[ends],
                    )
                    until_s = float(clock.to_common(seen.time_s[ends[1]]))
                    yield from tracked_beyond(name, last_s, until_s, moved_on(one, a, other, b))


def tracks_off(scene: bpy.types.Scene) -> tuple[Remark, ...]:
    """Where the block was tracked away from the motion of its picks."""
    seen = proposal.seen_names(scene)
    return tracks_off_the_motion(one for one in motion.motion_of(scene).courses if one.trajectory in seen)
