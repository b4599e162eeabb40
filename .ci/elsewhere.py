# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of the tests, and real commands, as on another person's machine or in a container.

    python .ci/elsewhere.py [PYTHON] [pytest arguments]

The checkout is copied to a folder with a space and an umlaut. Commands run with the language C and a home that cannot
be written to; tests with German decimal commas, also for the C libraries, where the machine has that language or can
make it. All have another time zone and fonts that Matplotlib looks for anew. The commands must give the same bytes as
in the checkout itself, and print no warnings.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLACE = ROOT / "build" / "elsewhere"
COPY = PLACE / "Prüf stand" / "rockfall"
KERNELS = PLACE / "kernels"
GERMAN, FONTS = "de_DE.UTF-8", "fonts-liberation"
SITECUSTOMIZE = "import locale\ntry:\n    locale.setlocale(locale.LC_ALL, '')\nexcept locale.Error:\n    pass\n"
TESTS = (
    "test_cli", "test_tables", "test_number_text", "test_reading", "test_project", "test_output", "test_map_files",
    "test_geopackage", "test_svg", "test_figures", "test_typefaces", "test_pdf_pages", "test_map_figures",
    "test_simulate_screens", "test_packaging", "test_kept_code", "test_boundary", "test_memory", "test_footage_clock",
)  # fmt: skip
"""Those in which language, place, fonts or home could matter."""
COMMANDS = (
    ("reconstruct", "assets/demo/project.toml"),
    ("simulate", "assets/demo/project.toml", "--model", "noel_2017", "--cell", "5"),
    ("design", "assets/demo/project.toml", "--number", "20", "--no-holdout", "--factors", "none", "--cell", "4",
     "--screen", "assets/demo/barriers.csv"),
)  # fmt: skip
SAME = ("impacts.csv", "trajectories.csv", "runs.csv", "hits.csv", "screens.csv")
"""Written by the commands: the same bytes wherever they run on one machine."""
UNWELCOME = ("Traceback", "Warning", "Matplotlib", "matplotlib", "missing from font")


def main() -> int:
    python, options = (sys.argv[1], sys.argv[2:]) if len(sys.argv) > 1 else (sys.executable, [])
    python = os.path.abspath(python)  # not what it links to: an environment of its own
    copy_checkout()
    settled = {**os.environ, "NUMBA_CACHE_DIR": str(KERNELS), "TZ": "Asia/Kathmandu", "PYTHONPATH": str(paths())}
    for name in ("LANG", "LANGUAGE", "MPLCONFIGDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"):
        settled.pop(name, None)
    settled |= {"HOME": str(home()), "LC_ALL": "C"}
    keep_kernels(python)
    get_fonts()
    failed = [" ".join(words) for words in COMMANDS if not same(python, words, settled)]
    for words in failed:
        print(f"elsewhere: FAILED: rockfall {words}", flush=True)
    language = GERMAN if has_german() else "C"
    print(f"elsewhere: tests with the language {language}", flush=True)
    settled |= {"LC_ALL": language, "MPLCONFIGDIR": str(PLACE / "matplotlib")}
    tests = [f"tests/core/{name}.py" for name in TESTS]
    status = subprocess.run(
        [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests, *options], cwd=COPY, env=settled, check=False
    ).returncode
    return status or int(bool(failed))


def copy_checkout() -> None:
    """What git knows or does not ignore; the history too, which a test lists."""
    shutil.rmtree(PLACE, ignore_errors=True)
    COPY.mkdir(parents=True)
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    for name in filter(None, listing.stdout.decode().split("\0")):
        if (ROOT / name).is_file():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, COPY / name)
    for command in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *command], cwd=COPY, check=True)


def paths() -> Path:
    """What Python looks into first: the copy under its name as a package, and a start with the language set."""
    folder = PLACE / "paths"
    folder.mkdir()
    (folder / "rockfall").symlink_to(COPY, target_is_directory=True)
    (folder / "sitecustomize.py").write_text(SITECUSTOMIZE, encoding="utf-8")
    return folder


def home() -> Path:
    """A folder that nobody writes to: root does so in any but the kernel's own."""
    if os.geteuid() == 0:
        return Path("/sys")
    folder = PLACE / "home"
    folder.mkdir(mode=0o555)
    return folder


def keep_kernels(python: str) -> None:
    """What the set-up has compiled serves the copy too; numba names its folders after the place of the source."""
    code = (
        "import sys; from numba.core.caching import _CacheLocator as c; from pathlib import Path\n"
        "root, copy = map(Path, sys.argv[1:])\n"
        "for folder in sorted({f.parent for f in (root / 'core').rglob('*.py')}):\n"
        "    there = copy / folder.relative_to(root)\n"
        "    print(c.get_suitable_cache_subpath(str(folder / 'a')), c.get_suitable_cache_subpath(str(there / 'a')))\n"
    )
    kept = Path(os.environ.get("NUMBA_CACHE_DIR", ROOT / "build" / "kernels"))
    KERNELS.mkdir()
    for under in (COPY, PLACE / "paths" / "rockfall"):
        names = subprocess.run([python, "-c", code, ROOT, under], capture_output=True, text=True, check=True)
        for line in names.stdout.splitlines():
            here, there = line.split()
            if (kept / here).is_dir() and not (KERNELS / there).exists():
                shutil.copytree(kept / here, KERNELS / there)


def get_fonts() -> None:
    """Those of a plain Debian, which lack letters of ours, where that is ours to do."""
    if os.geteuid() == 0 and os.environ.get("CI") and shutil.which("apt-get") and shutil.which("dpkg-query"):
        there = subprocess.run(["dpkg-query", "-W", FONTS], capture_output=True, check=False).returncode == 0
        if not there:
            silent = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
            install = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", FONTS]
            subprocess.run(install, check=False, stdout=subprocess.DEVNULL, env=silent)


def has_german() -> bool:
    """Whether the machine has the language, or can make it now."""
    if not shutil.which("locale"):
        return False
    if os.geteuid() == 0 and shutil.which("localedef") and Path("/usr/share/i18n/locales/de_DE").exists():
        subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", GERMAN], check=False, capture_output=True)
    names = subprocess.run(["locale", "-a"], capture_output=True, text=True, check=False).stdout.lower()
    return "de_de.utf8" in names or "de_de.utf-8" in names


def same(python: str, words: tuple[str, ...], settled: dict[str, str]) -> bool:
    """Run a command in the checkout and in the copy, and compare what it writes and says."""
    here, there = PLACE / "here" / words[0], PLACE / "über all" / words[0]
    command = [python, "-m", "rockfall.core.cli", *words, "--out"]
    first = subprocess.run([*command, here], cwd=ROOT, capture_output=True, text=True, check=False)
    second = subprocess.run([*command, there], cwd=COPY, env=settled, capture_output=True, text=True,
                            encoding="utf-8", check=False)  # fmt: skip
    wrong = [name for name in UNWELCOME if name in second.stderr]
    wrong += [f"status {one.returncode}" for one in (first, second) if one.returncode]
    names = [name for name in SAME if (here / name).exists()]
    wrong += [f"{name} differs" for name in names if (here / name).read_bytes() != _read(there / name)]
    if not names:
        wrong.append("no table")
    print(f"elsewhere: rockfall {words[0]}: {', '.join(wrong) or 'the same ' + ', '.join(names)}", flush=True)
    if wrong:
        print(second.stdout, second.stderr, sep="", flush=True)
    return not wrong


def _read(file: Path) -> bytes | None:
    return file.read_bytes() if file.exists() else None


if __name__ == "__main__":
    sys.exit(main())
