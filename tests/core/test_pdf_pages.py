# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of a PDF: nothing is lost, nothing lies over something else or beyond the margins, heads come again."""

import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from rockfall.core.exchange import pdf_pages
from rockfall.core.exchange.pdf_pages import Drawing, Page, Rows, Words, lay_out, measured_by_font, write_pdf

HEAD = ("screen", "model", "energy, 95 % [kJ]", "needed [kJ]", "verdict")
LONG = "The model is 20 % nearer than drawing one of the measured outcomes at random, score 0.989 against 1.243."


def table(rows: int) -> Rows:
    names = ("Noël et al. 2017", "CRSP (Pfeiffer & Bowen 1989)")
    lines = [(f"barrier {i}", names[i % 2], f"{11.2 * i:.1f} (10.3 to 14.1)", f"{i}", LONG) for i in range(rows)]
    return Rows(HEAD, tuple(lines), words=(4,))


def elements() -> list[Words | Rows | Drawing]:
    return [
        Words("h1", "Design sheet: a slope"),
        Words("problem", "The barrier is not enough: " + LONG),
        Words("h2", "What a barrier must have"),
        table(60),
        Words("note", f"{LONG} {LONG} {LONG}"),
        Drawing(Figure(figsize=(7.0, 11.0)), "Paths."),
        Words("h2", "What it does not say"),
        Words("text", "word " * 400 + "W" * 300),
    ]


def box(text: str, style: str) -> float:
    """How wide the outlines of the letters are, unlike the measure of the pages."""
    look = pdf_pages.STYLES[style]
    font = FontProperties(weight=look.get("fontweight", "normal"))
    return TextPath((0, 0), text, size=look["fontsize"], prop=font).get_extents().width


@pytest.fixture(scope="module")
def pages() -> list[Page]:
    from matplotlib import rc_context

    with rc_context(pdf_pages.STYLE):
        return lay_out(elements(), measured_by_font())


def test_nothing_is_lost(pages: list[Page]) -> None:
    said = re.sub(r"\s", "", "".join(text for page in pages for *_, text, _ in page.texts))
    assert said.count("W" * 300) == 1
    assert said.count("word") == 400
    assert sum(text == "Paths." for page in pages for *_, text, _ in page.texts) == 1
    words = " ".join(text for page in pages for *_, text, kind in page.texts if kind == "cell").split()
    assert sorted(words) == sorted(" ".join(cell for row in table(60).rows for cell in row).split())


def test_all_is_within_the_margins_and_nothing_lies_over_something_else(pages: list[Page]) -> None:
    from matplotlib import rc_context

    left, top, right, bottom = pdf_pages.MARGIN_PT
    wide, high = pdf_pages.PAGE_PT
    with rc_context(pdf_pages.STYLE):
        for page in pages:
            taken = list[tuple[float, float, float, float]]()
            for x, y, side, text, kind in page.texts:
                width = box(text, kind) if text.strip() else 0.0
                start = x - width if side == "right" else x
                assert start >= left - 1
                assert start + width <= wide - right + 1, text
                assert top <= y
                assert y + pdf_pages.STYLES[kind]["fontsize"] <= high - bottom + 1
                for other, above, end, below in taken:
                    apart = start >= end or start + width <= other or y >= below - 0.5 or y + 6 <= above
                    assert apart, text
                taken.append((start, y, start + width, y + pdf_pages.STYLES[kind]["fontsize"]))
            for x, y, width, height, _ in page.pictures:
                assert left <= x
                assert x + width <= wide - right + 1e-6
                assert y + height <= high - bottom
                assert width / height == pytest.approx(7.0 / 11.0)


def test_heads_come_again_and_headings_do_not_stand_alone(pages: list[Page]) -> None:
    with_rows = [page for page in pages if any(kind == "cell" for *_, kind in page.texts)]
    assert len(with_rows) > 1
    for page in with_rows:
        assert sum(text == "verdict" for *_, text, kind in page.texts if kind == "head") == 1
    for page in pages:
        assert max(page.texts, key=lambda one: one[1])[4] not in ("h2", "head")


def test_the_file_has_these_pages_each_of_a4(tmp_path: Path, pages: list[Page]) -> None:
    write_pdf(elements(), tmp_path / "a.pdf", "Design sheet")
    content = (tmp_path / "a.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", content)) == len(pages)
    boxes = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", content)
    assert {(round(float(a)), round(float(b))) for a, b in boxes} == {(595, 842)}
