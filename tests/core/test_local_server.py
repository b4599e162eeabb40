# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page answers requests that name this machine and its port, and no other page's, also through its socket."""

import asyncio
import base64
import re
import socket
from collections.abc import Iterator
from threading import Event, Thread

import pytest
from rockfall.core.analysis.local_server import hosts_of, local_server

pytest.importorskip("bokeh")


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """Of an empty page that is served by a thread."""
    found, ready, ending = [], Event(), []

    async def serve() -> None:
        server, port = local_server(lambda document: None)
        server.start()
        stop = asyncio.Event()
        ending.append((asyncio.get_running_loop(), stop))
        found.append(port)
        ready.set()
        await stop.wait()
        server.stop()

    thread = Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    assert ready.wait(60)
    yield found[0]
    loop, stop = ending[0]
    loop.call_soon_threadsafe(stop.set)
    thread.join()


def answer(port: int, path: str, *headers: str) -> str:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        connection.sendall("\r\n".join((f"GET {path} HTTP/1.1", *headers, "Connection: close", "", "")).encode())
        said = b""
        while part := connection.recv(65536):
            said += part
    return said.decode(errors="replace")


def opened(port: int, *headers: str) -> int:
    """The status with which the page's socket answers somebody who has a valid token."""
    page = answer(port, "/", f"Host: 127.0.0.1:{port}")
    token = re.search(r'"token":"([^"]+)"', page)[1]
    key = base64.b64encode(bytes(16)).decode()
    lines = [
        "GET /ws HTTP/1.1", *headers, "Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {key}",
        "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Protocol: bokeh, {token}", "", "",
    ]  # fmt: skip
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        connection.sendall("\r\n".join(lines).encode())
        return int(connection.recv(65536).split()[1])


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]", "LOCALHOST"])
def test_this_machine_is_answered(port, name) -> None:
    host = f"{name}:{port}"
    assert answer(port, "/", f"Host: {host}").startswith("HTTP/1.1 200")
    assert answer(port, "/", f"Host: {host}", f"Origin: http://{host}").startswith("HTTP/1.1 200")
    assert opened(port, f"Host: {host}", f"Origin: http://{host}") == 101


@pytest.mark.parametrize(
    "host", ["evil.example:{port}", "evil.example", "127.0.0.1", "localhost:1", "localhost.evil.example:{port}", ""]
)
def test_another_host_is_refused(port, host) -> None:
    host = host.format(port=port)
    for path in ("/", "/autoload.js", "/metadata", "/static/js/bokeh.min.js"):
        assert answer(port, path, f"Host: {host}").startswith("HTTP/1.1 403")
    assert opened(port, f"Host: {host}", f"Origin: http://{host}") == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example:{port}", "null", "https://localhost:{port}", "http://localhost:1"]
)
def test_a_page_from_elsewhere_is_refused(port, origin) -> None:
    origin = origin.format(port=port)
    assert answer(port, "/", f"Host: localhost:{port}", f"Origin: {origin}").startswith("HTTP/1.1 403")
    assert opened(port, f"Host: localhost:{port}", f"Origin: {origin}") == 403


def test_a_socket_without_origin_is_no_browsers(port) -> None:
    assert opened(port, f"Host: localhost:{port}") == 403


def test_the_usual_port_of_the_web_need_not_be_said() -> None:
    assert "localhost" in hosts_of(80)
    assert "localhost" not in hosts_of(8080)
