# SPDX-License-Identifier: GPL-3.0-or-later
"""The house stays as it is drawn: the core without Blender, imports in one direction, one name for each module."""

import ast
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import rockfall

ROOT = Path(rockfall.__file__).resolve().parent
BLENDER_MODULES = {"bpy", "bmesh", "gpu", "blf", "mathutils", "bpy_extras", "gpu_extras", "addon_utils"}

CORE_FLOORS = (
    {
        "blender_process",
        "children",
        "constants",
        "errors",
        "vectors",
        "compiled",
        "kept_code",
        "dependencies",
        "extras",
        "colours",
        "least_squares",
        "file_locks",
        "interrupts",
        "memory",
        "numba_internals",
        "open_folders",
        "opencv",
        "output",
        "plausibility",
        "progress",
        "reading",
        "remarks",
        "versions",
    },
    {"georeference"},
    {"formats"},
    {"terrain", "footage", "camera", "impact_models"},
    {"reconstruction"},
    {"simulation"},
    {"hazard", "analysis"},
    {"exchange"},
    {"workflow"},
    {"film"},
    {"outreach"},
    {"commands"},
    {"cli"},
    {"start"},
)
"""A module imports from the floors below its own; rooms of the lowest floor also from each other."""

ADDON_FLOORS = ({"scene"}, {"view"}, {"steps"}, {"preferences"}, {"handlers", "menus", "commands", "warm_up"})


def modules_of(package: str) -> Iterator[Path]:
    return (path for path in sorted((ROOT / package).rglob("*.py")) if "__pycache__" not in path.parts)


def relative_imports(path: Path) -> Iterator[tuple[str, ...]]:
    """The absolute place, from the root of the tree, of every module or name that a file imports relatively."""
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = package[: len(package) - node.level + 1] + tuple(
                (node.module or "").split(".") if node.module else ()
            )
            for alias in node.names:
                yield (*base, alias.name)


def upward_imports(package: str, floors: tuple[set[str], ...]) -> list[str]:
    floor_of = {room: number for number, rooms in enumerate(floors) for room in rooms}
    wrong = []
    for path in modules_of(package):
        room = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        if room == "__init__":
            continue
        if room not in floor_of:
            wrong.append(f"{package}/{room} has no floor: add it to the list in {Path(__file__).name}")
            continue
        for target in relative_imports(path):
            if target[0] != package or len(target) < 2 or target[1] == room or target[1] not in floor_of:
                continue
            here, there = floor_of[room], floor_of[target[1]]
            if there > here or (there == here and here > 0):
                wrong.append(f"{path.relative_to(ROOT)} imports {'.'.join(target)}, which is not below it")
    return wrong


def test_core_imports_run_one_way() -> None:
    assert upward_imports("core", CORE_FLOORS) == []


def test_addon_imports_run_one_way() -> None:
    assert upward_imports("rockfall_addon", ADDON_FLOORS) == []


def test_core_does_not_know_the_addon() -> None:
    knows = [path for path in modules_of("core") for target in relative_imports(path) if target[0] == "rockfall_addon"]
    assert knows == []


