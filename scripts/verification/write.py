# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the verification manual, docs/verification.

    python scripts/verification/write.py                      # the chapters of equations: half a minute
    python scripts/verification/write.py reconstruction real  # those that take some minutes each
    python scripts/verification/write.py --all
    python scripts/verification/write.py --check              # whether the quick chapters say what is computed now

Exit code 1 when a check fails. The quick chapters are written and compared by the tests, so that they are true at every
commit; the long ones are written anew for every release.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

import equations
import impact_models
import intervals
import real
import reconstruction
import simulation
from checks import Check, paragraph, table, verdict

FOLDER = Path(__file__).parents[2] / "docs" / "verification"
QUICK: dict[str, ModuleType] = {
    "equations": equations,
    "impact_models": impact_models,
    "simulation": simulation,
}
LONG: dict[str, ModuleType] = {"intervals": intervals, "reconstruction": reconstruction, "real": real}


def quick_page(name: str) -> tuple[str, list[Check]]:
    """A chapter of checks as Markdown, and its checks."""
    chapter = QUICK[name]
    made: list[Check] = chapter.checks()
    remarks = [line for text in getattr(chapter, "remarks", list)() for line in [*_lines(text), ""]]
    lines = [
        f"# {chapter.TITLE}",
        "",
        *paragraph(chapter.INTRODUCTION),
        "",
        verdict(made),
        "",
        *table(made),
        "",
        *remarks,
        *paragraph(
            f"Written by `scripts/verification/{name}.py`. Differences are the greatest of all numbers compared; "
            "*rounding* is less than 1e-8, *of it* relative to the greatest number."
        ),
    ]
    return "\n".join(lines) + "\n", made


def _lines(text: str) -> list[str]:
    """Those of a heading or a table as they are, those of a paragraph wrapped."""
    return text.splitlines() if text.startswith(("#", "|")) else paragraph(text)


def contents() -> str:
    """The manual's first page, of the chapters that there are."""
    lines = [
        "# Verification",
        "",
        *paragraph(
            "What Rockfall computes, beside numbers that it did not compute: printed ones, closed forms, second "
            "computations that share neither code nor form with the first, and measurements. Every page is written by "
            "a script in `scripts/verification`; nothing in it is typed by hand."
        ),
        "",
    ]
    for name, chapter in (QUICK | LONG).items():
        if (FOLDER / f"{name}.md").is_file():
            lines.append(f"- [{chapter.TITLE}]({name}.md): {chapter.SUMMARY}")
    lines += [
        "",
        *paragraph(
            "The chapters of checks are written and compared by every run of the tests, so that they are true at every "
            "commit; `python scripts/verification/write.py --all` writes all of them, for a release. What could not be "
            "checked against a primary text stands in the module of its model, as *not verified*."
        ),
    ]
    return "\n".join(lines) + "\n"


def main(words: Sequence[str] | None = None) -> int:
    """Write the chapters that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("chapters", nargs="*", choices=[*QUICK, *LONG, []], help="default: the quick ones")
    parser.add_argument("--all", action="store_true", help="all chapters")
    parser.add_argument("--check", action="store_true", help="write nothing; say which quick chapters would change")
    arguments = parser.parse_args(words)
    chosen = [*QUICK, *LONG] if arguments.all else arguments.chapters or list(QUICK)
    failed: list[Check] = []
    changed: list[str] = []
    for name in chosen:
        if name in QUICK:
            text, made = quick_page(name)
            failed += [check for check in made if not check.holds]
            if arguments.check:
                if (FOLDER / f"{name}.md").read_text(encoding="utf-8") != text:
                    changed.append(name)
                continue
        else:
            long_page: Callable[[Path], str] = LONG[name].page
            text = long_page(FOLDER)
        (FOLDER / f"{name}.md").write_text(text, encoding="utf-8")
        print(f"{name}: written")
    if not arguments.check:
        (FOLDER / "README.md").write_text(contents(), encoding="utf-8")
    for name in changed:
        print(f"CHANGED: {name}; write it with: python scripts/verification/write.py {name}")
    for check in failed:
        print(f"FAILS: {check.what}, {check.difference:g} instead of at most {check.allowed:g} {check.unit}")
    return 1 if failed or changed else 0


if __name__ == "__main__":
    sys.exit(main())
