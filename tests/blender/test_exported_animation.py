# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations for other programs: files that Blender writes are read back, and blocks are where the core has them."""

import errno
import json
import os
import re
import struct
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

RATE = 20.0
NEAR_M = 1e-3
BYTES = {5126: "<f4", 5123: "<u2", 5125: "<u4"}
COUNTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


HAS_USD, HAS_ALEMBIC = bpy.app.build_options.usd, bpy.app.build_options.alembic
ENDINGS = ["abc"] * HAS_ALEMBIC + ["glb"] + ["usdc"] * HAS_USD
"""Some builds of Blender lack formats; Blender as a module has all."""


def truth(part, names: list[str], rate: float, frames: int) -> dict[str, np.ndarray]:
    """(f, 3) survey coordinates of each block, from its flights; NaN where no flight is known."""
    opening, project = part("core.workflow.opening"), part("core.exchange.project")
    demo = Path(part("core").__file__).parents[1] / "assets" / "demo" / "project.toml"
    _, result = opening.open_project(project.read_project(demo))
    return flown(part, result, names, rate, frames)


def flown(part, result, names: list[str], rate: float, frames: int) -> dict[str, np.ndarray]:
    flights, states = result.flights, part("core.reconstruction.flight").flight_states
    moments, found = np.arange(frames) / rate, {}
    for name in names:
        places = np.full((frames, 3), np.nan)
        own = np.flatnonzero(flights.trajectory == name)
        since = moments + flights.start_time_s[own[0]]
        for i in own:
            rows = np.flatnonzero((since > flights.start_time_s[i] + 1e-6) & (since < flights.end_time_s[i] - 1e-6))
            places[rows] = states(flights, np.full(rows.size, i), since[rows])[0]
        found[name] = places + result.picks.shift.vector
    return found


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, shared_part) -> Path:
    """The demo, exported as the command line does."""
    folder = tmp_path_factory.mktemp("exported") / "out"
    demo = Path(shared_part("core").__file__).parents[1] / "assets" / "demo" / "project.toml"
    run = shared_part("rockfall_addon.commands").run
    options = ["--rate", str(RATE), "--block", "box", "--format", *ENDINGS, "--out", str(folder)]
    assert run(["export", str(demo), *options]) == 0
    assert sorted(path.name for path in folder.iterdir()) == [f"animation.{ending}" for ending in ENDINGS]
    return folder


@pytest.fixture(scope="module")
def shared_part(installation):
    def part(name: str):
        import importlib

        installation.shared()
        return importlib.import_module(f"{installation.name}.{name}")

    return part


def compare(part, places: dict[str, np.ndarray], origin: np.ndarray) -> None:
    frames = len(next(iter(places.values())))
    known = truth(part, list(places), RATE, frames)
    assert len(places) == 15
    compared = 0
    for name, found in places.items():
        away = np.abs(found + origin - known[name])
        assert np.nanmax(away) < NEAR_M, name
        compared += int(np.isfinite(away[:, 0]).sum())
    assert compared > 600


def glb(file: Path) -> tuple[dict, bytes]:
    """The two chunks of a glTF file, as its specification has them."""
    data = file.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def accessor(content: dict, binary: bytes, number: int) -> np.ndarray:
    said = content["accessors"][number]
    view = content["bufferViews"][said["bufferView"]]
    begin = view.get("byteOffset", 0) + said.get("byteOffset", 0)
    columns = COUNTS[said["type"]]
    values = np.frombuffer(binary, BYTES[said["componentType"]], said["count"] * columns, begin)
    return values.reshape(-1, columns).astype(np.float64)


def test_gltf_has_the_blocks_places_and_turns(rockfall, part, files: Path) -> None:
    content, binary = glb(files / "animation.glb")
    root = next(node for node in content["nodes"] if node["name"] == "Rockfall")
    (animation,) = content["animations"]
    places, turns = {}, {}
    for channel in animation["channels"]:
        node, sampler = content["nodes"][channel["target"]["node"]], animation["samplers"][channel["sampler"]]
        time = accessor(content, binary, sampler["input"])[:, 0]
        np.testing.assert_allclose(time, np.arange(time.size) / RATE, atol=1e-5)
        values = accessor(content, binary, sampler["output"])
        assert sampler["interpolation"] == "LINEAR"
        if channel["target"]["path"] == "translation":
            places[node["name"]] = values[:, [0, 2, 1]] * [1, -1, 1]  # y is up in glTF
        else:
            turns[node["name"]] = values
    compare(part, places, np.array(root["extras"]["survey_origin_m"]))
    assert set(turns) == set(places)
    for values in turns.values():
        np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1.0, atol=1e-5)
        assert np.abs(np.diff(values, axis=0)).max() > 0.05  # they do turn
    kinds = {node["name"]: node.get("extras", {}).get("kind") for node in content["nodes"]}
    assert all(kinds[name] == "measured" for name in places)
    terrain = next(mesh for mesh in content["meshes"] if mesh["name"] == "Terrain")["primitives"][0]
    assert "COLOR_0" in terrain["attributes"]
    assert content["accessors"][terrain["indices"]]["count"] == 3 * 300330
    assert sum(p.get("mode") == 1 for mesh in content["meshes"] for p in mesh["primitives"]) == 15  # the paths


