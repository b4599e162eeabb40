# SPDX-License-Identifier: GPL-3.0-or-later
"""Fonts by the letters that they have, with fonts that come with Matplotlib: the same on machines with other fonts."""

import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
from matplotlib import font_manager, rc_context  # noqa: E402
from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ft2font import FT2Font  # noqa: E402
from rockfall.core.analysis import typefaces  # noqa: E402
from rockfall.core.analysis.figures import STYLE, save_figure  # noqa: E402
from rockfall.core.analysis.typefaces import families_for, lettered  # noqa: E402
from rockfall.core.exchange.pdf_pages import Words, write_pdf  # noqa: E402

BUNDLED = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
OURS = "Rᴛ R_ɴ ° · × ÷ ± ≤ ≥ ≈ → ∞ √ − – — … ² ³ ½ ₀ ₁ ₂ α β γ δ ε θ κ λ μ ρ σ τ φ ω Δ Σ é ü ß ñ"
NOBODYS = "\U0010fffd"
"""For private use: no font of letters has it."""


@pytest.fixture(autouse=True)
def _poor_font(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The first font lacks nearly all but ASCII, as a machine's own may."""
    monkeypatch.setitem(STYLE, "font.sans-serif", ["cmr10"])
    bundled = [entry for entry in font_manager.fontManager.ttflist if Path(entry.fname).parent == BUNDLED]
    monkeypatch.setattr(font_manager.fontManager, "ttflist", bundled)
    caches = (typefaces._letters, typefaces._families_with, typefaces._installed, typefaces._letters_of)
    for cached in (*caches, font_manager.fontManager._findfont_cached):
        cached.cache_clear()
    yield
    for cached in (*caches, font_manager.fontManager._findfont_cached):
        cached.cache_clear()


def letter_of_another_font() -> str:
    """One that DejaVu Sans lacks, and STIX has."""
    known = FT2Font(str(BUNDLED / "DejaVuSans.ttf")).get_charmap()
    return next(chr(code) for code in sorted(FT2Font(str(BUNDLED / "STIXGeneral.ttf")).get_charmap())
                if code not in known and 0x300 < code < 0xE000)  # fmt: skip


def drawn(text: str, style: dict, choose: bool = True) -> np.ndarray:
    with rc_context(style):
        figure = Figure(figsize=(1, 1), dpi=100)
        canvas = FigureCanvasAgg(figure)
        figure.text(0.3, 0.3, text, fontsize=30)
        if choose:
            with lettered(figure):
                canvas.draw()
        else:
            canvas.draw()
        return np.asarray(canvas.buffer_rgba()).copy()


def alike(one: np.ndarray, other: np.ndarray) -> bool:
    """The same letter: a font that stands in for another is fitted to the pixels a little otherwise."""
    return bool(np.abs(one.astype(int) - other.astype(int)).max() < 100)


def test_our_own_letters_are_in_the_fonts_of_the_style() -> None:
    with rc_context(STYLE):
        assert families_for(OURS) == ()


@pytest.mark.parametrize("letter", ["ɴ", "ü", "≤"])
def test_a_letter_that_the_first_font_lacks_is_taken_from_the_next(letter: str) -> None:
    assert alike(drawn(letter, STYLE), drawn(letter, {"font.family": "DejaVu Sans"}, choose=False))
    assert not alike(drawn(letter, STYLE), drawn(NOBODYS, STYLE))


def test_a_letter_of_neither_is_taken_from_any_font_that_has_it() -> None:
    letter = letter_of_another_font()
    with rc_context(STYLE):
        families = families_for(f"The cliff of {letter}")
        assert len(families) == 1
    assert alike(drawn(letter, STYLE), drawn(letter, {"font.family": families[0]}, choose=False))
    assert not alike(drawn(letter, STYLE), drawn(NOBODYS, STYLE))


def test_a_letter_that_nobody_has_is_a_box_without_a_warning(tmp_path: Path) -> None:
    box = drawn(NOBODYS, STYLE)
    assert (box[..., 0] < 128).any()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for kind in ("png", "svg", "pdf"):
            figure = Figure()
            figure.text(0.1, 0.1, f"a{NOBODYS}b")
            save_figure(figure, tmp_path / f"a.{kind}")
        write_pdf([Words("h1", f"a{NOBODYS}b")], tmp_path / "pages.pdf", f"a{NOBODYS}")


def test_pages_are_lettered_too(tmp_path: Path) -> None:
    """The PDF carries each font that a letter was taken from."""
    write_pdf([Words("text", "R_N")], tmp_path / "plain.pdf", "a")
    write_pdf([Words("text", "R_ɴ")], tmp_path / "symbol.pdf", "a")
    write_pdf([Words("text", letter_of_another_font())], tmp_path / "other.pdf", "a")
    plain, symbol, other = ((tmp_path / f"{name}.pdf").read_bytes() for name in ("plain", "symbol", "other"))
    assert b"DejaVuSans" not in plain
    assert b"DejaVuSans" in symbol
    assert b"STIX" in other


def test_commands_pass_on_no_notes_of_matplotlib(tmp_path: Path) -> None:
    """It has some to say about a home that cannot be written to."""
    (tmp_path / "home").write_text("not a folder", encoding="utf-8")
    code = "from rockfall.core.cli import main; main(['models']); import matplotlib.font_manager"
    environment = {key: value for key, value in os.environ.items() if key != "MPLCONFIGDIR" and key[:4] != "XDG_"}
    environment |= {"HOME": str(tmp_path / "home"), "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert done.stderr == ""
