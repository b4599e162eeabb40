# SPDX-License-Identifier: GPL-3.0-or-later
"""What a browser tells the live page through its socket, right and damaged: sliders, menus, buttons, many at once.

Whatever was said, nothing of Rockfall may end in a traceback, a page that is opened afterwards must work, and so must
this one while its socket is open.
"""

import asyncio
import json
import logging
import re
import threading
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

MODELS = ("noel_2017", "stevens_1998")
ANSWER_S = 20.0
BETWEEN_S = 0.1
"""More than the page waits before it draws what it was told."""
OURS = "/core/"
Model = dict[str, Any]


def _changed(name: str, attribute: str, value: object) -> str:
    event = {"kind": "ModelChanged", "model": {"id": f"@{name}"}, "attr": attribute, "new": value}
    return json.dumps({"events": [event]})


def _pressed(name: str) -> str:
    values = {"type": "map", "entries": [["model", {"id": f"@{name}"}]]}
    event = {"type": "event", "name": "button_click", "values": values}
    return json.dumps({"events": [{"kind": "MessageSent", "msg_type": "bokeh_event", "msg_data": event}]})


def moves() -> bytes:
    """A line for each message; ``@name`` stands for the id of the page's model of that name."""
    slider, field = "noel_2017.transfer", "noel_2017.transfer.field"
    lines = [
        _changed(slider, "value", 0.4), _changed(field, "value", 0.55), _changed("model", "value", "stevens_1998"),
        _changed("stevens_1998.rn", "value", 0.3), _changed("run", "active", 1), _pressed("again"),
        _changed("noel_2017.rt", "value", 0.7), _changed("model", "value", "noel_2017"), _pressed("reset"),
        _changed("fit", "value", ["transfer", "rt"]), _pressed("calibrate"), _pressed("calibrate"), _pressed("save"),
        _changed("run", "active", 0), _changed(slider, "value", {"type": "number", "value": "nan"}),
        _changed(field, "value", {"type": "number", "value": "-inf"}), _changed(slider, "value", 1e300),
        _changed("model", "value", "no_such_model"), _changed("run", "active", 9), _changed("fit", "value", ["none"]),
    ]  # fmt: skip
    return "\n".join(lines).encode()


class Page:
    """A socket to a page, and the ids of its models by their names."""

    def __init__(self, socket: Any, ids: dict[str, str]) -> None:
        self.socket, self.ids = socket, ids

    @classmethod
    async def opened(cls, port: int) -> "Page":
        from tornado.httpclient import AsyncHTTPClient, HTTPRequest
        from tornado.websocket import websocket_connect

        origin = f"http://127.0.0.1:{port}"
        html = (await AsyncHTTPClient().fetch(f"{origin}/")).body.decode()
        token = re.search(r'"token":"([^"]+)"', html)[1]
        request = HTTPRequest(f"ws://127.0.0.1:{port}/ws", headers={"Origin": origin})
        page = cls(await websocket_connect(request, subprotocols=["bokeh", token]), {})
        await page.said("ACK")
        await page.say("PULL-DOC-REQ", "{}")
        document = await page.said("PULL-DOC-REPLY")
        page.ids = dict(_named(document["doc"]["roots"]))
        return page

    async def say(self, kind: str, content: str) -> None:
        from tornado.websocket import WebSocketClosedError

        for part in (json.dumps({"msgid": "1000", "msgtype": kind}), "{}", content):
            try:
                await self.socket.write_message(part)
            except WebSocketClosedError:
                return

    async def said(self, kind: str, about: str = "") -> Any:
        """The next message of a kind, about a model; None when the socket has been closed."""
        while True:
            header = await self.socket.read_message()
            if header is None:
                return None
            found = json.loads(header)
            await self.socket.read_message()
            text = await self.socket.read_message()
            for _ in range(2 * found.get("num_buffers", 0)):
                await self.socket.read_message()
            if text is None:
                return None
            if found["msgtype"] == kind and about in text:
                return json.loads(text)

    async def works(self) -> bool:
        """Whether a slider is answered with scores; True also where the socket is closed."""
        for name, attribute, value in (("model", "value", "noel_2017"), ("run", "active", 0)):
            await self.say("PATCH-DOC", self.with_ids(_changed(name, attribute, value)))
        for value in (0.31, 0.32):  # one of them is not what it was
            await self.say("PATCH-DOC", self.with_ids(_changed("noel_2017.transfer", "value", value)))
        try:
            async with asyncio.timeout(ANSWER_S):
                await self.said("PATCH-DOC", f'"{self.ids["scores"]}"')
        except TimeoutError:
            return False
        return True

    def with_ids(self, line: str) -> str:
        return re.sub(r"@([\w.]+)", lambda found: self.ids.get(found[1], found[1]), line)


