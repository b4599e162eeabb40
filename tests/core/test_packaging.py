# SPDX-License-Identifier: GPL-3.0-or-later
"""The manifest, the project file, the pinned versions and the checks of dependencies agree with each other."""

import base64
import csv
import ctypes
import hashlib
import importlib.util
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType

import pytest
import rockfall
from rockfall.core import dependencies
from rockfall.core.errors import DependencyError

ROOT = Path(rockfall.__file__).resolve().parent
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
REQUIREMENTS = (*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["blender"])


@pytest.fixture(scope="module")
def build_extension() -> ModuleType:
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "scripts" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_manifest_project_and_package_agree() -> None:
    assert MANIFEST["id"] == PROJECT["name"] == "rockfall"
    assert MANIFEST["version"] == PROJECT["version"] == rockfall.__version__
    assert MANIFEST["license"] == [f"SPDX:{PROJECT['license']}"]


def test_manifest_follows_the_rules_of_the_platform() -> None:
    """Blender's packager refuses texts over 64 characters and those that end with punctuation."""
    for text in (MANIFEST["tagline"], *MANIFEST["permissions"].values()):
        assert 0 < len(text) <= 64
        assert text[-1].isalnum()
    assert tuple(map(int, MANIFEST["blender_version_min"].split("."))) >= (5, 1, 0)
    assert "wheels" not in MANIFEST
    assert not any(pattern.startswith("!") for pattern in MANIFEST["build"]["paths_exclude_pattern"])


def test_pins_satisfy_the_requirements(build_extension: ModuleType) -> None:
    requirements = pytest.importorskip("packaging.requirements")
    pins = build_extension.pinned_versions()
    for text in (*REQUIREMENTS, *PROJECT["optional-dependencies"]["dev"]):
        requirement = requirements.Requirement(text)
        assert requirement.specifier.contains(pins[build_extension.normalised(requirement.name)]), text
    assert pins["numpy"] == "2.3.4"  # the one in Blender 5.2


def test_bundled_packages_are_what_the_core_asks_for(build_extension: ModuleType) -> None:
    bundled = {build_extension.normalised(name) for name in build_extension.bundled_packages()}
    assert bundled == {dependencies.DISTRIBUTIONS.get(name, name) for name in dependencies.PACKAGES} - {"numpy"}
    assert bundled <= build_extension.pinned_versions().keys()


@pytest.mark.parametrize(
    ("name", "system", "fits"),
    [
        ("trimesh-4.9.0-py3-none-any.whl", "windows-x64", True),
        ("opencv_python_headless-4.13.0-cp37-abi3-manylinux2014_x86_64.manylinux_2_17_x86_64.whl", "linux-x64", True),
        ("opencv_python_headless-4.13.0-cp37-abi3-win_amd64.whl", "linux-x64", False),
        ("numba-0.65.0-cp313-cp313-manylinux_2_28_x86_64.whl", "linux-x64", False),
    ],
)
def test_wheels_that_fit_any_python(build_extension: ModuleType, name: str, system: str, fits: bool) -> None:
    assert build_extension.fits_any_python(name, system) == fits


