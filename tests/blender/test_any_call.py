# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever an operator is called with, and whatever another add-on has written into the scene: it answers in words."""

import importlib.util
import math
import random
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import bpy
import pytest

NAN, INF = math.nan, math.inf
SLOW = {"export_animation", "export_web_page", "render_film", "preview_film", "simulate"}
"""Operators that take seconds where there is something to do."""
SLOW_IN_DEMO = SLOW | {
    "refine", "track_block", "follow_background", "find_equivalent", "calibrate", "propose_impacts", "build_proxy",
    "compute_maps",
}  # fmt: skip
DEMOS = ("load_demo", "load_footage_demo")
REPLACES = (*DEMOS, "open_project", "import_terrain", "import_picks", "add_video")
"""Operators after which the scene is another one."""
NONSENSE = (
    {"STRING": "", "INT": 0, "FLOAT": 0.0, "BOOLEAN": True},
    {"STRING": "nan", "INT": 2**31 - 1, "FLOAT": NAN, "BOOLEAN": False},
    {"STRING": "/nowhere/\nü" + 300 * "x", "INT": -(2**31), "FLOAT": 1e38, "BOOLEAN": True},
    {"STRING": "../..", "INT": 7, "FLOAT": -1e38, "BOOLEAN": False},
    {"STRING": "/", "INT": 1, "FLOAT": INF, "BOOLEAN": True},
)
JUNK = (
    5, NAN, -INF, -1, 1e300, 2**31 - 1, True, "", "x", "{", "[]", '{"A": null}', "[[1]]", [], [NAN] * 3, [1.0] * 3,
    [1, 2], ["a"], {"a": {}}, {"a": [1.0]}, b"\xff",
)  # fmt: skip


def write_project(folder: Path) -> None:
    spec = importlib.util.spec_from_file_location("random_walk", Path(__file__).with_name("random_walk.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.write_project(folder)


def begin(kind: str, folder: Path) -> None:
    """A scene of a kind, from a file of the second time on."""
    file = folder / f"{kind}.blend"
    if file.is_file():
        bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False)
        return
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    if kind == "project":
        assert bpy.ops.rockfall.open_project(filepath=str(folder / "project.toml")) == {"FINISHED"}
    elif kind == "demo":
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)


def operators() -> list[str]:
    return [name for name in dir(bpy.ops.rockfall) if not name.startswith("_")]


def given(name: str) -> Iterator[dict[str, object]]:
    """Values for the properties of an operator: its defaults, and nonsense."""
    yield {}
    properties = [each for each in getattr(bpy.ops.rockfall, name).get_rna_type().properties if not each.is_readonly]
    for values in NONSENSE:
        found = {}
        for each in properties:
            if each.type in values:
                value = values[each.type]
                found[each.identifier] = [value] * each.array_length if getattr(each, "is_array", False) else value
            elif each.type == "ENUM" and each.enum_items:
                last = [item.identifier for item in each.enum_items][-1]
                found[each.identifier] = {last} if each.is_enum_flag else last
        if found:
            yield found
    for each in properties:
        if each.type == "ENUM":
            yield {each.identifier: {"no such"} if each.is_enum_flag else "no such"}


def call(name: str, values: dict[str, object]) -> str:
    """Call an operator; what it says where it refuses."""
    with suppress(TypeError):  # a value that Blender itself does not take
        try:
            getattr(bpy.ops.rockfall, name)("EXEC_DEFAULT", **values)
        except RuntimeError as error:
            return str(error)
    return ""


def check(said: str, capfd: pytest.CaptureFixture, what: object) -> None:
    printed = capfd.readouterr()
    for text in (said, printed.out, printed.err):
        for bad in ("Traceback", "went wrong"):
            assert bad not in text, (what, text[text.index(bad) :][:2000])


@pytest.mark.parametrize("kind", ["empty", "project", "demo"])
def test_any_values(part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd, kind: str) -> None:
    """Defaults, empty and impossible paths, numbers that are none or huge, choices that there are not."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    write_project(tmp_path)
    begin(kind, tmp_path)
    left_out = {"empty": set(), "project": SLOW, "demo": SLOW_IN_DEMO}[kind]
    for name in operators():
        for values in given(name) if name not in left_out else ():
            check(call(name, values), capfd, (name, values))
            if name in REPLACES:
                begin(kind, tmp_path)
            if name in DEMOS:
                break


@pytest.mark.parametrize("seed", range(4))
def test_any_stored_values(part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd, seed: int) -> None:
    """Another add-on writes where we do, and nobody has looked since; picks that it left alone stay."""
    monkeypatch.chdir(tmp_path)
    write_project(tmp_path)
    choice = random.Random(seed)
    names = [name for name in operators() if name not in SLOW | set(REPLACES)]
    if seed % 2:
        begin("demo", tmp_path)
        names = [name for name in names if name not in SLOW_IN_DEMO | {"remove_video", "remove_pick"}]
    else:
        begin("project", tmp_path)
    names = [name for name in names if "remove" not in name and "delete" not in name and "clear" not in name]
    ours = [obj for obj in bpy.data.objects if "rockfall_role" in obj]
    held = [*bpy.data.scenes, *ours, *bpy.data.actions, *bpy.data.collections]
    hurt, damage = set(), []
    for _ in range(12):
        holder = choice.choice(held)
        keys = sorted(key for key, _ in holder.items() if key.startswith("rockfall_") and key != "rockfall_schema")
        if keys:
            key, value = choice.choice(keys), choice.choice(JUNK)
            holder[key] = value
            hurt.add(holder)
            damage.append((holder.name, key, value))
    whole = [obj for obj in ours if obj["rockfall_role"] == "pick" and obj not in hurt]
    whole = [obj for obj in whole if obj.animation_data is None or obj.animation_data.action not in hurt]
    ids = {obj["rockfall_id"] for obj in whole}
    for name in choice.sample(names, len(names)):
        check(call(name, {}), capfd, (name, damage))
    there = {obj.get("rockfall_id") for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "pick"}
    assert ids <= there, damage
