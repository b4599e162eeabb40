# SPDX-License-Identifier: GPL-3.0-or-later
"""A random walk over what a person can do to a scene: every operator of ours, what Blender does to objects, scenes and
collections, undo and redo, saving and loading. After each step no pick is lost and nothing has gone wrong.

Every step is stored for undo, as those of a person are. Blender itself (5.2, also without Rockfall) crashes now and
then in an undo after a script has made or removed data-blocks that no stored step knows: of walks that store two steps
of five, about every second one ends so.

Used in Blender as a module, in a process of its own (test_random_walk.py, scripts/fuzzing/walk_blender.py), and in a
window (tests/interface/walk_of_operators.py).

    python tests/blender/random_walk.py SEED STEPS FOLDER
    blender --background --factory-startup --addons bl_ext.user_default.rockfall \\
        --python tests/blender/random_walk.py -- SEED STEPS FOLDER
"""

import contextlib
import faulthandler
import importlib
import os
import random
import shutil
import sys
import traceback
from collections.abc import Callable
from math import cos, sin
from pathlib import Path

import bpy

VIDEO = Path(__file__).resolve().parents[1] / "data" / "videos" / "constant.mp4"
NAME = "bl_ext.user_default.rockfall" if bpy.app.binary_path else "rockfall"

DEMO = ("load_demo", "load_footage_demo", "open_project")
SLOW = {
    "render_film", "preview_film", "calibrate", "find_equivalent", "simulate", "track_block", "follow_background",
    "refine", "build_proxy", "export_graphs", "propose_pairs", "propose_impacts", "compute_maps", "export_maps",
    "export_web_page", "export_animation",
}  # fmt: skip
"""Operators that may take more than a second."""
REPLACES = {"import_picks", "load_demo", "open_project", "load_footage_demo"}
"""Operators that put other picks into the scene."""
FILES = {"filepath", "directory"}
UNDO_STEPS = 12
KEPT = (
    "rockfall_kind", "rockfall_status", "rockfall_normal", "rockfall_sigma_time_s", "rockfall_sigma_position_m",
    "rockfall_angular_velocity_radps", "rockfall_extra",
)  # fmt: skip
"""What a pick holds beside its trajectory, time and place."""
MOST_THINGS = 400
FEW = 4
"""With fewer picks than this, a table is imported."""

Picks = dict[tuple[str, str], tuple]
"""(scene, id) → trajectory, time and place of a pick, to the last bit."""