def test_upward_imports_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The check itself: a package that imports upward is told apart from one that does not."""
    for name, text in {
        "core/terrain/readers.py": "from ..exchange.tables import read_picks\nfrom ..errors import InputError",
        "core/exchange/tables.py": "from .. import terrain\nfrom .project import x",
        "core/stray.py": "",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    wrong = upward_imports("core", CORE_FLOORS)
    assert [sentence.split(" ")[0] for sentence in wrong] == ["core/stray", str(Path("core/terrain/readers.py"))]


def test_imports_inside_the_tree_are_relative() -> None:
    absolute = []
    for package in ("core", "rockfall_addon"):
        for path in modules_of(package):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom) and not node.level:
                    names = [node.module or ""]
                absolute += [f"{path.name}: {name}" for name in names if name.split(".")[0] in {"core", "rockfall"}]
    assert absolute == []


def test_every_package_directory_is_declared() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    present = {"rockfall"}
    for package in ("core", "rockfall_addon"):
        for path in modules_of(package):
            present.add(".".join(("rockfall", *path.relative_to(ROOT).parent.parts)))
    assert sorted(declared) == sorted(present)
    without_init = [name for name in present if not ROOT.joinpath(*name.split(".")[1:], "__init__.py").exists()]
    assert without_init == []


def test_no_core_module_imports_blender() -> None:
    """Each module is imported in a bare interpreter, where importing Blender would show."""
    names = [
        ".".join(("rockfall", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")
        for path in modules_of("core")
    ]
    assert len(names) > 5
    code = (
        "import importlib, sys\n"
        f"for name in {names!r}: importlib.import_module(name)\n"
        f"print(sorted({BLENDER_MODULES!r} & sys.modules.keys()))\n"
        "assert importlib.util.find_spec('core') is None, 'core can be imported under a second name'\n"
        "assert not [name for name in sys.modules if name.split('.')[0] == 'core']\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=Path(sys.prefix)
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip().splitlines()[-1] == "[]"


def test_importing_the_root_imports_nothing_else() -> None:
    code = "import sys; before = set(sys.modules); import rockfall; print(sorted(set(sys.modules) - before))"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(sys.prefix)
    )
    assert result.stdout.strip() == "['rockfall']"


def tracked_files() -> list[Path]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listing.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listing.stdout.decode().split("\0") if name and (ROOT / name).is_file()]


def places_of_this_machine(root: Path) -> list[str]:
    """Folders that no file may name: the checkout, where it lies, and the home; not the temporary folder."""
    anywhere = {Path("/"), Path("/tmp"), Path(tempfile.gettempdir()), Path("/sys")}  # a home that none can write to
    return [f"{place}/" for place in (root, root.parent, Path.home()) if place not in anywhere]


def test_a_checkout_in_the_temporary_folder_does_not_forbid_its_name() -> None:
    temporary = Path(tempfile.gettempdir())
    assert (
        places_of_this_machine(temporary / "rockfall")
        == [f"{temporary / 'rockfall'}/", f"{Path.home()}/"][: 2 - (Path.home() in (Path("/sys"), Path("/")))]
    )
    assert f"{temporary / 'a'}/" in places_of_this_machine(temporary / "a" / "rockfall")


def test_no_file_names_a_registry_or_a_place_of_one_machine() -> None:
    registries = [".".join(name) for name in (("pypi", "org"), ("pythonhosted", "org"), ("deb", "debian", "org"))]
    options = ["-".join(name) for name in (("index", "url"), ("find", "links"))]
    forbidden = re.compile("|".join(map(re.escape, [*registries, *options, *places_of_this_machine(ROOT)])))
    found = []
    for path in tracked_files():
        content = path.read_bytes()
        if b"\0" in content[:8192]:
            continue
        for number, line in enumerate(content.decode("utf-8", errors="replace").splitlines(), 1):
            if match := forbidden.search(line):
                found.append(f"{path.relative_to(ROOT)}:{number}: {match[0]}")
    assert found == []


def test_every_python_file_names_its_licence() -> None:
    without = [
        str(path.relative_to(ROOT))
        for path in tracked_files()
        if path.suffix == ".py" and "SPDX-License-Identifier: GPL-3.0-or-later" not in path.read_text(encoding="utf-8")
    ]
    assert without == []


def test_processors_are_those_of_this_process() -> None:
    """A container or a queue may give a process fewer than the machine has."""
    names = re.compile(r"\b(?:os|multiprocessing)\.cpu_" + "count|import cpu_" + "count")
    found = [str(path.relative_to(ROOT)) for path in tracked_files() if path.suffix == ".py" and
             names.search(path.read_text(encoding="utf-8"))]  # fmt: skip
    assert found == []


def test_equal_values_are_sorted_the_same_way_everywhere() -> None:
    """What NumPy sorts with otherwise puts equal values in an order that depends on the processor."""
    sorting = re.compile(r"np\.arg(?:sort|partition)\((?!.*kind=\"stable\")")
    kernels = {"core/terrain/kernels.py"}  # compiled by numba, whose sorting is the same everywhere
    found = [
        f"{path.relative_to(ROOT).as_posix()}: {line.strip()}"
        for package in ("core", "rockfall_addon")
        for path in modules_of(package)
        if path.relative_to(ROOT).as_posix() not in kernels
        for line in path.read_text(encoding="utf-8").splitlines()
        if sorting.search(line)
    ]
    assert found == []


def test_tests_are_not_a_package() -> None:
    assert list((ROOT / "tests").rglob("__init__.py")) == []


def imported_files(path: Path) -> set[Path]:
    """The files of the tree that a file imports, at its top or inside a function."""
    found = set()
    for target in relative_imports(path):
        for parts in (target, target[:-1]):
            for candidate in (ROOT.joinpath(*parts).with_suffix(".py"), ROOT.joinpath(*parts, "__init__.py")):
                if parts and candidate.is_file():
                    found.add(candidate)
    return found - {path}


def circles(files: Iterator[Path]) -> list[list[str]]:
    """Files that import each other in a circle, each circle once."""
    graph = {path: imported_files(path) for path in files if path.name != "__init__.py"}
    found, done = [], set()

    def walk(path: Path, way: list[Path]) -> None:
        if path in way:
            found.append([str(each.relative_to(ROOT)) for each in way[way.index(path) :]])
        elif path in graph and path not in done:
            for target in sorted(graph[path]):
                walk(target, [*way, path])
            done.add(path)

    for path in graph:
        walk(path, [])
    return found


@pytest.mark.parametrize("package", ["core", "rockfall_addon"])
def test_no_files_import_each_other_in_a_circle(package: str) -> None:
    assert circles(modules_of(package)) == []


def test_no_step_imports_another() -> None:
    wrong = []
    for path in modules_of("rockfall_addon/steps"):
        parts = path.relative_to(ROOT).parts
        for target in relative_imports(path):
            if len(parts) > 3 and target[:2] == parts[:2] and len(target) > 2 and target[2] != parts[2]:
                wrong.append(f"{Path(*parts)} imports {'.'.join(target)}")
    assert wrong == []


STORED = re.compile(r"rockfall_[a-z0-9_]+")


def registered_properties(paths: list[Path]) -> set[str]:
    """Names that the add-on gives to Blender's own types: ``bpy.types.Scene.rockfall_picking = …``."""
    return {
        target.attr
        for path in paths
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Attribute) and ast.unparse(target.value).startswith("bpy.types.")
    }