def test_gltf_turns_as_the_core(rockfall, part, files: Path) -> None:
    content, binary = glb(files / "animation.glb")
    animation = content["animations"][0]
    show = part("core.outreach.show")
    demo = Path(part("core").__file__).parents[1] / "assets" / "demo" / "project.toml"
    falls = {fall.name: fall for fall in show.open_show(show.ShowRequest(demo)).falls}
    upright = part("core.georeference").Z_UP
    for channel in animation["channels"]:
        name = content["nodes"][channel["target"]["node"]]["name"]
        if channel["target"]["path"] != "rotation" or name not in ("B01", "B06"):
            continue
        x, y, z, w = accessor(content, binary, animation["samplers"][channel["sampler"]]["output"])[15]
        vector = np.array([x, y, z])
        angle = 2 * np.arctan2(np.linalg.norm(vector), w)
        turn = part("core.camera.model").rotation_from_vector(vector / np.linalg.norm(vector) * angle)
        np.testing.assert_allclose(upright @ turn @ upright.T, falls[name].turn(15 / RATE), atol=1e-4)


@pytest.mark.skipif(not HAS_USD, reason="this Blender is built without USD")
def test_usd_read_by_its_own_library(rockfall, part, files: Path) -> None:
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    from pxr import UsdGeom

    stage = usd.Stage.Open(str(files / "animation.usdc"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetTimeCodesPerSecond() == RATE
    frames = int(stage.GetEndTimeCode()) + 1
    assert stage.GetStartTimeCode() == 0
    root = next(prim for prim in stage.Traverse() if prim.GetName() == "Rockfall")
    origin = next(root.GetAttribute(n).Get() for n in root.GetPropertyNames() if n.endswith("survey_origin_m"))
    places = {}
    for prim in root.GetChildren():
        if re.fullmatch(r"B\d\d", prim.GetName()):
            moved = [
                UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(t).ExtractTranslation() for t in range(frames)
            ]
            places[prim.GetName()] = np.array(moved)
    compare(part, places, np.array(list(origin)))


@pytest.mark.parametrize("ending", [ending for ending in ENDINGS if ending != "glb"])
def test_files_come_back_into_blender(rockfall, part, files: Path, ending: str) -> None:
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = round(RATE), 1.0
    file = str(files / f"animation.{ending}")
    if ending == "abc":
        assert bpy.ops.wm.alembic_import(filepath=file, as_background_job=False, set_frame_range=True) == {"FINISHED"}
    else:
        assert bpy.ops.wm.usd_import(filepath=file) == {"FINISHED"}
    blocks = {found[1]: obj for obj in scene.objects if (found := re.fullmatch(r"(?:Block_)?(B\d\d)", obj.name))}
    frames = scene.frame_end + 1
    places = {name: np.empty((frames, 3)) for name in blocks}
    for frame in range(frames):
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        for name, obj in blocks.items():
            places[name][frame] = obj.evaluated_get(graph).matrix_world.translation
    content, _ = glb(files / "animation.glb")
    origin = next(node for node in content["nodes"] if node["name"] == "Rockfall")["extras"]["survey_origin_m"]
    compare(part, places, np.array(origin))
    terrain = next(obj for obj in scene.objects if obj.name.startswith("Terrain") and obj.type == "MESH")
    assert len(terrain.data.polygons) == 300330


def test_the_scene_exports_what_it_shows(slope: bpy.types.Scene, part, tmp_path: Path) -> None:
    file = tmp_path / "fall.glb"
    assert bpy.ops.rockfall.export_animation(filepath=str(file), rate=RATE, formats={"glb"}) == {"FINISHED"}
    content, binary = glb(file)
    origin = np.array(
        next(node for node in content["nodes"] if node["name"] == "Rockfall")["extras"]["survey_origin_m"]
    )
    result = part("rockfall_addon.scene.reconstruction").reconstruct_good(slope)[0]
    animation, compared = content["animations"][0], 0
    for channel in animation["channels"]:
        if channel["target"]["path"] == "translation":
            name = content["nodes"][channel["target"]["node"]]["name"]
            values = accessor(content, binary, animation["samplers"][channel["sampler"]]["output"])
            known = flown(part, result, [name], RATE, len(values))[name]
            assert np.nanmax(np.abs(values[:, [0, 2, 1]] * [1, -1, 1] + origin - known)) < NEAR_M
            compared += int(np.isfinite(known[:, 0]).sum())
    assert compared > 60


def test_the_scene_writes_a_page_of_what_it_shows(slope: bpy.types.Scene, part, tmp_path: Path) -> None:
    slope["rockfall_site"], slope["rockfall_site_description"] = "Plane", "two runs"
    file = tmp_path / "plane"
    assert bpy.ops.rockfall.export_web_page(filepath=str(file), language="de") == {"FINISHED"}
    text = (tmp_path / "plane.html").read_text(encoding="utf-8")
    content = json.loads(re.search(r'id="show">(.*?)</script>', text, re.DOTALL)[1])
    assert (content["title"], content["subtitle"], content["language"]) == ("Plane", "two runs", "de")
    assert [block["name"] for block in content["blocks"]] == ["A", "B"]
    assert [block["rests"] for block in content["blocks"]] == [True, True]
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".html"] == ["plane.html"]


def test_credits_of_a_project_stay_with_the_file(rockfall, part, tmp_path: Path) -> None:
    demo = Path(part("core").__file__).parents[1] / "assets" / "demo"
    text = (
        (demo / "project.toml")
        .read_text(encoding="utf-8")
        .replace("[site]\n", '[site]\ncredits = "Noël"\ndoi = "10.1/x"\n')
    )
    for name in ("terrain.ply", "picks.csv"):
        text = text.replace(f'"{name}"', f'"{(demo / name).as_posix()}"')
    (tmp_path / "project.toml").write_text(text, encoding="utf-8")
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "project.toml")) == {"FINISHED"}
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "again")) == {"FINISHED"}
    again = part("core.exchange.project").read_project(tmp_path / "again" / "project.toml")
    assert again.site.extra == {"credits": "Noël", "doi": "10.1/x"}
    assert bpy.ops.rockfall.export_web_page(filepath=str(tmp_path / "a.html")) == {"FINISHED"}
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    content = json.loads(re.search(r'id="show">(.*?)</script>', text, re.DOTALL)[1])
    assert (content["credits"], content["doi"]) == ("Noël", "10.1/x")


