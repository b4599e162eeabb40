# SPDX-License-Identifier: GPL-3.0-or-later
"""The design sheet as a page that needs nothing else, as a PDF of the same, and as tables."""

import base64
import io
import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.figures import STYLE
from ..analysis.likelihood_free import weighted_quantiles
from ..analysis.scores import Score
from ..analysis.typefaces import lettered
from ..analysis.variables import find_variable
from ..errors import visible
from ..exchange.pdf_pages import STYLES, Drawing, Element, Rows, Words, write_pdf
from ..exchange.simulation_tables import inputs_with_digests
from ..hazard.design import KNOWN_TO, LEVELS_KJ, ON, DesignValues, Factor
from ..hazard.screens import OUTCOMES, Screen
from ..impact_models.registry import find_model
from ..output import write_text
from ..progress import Progress, silent
from ..remarks import to_plain
from ..simulation.convergence import Quantile, fewest
from ..simulation.parameter_draws import FRICTION_NAME
from ..simulation.trees import LAW, NOT_KNOWN
from .design_figures import figures_of
from .design_sheet import ENERGY_LINES_DEG, DesignSheet, ModelDesign

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE_FILE = Path(__file__).parents[2] / "assets" / "report" / "design.css"
DPI = 170
KJ = 1e-3
INTERVAL = np.array([0.025, 0.5, 0.975])