def stored_names_in(paths: list[Path], known: set[str]) -> list[str]:
    """Literals spelled like a stored name; properties that Blender registers and names of layout panels are none."""
    found = []
    for path in paths:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        panels = {
            id(node.args[0])
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "panel"
        }
        found += [
            f"{path.name}:{node.lineno}: {node.value}"
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and STORED.fullmatch(node.value)
            if node.value not in known and id(node) not in panels
        ]
    return found


def test_stored_names_stand_in_one_place() -> None:
    store = ROOT / "rockfall_addon" / "scene" / "store.py"
    paths = list(modules_of("rockfall_addon"))
    known = registered_properties(paths)
    assert stored_names_in([path for path in paths if path != store], known) == []
    names = [line.split(": ")[1] for line in stored_names_in([store], known)]
    assert len(names) == len(set(names)) > 60
    assert not known & set(names)


def test_stored_names_elsewhere_are_found(tmp_path: Path) -> None:
    """The check itself: a key is found, a registered property and a panel's name are not taken for one."""
    path = tmp_path / "panel.py"
    path.write_text(
        "import bpy\nbpy.types.Scene.rockfall_rows = 1\nthing['rockfall_time_s'] = 'rockfall: ready'\n"
        "layout.panel('rockfall_more')\nlayout.prop(scene, 'rockfall_rows')\n"
    )
    assert stored_names_in([path], registered_properties([path])) == ["panel.py:3: rockfall_time_s"]
