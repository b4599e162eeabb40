# SPDX-License-Identifier: GPL-3.0-or-later
"""Names with characters that turn letters round, or that nobody sees: not on terminals, in figures, pages and films."""

import io

import numpy as np
import pytest
from rockfall.core import cli
from rockfall.core.analysis.svg import Svg
from rockfall.core.cli import VisibleStream
from rockfall.core.errors import HIDDEN, visible

HOSTILE = "safe\u202egpj.exe\u2066\u200b\x1b[31m\x07"
SHOWN = "safegpj.exe[31m"


def test_what_is_taken_out_and_what_stays():
    assert visible(HOSTILE) == SHOWN
    for text in ("Größe 石 שלום", "two\nlines\tand a tab\r", "−3 °", "a b"):
        assert visible(text) == text


def test_the_terminal_gets_no_commands_from_a_name(tmp_path, capsys):
    stream = io.StringIO()
    print(HOSTILE, file=VisibleStream(stream))
    assert stream.getvalue() == f"{SHOWN}\n"
    rows = [
        f"{HOSTILE},{t},{5.0 * t},0,{100 - 5 * t * t},{kind}" for t, kind in ((0, "release"), (1, "impact"), (2, "end"))
    ]
    (tmp_path / "picks.csv").write_text("trajectory,time_s,x_m,y_m,z_m,kind\n" + "\n".join(rows), encoding="utf-8")
    cli.main(["reconstruct", str(tmp_path / "picks.csv"), "--out", str(tmp_path / "out")])
    printed = "".join(capsys.readouterr())
    assert "safe" in printed or "trajectory" in printed
    assert not HIDDEN.search(printed)


def test_figures_pdf_and_films(tmp_path):
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure
    from rockfall.core.analysis.figures import save_figure
    from rockfall.core.exchange.pdf_pages import Words, write_pdf
    from rockfall.core.film.composed.canvas import text_width

    figure = Figure()
    figure.suptitle(HOSTILE)
    save_figure(figure, tmp_path / "a.svg")
    assert figure.get_suptitle() == SHOWN
    write_pdf([Words("text", HOSTILE)], tmp_path / "a.pdf", HOSTILE)
    assert "\u202e".encode("utf-16-be") not in (tmp_path / "a.pdf").read_bytes()
    assert text_width(HOSTILE, 20) == text_width(SHOWN, 20)


def test_drawings_as_svg():
    drawing = Svg(100, 50)
    drawing.text(5, 5, HOSTILE, 10, np.array([0.0, 0.0, 0.0]), (0.0, 0.0))
    assert SHOWN in drawing.document()
    assert not HIDDEN.search(drawing.document())