@dataclass(frozen=True)
class Table:
    """A table, with a title and a note; `words` are columns that are no numbers, beside the first two."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    words: tuple[int, ...] = ()


def write_design(
    sheet: DesignSheet,
    folder: Path,
    inputs: Mapping[str, Path],
    *,
    pdf: bool = True,
    drawn: bool = True,
    progress: Progress = silent,
) -> list[str]:
    """Write design.html, design.pdf and design.json into a folder; returns their names.

    Parameters
    ----------
    inputs : what it is → file: their hashes are on the page.
    drawn : whether there are figures, and so a PDF; a page without them says so, and needs no Matplotlib.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    OSError : the folder cannot be written.
    """
    facts = provenance(sheet, inputs)
    tables = tuple(tables_of(sheet))
    figures = []
    for name, caption, figure in figures_of(sheet) if drawn else ():
        progress(f"Drawing {name}", 0, 0)
        figures.append((name, caption, figure))
    write_text(folder / "design.html", visible(page(sheet, tables, facts, figures)))
    written = ["design.html"]
    if pdf and drawn:
        progress("Writing the PDF", 0, 0)
        write_pdf(list(_elements(sheet, tables, facts, figures)), folder / "design.pdf", _heading(sheet))
        written.append("design.pdf")
    write_text(folder / "design.json", json.dumps(plain(sheet, facts), indent=2, ensure_ascii=False) + "\n")
    return [*written, "design.json"]


def tables_of(sheet: DesignSheet) -> Iterator[Table]:
    """What the page tells in tables, in its order."""
    percent = f"{100 * sheet.share:g} %"
    asked = [(screen, one, values) for one in sheet.models for screen, values in one.values.items()]
    on_energy = sheet.factors.unverified("speed", "mass", "energy")
    on_needed, on_height = sheet.factors.unverified("capacity"), sheet.factors.unverified("height")
    note = (
        f"{percent} of the blocks that come do not exceed the first value; behind it is its 95 % interval. It is of "
        "blocks, of each its greatest hit, and blocks from one place of release are not taken as independent. Design "
        f"values are the upper end of that interval times the partial factors of {sheet.factors.title}; without an "
        f"upper end, which takes {fewest(sheet.share)} independent blocks, nothing is designed. The needed energy is "
        "times the factor on the capacity, the needed height is with the free height above the block. "
        f"{_unverified_sentence(sheet)}Energy is of translation and rotation; height is that of the block's centre, "
        "vertically above the terrain. Class: of maximum energy level (MEL) of EAD 340059-00-0106, whose test blocks "
        "do not turn, so that it counts ½mv² alone; rotation is counted here as well, which is on the safe side."
    )
    yield Table(
        "What a barrier must have",
        ("screen", "model", "verdict", f"energy, {percent} [kJ]", "of it translation", "design [kJ]", "needed [kJ]",
         "class", f"height, {percent} [m]", "design [m]", "needed [m]"),
        tuple(
            (
                screen, _title(one), VERDICTS[values.verdict], _known(values.energy_j, KJ),
                _number(values.translation_j.value * KJ), _asked(values.design_energy_j * KJ, on_energy),
                _asked(values.needed_energy_j * KJ, (*on_energy, *on_needed)), _level(values, (*on_energy, *on_needed)),
                _known(values.height_m), _asked(values.design_height_m, on_height),
                _asked(values.needed_height_m, on_height),
            )
            for screen, one, values in asked
        ),
        note,
        words=(2,),
    )  # fmt: skip
    yield Table(
        "What comes to each screen",
        ("screen", "model", "blocks", "reach it", "share [%]", "places of release", "worth independent blocks", "hits",
         f"speed, {percent} [m/s]", "design [m/s]", "energy known to", "height known to", "more blocks to tell"),
        tuple(
            (
                screen, _title(one), str(values.blocks), str(values.reach),
                f"{100 * values.reach / values.blocks:.3g}", f"{values.places} of {values.released_from}",
                f"{min(values.energy_j.effective, values.height_m.effective):.0f}", str(values.hits),
                _known(values.speed_mps), _asked(values.design_speed_mps, sheet.factors.unverified("speed")),
                _to(values.energy_j), _to(values.height_m), _more(values),
            )
            for screen, one, values in asked
        ),
        "Conditional on the release: these are shares of the blocks that were released, not how often blocks fall. "
        f"Values are known to half the width of their interval; {100 * KNOWN_TO:g} % or less is usual. Blocks from one "
        "place of release are alike: they tell as much as the fewer independent ones that they are worth.",
    )  # fmt: skip
    barriers = [screen for screen in sheet.screens if screen.holds]
    if barriers:
        held = []
        for one in sheet.models:
            before, after = one.tally.figures(), one.tally.figures(with_barriers=True)
            for place, screen in enumerate(sheet.screens):
                outcomes = [str(after[place].outcomes[name]) for name in OUTCOMES[1:]] if screen.holds else ["–"] * 3
                held.append((screen.name, _title(one), str(before[place].reach), str(after[place].reach), *outcomes))
        names = ", ".join(
            f"{screen.name}: {screen.height_m:g} m, {(screen.capacity_j or 0) * KJ:g} kJ" for screen in barriers
        )
        yield Table(
            "Before and after the barriers",
            ("screen", "model", "blocks without barriers", "with barriers", "held", "over", "through"),
            tuple(held),
            f"The same runs, with and without: counts, and no verdict. {names}. A barrier holds a block that hits it "
            "with all of it below its top, up to its capacity; what it does not hold goes on as it came.",
        )
    yield from _evidence_tables(sheet)
    yield from _drawn_tables(sheet)
    yield Table(
        "Energy lines",
        ("model", "lowest", "5 %", "median", *(f"runs that end below {angle:g}°" for angle in ENERGY_LINES_DEG)),
        tuple(
            (
                _title(one),
                *(f"{value:.1f}°" for value in np.quantile(one.energy_lines_deg, [0.0, 0.05, 0.5])),
                *(f"{100 * float((one.energy_lines_deg < angle).mean()):.3g} %" for angle in ENERGY_LINES_DEG),
            )
            for one in sheet.models
            if one.energy_lines_deg.size
        ),
        f"The angle below the horizontal from the release to the end, of {max(len(one.drawn) for one in sheet.models)} "
        "runs. Observed rockfalls seldom end below 28.5° to 33.5°: many that do ask for a reason.",
    )
    rows = [
        (one.symbol, one.on, _asked(one.value, () if one.verified else (one,)), one.meaning, one.source)
        for one in sheet.factors.factors
    ]
    yield Table(
        f"Partial factors: {sheet.factors.title}",
        ("factor", "on", "value", "meaning", "source"),
        tuple(rows),
        f"{sheet.factors.note} {_unverified_sentence(sheet)}The energy is multiplied by the factors of the mass, of "
        f"the energy and, squared, of the speed. Free height: {sheet.factors.clearance_m:g} m, or the radius of the "
        "block where that is more.",
        words=(3, 4),
    )


def _evidence_tables(sheet: DesignSheet) -> Iterator[Table]:
    known = [(one, one.evidence) for one in sheet.models if one.evidence is not None]
    if not known:
        return
    rows = []
    for one, evidence in known:
        for score in evidence.scores:
            rows.append((_title(one), *_score_cells(score)))
    evidence = known[0][1]
    drawn = ", of those that blocks drew their means" if any(one.settings.draws for one, _ in known) else ""
    yield Table(
        "Evidence: the impacts that were measured on this site",
        ("model", "quantity", "impacts", "bias", "RMSE", "95 % interval", "measured within the model's 90 %"),
        tuple(rows),
        f"{evidence.impacts} impacts of {evidence.trajectories} trajectories, which were filmed here. Each model gets "
        f"their incident velocity, with the parameters of this simulation{drawn}. Bias is model − measured. The last "
        "column should be 90 %; a model without chance has 0.",
    )
    folds = [(one, e.calibration) for one, e in known if e.calibration is not None]
    if folds:
        yield Table(
            "Evidence: how well trajectories that were left out are predicted",
            ("model", "default parameters", "fitted to all", "fitted, of those left out", "verdict"),
            tuple(
                (
                    _title(one), _number(c.default_score, 3), _number(c.fitted_score, 3),
                    _number(c.held_out_score, 3), " ".join(remark.text for remark in c.remarks) or "–",
                )
                for one, c in folds
            ),
            "Mean energy score of rebounds; 0 is perfect. Each fifth of the trajectories is predicted by a fit to the "
            "others.",
            words=(4,),
        )  # fmt: skip


def _drawn_tables(sheet: DesignSheet) -> Iterator[Table]:
    """Parameters of which each block drew its own."""
    rows = []
    for one in sheet.models:
        draws = one.settings.draws
        for place, name in enumerate(() if draws is None else draws.names):
            assert draws is not None
            low, middle, high = weighted_quantiles(draws.values[:, place], draws.weight, INTERVAL).tolist()
            before = draws.before[place] if draws.before else "not known"
            rows.append((_title(one), name, f"{middle:.3g}", f"{low:.3g} to {high:.3g}", before))
    if rows:
        yield Table(
            "Parameters: back-analysed from whole falls",
            ("model", "parameter", "median", "95 % interval", "what was thought possible before"),
            tuple(rows),
            "Each block drew a set of its own from all that fit the observed runs, so that the values above have in "
            "them what is not known of the parameters, beside chance. A parameter of which nearly all is left was not "
            "told by the runs." + "".join(f" {_title(one)}: {doubt}" for one in sheet.models for doubt in _doubts(one)),
            words=(4,),
        )


def _doubts(model: ModelDesign) -> tuple[str, ...]:
    """What the back-analysis of its parameters says against itself."""
    return () if model.settings.draws is None else model.settings.draws.doubts


def _score_cells(score: Score) -> tuple[str, ...]:
    variable = find_variable(score.quantity)
    unit = f" [{variable.unit}]" if variable.unit else ""
    interval = "–" if score.rmse_low != score.rmse_low else f"{score.rmse_low:.2g} to {score.rmse_high:.2g}"
    covered = "–" if score.coverage90 != score.coverage90 else f"{100 * score.coverage90:.0f} %"
    bias = f"{score.bias:+.2g}".replace("-", "−")
    return f"{variable.symbol}{unit}", str(score.n), bias, f"{score.rmse:.2g}", interval, covered


def provenance(sheet: DesignSheet, inputs: Mapping[str, Path]) -> dict[str, str]:
    """What ran, with what: enough to do it again."""
    first = sheet.models[0]
    settings = first.settings
    facts = {
        "Site": sheet.title or "–",
        "Rockfall": str(import_module((__package__ or "").partition(".core")[0]).__version__),
        "Python, NumPy": f"{platform.python_version()}, {version('numpy')}",
        "Written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "Coordinates": sheet.ground.shift.crs or "system unknown",
        "Blocks": ", ".join(f"{_title(one)}: {one.counted.blocks}" for one in sheet.models),
        "Seed": str(settings.seed),
        "Rolling, friction": f"{settings.rolling}, {_friction(sheet)}",
        "Drag of air": "yes" if settings.drag is not None else "no",
        "Trees": "none" if settings.trees is None else f"{len(settings.trees)}. {LAW} {NOT_KNOWN}",
        "Ends": "; ".join(
            f"{_title(one)}: " + ", ".join(f"{name} {n}" for name, n in one.counted.ends.items() if n)
            for one in sheet.models
        ),
    }
    for one in sheet.models:
        values = find_model(one.settings.model).settings(one.settings.parameters)
        drawn = () if one.settings.draws is None else one.settings.draws.names
        facts[f"Parameters, {_title(one)}"] = ", ".join(
            f"{name} = {'drawn by each block' if name in drawn else _plain(value)}" for name, value in values.items()
        )
    for name, about in inputs_with_digests(inputs).items():
        facts[f"File: {name}"] = f"{about['file']}, SHA-256 {about['sha256']}"
    return facts


def _friction(sheet: DesignSheet) -> str:
    """The coefficient on the ground, and whose blocks drew their own."""
    value = f"{sheet.models[0].settings.friction:g}"
    drawing = [_title(one) for one in sheet.models if one.settings.draws and FRICTION_NAME in one.settings.draws.names]
    return f"{value}; of {', '.join(drawing)} drawn by each block" if drawing else value


def plain(sheet: DesignSheet, facts: Mapping[str, str]) -> dict[str, Any]:
    """The same for programs."""

    def quantile(one: Quantile) -> dict[str, float | None]:
        return {name: _finite(getattr(one, name)) for name in ("share", "value", "low", "high", "effective")}

    def values(one: DesignValues) -> dict[str, Any]:
        names = (
            "blocks", "released_from", "places", "reach", "hits", "radius_m", "design_speed_mps", "design_energy_j",
            "design_height_m", "clearance_m", "needed_energy_j", "needed_height_m", "level", "different", "verdict",
        )  # fmt: skip
        known = {name: quantile(getattr(one, name)) for name in ("speed_mps", "energy_j", "translation_j", "height_m")}
        more = one.more
        return (
            known
            | {name: _finite(getattr(one, name)) for name in names}
            | {"faults": list(one.faults)}
            | {"more_blocks": 0 if more is None and one.is_sample else None if more is None else more.blocks}
            | {"more_from_other_places": more is not None and more.elsewhere}
        )

    def nothing(screen: Screen, blocks: int) -> dict[str, Any]:
        return {"blocks": blocks, "reach": 0, "verdict": "not_known" if screen.holds else None, "more_blocks": None}

    return {
        "title": sheet.title,
        "factors": sheet.factors.title,
        "unverified_factors": {one.symbol: one.value for one in sheet.factors.unverified(*ON)},
        "models": {
            one.settings.model: {
                screen.name: values(one.values[screen.name])
                if screen.name in one.values
                else nothing(screen, one.counted.blocks)
                for screen in sheet.screens
            }
            for one in sheet.models
        },
        "remarks": to_plain(sheet.remarks),
        "provenance": dict(facts),
    }


def page(
    sheet: DesignSheet,
    tables: Sequence[Table],
    facts: Mapping[str, str],
    figures: "Sequence[tuple[str, str, Figure]]",
) -> str:
    """The page as one HTML text, pictures included."""
    remarks = "".join(f'<li class="{kind}">{escape(text)}</li>' for kind, text in _first_said(sheet))
    pictures = "".join(
        f'<figure id="{escape(name, quote=True)}"><img alt="{escape(caption, quote=True)}" src="{_picture(figure)}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for name, caption, figure in figures
    )
    body = "".join(_html(table) for table in tables)
    rows = "".join(f"<tr><td>{escape(name)}</td><td>{escape(text)}</td></tr>" for name, text in facts.items())
    title = escape(_heading(sheet))
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
        'img-src data:">'
        f'<title>{title}</title><link rel="icon" href="data:,"><style>{STYLE_FILE.read_text(encoding="utf-8")}</style>'
        f"</head><body><header><h1>{title}</h1><p>{escape(_summary(sheet))}</p></header><main>"
        f'<ul class="remarks">{remarks}</ul>{_html(tables[0])}'
        f'<section class="figures">{pictures or NO_FIGURES}</section>'
        f"{body[len(_html(tables[0])) :]}"
        f'<h2>Inputs and versions</h2><div class="scroll"><table class="facts">{rows}</table></div>'
        f"<h2>What this sheet does not say</h2><p>{escape(LIMITS)}</p></main></body></html>\n"
    )


NO_FIGURES = (
    "<p>No figures: this page was made where Matplotlib is not installed. <code>rockfall design</code> draws them.</p>"
)
LIMITS = (
    "How often blocks fall: everything here is conditional on the release that is given above. That the blocks do not "
    "break, and do not meet each other. What trees, water, snow or an earlier block would change. That a barrier is "
    "where its line is drawn, stands upright, and lets pass unchanged what it does not hold."
)


def _heading(sheet: DesignSheet) -> str:
    return f"Design sheet: {sheet.title}" if sheet.title else "Design sheet"


def _summary(sheet: DesignSheet) -> str:
    names = ", ".join(screen.name for screen in sheet.screens)
    models = ", ".join(_title(one) for one in sheet.models)
    blocks = max(one.counted.blocks for one in sheet.models)
    known = "" if sheet.limit is None else f", until the values were known or {sheet.limit} had fallen"
    return f"{blocks} simulated blocks with each of: {models}{known}. Screens: {names}."


def _html(table: Table) -> str:
    def cells(tag: str, row: Sequence[str]) -> str:
        kinds = (' class="words"' if i in table.words else "" for i in range(len(row)))
        return "".join(f"<{tag}{kind}>{escape(cell)}</{tag}>" for kind, cell in zip(kinds, row, strict=True))

    head = cells("th", table.head)
    rows = "".join(f"<tr>{cells('td', row)}</tr>" for row in table.rows)
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    return (
        f'<h2>{escape(table.title)}</h2><div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>{note}"
    )


def _picture(figure: "Figure") -> str:
    from matplotlib import rc_context

    from ..analysis.figures import show_names

    buffer = io.BytesIO()
    show_names(figure)
    with rc_context(STYLE), lettered(figure):
        figure.savefig(buffer, format="png", dpi=DPI)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def _elements(
    sheet: DesignSheet,
    tables: Sequence[Table],
    facts: Mapping[str, str],
    figures: "Sequence[tuple[str, str, Figure]]",
) -> Iterator[Element]:
    """The PDF in the reading order of the HTML page."""
    yield Words("h1", _heading(sheet))
    yield Words("text", _summary(sheet))
    for kind, text in _first_said(sheet):
        yield Words(kind if kind in STYLES and kind != "note" else "text", text)
    yield from _on_paper(tables[0])
    for _, caption, figure in figures:
        yield Drawing(figure, caption)
    for table in tables[1:]:
        yield from _on_paper(table)
    yield Words("h2", "Inputs and versions")
    yield Rows(("", ""), tuple(facts.items()))
    yield Words("h2", "What this sheet does not say")
    yield Words("text", LIMITS)


def _on_paper(table: Table) -> Iterator[Element]:
    yield Words("h2", table.title)
    yield Rows(table.head, table.rows, words=table.words)
    if table.note:
        yield Words("note", table.note)


def _title(one: ModelDesign) -> str:
    return find_model(one.settings.model).title


def _known(one: Quantile, factor: float = 1.0) -> str:
    low, high = (_number(end * factor) if end == end else "?" for end in (one.low, one.high))
    interval = f" ({low} to {high})" if np.isfinite([one.low, one.high]).any() else " (interval unknown)"
    return f"{_number(one.value * factor)}{interval}"


def _to(one: Quantile) -> str:
    return f"{100 * one.known_to:.1f} %" if np.isfinite(one.known_to) else "?"


def _first_said(sheet: DesignSheet) -> Iterator[tuple[str, str]]:
    """The kind and text of what stands above all tables: the verdicts, the bad ones first, then what else to know."""
    worst = ("not_enough", "not_known", "enough")
    verdicts = sorted(sheet.verdicts, key=lambda one: worst.index(one[0]))
    yield from ((verdict, remark.text) for verdict, remark in verdicts)
    said = {remark for _, remark in verdicts}
    yield from ((remark.severity, remark.text) for remark in sheet.remarks if remark not in said)


def _asked(value: float, unverified: Sequence[Factor]) -> str:
    """A value that something must have; marked where factors that are not verified are in it."""
    if not np.isfinite(value):
        return "not known"
    return f"{_number(value)}{UNVERIFIED if unverified else ''}"


UNVERIFIED = " ‡"
VERDICTS = {"enough": "enough", "not_enough": "NOT ENOUGH", "not_known": "not known yet", None: "no barrier"}


def _unverified_sentence(sheet: DesignSheet) -> str:
    found = sheet.factors.unverified(*ON)
    if not found:
        return ""
    names = ", ".join(f"{one.symbol} = {one.value:g}" for one in found)
    return f"‡: with factors that are not verified against the standard, {names}. "


def _more(values: DesignValues) -> str:
    more = values.more
    if more is None:
        return "–" if values.is_sample else "none would"
    return f"{more.blocks}{' from other places' if more.elsewhere else ''}"


def _level(values: DesignValues, unverified: Sequence[Factor]) -> str:
    mark = UNVERIFIED if unverified else ""
    if values.level is None:
        return "not known"
    if values.level == len(LEVELS_KJ):
        return f"8 (above {LEVELS_KJ[-1]:.0f} kJ){mark}"
    return f"{values.level} (MEL {values.level_kj:.0f} kJ){mark}"


def _number(value: float, digits: int = 3) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.{digits}g}"


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _finite(value: Any) -> Any:
    """The same, None for a number that is not finite."""
    return None if isinstance(value, float) and not np.isfinite(value) else value
