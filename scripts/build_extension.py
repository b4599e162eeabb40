# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension's zips, one for each system, with the libraries that Rockfall needs inside.

    python scripts/build_extension.py                     # dist/rockfall-<version>-<system>.zip
    python scripts/build_extension.py --system linux-x64 --python 3.14
    python scripts/build_extension.py --develop DIR --python 3.14

Wheels are fetched with pip, at the versions of constraints.txt, into wheels/, and fetched again only when a version
changes. They travel without their tests, the sources of compiled modules and, where this machine has `strip`, the
symbols of Linux's libraries that only debuggers read. The tracked manifest lists no wheels: they are written into a
staged copy. NumPy is Blender's own. No Blender is needed: the bpy module in this Python brings
Blender's own packager, which also validates the zips.

With --develop nothing is packed: DIR becomes a Blender user directory (BLENDER_USER_RESOURCES) in which the extension
has its wheels and is otherwise linked to this checkout, so that an edit runs at the next start.
"""

import argparse
import base64
import csv
import hashlib
import importlib.util
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CONSTRAINTS = ROOT / "scripts" / "constraints.txt"
CONTENT = ("__init__.py", "core", "rockfall_addon", "assets", "LICENSE", "README.md", "CHANGELOG.md")
SYSTEMS = {
    "linux-x64": (
        "manylinux_2_28_x86_64",
        "manylinux_2_27_x86_64",
        "manylinux_2_17_x86_64",
        "manylinux2014_x86_64",
    ),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_13_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
}
BLENDER_PYTHON = "3.13"
LARGEST_ZIP_BYTES = 175_000_000
NOT_BUNDLED = {"numpy"}
"""Blender brings its own, and two copies in one process crash."""
LEFT_OUT = {"pyi", "pyx", "pxd", "c", "cpp", "cu", "h", "hpp"}
"""Endings of files that are of use to compilers and editors only."""
ALSO_BUNDLED = ("llvmlite",)
"""What the dependencies depend on; a test compares the whole list with what the core asks for."""


def normalised(name: str) -> str:
    """The name of a distribution as wheels spell it."""
    return re.sub(r"[-_.]+", "_", name).lower()


def bundled_packages() -> list[str]:
    """The distributions that travel in the zips, from pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = [re.match(r"[A-Za-z0-9._-]+", requirement)[0] for requirement in project["dependencies"]]
    return sorted({*names, *ALSO_BUNDLED} - NOT_BUNDLED)


def pinned_versions() -> dict[str, str]:
    """Version by normalised name, from constraints.txt."""
    lines = CONSTRAINTS.read_text(encoding="utf-8").splitlines()
    pins = [line.split("==") for line in lines if "==" in line and not line.startswith("#")]
    return {normalised(name): version.strip() for name, version in pins}


def fetch_wheels(system: str, python: str) -> list[Path]:
    """The wheels of one system and Python version, from wheels/ or else through pip and the user's settings of it."""
    directory = ROOT / "wheels" / f"{system}-cp{python.replace('.', '')}"
    pins = pinned_versions()
    wanted = {(normalised(name), pins[normalised(name)]) for name in bundled_packages()}

    def present() -> dict[tuple[str, str], Path]:
        return {(name.lower(), version): path for path in directory.glob("*.whl")
                for name, version, *_ in [path.name.split("-")]}  # fmt: skip

    directory.mkdir(parents=True, exist_ok=True)
    for path in sorted(directory.parent.glob("*/*.whl")):
        key = (path.name.split("-")[0].lower(), path.name.split("-")[1])
        if key in wanted - present().keys() and fits_any_python(path.name, system):
            shutil.copy2(path, directory)  # fetched before, for another system or Python
    missing = wanted - present().keys()
    if missing:
        print(f"{system}, Python {python}: fetching {len(missing)} wheels", flush=True)
        command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet"]
        command += ["--no-deps", "--only-binary=:all:"]
        command += ["--implementation", "cp", "--python-version", python, "--dest", str(directory)]
        command += [option for tag in SYSTEMS[system] for option in ("--platform", tag)]
        command += [f"{name}=={version}" for name, version in sorted(missing)]
        subprocess.run(command, check=True)
    found = present()
    for stale in found.keys() - wanted:
        found.pop(stale).unlink()
    if wanted - found.keys():
        raise SystemExit(f"build_extension: pip brought no wheel of {sorted(wanted - found.keys())} for {system}")
    return sorted(found.values())


def fits_any_python(name: str, system: str) -> bool:
    """Whether a wheel is of pure Python or of the stable interface, and for this system."""
    python, abi, platforms = name.removesuffix(".whl").split("-")[-3:]
    fits = platforms == "any" or not set(SYSTEMS[system]).isdisjoint(platforms.split("."))
    return fits and (abi == "abi3" or python.startswith("py"))


def is_needed(name: str) -> bool:
    """Whether a file of a wheel does anything in Blender: tests and the sources of compiled modules do not."""
    folders, ending = name.split("/")[:-1], name.rpartition(".")[2]
    if any(folder.endswith((".dist-info", ".data")) for folder in folders):
        return True  # with the licences
    return "tests" not in folders and ending not in LEFT_OUT


def without_symbols(name: str, content: bytes) -> bytes:
    """A library of Linux without the symbols that only debuggers read, where this machine has `strip`; else as it is.

    Those in folders `.libs` stay: auditwheel has rewritten them in a way that not every `strip` understands.
    """
    strip = shutil.which("strip")
    if strip is None or not content.startswith(b"\x7fELF") or ".libs/" in name:
        return content
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "library.so"
        file.write_bytes(content)
        done = subprocess.run([strip, "--strip-unneeded", str(file)], check=False, capture_output=True)
        return file.read_bytes() if done.returncode == 0 else content