def _named(part: Any) -> Iterator[tuple[str, str]]:
    if isinstance(part, list):
        for one in part:
            yield from _named(one)
    elif isinstance(part, dict):
        if "id" in part and isinstance(name := part.get("attributes", {}).get("name"), str):
            yield name, part["id"]
        for one in part.values():
            yield from _named(one)


class _Heard(logging.Handler):
    """Where something of Rockfall was in a traceback that the server has logged."""

    def __init__(self) -> None:
        super().__init__()
        self.places: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and record.exc_info[1] is not None:
            self.note(record.exc_info[1])

    def note(self, error: BaseException) -> None:
        ours = [one for one in traceback.extract_tb(error.__traceback__) if OURS in one.filename]
        if ours and "bokeh" not in ours[-1].filename:
            place = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}"
            self.places.append(f"{type(error).__name__} at {place}: {error}"[:200])


@contextmanager
def _listening() -> Iterator[_Heard]:
    heard, loggers = _Heard(), [logging.getLogger(name) for name in ("bokeh", "tornado", "asyncio")]
    kept = [(one.handlers, one.propagate) for one in loggers]
    hook = threading.excepthook
    for one in loggers:
        one.handlers, one.propagate = [heard], False
    threading.excepthook = lambda said: heard.note(said.exc_value)
    try:
        yield heard
    finally:
        threading.excepthook = hook
        for one, (handlers, propagates) in zip(loggers, kept, strict=True):
            one.handlers, one.propagate = handlers, propagates


def explore(at: Path) -> object:
    """Serve the page of a table, say all lines of moves.txt, and see what still works."""
    with _listening() as heard, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a session that Bokeh would have ended a moment later
        asyncio.run(_served(at, (at / "moves.txt").read_bytes()))
    assert not heard.places, heard.places[0]
    return at


async def _served(at: Path, said: bytes) -> None:
    from rockfall.core.analysis.courses import find_courses
    from rockfall.core.analysis.explorer import Exploration, open_page
    from rockfall.core.analysis.local_server import local_server
    from rockfall.core.exchange.parameters import write_parameters
    from rockfall.core.exchange.tables import read_impacts

    impacts = read_impacts(at / "impacts.csv")
    courses = find_courses(impacts, "table", None)

    def save(settings: Any) -> str:
        write_parameters(settings, at / "saved.toml")
        return str(at)

    start = Exploration(impacts, courses, MODELS, save)
    server, port = local_server(lambda document: open_page(document, start))
    server.start()
    try:
        page = await Page.opened(port)
        for line in said.split(b"\n"):
            await page.say("PATCH-DOC", page.with_ids(line.decode("utf-8", "replace")))
        await asyncio.sleep(BETWEEN_S)
        assert await page.works(), "the page has stopped answering"
        page.socket.close()
        later = await Page.opened(port)
        assert await later.works(), "a new page does not answer"
        later.socket.close()
    finally:
        server.stop()
        await asyncio.sleep(0.05)