class Walk:
    """One walk; `step` does the next thing and returns its name, `check` then looks whether all is well.

    Parameters
    ----------
    seed : two walks with the same seed do the same.
    folder : empty, for what is written.
    part : a module of the registered package by its name.
    slow : whether operators that take long belong to it, too.
    first_the_step : whether, as in a window, the undo step is stored before anything looks at what was done.
    can_disable : whether the extension is disabled and enabled again on the way.
    """

    def __init__(
        self,
        seed: int,
        folder: Path,
        part: Callable[[str], object],
        *,
        slow: bool = False,
        first_the_step: bool = False,
        can_disable: bool = False,
    ) -> None:
        self.random, self.folder, self.part = random.Random(seed), folder, part
        self.operators = sorted(name for name in dir(bpy.ops.rockfall) if not name.startswith("_"))
        if not slow:
            self.operators = [name for name in self.operators if name not in SLOW]
        self.actions: list[tuple[int, Callable[[], str]]] = [
            (30, self.operator), (8, self.undo), (5, self.redo), (6, self.move_pick), (5, self.move_key),
            (3, self.move_block_key), (3, self.delete_object), (1, self.delete_trajectory), (4, self.rename),
            (2, self.delete_collection), (2, self.new_scene), (3, self.delete_scene), (3, self.other_scene),
            (3, self.duplicate), (3, self.save), (2, self.save_and_load), (3, self.go_to_frame), (1, self.frame_rate),
            (3, self.setting), (1, self.clear_animation), (3, self.select), (1, self.parent), (1, self.purge),
            (1, self.link_elsewhere), (1, self.unlink), (1, self.edit_mode), (2, self.append), (1, self.append_scene),
            (1, self.link_file), (1, self.make_local), (1, self.unit_scale), (1, self.move_file),
            (1, self.rename_video),
        ]  # fmt: skip
        if can_disable:
            self.actions.append((2, self.disable_and_enable))
        self.before: Picks = {}
        self.may_go: set[str] | None = set()
        self.may_change = False
        self.history: list[Picks] = []
        self.place = -1
        self.pushes, self.pushed, self.first_the_step = False, "", first_the_step
        self.done: list[str] = []

    def begin(self) -> None:
        """A slope with three runs, which is the first step that can be undone to."""
        write_project(self.folder)
        self.home = self.folder / "site"
        self.home.mkdir()
        shutil.copy(VIDEO, self.home / "video.mp4")
        assert bpy.ops.rockfall.open_project(filepath=str(self.folder / "project.toml")) == {"FINISHED"}
        bpy.ops.wm.save_as_mainfile(filepath=str(self.folder / "other.blend"), copy=True)
        bpy.ops.rockfall.add_video(filepath=str(self.home / "video.mp4"))
        bpy.ops.ed.undo_push(message="project")
        self.history, self.place = [picks_of_all()], 0

    def step(self) -> str:
        """Do the next thing."""
        self.before, self.may_go, self.may_change, self.pushes = picks_of_all(), set(), False, True
        weights, actions = zip(*self.actions, strict=True)
        (action,) = self.random.choices(actions, weights)
        name = self.import_again() if len(self.before) < FEW else action()
        self.done.append(name)
        return name

    def check(self) -> None:
        """Nothing has gone wrong in the last step; it can be undone."""
        said, self.pushed = self.done[-1], self.done[-1][:60] if self.pushes else self.pushed
        if self.pushes and self.first_the_step:
            bpy.ops.ed.undo_push(message=self.pushed)
        problems, sync = self.part("rockfall_addon.scene.problems"), self.part("rockfall_addon.scene.footage.sync")
        if self.first_the_step:
            for scene in bpy.data.scenes:
                sync.touch(scene)
            sync.work()
        for scene in bpy.data.scenes:
            sync.sync(scene)
        troubles = [remark.text for remark in problems.remarks(bpy.context.scene) if "went wrong" in remark.text]
        assert not troubles, (said, troubles)
        now = picks_of_all()
        if self.may_go is not None:
            lost = {key for key in self.before if key not in now and key[1] not in self.may_go}
            assert not lost, (said, "picks are lost", sorted(lost)[:3])
            if not self.may_change:
                other = {key for key in self.before if key in now and now[key] != self.before[key]}
                assert not other, (
                    said,
                    "picks have changed",
                    [(self.before[one], now[one]) for one in sorted(other)][:2],
                )
        again = settled(sync)
        assert again == now, (said, "a second look changes picks", different(now, again))
        if self.pushes:
            if not self.first_the_step:
                bpy.ops.ed.undo_push(message=self.pushed)
            self.history = [*self.history[: self.place + 1], now][-UNDO_STEPS:]
            self.place = len(self.history) - 1

    # what is done

    def operator(self) -> str:
        name = self.random.choice(self.operators)
        if name in DEMO and self.random.random() < 0.9:
            return "nothing"
        call = getattr(bpy.ops.rockfall, name)
        values = {each.identifier: self.value(each, name) for each in call.get_rna_type().properties if self.asks(each)}
        self.may_change = True
        if name in REPLACES:
            self.may_go = None
        if name == "remove_pick":
            self.may_go = {obj["rockfall_id"] for obj in bpy.context.selected_objects if "rockfall_id" in obj}
            self.may_go |= {obj["rockfall_id"] for obj in (bpy.context.object,) if obj and "rockfall_id" in obj}
        said = f"{name}({', '.join(f'{key}={value!r}' for key, value in values.items())})"
        refused = ""
        try:
            call("EXEC_DEFAULT", **values)
        except RuntimeError as error:
            refused = str(error)
        assert "Traceback" not in refused, (said, refused)
        return f"{said} {refused.strip()[:60]}"

    def asks(self, each: bpy.types.Property) -> bool:
        """Whether a value of the operator is chosen at random."""
        if each.identifier in FILES:
            return True
        if each.type == "ENUM" and not each.enum_items:  # those of a function
            return False
        return each.type in {"ENUM", "BOOLEAN", "INT", "STRING"} and not each.is_hidden and self.random.random() < 0.5

    def value(self, each: bpy.types.Property, operator: str) -> object:
        if each.identifier == "filepath":
            if operator in {"open_project", "import_picks", "import_terrain"} and self.random.random() < 0.7:
                names = {"open_project": "project.toml", "import_picks": "picks.csv", "import_terrain": "slope.obj"}
                return str(self.folder / names[operator])
            return str(self.folder / f"{operator}.{self.random.choice(['csv', 'toml', 'png', 'mp4', 'ply'])}")
        if each.identifier == "directory":
            return str(self.folder / operator)
        if each.type == "BOOLEAN":
            return self.random.random() < 0.5
        if each.type == "INT":
            return self.random.choice([-1, 0, 1, 2, 7])
        if each.type == "STRING" and each.identifier == "which":
            return self.random.choice(["A", "B"])
        if each.type == "STRING":
            return self.random.choice(["", "noel_2017", "rn", "B03", "x", "nan", "-1"])
        items = [item.identifier for item in each.enum_items]
        return {self.random.choice(items)} if each.is_enum_flag else self.random.choice(items)

    def import_again(self) -> str:
        self.may_go = None
        with contextlib.suppress(RuntimeError):  # where another origin is in the way
            bpy.ops.rockfall.import_picks(filepath=str(self.folder / "picks.csv"))
        if not picks_of_all():
            bpy.context.window_manager.windows[0].scene = bpy.data.scenes.new("new")
            bpy.ops.rockfall.open_project(filepath=str(self.folder / "project.toml"))
        return "import again"

    def undo(self) -> str:
        if self.place <= 0:
            return "nothing"
        return self.go_in_history(-1, bpy.ops.ed.undo)

    def redo(self) -> str:
        if self.place >= len(self.history) - 1:
            return "nothing"
        return self.go_in_history(1, bpy.ops.ed.redo)

    def go_in_history(self, way: int, how: Callable[[], set[str]]) -> str:
        how()
        self.place += way
        self.before, self.pushes = self.history[self.place], False
        return "undo" if way < 0 else "redo"

    def move_pick(self) -> str:
        obj = self.any_of("pick")
        if obj is None:
            return "nothing"
        self.may_change = True
        obj.location[self.random.randrange(3)] += self.random.choice([0.0, 1e-7, 0.3, -2.0, 500.0])
        bpy.context.view_layer.update()
        return f"move {obj.name}"

    def move_key(self) -> str:
        return self.shift_keys(self.any_of("pick"), every=True)

    def move_block_key(self) -> str:
        return self.shift_keys(self.any_of("block"), every=False)

    def shift_keys(self, obj: bpy.types.Object | None, *, every: bool) -> str:
        animation = obj.animation_data if obj is not None else None
        if animation is None or animation.action is None or animation.action_slot is None:
            return "nothing"
        self.may_change = True
        bag = animation.action.layers[0].strips[0].channelbag(animation.action_slot)
        which, frames = self.random.random(), self.random.choice([0.513, -3.117, 12.371])  # never onto another key
        for curve in bag.fcurves:
            points = list(curve.keyframe_points)
            for point in points if every else points[int(which * len(points)) :][:1]:
                point.co_ui[0] += frames
            curve.update()
        bpy.context.view_layer.update()
        return f"keys of {obj.name} by {frames}"

    def delete_object(self) -> str:
        obj = self.any_object()
        if obj is None:
            return "nothing"
        self.may_go = {obj.get("rockfall_id")}
        name = obj.name
        bpy.data.objects.remove(obj)
        bpy.context.view_layer.update()
        return f"delete {name}"

    def delete_trajectory(self) -> str:
        obj = self.any_of("pick")
        if obj is None:
            return "nothing"
        name = obj["rockfall_trajectory"]
        gone = [each for each in ours("pick") if each.get("rockfall_trajectory") == name]
        self.may_go = {each["rockfall_id"] for each in gone}
        bpy.data.batch_remove(gone)
        bpy.context.view_layer.update()
        return f"delete picks of {name}"

    def rename(self) -> str:
        kinds = ("objects", "collections", "meshes", "materials", "actions", "node_groups", "cameras", "worlds")
        held = [each for each in getattr(bpy.data, self.random.choice(kinds)) if each.library is None]
        if not held:
            return "nothing"
        each = self.random.choice(held)
        old, each.name = each.name, self.random.choice(["ä ö", "B03", "x" * 63, "Rockfall", "A 01 impact"])
        bpy.context.view_layer.update()
        return f"rename {old} to {each.name}"

    def delete_collection(self) -> str:
        """As the outliner does it: what was in it goes to the scene; or with all that is in it."""
        held = [each for each in bpy.data.collections if each.library is None]
        if not held:
            return "nothing"
        each = self.random.choice(held)
        name = each.name
        if self.random.random() < 0.6:
            for scene in bpy.data.scenes:
                if each in scene.collection.children_recursive:
                    for obj in each.objects:
                        if obj.name not in scene.collection.objects:
                            scene.collection.objects.link(obj)
                    for child in each.children:
                        if child.name not in scene.collection.children:
                            scene.collection.children.link(child)
        else:
            self.may_go = {obj.get("rockfall_id") for obj in each.all_objects}
        bpy.data.collections.remove(each)
        bpy.context.view_layer.update()
        return f"delete collection {name}"

    def new_scene(self) -> str:
        if len(bpy.data.scenes) > 3:
            return "nothing"
        kind = self.random.choice(["NEW", "EMPTY", "LINK_COPY", "FULL_COPY"])
        bpy.ops.scene.new(type=kind)
        return f"new scene {kind}"

    def delete_scene(self) -> str:
        if len(bpy.data.scenes) < 2:
            return "nothing"
        scene = self.random.choice(list(bpy.data.scenes))
        name = scene.name
        self.may_go = {key[1] for key in self.before if key[0] == name}
        shared = [obj for obj in scene.objects if "rockfall_id" in obj and len(obj.users_scene) > 1]
        self.may_change = bool(shared)  # another scene keeps them now, and does the edits that waited in this one
        bpy.data.scenes.remove(scene)
        return f"delete scene {name}"

    def other_scene(self) -> str:
        window = next(iter(bpy.context.window_manager.windows), None)
        if window is None:
            return "nothing"
        window.scene = self.random.choice(list(bpy.data.scenes))
        return f"scene {window.scene.name}"

    def duplicate(self) -> str:
        obj = self.any_object()
        if obj is None:
            return "nothing"
        copy = obj.copy()
        if obj.data is not None and self.random.random() < 0.5:
            copy.data = obj.data.copy()
        if copy.animation_data and copy.animation_data.action and self.random.random() < 0.5:
            copy.animation_data.action = copy.animation_data.action.copy()
        bpy.context.scene.collection.objects.link(copy)
        bpy.context.view_layer.update()
        return f"duplicate {obj.name}"

    def save(self) -> str:
        bpy.ops.wm.save_as_mainfile(filepath=str(self.home / "walk.blend"))
        return "save"

    def save_and_load(self) -> str:
        self.save()
        self.load()
        return "save and load"

    def load(self) -> None:
        bpy.ops.wm.open_mainfile(filepath=str(self.home / "walk.blend"), load_ui=False)
        self.history, self.place = [], -1

    def move_file(self) -> str:
        """The .blend and the video beside it come to another folder; the old ones are no more."""
        self.save()
        moved = self.folder / f"site {len(self.done)}"
        self.home = self.home.rename(moved)
        self.load()
        return "move the file"

    def rename_video(self) -> str:
        """The file of the video has another name, or its own again."""
        here, there = self.home / "video.mp4", self.home / "moved video.mp4"
        (here if here.exists() else there).rename(there if here.exists() else here)
        return "rename the video"

    def append(self) -> str:
        """Objects or a collection of another file, some with the same ids and names."""
        if sum(map(len, (bpy.data.objects, bpy.data.meshes))) > MOST_THINGS:
            return "nothing"
        kind = self.random.choice(["objects", "collections"])
        with bpy.data.libraries.load(str(self.folder / "other.blend")) as (there, _):
            names = sorted(getattr(there, kind))
        folder = str(self.folder / "other.blend" / {"objects": "Object", "collections": "Collection"}[kind]) + os.sep
        chosen = self.random.sample(names, min(len(names), self.random.choice([1, 3])))
        bpy.ops.wm.append(directory=folder, filename=chosen[0], files=[{"name": name} for name in chosen])
        bpy.context.view_layer.update()
        self.may_change = True  # other picks of a run are before and after
        return f"append {kind} {', '.join(chosen)}"

    def append_scene(self) -> str:
        if len(bpy.data.scenes) > 3:
            return "nothing"
        folder = str(self.folder / "other.blend" / "Scene") + os.sep
        bpy.ops.wm.append(directory=folder, filename="Scene")
        return "append a scene"

    def link_file(self) -> str:
        """A collection of another file, which is not to be written to."""
        folder = str(self.folder / "other.blend" / "Collection") + os.sep
        bpy.ops.wm.link(directory=folder, filename="Rockfall", instance_collections=self.random.random() < 0.5)
        bpy.context.view_layer.update()
        return "link a collection"

    def make_local(self) -> str:
        if not bpy.data.libraries:
            return "nothing"
        if self.random.random() < 0.5:
            bpy.data.libraries.remove(self.random.choice(list(bpy.data.libraries)))
            return "remove a library"
        for obj in bpy.context.view_layer.objects:
            obj.select_set(obj.library is not None)
        with contextlib.suppress(RuntimeError):
            bpy.ops.object.make_local(type=self.random.choice(["SELECT_OBJECT", "ALL"]))
        bpy.context.view_layer.update()
        self.may_change = True
        return "make local"

    def unit_scale(self) -> str:
        scene = self.random.choice(list(bpy.data.scenes))
        scene.unit_settings.scale_length = self.random.choice([1.0, 0.01, 0.3048])
        return f"unit scale {scene.unit_settings.scale_length}"

    def disable_and_enable(self) -> str:
        """All stays as it is, to the last bit."""
        before = stored()
        disable()
        without = picks_of_all()
        assert stored() == before, "disabling changes what is stored"
        enable()
        assert picks_of_all() == without, "enabling changes picks"
        self.pushes = False
        return "disable and enable"

    def go_to_frame(self) -> str:
        frame = self.random.choice([0, 1, 33, 250, -5])
        bpy.context.scene.frame_set(frame, subframe=self.random.choice([0.0, 0.37]))
        return f"frame {frame}"

    def frame_rate(self) -> str:
        bpy.context.scene.render.fps = self.random.choice([24, 25, 30, 60, 120])
        bpy.context.view_layer.update()
        return f"{bpy.context.scene.render.fps} frames per second"

    def setting(self) -> str:
        groups = [name for name in dir(bpy.context.scene) if name.startswith("rockfall")]
        group = getattr(bpy.context.scene, self.random.choice(groups))
        if not isinstance(group, bpy.types.PropertyGroup):
            return "nothing"
        each = self.random.choice([one for one in group.bl_rna.properties if not one.is_readonly] or [None])
        if each is None or each.type not in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}:
            return "nothing"
        if getattr(each, "is_array", False) or (each.type == "ENUM" and not each.enum_items):
            return "nothing"
        self.may_change = True
        value = self.random.choice([0.0, 1.0, 0.35, 1e6]) if each.type == "FLOAT" else self.value(each, "setting")
        with contextlib.suppress(TypeError):  # an enum whose items are a function's
            setattr(group, each.identifier, value)
        bpy.context.view_layer.update()
        return f"{group.bl_rna.identifier}.{each.identifier} = {value!r}"

    def clear_animation(self) -> str:
        obj = self.any_object()
        if obj is None:
            return "nothing"
        obj.animation_data_clear()
        if bpy.context.scene.camera is not None:
            bpy.context.scene.camera.animation_data_clear()
        bpy.context.view_layer.update()
        return f"clear animation of {obj.name}"

    def select(self) -> str:
        for obj in bpy.context.view_layer.objects:
            obj.select_set(self.random.random() < 0.05)
        obj = self.any_object()
        if obj is not None and obj.name in bpy.context.view_layer.objects:
            bpy.context.view_layer.objects.active = obj
        return "select"

    def parent(self) -> str:
        child, parent = self.any_object(), self.any_object()
        if child is None or child == parent or parent.parent is not None:
            return "nothing"
        child.parent = parent
        bpy.context.view_layer.update()
        return f"parent {child.name}"

    def purge(self) -> str:
        bpy.data.orphans_purge(do_recursive=True)
        return "purge"

    def link_elsewhere(self) -> str:
        obj, scene = self.any_object(), self.random.choice(list(bpy.data.scenes))
        origins = [list(each.get("rockfall_shift_m", ())) for each in (scene, bpy.context.scene)]
        if obj is None or obj.name in scene.objects or origins[0] != origins[1]:
            return "nothing"
        scene.collection.objects.link(obj)
        self.may_go, self.may_change = {obj.get("rockfall_id")}, True  # it may get an id, and another origin
        bpy.context.view_layer.update()
        return f"link {obj.name} to {scene.name}"

    def unlink(self) -> str:
        obj = self.any_object()
        if obj is None:
            return "nothing"
        self.may_go = {obj.get("rockfall_id")}
        for each in obj.users_collection:
            each.objects.unlink(obj)
        bpy.context.view_layer.update()
        return f"unlink {obj.name}"

    def edit_mode(self) -> str:
        obj = bpy.context.view_layer.objects.active
        if obj is None or obj.type != "MESH" or not obj.visible_get() or obj.name not in bpy.context.view_layer.objects:
            return "nothing"
        with contextlib.suppress(RuntimeError):  # steps that are undone in Edit Mode are those of the mesh alone
            bpy.ops.object.mode_set(mode="EDIT")
            bpy.ops.object.mode_set(mode="OBJECT")
        return f"edit mode of {obj.name}"

    def any_of(self, role: str) -> bpy.types.Object | None:
        found = ours(role)
        return self.random.choice(found) if found else None

    def any_object(self) -> bpy.types.Object | None:
        found = [obj for obj in bpy.context.scene.objects if obj.library is None]
        return self.random.choice(found) if found else None