def lean(wheel: Path) -> Path:
    """The same wheel without what is not needed, its list of files as it is then; made once, in a folder beside."""
    made = wheel.parent / "lean" / wheel.name
    if made.exists() and made.stat().st_mtime >= wheel.stat().st_mtime:
        return made
    made.parent.mkdir(exist_ok=True)
    draft = made.with_suffix(f".{os.getpid()}")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as new:
        lists = [info for info in old.infolist() if info.filename.endswith(".dist-info/RECORD")]
        stripped = {}
        for info in old.infolist():
            if info in lists or not is_needed(info.filename):
                continue
            content = old.read(info)
            if (smaller := without_symbols(info.filename, content)) is not content:
                digest = base64.urlsafe_b64encode(hashlib.sha256(smaller).digest()).rstrip(b"=").decode()
                stripped[info.filename] = [info.filename, f"sha256={digest}", str(len(smaller))]
            new.writestr(info, smaller, zipfile.ZIP_DEFLATED)
        for info in lists:
            rows = csv.reader(io.StringIO(old.read(info).decode("utf-8"), newline=""))
            listed = io.StringIO(newline="")
            kept = [stripped.get(row[0], row) for row in rows if row and is_needed(row[0])]
            csv.writer(listed, lineterminator="\n").writerows(kept)
            new.writestr(info, listed.getvalue().encode("utf-8"), zipfile.ZIP_DEFLATED)
    draft.replace(made)
    return made


def stage(directory: Path, wheels: dict[str, list[Path]], *, link: bool = False) -> Path:
    """Write the extension's tree with the wheels of the systems in its manifest; copied, or linked to this checkout."""
    directory.mkdir(parents=True)
    for name in CONTENT:
        source, target = ROOT / name, directory / name
        if not source.exists():
            continue
        if link:
            target.symlink_to(source)
        elif source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "*.pyc", ".*", "*.blend1"))
        else:
            shutil.copy2(source, target)
    (directory / "wheels").mkdir()
    for path in {path.name: lean(path) for paths in wheels.values() for path in paths}.values():
        try:
            os.link(path, directory / "wheels" / path.name)
        except OSError:
            shutil.copy2(path, directory / "wheels" / path.name)
    names = sorted(path.name for path in (directory / "wheels").iterdir())
    listing = "".join(f'  "./wheels/{name}",\n' for name in names)
    extra = f"platforms = {json.dumps(sorted(wheels))}\nwheels = [\n{listing}]\n\n[permissions]\n"
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    if manifest.count("[permissions]\n") != 1:
        raise SystemExit("build_extension: blender_manifest.toml needs one [permissions] table")
    (directory / "blender_manifest.toml").write_text(manifest.replace("[permissions]\n", extra), encoding="utf-8")
    return directory


def packager(*arguments: str) -> None:
    """Run Blender's own command line for extensions, which is plain Python inside the bpy module."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None:
        raise SystemExit("build_extension: needs the bpy module: python3.13 scripts/run.py extension")
    (cli,) = Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    tags = cli.parents[3] / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([sys.executable, cli, *arguments, "--valid-tags", tags], check=True, env=environment)


def build(system: str, python: str) -> Path:
    """Stage, pack and validate one zip."""
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    suffix = "" if python == BLENDER_PYTHON else f"-cp{python.replace('.', '')}"
    output = ROOT / "dist" / f"{manifest['id']}-{manifest['version']}-{system.replace('-', '_')}{suffix}.zip"
    output.parent.mkdir(exist_ok=True)
    wheels = fetch_wheels(system, python)
    with tempfile.TemporaryDirectory(prefix="stage-", dir=output.parent) as temporary:
        source = stage(Path(temporary) / manifest["id"], {system: wheels})
        packager("build", "--source-dir", str(source), "--output-filepath", str(output))
    packager("validate", str(output))
    size = output.stat().st_size
    if size > LARGEST_ZIP_BYTES:
        raise SystemExit(f"build_extension: {output.name} has {size / 1e6:.0f} MB, more than can be published")
    with zipfile.ZipFile(output) as archive:
        bundled = sum(info.compress_size for info in archive.infolist() if info.filename.endswith(".whl"))
    print(
        f"{output.relative_to(ROOT)}: {size / 1e6:.1f} MB, {len(wheels)} wheels of {bundled / 1e6:.1f} MB", flush=True
    )
    return output


def develop(directory: Path, system: str, python: str) -> None:
    """Make a Blender user directory whose extension is this checkout."""
    extension = directory / "extensions" / "user_default" / "rockfall"
    if extension.exists():
        shutil.rmtree(extension)
    stage(extension, {system: fetch_wheels(system, python)}, link=True)
    print(f"start Blender with BLENDER_USER_RESOURCES={directory} and --addons bl_ext.user_default.rockfall")


def this_system() -> str:
    return {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}.get(sys.platform, "linux-x64")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--system", action="append", choices=SYSTEMS, help="only this one (may be repeated)")
    parser.add_argument("--python", default=BLENDER_PYTHON, help="Python of the Blender that it is for")
    parser.add_argument("--with-cp314", action="store_true", help="also a Linux zip for a Blender with Python 3.14")
    parser.add_argument("--develop", type=Path, metavar="DIR", help="no zip: a Blender user directory of this checkout")
    options = parser.parse_args()
    try:
        if options.develop:
            develop(options.develop.resolve(), (options.system or [this_system()])[0], options.python)
            return
        for system in options.system or SYSTEMS:
            build(system, options.python)
        if options.with_cp314:
            build("linux-x64", "3.14")
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"build_extension: {Path(error.cmd[0]).name} failed with status {error.returncode}") from None


if __name__ == "__main__":
    main()
