# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page: move a parameter, and the model's points, links, curves and scores follow (Bokeh server).

It listens on this machine only, and answers only pages that it served itself.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import Any

from ..errors import RockfallError
from ..extras import PAGES, demand
from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import find_model
from ..progress import Progress
from ..reconstruction.impact import Impacts
from .background import Job
from .comparison import predict, thinned
from .courses import Courses
from .estimation import FitOptions, FittedModel
from .linked_columns import model_columns
from .linked_graphs import SHEET, WEB, LinkedGraphs, link_graphs
from .local_server import ADDRESS, local_server
from .parameter_inputs import ParameterInputs, parameter_inputs
from .report import MOST_SHOWN, fewer_sentence, frame, score_table, summary, template
from .scores import Score, scores

REPLICATES = 6
"""Draws of a random model that its scores are computed with: few, so that they keep pace with the slider."""

FIRST_MS, POINT_MS = 15, 0.05
"""Between two changes of what is shown, and more for each point: the browser has to draw them."""

Settings = dict[str, dict[str, Value]]
"""Model → parameter → value, of what is not at its default."""


@dataclass(frozen=True, eq=False)
class Exploration:
    """What a page starts with.

    Attributes
    ----------
    impacts, courses : the measured impacts, and those of them that can be compared.
    models : names.
    given : parameters that are not to start at their default.
    seed : of the random numbers.
    origin : name of the table of impacts.
    title : heading of the page; "" for the usual one.
    shown : models that are shown at first; the first one alone, if empty.
    save : writes model → all parameters, and returns where.
    """

    impacts: Impacts
    courses: Courses
    models: Sequence[str]
    save: Callable[[Mapping[str, Mapping[str, Value]]], str]
    given: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    seed: int = 0
    origin: str = ""
    title: str = ""
    shown: Sequence[str] = ()


def serve(exploration: Exploration, port: int = 0, ready: Callable[[str], None] | None = None) -> None:
    """Serve the page until the process is interrupted.

    Parameters
    ----------
    port : 0 for any that is free.
    ready : told the address as soon as the page can be opened.

    Raises
    ------
    DependencyError : Bokeh is not installed.
    RockfallError : the port is taken.
    """
    demand(PAGES)
    try:
        server, port = local_server(lambda document: open_page(document, exploration), port)
    except OSError as error:
        raise RockfallError(
            f"Port {port} cannot be used ({error.strerror}). Leave --port out to take a free one."
        ) from error
    server.start()
    if ready is not None:
        server.io_loop.add_callback(ready, f"http://{ADDRESS}:{port}/")
    try:
        server.io_loop.start()
    finally:
        server.stop()


def open_page(document: Any, exploration: Exploration) -> None:
    """Put the page into a document of the server."""
    page = _Page(document, exploration)
    for root in page.roots():
        document.add_root(root)
    document.title = exploration.title or "Rockfall: explore impact models"
    document.template = template()
    document.template_variables.update(
        heading=exploration.title or "Explore impact models",
        summary=summary(page.first, len(exploration.impacts), exploration.origin, chance=False) + page.less,
        after="",
        live=True,
        **frame(page.linked.graphs),
    )
    document.on_session_destroyed(lambda _context: page.job.close())


def _said_of(result: FittedModel) -> str:
    """What a fit is worth, as HTML: of single parameters only what is not in order."""
    single = [remark for one in result.estimates for remark in one.remarks if remark.severity != "note"]
    remarks = [replace(one, text=f"{one.about}: {one.text}") for one in single] + [*result.remarks]
    return "".join(f'<div class="remark {one.severity}">{escape(one.text)}</div>' for one in remarks)


