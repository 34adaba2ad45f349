"""Serves one page to this machine: at 127.0.0.1, under one path, to requests that name this server as their host.

A page elsewhere could have its own name resolve to 127.0.0.1 and then read what is served there; the name that a
browser asked for is in the header Host.
"""

from __future__ import annotations

import os
import socketserver
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from ..system.errors import OptionError

ADDRESS = "127.0.0.1"
NAMES = (ADDRESS, "localhost")  # by which a browser may ask for it
PATIENCE = 10.0  # seconds that a connection may be silent
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
    "Connection": "close",
}


class Server(ThreadingHTTPServer):
    """A server of one page. Once it is made, it listens; `serve_forever` answers.

    page: in UTF-8. policy: the page's. port: 0 for a free one. Raises OptionError if the port is taken or cannot be
    used.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = os.name != "nt"  # there, two programs could listen at one port

    def __init__(self, page: bytes, policy: str, port: int = 0) -> None:
        self.page = page
        self.policy = f"{policy}; frame-ancestors 'none'"
        try:
            super().__init__((ADDRESS, port), _Handler)
        except OSError as error:
            raise OptionError(f"port: expected a free port, found {port} ({error.strerror or error})") from error

    def server_bind(self) -> None:
        """As `HTTPServer` does, but that no name is looked up."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = ADDRESS, self.server_address[1]

    @property
    def url(self) -> str:
        return f"http://{ADDRESS}:{self.server_port}/"

    @property
    def hosts(self) -> set[str]:
        """The headers Host that requests for this server have."""
        ports = [f":{self.server_port}"] + ([""] if self.server_port == 80 else [])
        return {name + port for name in NAMES for port in ports}

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Whoever asked has gone; nobody is left to be told."""


class _Handler(BaseHTTPRequestHandler):
    """Answers one request. Everything but GET and HEAD of the page itself is refused."""

    server: Server  # pyright: ignore[reportIncompatibleVariableOverride]
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE

    def do_GET(self) -> None:
        self._answer(body=True)

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def __getattr__(self, name: str) -> Callable[[], None]:
        """Of other methods."""
        if not name.startswith("do_"):
            raise AttributeError(name)
        return self._refuse_method

    def version_string(self) -> str:
        return "Sommerl"

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the terminal is for what the command says."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the base class refuses: requests that are none."""
        self._send(HTTPStatus(code), HTTPStatus(code).phrase.encode(), "text/plain; charset=utf-8", body=True)

    def _answer(self, *, body: bool) -> None:
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or hosts[0].strip().lower() not in self.server.hosts:
            self._refuse(HTTPStatus.FORBIDDEN, body=body)
        elif self.path != "/" or self.requestline.split(" ")[1:2] != ["/"]:  # `path` is tidied, "//" is "/" there
            self._refuse(HTTPStatus.NOT_FOUND, body=body)
        else:
            self._send(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8", body=body)

    def _refuse_method(self) -> None:
        self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, body=True)

    def _refuse(self, status: HTTPStatus, *, body: bool) -> None:
        self._send(status, status.phrase.encode(), "text/plain; charset=utf-8", body=body)

    def _send(self, status: HTTPStatus, content: bytes, kind: str, *, body: bool) -> None:
        self.close_connection = True
        self.send_response(status)
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", "GET, HEAD")
        headers = {"Content-Type": kind, "Content-Length": str(len(content)), **HEADERS}
        for name, value in (headers | {"Content-Security-Policy": self.server.policy}).items():
            self.send_header(name, value)
        self.end_headers()
        if body:
            self.wfile.write(content)
