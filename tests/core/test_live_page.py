# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page goes on whatever its socket is told: values no slider has, models that are not there, a page that is
gone. What it saves tells which values it has taken."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rockfall.core.analysis import explorer
from rockfall.core.analysis.background import Job
from rockfall.core.analysis.courses import find_courses
from rockfall.core.errors import InputError
from rockfall.core.exchange.tables import read_impacts

bokeh = pytest.importorskip("bokeh.document")
FUZZING = Path(__file__).parents[2] / "scripts" / "fuzzing"
MODELS = ("noel_2017", "stevens_1998")


class Opened:
    """A page without a browser: what stands on it by name, and what was saved."""

    def __init__(self, file: Path) -> None:
        impacts = read_impacts(file)
        self.saved: list[Any] = []
        self.document = bokeh.Document()
        start = explorer.Exploration(impacts, find_courses(impacts, "table", None), MODELS, self._save)
        explorer.open_page(self.document, start)

    def _save(self, settings: Any) -> str:
        self.saved.append(settings)
        return "there"

    def __getitem__(self, name: str) -> Any:
        return self.document.select_one({"name": name})

    def press(self, name: str) -> None:
        from bokeh.events import ButtonClick

        self[name]._trigger_event(ButtonClick(self[name]))

    def settings(self) -> Any:
        self.press("save")
        return self.saved[-1]

    def draw(self) -> None:
        """What the page does after a moment."""
        for waiting in list(self.document.session_callbacks):
            waiting.callback()


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Opened:
    monkeypatch.syspath_prepend(FUZZING)
    import examples

    (tmp_path / "impacts.csv").write_bytes(examples.IMPACTS)
    return Opened(tmp_path / "impacts.csv")


@pytest.mark.parametrize("name", ["noel_2017.transfer", "noel_2017.transfer.field"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -0.1, 1e300])
def test_a_value_out_of_range_is_refused_and_the_old_one_shown(page: Opened, name: str, value: float) -> None:
    page[name].value = 0.4
    page[name].value = value
    assert page.settings()["noel_2017"]["transfer"] == 0.4
    assert (page["noel_2017.transfer"].value, page["noel_2017.transfer.field"].value) == (0.4, 0.4)
    page[name].value = value
    assert page["status"].text.startswith("noel_2017.transfer is")
    page[name].value = 0.5
    page.draw()
    assert page.settings()["noel_2017"]["transfer"] == 0.5


def test_a_menu_knows_its_choices_alone(page: Opened) -> None:
    menu = page["noel_2017.transfer_basis"]
    menu.value = "<b>gravity</b>"
    assert menu.value == page.settings()["noel_2017"]["transfer_basis"] == "velocity"
    menu.value = "<b>gravity</b>"
    assert "&lt;b&gt;gravity&lt;/b&gt;" in page["status"].text
    menu.value = "energy"
    assert page.settings()["noel_2017"]["transfer_basis"] == "energy"


def test_a_slider_of_a_model_that_is_not_chosen_moves_its_own(page: Opened) -> None:
    page["model"].value = "stevens_1998"
    page["noel_2017.transfer"].value = 0.4
    page.draw()
    assert page.settings()["noel_2017"]["transfer"] == 0.4
    assert "transfer" not in page.settings()["stevens_1998"]


def test_a_model_or_draw_that_is_not_there_is_not_chosen(page: Opened) -> None:
    page["model"].value = "no_such_model"
    assert page["model"].value == "noel_2017"
    for run in (9, -1, None):
        page["run"].active = run
        assert page["run"].active == 0
    page["noel_2017.transfer"].value = 0.4
    page.draw()
    page["run"].active = 1
    page.draw()
    assert page["run"].active == 1


def test_after_a_drawing_that_failed_the_next_move_is_drawn(page: Opened, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> object:
        raise ZeroDivisionError

    with monkeypatch.context() as broken:
        broken.setattr(explorer, "predict", fail)
        page["noel_2017.transfer"].value = 0.4
        with pytest.raises(ZeroDivisionError):
            page.draw()
    page["noel_2017.transfer"].value = 0.3
    assert page.document.session_callbacks, "it is going to be drawn"
    page.draw()


class Later:
    """A document that does at once what it is asked to do later, and cannot once it is gone."""

    gone: Exception | None = None

    def add_next_tick_callback(self, what: Callable[[], None]) -> None:
        if self.gone:
            raise self.gone
        what()


def wait(job: Job) -> None:
    end = time.monotonic() + 20
    while job.is_running and time.monotonic() < end:
        time.sleep(0.01)


def test_work_that_fails_in_an_unforeseen_way_ends() -> None:
    said, done = list[str](), list[object]()
    job = Job(Later(), said.append)
    for error in (ValueError("a <b>"), InputError("There are none", advice="Give one")):

        def work(_: object, error: Exception = error) -> object:
            raise error

        job.begin(work, done.append)
        wait(job)
        assert not job.is_running
    assert done == [None, None]
    assert said == ["Something is wrong in Rockfall itself (ValueError: a &lt;b&gt;).", "There are none. Give one."]


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("is_told", [True, False])
@pytest.mark.parametrize("gone", [AttributeError("_change_callbacks"), RuntimeError("Event loop is closed")])
def test_a_page_that_is_gone_is_told_nothing(gone: Exception, is_told: bool) -> None:
    document, said = Later(), list[str]()
    job = Job(document, said.append)

    def work(progress: Any) -> None:
        document.gone = gone
        if is_told:
            job.close()
        for done in range(3):
            progress("Fitting", done, 2)
        raise AssertionError("it goes on for nobody")

    job.begin(work, lambda _: said.append("done"))
    assert job._thread is not None
    job._thread.join(20)
    assert said == []


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_all_of_it_through_a_socket(page: Opened, tmp_path: Path) -> None:
    """What scripts/fuzzing damages, as it is: `explore` refuses tracebacks, and a page that is stuck."""
    import live

    (tmp_path / "moves.txt").write_bytes(live.moves() + b"\n" + b"\n".join(live.moves().split(b"\n")[:1] * 300))
    live.explore(tmp_path)
