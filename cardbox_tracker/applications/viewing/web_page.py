"""Serves the pages of the viewer to a browser without access to other computers.

The page of Rerun reports its use to its maker and loads fonts and news. A content security policy
restricts the browser to this computer, so nothing of a session is sent out.
"""

from __future__ import annotations

import errno
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

THIS_COMPUTER = "127.0.0.1"
PORT = 9090

_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob: http://127.0.0.1:*"
)
_TIMEOUT_S = 10.0


@contextmanager
def web_page(rr: Any, port: int = PORT) -> Iterator[str]:
    """Context of the viewer's page; gives its address.

    Args:
        rr: module rerun.
        port: port of this computer; 0 takes any free one.

    Raises:
        OSError: the port is in use.
    """
    files_port = _free_port()
    with _server(port, partial(_Page, files_port)) as server:
        rr.serve_web_viewer(web_port=files_port, open_browser=False)
        thread = threading.Thread(target=server.serve_forever, name="web page", daemon=True)
        thread.start()
        try:
            yield f"http://localhost:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


class _Page(BaseHTTPRequestHandler):
    """Passes files on from Rerun's own server, with the policy."""

    def __init__(self, files_port: int, *of_server: Any) -> None:
        self._files_port = files_port
        super().__init__(*of_server)

    def do_GET(self) -> None:
        """Answer with the file."""
        connection = HTTPConnection(THIS_COMPUTER, self._files_port, timeout=_TIMEOUT_S)
        try:
            connection.request("GET", self.path)
            answer = connection.getresponse()
            content = answer.read()
        except (OSError, HTTPException) as error:
            self.send_error(502, f"the viewer's files cannot be read: {error}")
            return
        finally:
            connection.close()
        self.send_response(answer.status)
        for name in ("Content-Type", "Content-Encoding"):
            value = answer.getheader(name)
            if value is not None:
                self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", _POLICY)
        # A browser that closes its page ends the transfer.
        with suppress(ConnectionError):
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Write nothing to the terminal for each request."""


def _server(port: int, page: Callable[..., BaseHTTPRequestHandler]) -> ThreadingHTTPServer:
    try:
        return ThreadingHTTPServer((THIS_COMPUTER, port), page)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        message = f"port {port} is in use; end the other 'cardbox view --web' or program there"
        raise OSError(error.errno, message) from error


def _free_port() -> int:
    with socket.socket() as one:
        one.bind((THIS_COMPUTER, 0))
        port: int = one.getsockname()[1]
    return port