def test_nothing_is_exported_without_trajectories(rockfall) -> None:
    assert not bpy.ops.rockfall.export_web_page.poll()
    assert not bpy.ops.rockfall.export_animation.poll()


def test_a_format_that_blender_is_built_without_is_named(rockfall, part, monkeypatch: pytest.MonkeyPatch) -> None:
    module = part("rockfall_addon.steps.share.animation")
    options = SimpleNamespace(usd=False, alembic=True)
    without = SimpleNamespace(app=SimpleNamespace(build_options=options))
    monkeypatch.setattr(module, "bpy", without)
    module.check_formats(["glb", "abc"])
    with pytest.raises(part("core.errors").RockfallError, match="built without USD"):
        module.check_formats(["glb", "usdc"])


def test_a_folder_that_cannot_be_written_is_told(slope: bpy.types.Scene, tmp_path: Path) -> None:
    wall = tmp_path / "wall"
    wall.write_text("a file")
    with pytest.raises(RuntimeError, match=r"wall"):
        bpy.ops.rockfall.export_animation(filepath=str(wall / "a.glb"), rate=5.0)
    with pytest.raises(RuntimeError, match=r"wall"):
        bpy.ops.rockfall.export_web_page(filepath=str(wall / "a.html"))
    assert wall.read_text() == "a file"


@pytest.mark.skipif(sys.platform != "linux", reason="/dev/full")
def test_a_full_disk_leaves_nothing(rockfall, part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender's own writers: what they say of a disk that is full, and that no piece of a file stays."""
    resource = pytest.importorskip("resource")
    show, animation = part("core.outreach.show"), part("core.outreach.animation")
    demo = Path(part("core").__file__).parents[1] / "assets" / "demo" / "project.toml"
    made = animation.animate(show.open_show(show.ShowRequest(demo)), 5.0)
    beside = part("rockfall_addon.steps.share.beside").blender_command()
    limited = ("prlimit", f"--fsize={1_000_000}:{resource.RLIM_INFINITY}", *beside)
    old = tmp_path / "a.usdc"
    old.write_bytes(b"old")
    for ending in ENDINGS:
        with pytest.raises(part("core.errors").RockfallError, match=r"room on the disk"):
            part("core.outreach.animator").write_animation(made, [tmp_path / f"a.{ending}"], limited)
    assert [path.name for path in tmp_path.iterdir()] == ["a.usdc"]
    assert old.read_bytes() == b"old"


def test_an_exporter_that_fails_is_told_in_a_line(part, tmp_path: Path, monkeypatch) -> None:
    """Blender's glTF exporter is Python, and reports its whole traceback: only the error at its end is told."""
    if not Path("/dev/full").exists():
        pytest.skip("there is no file here that is always full")
    mesh = bpy.data.meshes.new("triangle")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("triangle", mesh))
    file = tmp_path / "full.glb"
    file.symlink_to("/dev/full")
    with pytest.raises(part("core.errors").RockfallError) as caught:
        part("rockfall_addon.steps.share.animation")._export(file, None)
    said = str(caught.value)
    assert "could not write full.glb" in said
    assert os.strerror(errno.ENOSPC) in said
    assert len(said) < 400
    assert "Traceback" not in said
    assert ".py" not in said
