# SPDX-License-Identifier: GPL-3.0-or-later
"""Make tests/data/saved_by_0.1.0.blend and .json: a scene with everything that a file can hold, and what it holds.

It runs with version 0.1.0 of Rockfall only, whose modules it names: the package `rockfall` on the path must be that of
the tag, and the folder given must hold its assets/demo.

    PYTHONPATH=<folder with rockfall 0.1.0> python saved_by_0_1_0.py <folder with assets/demo>
"""

import csv
import importlib
import json
import os
import sys
from pathlib import Path

import bpy
import numpy as np

NAME = "rockfall"
VIDEO = "//../../assets/demo/footage/footage.mp4"
ELSEWHERE = "/footage"  # the place of the video when the file was saved; it is found beside the file
TRIANGLES = 7000
BEGIN_S = {"B02": 467.0, "B07": 466.2}  # on the clock of the footage, so that all of it is in one film


def part(name: str):
    return importlib.import_module(f"{NAME}.{name}")


def bridge(name: str):
    return part(f"rockfall_addon.bridge.{name}")


def coarse_terrain(demo: Path, target: Path) -> None:
    """The demo's terrain with few triangles, as an OBJ file in survey coordinates."""
    decimate = part("core.terrain.decimation").decimate
    surface = part("core.terrain.readers").read_terrain(
        demo / "terrain.ply", shift=part("core.georeference").GlobalShift(988400.0, 6375600.0, 1500.0)
    )
    coarse = decimate(surface.vertices, surface.faces, TRIANGLES)
    survey = surface.shift.to_survey(coarse.vertices)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in survey.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (coarse.faces + 1).tolist()]
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def few_picks(demo: Path, target: Path) -> None:
    """Two of the demo's trajectories, with columns that a person may have added."""
    with (demo / "picks.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["trajectory"] in ("B02", "B07")]
    first = {row["trajectory"]: float(row["time_s"]) for row in reversed(rows)}
    for number, row in enumerate(rows):
        row["time_s"] = f"{float(row['time_s']) + BEGIN_S[row['trajectory']] - first[row['trajectory']]:.6f}"
        row["note"] = f"“{number}”, seen from the road" if number % 5 == 0 else ""
        row["status"] = "doubtful" if number in (4, 9) else row["status"]
        row["weather"] = "rain" if number % 2 else ""
        row["nx"], row["ny"], row["nz"] = ("0.1", "-0.31", "0.945") if number == 3 else ("", "", "")
        row["omega1x_radps"], row["omega1y_radps"], row["omega1z_radps"] = (
            ("1.25", "-7.5", "0.125") if number == 5 else ("", "", "")
        )
    with target.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)