def test_staged_manifest_lists_the_wheels(build_extension: ModuleType, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "scipy-1.0-py3-none-any.whl", "w") as archive:
        archive.writestr("scipy/__init__.py", "")
    wheels = {"linux-x64": [tmp_path / "scipy-1.0-py3-none-any.whl"]}
    staged = build_extension.stage(tmp_path / "rockfall", wheels)
    manifest = tomllib.loads((staged / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["wheels"] == ["./wheels/scipy-1.0-py3-none-any.whl"]
    assert manifest["platforms"] == ["linux-x64"]
    assert {key: manifest[key] for key in MANIFEST} == MANIFEST
    assert (staged / "core" / "errors.py").read_bytes() == (ROOT / "core" / "errors.py").read_bytes()
    with zipfile.ZipFile(staged / "wheels" / "scipy-1.0-py3-none-any.whl") as archive:
        assert archive.namelist() == ["scipy/__init__.py"]
    assert not [
        path for path in staged.rglob("*") if path.name in {"__pycache__", "tests", "scripts", "pyproject.toml"}
    ]


def test_missing_packages_are_named() -> None:
    assert dependencies.missing_packages() == ()
    assert dependencies.missing_packages(("numpy", "no_such_package")) == ("no_such_package",)


def loader_without(*names: str):
    def load(file: str) -> None:
        if file in names:
            raise OSError(f"{file}: cannot open shared object file")

    return load


@pytest.fixture
def linux(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(dependencies.os, "geteuid", lambda: 1000, raising=False)
    return monkeypatch


def test_missing_system_libraries_come_with_the_command(linux: pytest.MonkeyPatch) -> None:
    missing = dependencies.missing_system_libraries(load=loader_without("libXi.so.6", "libGL.so.1", "libEGL.so.1"))
    assert [library.file for library in missing] == ["libXi.so.6", "libGL.so.1"]
    commands = {
        "apt": "sudo apt-get install -y --no-install-recommends libxi6 libgl1",
        "dnf": "sudo dnf install -y libXi libglvnd-glx",
        "pacman": "sudo pacman -S --noconfirm libxi libglvnd",
    }
    for manager, command in commands.items():
        linux.setattr(dependencies, "package_manager", lambda manager=manager: manager)
        text = dependencies.explain_missing_libraries(missing)
        assert text.endswith(f"Install them with: {command}")
        assert "libXi.so.6, libGL.so.1" in text
    linux.setattr(dependencies, "package_manager", lambda: None)
    assert "libxi6 libgl1" in dependencies.explain_missing_libraries(missing)


def test_graphics_libraries_are_asked_for_separately(linux: pytest.MonkeyPatch) -> None:
    load = loader_without("libEGL.so.1", "libEGL_mesa.so.0")
    assert dependencies.missing_system_libraries(load=load) == ()
    assert len(dependencies.missing_system_libraries(load=load, graphics=True)) == 2


def test_requiring_the_libraries_raises_a_clear_error(linux: pytest.MonkeyPatch) -> None:
    linux.setattr(dependencies, "missing_system_libraries", lambda: dependencies.BLENDER_LIBRARIES[3:4])
    linux.setattr(dependencies, "package_manager", lambda: "apt")
    with pytest.raises(DependencyError, match=r"libXi\.so\.6.*apt-get install .* libxi6"):
        dependencies.require_blender_libraries()


def test_other_systems_need_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    for platform in ("win32", "darwin"):
        monkeypatch.setattr(sys, "platform", platform)
        assert dependencies.missing_system_libraries(load=loader_without("libXi.so.6")) == ()


def test_set_up_script_refuses_another_python(tmp_path: Path) -> None:
    """In a process that believes to be an older Python, without touching .venv."""
    code = (
        "import runpy, sys\n"
        "sys.version_info = (3, 12, 1)\n"
        "sys.argv = ['scripts/run.py', 'demo']\n"
        f"runpy.run_path({str(ROOT / 'scripts' / 'run.py')!r}, run_name='__main__')\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert result.returncode == 1
    assert re.search(r"needs a 64-bit Python 3\.13.*this is 3\.12\.1", result.stderr)
    assert "scripts/run.py demo" in result.stderr


def test_wheels_travel_without_tests_and_sources(build_extension: ModuleType, tmp_path: Path) -> None:
    """What is left is a wheel still: pip takes it, its list of files is that of its files, and the licence is there."""
    wheel = tmp_path / "stone-1.0-py3-none-any.whl"
    files = {
        "stone/__init__.py": "weight = 7\n",
        "stone/tests/__init__.py": "",
        "stone/tests/test_weight.py": "assert False\n",
        "stone/fast.pyx": "cdef int weight\n",
        "stone/__init__.pyi": "weight: int\n",
        "stone/testing.py": "helps = True\n",
        "stone-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: stone\nVersion: 1.0\n",
        "stone-1.0.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        "stone-1.0.dist-info/licenses/tests/LICENSE": "free\n",
    }
    record = "stone-1.0.dist-info/RECORD"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
        archive.writestr(record, "".join(f"{name},,\n" for name in (*files, record)))
    lean = build_extension.lean(wheel)
    with zipfile.ZipFile(lean) as archive:
        assert archive.testzip() is None
        names = set(archive.namelist())
        listed = {line.split(",")[0] for line in archive.read(record).decode().splitlines()}
    gone = {"stone/tests/__init__.py", "stone/tests/test_weight.py", "stone/fast.pyx", "stone/__init__.pyi"}
    assert names == listed == {*files, record} - gone
    target = tmp_path / "there"
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-index",
        "--no-deps",
        "--target",
        str(target),
        str(lean),
    ]
    subprocess.run(command, check=True)
    assert (target / "stone" / "testing.py").exists()
    before = lean.stat().st_mtime_ns
    assert build_extension.lean(wheel) == lean
    assert lean.stat().st_mtime_ns == before, "made once"


@pytest.mark.skipif(shutil.which("strip") is None, reason="this machine has no strip")
def test_libraries_travel_without_symbols_and_are_listed_as_they_are_then(
    build_extension: ModuleType, tmp_path: Path
) -> None:
    numba = Path(importlib.util.find_spec("numba").origin).parent
    library = max((numba / "core" / "typeconv").glob("*.so"), key=lambda file: file.stat().st_size)
    record, names = "stone-1.0.dist-info/RECORD", ("stone/fast.so", "stone.libs/rewritten.so")
    wheel = tmp_path / "stone-1.0-cp313-cp313-linux_x86_64.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name in names:
            archive.write(library, name)
        archive.writestr(record, "".join(f"{name},sha256=old,1\n" for name in names) + f"{record},,\n")
    with zipfile.ZipFile(build_extension.lean(wheel)) as archive:
        rows = {row[0]: row[1:] for row in csv.reader(archive.read(record).decode().splitlines())}
        content = archive.read(names[0])
        assert archive.read(names[1]) == library.read_bytes()
    assert len(content) < library.stat().st_size
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
    assert rows == {names[0]: [f"sha256={digest}", str(len(content))], names[1]: ["sha256=old", "1"], record: ["", ""]}
    (tmp_path / "fast.so").write_bytes(content)
    assert ctypes.CDLL(str(tmp_path / "fast.so")) is not None