class _Page:
    """The state of one open page: the chosen model, its parameters, and the widgets that show them."""

    def __init__(self, document: Any, exploration: Exploration) -> None:
        from bokeh.models import Div, InlineStyleSheet, Select

        self.document, self.start = document, exploration
        self.given: Settings = {name: dict(exploration.given.get(name, {})) for name in exploration.models}
        self.model, self.run, self.seed = exploration.models[0], 0, exploration.seed
        self.behind: set[str] = set()
        self.scoring: Any = None
        self.sheet = InlineStyleSheet(css=SHEET)
        self.job = Job(document, self._say)
        self.first = predict(
            exploration.impacts, exploration.courses, exploration.models, self.given, replicates=1, seed=self.seed
        )
        titles = [(name, find_model(name).title) for name in exploration.models]
        self.select = Select(
            title="Parameters of",
            value=self.model,
            options=titles,
            name="model",
            stylesheets=[self.sheet],
            sizing_mode="stretch_width",
        )
        shown = thinned(self.first, MOST_SHOWN)
        self.less = fewer_sentence(self.first, shown)
        self.pace_ms = FIRST_MS + round(shown.row.size * POINT_MS)
        self.linked: LinkedGraphs = link_graphs(
            exploration.impacts, shown, self.run, exploration.shown or [self.model], edited=self.select
        )
        css = InlineStyleSheet(css=(WEB / "page.css").read_text(encoding="utf-8"))
        self.scores = Div(name="scores", stylesheets=[self.sheet, css], sizing_mode="stretch_width")
        self.status = Div(
            text="", name="status", disable_math=True, stylesheets=[self.sheet], sizing_mode="stretch_width"
        )
        self.defaults = {name: self._scores_of(name, {}) for name in exploration.models}
        self.inputs = {name: self._inputs(name) for name in exploration.models}
        self._show_scores()

    def roots(self) -> tuple[Any, ...]:
        """What the page's frame asks for."""
        from bokeh.layouts import column, row
        from bokeh.models import Button, MultiChoice, RadioButtonGroup

        common: dict[str, Any] = {"stylesheets": [self.sheet], "sizing_mode": "stretch_width"}
        self.select.on_change("value", lambda _attribute, _old, new: self._choose(new))
        self.runs = RadioButtonGroup(labels=["Mean", "One draw per impact"], active=0, name="run", **common)
        self.runs.on_change("active", lambda _attribute, _old, new: self._draw(new))
        self.again = Button(label="Draw again", name="again", **common)
        self.again.on_click(self._draw_again)
        save, reset = Button(label="Save", name="save", **common), Button(label="Reset", name="reset", **common)
        save.on_click(self._save)
        reset.on_click(self._reset)
        self.fit = MultiChoice(title="Fit", value=[], options=[], name="fit", **common)
        self.calibrate = Button(label="Calibrate", button_type="primary", name="calibrate", **common)
        self.calibrate.on_click(self._calibrate)
        self._offer()
        controls = column(
            self.select,
            self.runs,
            self.again,
            *(inputs.layout for inputs in self.inputs.values()),
            row(reset, save, sizing_mode="stretch_width"),
            self.fit,
            self.calibrate,
            self.status,
            name="controls",
            sizing_mode="stretch_width",
            spacing=10,
        )
        return controls, *self.linked.graphs.values(), self.linked.selection, self.scores

    def _inputs(self, name: str) -> ParameterInputs:
        model = find_model(name)
        inputs = parameter_inputs(
            model,
            model.settings(self.given[name]),
            lambda key, value: self._set(name, key, value),
            lambda problem: self._say(escape(problem)),
        )
        inputs.layout.visible = name == self.model
        return inputs

    def _set(self, name: str, key: str, value: Value) -> None:
        model, given = find_model(name), self.given[name]
        given[key] = value
        followers = [spec.name for spec in model.parameters if spec.follows and spec.follows[0] == key]
        for follower in followers:
            given.pop(follower, None)
        if followers:
            self.inputs[name].show(model.settings(given))
        self._show([name])

    def _choose(self, name: str) -> None:
        if name not in self.inputs:  # no browser says that
            self.select.value = self.model
            return
        self.inputs[self.model].layout.visible = False
        self.model = name
        self.inputs[name].layout.visible = True
        self._offer()
        self._show()

    def _draw(self, run: int | None) -> None:
        if run not in (0, 1):  # no browser says that
            self.runs.active = self.run
            return
        self.run = run
        self._offer_draws()
        self._show(self.start.models)

    def _draw_again(self) -> None:
        self.seed += 1
        self._show(self.start.models)

    def _reset(self) -> None:
        self.given[self.model].clear()
        self.inputs[self.model].show(find_model(self.model).settings())
        self._show()
        self._say("")

    def _save(self) -> None:
        settings = {name: find_model(name).settings(self.given[name]) for name in self.start.models}
        try:
            self._say(f"Saved to {escape(self.start.save(settings))}")
        except RockfallError as error:
            self._say(escape(str(error)))

    def _offer(self) -> None:
        """What suits the chosen model: draws if it has chance in it, and parameters that can be fitted."""
        self._offer_draws()
        from .calibration import usual_names

        model = find_model(self.model)
        self.fit.options = [spec.name for spec in model.parameters]
        self.fit.value = list(usual_names(model))

    def _offer_draws(self) -> None:
        self.runs.visible = find_model(self.model).is_random
        self.again.visible = self.runs.visible and bool(self.run)

    def _calibrate(self) -> None:
        if self.job.is_running:
            self.job.cancel()
            return
        from .calibration import Calibration, calibrate

        name, fitted = self.model, tuple(self.fit.value)
        if not fitted:
            self._say("Choose the parameters to fit.")
            return
        fixed = {key: value for key, value in self.given[name].items() if key not in fitted}
        courses = self.start.courses
        options = FitOptions(seed=self.start.seed, spin=courses.spin, radius_m=courses.radius_m)

        def work(progress: Progress) -> Calibration:
            return calibrate(self.start.impacts, name, fitted, fixed, options, progress=progress)

        def done(result: Calibration | None) -> None:
            self.calibrate.update(label="Calibrate", button_type="primary")
            if result is not None:
                self.given[name].update({key: result.settings[key] for key in fitted})
                self.inputs[name].show(result.settings)
                self._show()
                self._say(_said_of(result))

        self.calibrate.update(label="Cancel", button_type="default")
        self.job.begin(work, done)

    def _scores_of(self, name: str, given: Mapping[str, Value]) -> list[Score]:
        replicates = REPLICATES if find_model(name).is_random else 0
        found = predict(
            self.start.impacts, self.start.courses, [name], {name: given}, replicates=replicates, seed=self.seed
        )
        return list(scores(self.start.impacts, found))

    def _show(self, models: Sequence[str] = ()) -> None:
        """Soon bring the page in line with the parameters of the chosen model, or of some.

        A slider asks for it many times a second: what it asked for in the meantime is done once.
        """
        if not self.behind:
            self.document.add_timeout_callback(self._show_points, self.pace_ms)
        self.behind |= {self.model, *models}

    def _show_points(self) -> None:
        impacts, columns = self.start.impacts, dict[str, Any]()
        behind, self.behind = self.behind, set()
        for name in behind:
            run = self.run if find_model(name).is_random else 0
            found = predict(impacts, self.start.courses, [name], self.given, replicates=run, seed=self.seed)
            place = self.start.models.index(name)
            columns |= model_columns(impacts, thinned(found, MOST_SHOWN), name, run, place)
        self.linked.source.data.update(columns)
        if self.scoring is not None:
            self.document.remove_timeout_callback(self.scoring)
        self.scoring = self.document.add_timeout_callback(self._show_scores, self.pace_ms)

    def _show_scores(self) -> None:
        self.scoring = None
        rows = {"Now": self._scores_of(self.model, self.given[self.model]), "Defaults": self.defaults[self.model]}
        self.scores.text = score_table(rows, find_model(self.model).title)

    def _say(self, text: str) -> None:
        self.status.text = text
