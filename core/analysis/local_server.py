# SPDX-License-Identifier: GPL-3.0-or-later
"""A Bokeh server for this machine alone, which answers only pages that it served itself.

A page from elsewhere can let its own name point to this machine once it is loaded (DNS rebinding). Its requests then
come from here and say the name of the page, so every request must say ours: as its host and, where it names one, as its
origin. Browsers name the origin of every websocket.
"""

import socket
from collections.abc import Callable
from typing import Any

ADDRESS = "127.0.0.1"
NAMES = (ADDRESS, "localhost", "[::1]")
FORBIDDEN = 403


def local_server(open_page: Callable[[Any], None], port: int = 0) -> tuple[Any, int]:
    """A server that is not yet started, and its port.

    Parameters
    ----------
    open_page : puts the page into a new document.
    port : 0 for any that is free.

    Raises
    ------
    OSError : the port is taken.
    """
    from bokeh.server.server import BaseServer
    from bokeh.server.tornado import BokehTornado
    from tornado.httpserver import HTTPServer
    from tornado.ioloop import IOLoop
    from tornado.netutil import bind_sockets
    from tornado.web import ErrorHandler

    sockets = bind_sockets(port, ADDRESS, family=socket.AF_INET)
    port = sockets[0].getsockname()[1]
    hosts = hosts_of(port)

    class Guarded(BokehTornado):  # type: ignore[misc, unused-ignore]
        def find_handler(self, request: Any, **more: Any) -> Any:
            if is_ours(request.headers, hosts):
                return super().find_handler(request, **more)
            return self.get_handler_delegate(request, ErrorHandler, {"status_code": FORBIDDEN})

    pages = Guarded({"/": open_page}, extra_websocket_origins=sorted(hosts), absolute_url=f"http://{ADDRESS}:{port}/")
    http = HTTPServer(pages)
    http.add_sockets(sockets)
    return BaseServer(IOLoop.current(), pages, http), port


def hosts_of(port: int) -> frozenset[str]:
    """What a request to this machine and port can say as its host."""
    with_port = {f"{name}:{port}" for name in NAMES}
    return frozenset(with_port | set(NAMES) if port == 80 else with_port)


def is_ours(headers: Any, hosts: frozenset[str]) -> bool:
    """Whether a request says one of the hosts, and as its origin the same one; a websocket must say its origin."""
    host, origin = headers.get("Host", "").lower(), headers.get("Origin")
    if host not in hosts:
        return False
    if origin is None:
        return headers.get("Upgrade", "").lower() != "websocket"
    return bool(origin.lower() == f"http://{host}")