def write_project(folder: Path) -> None:
    """A slope of 200 triangles in survey coordinates, and three runs of six picks."""
    east, north, up = 2_600_000.0, 1_200_000.0, 1_500.0

    def height(x: float, y: float) -> float:
        return up + 50 - 0.7 * x + 0.5 * sin(0.3 * x) * cos(0.4 * y)

    places = [(x, y) for x in range(-5, 50, 5) for y in range(-10, 40, 5)]
    lines = [f"v {east + x} {north + y} {height(x, y)}" for x, y in places]
    for corner in (10 * i + j for i in range(10) for j in range(9)):
        a, b, c, d = (corner + 1, corner + 11, corner + 12, corner + 2)
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    (folder / "slope.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = ["trajectory,time_s,x_m,y_m,z_m,kind,status,confidence"]
    for number, name in enumerate(("A", "B", "C" * 70)):
        time, x, y = 10.0 + 7 * number, 0.0, 3.123456789 + 9 * number
        for kind, lasts in zip(
            ("release", "impact", "impact", "impact", "impact", "stop"), (0.73, 1.17, 0.9, 0.61, 0.5, 0), strict=True
        ):
            rows.append(f"{name},{time!r},{east + x!r},{north + y!r},{height(x, y)!r},{kind},ok,2")
            time, x, y = time + lasts, x + 7.3 * lasts, y + 0.4 * lasts
    (folder / "picks.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "project.toml").write_text(
        f'schema = 1\n[terrain]\nfile = "slope.obj"\nshift = [{east}, {north}, {up}]\nup = "z"\n'
        '[picks]\nfile = "picks.csv"\n[block]\nd1_m = 0.5\nd2_m = 0.5\nd3_m = 0.4\n',
        encoding="utf-8",
    )


def ours(role: str) -> list[bpy.types.Object]:
    return [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == role and obj.library is None]


def picks_of_all() -> Picks:
    """All picks of all scenes."""
    return {
        (scene.name, obj["rockfall_id"]): (
            obj["rockfall_trajectory"],
            float(obj["rockfall_time_s"]).hex(),
            tuple(value.hex() for value in obj["rockfall_position_m"]),
            tuple(plain(obj.get(key)) for key in KEPT),
        )
        for scene in bpy.data.scenes
        for obj in scene.objects
        if obj.get("rockfall_role") == "pick" and "rockfall_id" in obj and obj.library is None
    }


def plain(value: object) -> str:
    """What an ID property holds, to the last bit."""
    for way in ("to_dict", "to_list"):
        if hasattr(value, way):
            value = getattr(value, way)()
    return repr(value)


def stored() -> dict[tuple[str, str], str]:
    """All that we have written into objects and scenes of this file."""
    return {
        (each.name_full, key): plain(value)
        for each in (*bpy.data.objects, *bpy.data.scenes)
        for key, value in each.items()
        if key.startswith("rockfall_") and each.library is None
    }


def settled(sync: object) -> Picks:
    """The picks after another look at them, as before a file is saved."""
    for scene in bpy.data.scenes:
        sync.sync(scene)
    return picks_of_all()


def different(before: Picks, after: Picks) -> list[tuple]:
    return [(key, before.get(key), after.get(key)) for key in {*before, *after} if before.get(key) != after.get(key)][
        :3
    ]


def enable() -> None:
    """As ticking the box in the preferences does."""
    if bpy.app.binary_path:
        import addon_utils

        assert addon_utils.enable(NAME, default_set=True, refresh_handled=True) is not None
        return
    if NAME not in bpy.context.preferences.addons:
        bpy.context.preferences.addons.new().module = NAME
    importlib.import_module(NAME).register()


def disable() -> None:
    if bpy.app.binary_path:
        import addon_utils

        addon_utils.disable(NAME, refresh_handled=True)
    else:
        importlib.import_module(NAME).unregister()


def main(seed: int, steps: int, folder: Path) -> int:
    """Walk; what is done is written to ``steps.txt`` before and after it is, as Blender may end at any of it."""
    faulthandler.enable()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    if not hasattr(bpy.types, "ROCKFALL_PT_installation"):
        enable()
    walk = Walk(seed, folder, lambda name: importlib.import_module(f"{NAME}.{name}"), can_disable=True)
    walk.begin()
    with (folder / "steps.txt").open("w", encoding="utf-8") as told:
        try:
            for number in range(steps):
                print(number, end=" ", file=told, flush=True)
                print(walk.step(), file=told, flush=True)
                walk.check()
        except BaseException:  # noqa: BLE001 - all of it is to be seen
            traceback.print_exc()
            return 1
    kinds = {name.split()[0].split("(")[0] for name in walk.done}
    print(f"{len(walk.done)} steps of {len(kinds)} kinds")
    return 0


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    code = main(int(given[0]), int(given[1]), Path(given[2]))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # a regular exit can crash after GPU work