def make(demo: Path, work: Path) -> None:
    scene = bpy.context.scene
    coarse_terrain(demo, work / "terrain.obj")
    few_picks(demo, work / "picks.csv")
    text = (demo / "footage" / "project.toml").read_text(encoding="utf-8").replace("../terrain.ply", "terrain.obj")
    text = text.replace("[block]", '[picks]\nfile = "picks.csv"\n\n[block]')
    for name in ("footage.mp4", "camera.toml", "track.csv", "events.csv"):
        (work / name).write_bytes((demo / "footage" / name).read_bytes())
    (work / "project.toml").write_text(text, encoding="utf-8")
    bridge("project").load_project(scene, work / "project.toml")
    videos, alignment, picking = bridge("videos"), bridge("alignment"), bridge("picking")
    (first,) = videos.cameras(scene)
    scene.camera = first
    first.name = "Road"
    scene.rockfall_picking.trajectory = "B10"

    second = videos.add_video(scene, work / "footage.mp4")
    second.name = "Bridge"
    videos.set_clock(second, part("core.footage.clock").Clock(465.4983, 2.5e-5, 0.0))
    second["rockfall_row_time_s"] = 1.25e-5
    scene.camera = second
    scene.frame_set(round(videos.scene_frame_of(scene, second, 0)))
    files = bridge("alignment_files")
    files.import_pairs(scene, second, demo / "footage" / "pairs.csv")
    pairs = alignment.pairs_of(second)
    alignment.edit(scene, second, pairs[2].id, enabled=False)
    times = bridge("video_times")
    for camera, frames in ((first, (51, 89)), (second, (51, 90))):
        for number, frame in enumerate(frames, 1):
            times.go_to(scene, videos.scene_frame_of(scene, camera, frame))
            times.mark_event(scene, camera, number)

    scene.camera = first
    track = bridge("observations").seen_in(first, "B10")
    for frame in (51, 89, 116, 132):
        times.go_to(scene, videos.scene_frame_of(scene, first, frame))
        pixel = track.pixel[np.abs(track.frame - frame).argmin()]
        place = picking.in_picture(scene, first, pixel, "B10", centre=True)
        obj, _ = picking.put(scene, first, place, "B10", "impact")
        picking.finish(scene, obj)
    scene.camera = second
    times.go_to(scene, videos.scene_frame_of(scene, second, 51))
    place = picking.in_picture(scene, second, track.pixel[np.abs(track.frame - 51).argmin()], "B10", centre=True)
    picking.finish(scene, picking.put(scene, second, place, "B10", "impact")[0])
    scene.camera = first
    bridge("picks").set_extra(obj, "note", "the last one")
    bridge("live").sync(scene)
    bridge("refinement").propose(scene, ["B10"], [])
    settings = scene.rockfall
    settings.use_drag, settings.stagger_s, settings.block_scale = True, 0.25, 1.5
    settings.colour_by, settings.marker_radius_m, settings.density_kgpm3 = "ENERGY", 0.2, 2712.0
    scene.rockfall_terrain.hillshade = 0.6
    bpy.ops.rockfall.show_twins(models={"noel_2017", "pfeiffer_bowen_1989"})
    bpy.ops.rockfall.set_up_film(size="hd", engine="cycles")
    bridge("live").sync(scene)


def forget_places(scene: bpy.types.Scene) -> None:
    """No path of this machine stays in the file; the footage is found beside it."""
    for obj in scene.objects:
        if "rockfall_video_file" in obj:
            obj["rockfall_video_file"] = f"{ELSEWHERE}/footage.mp4"
        if "rockfall_events_file" in obj:
            obj["rockfall_events_file"] = f"{ELSEWHERE}/events.csv"
    for clip in bpy.data.movieclips:
        clip.filepath = VIDEO
    for font in bpy.data.fonts:
        if font.filepath != "<builtin>":
            font.filepath = f"/usr/share/blender/fonts/{Path(font.filepath).name}"
    scene["rockfall_picks_source"] = "picks.csv"
    for text in list(bpy.data.texts):
        bpy.data.texts.remove(text)
    for brush in list(bpy.data.brushes):
        bpy.data.brushes.remove(brush)
    bpy.data.orphans_purge(do_recursive=True)


def plain(value):
    """What JSON can hold, doubles exactly."""
    if hasattr(value, "to_dict"):
        return {name: plain(each) for name, each in value.to_dict().items()}
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if hasattr(value, "to_list"):
        return value.to_list()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, np.generic):
        return value.item()
    return value


def ours(obj) -> dict:
    return {name: plain(obj[name]) for name in sorted(obj.keys()) if name.startswith("rockfall_")}


def fields(one) -> dict:
    return {name: plain(getattr(one, name)) for name in one.__dataclass_fields__ if name != "shift"}


def numbers(settings) -> dict:
    return {
        name: plain(sorted(value) if isinstance(value := getattr(settings, name), set) else value)
        for name in dict(settings.bl_rna.properties.items())
        if name not in ("rna_type", "name") and isinstance(getattr(settings, name), (bool, int, float, str, set))
    }


def content(scene: bpy.types.Scene) -> dict:
    """What the old code reads from the opened file."""
    videos, alignment, picks = bridge("videos"), bridge("alignment"), bridge("picks")
    result = bridge("reconstruction").reconstruct_scene(scene)
    impacts = result.impacts
    table = picks.picks_of(scene)
    cameras = {}
    for camera in videos.cameras(scene):
        path = videos.moving_camera(camera)
        cameras[camera.name] = {
            "time_s": plain(path.time_s),
            "position": plain(path.position),
            "rotation": plain(path.rotation),
            "sigma_position_m": plain(path.sigma_position_m),
            "sigma_rotation": plain(path.sigma_rotation),
            "intrinsics": plain(path.camera.intrinsics),
            "clock": fields(videos.clock_of(camera)),
            "video_s": plain(videos.times_of(camera)[:5]),
            "frames": len(videos.times_of(camera)),
            "row_time_s": videos.row_time_of(camera),
            "pose_covariance": plain(videos.pose_covariance(camera)),
            "pairs": [fields(pair) for pair in alignment.pairs_of(camera)],
            "solution": fields(alignment.solution_of(camera)),
            "placement": alignment.placement(camera),
            "events": bridge("video_times").events_of(camera),
            "seen": {name: fields(bridge("observations").seen_in(camera, name))
                     for name in bridge("observations").names_in(camera)},
            "settings": numbers(camera.rockfall_alignment),
        }  # fmt: skip
    project = bridge("reconstruction").project_settings(scene, table.trajectory.tolist())
    return {
        "version": "0.1.0",
        "scene": ours(scene),
        "shift": [*bridge("state").read_shift(scene).vector.tolist(), bridge("state").read_shift(scene).crs],
        "settings": numbers(scene.rockfall),
        "picking": numbers(scene.rockfall_picking),
        "terrain": [[len(tile.data.vertices), len(tile.data.polygons)] for tile in bridge("terrain").tiles(scene)],
        "reconstruction": fields(project.reconstruction) | {"block": fields(project.block)},
        "picks": [ours(obj) for obj in picks.ordered(scene, picks.objects_of(scene))],
        "sightings": {
            obj["rockfall_id"]: {name: fields(each) for name, each in bridge("picking").sightings(obj).items()}
            for obj in picks.objects_of(scene)
        },
        "table": fields(table),
        "impacts": {name: plain(getattr(impacts, name)) for name in
                    ("trajectory", "impact", "time_s", "position", "normal", "v1", "v2", "rn", "rt", "r", "theta1",
                     "theta_dev", "kinetic1_j", "kinetic2_j")} | {"sigma": plain(impacts.sigma)},
        "cameras": cameras,
        "proposal": bridge("refinement").proposal(scene),
        "models": list(bridge("twins").shown_models(scene)),
        "film": part("rockfall_addon.film.remembered").is_set_up(scene),
        "objects": sorted(
            [obj.name, str(obj.get("rockfall_role", "")), str(obj.get("rockfall_trajectory", ""))]
            for obj in scene.objects
        ),
    }  # fmt: skip


def main() -> None:
    demo = Path(sys.argv[1]).resolve() / "assets" / "demo"
    root = Path("/tmp/rockfall")
    target, work = root / "tests" / "data" / "saved_by_0.1.0.blend", root / "work"
    for folder in (target.parent, work, root / "assets" / "demo" / "footage"):
        folder.mkdir(parents=True, exist_ok=True)
    (root / "assets/demo/footage/footage.mp4").write_bytes((demo / "footage" / "footage.mp4").read_bytes())
    module = importlib.import_module(NAME)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.context.preferences.addons.new().module = NAME
    module.register()
    make(demo, work)
    bpy.ops.wm.save_as_mainfile(filepath=str(target), compress=True)
    forget_places(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(target), compress=True)
    bpy.ops.wm.open_mainfile(filepath=str(target))
    text = json.dumps(content(bpy.context.scene), ensure_ascii=False, sort_keys=True)
    text = text.replace(', "', ',\n"')
    target.with_suffix(".json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
