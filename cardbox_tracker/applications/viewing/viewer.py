"""Opens recordings of the optional library rerun-sdk: to a file, in a window or in a browser.

A content security policy restricts the browser to this computer, since the page of Rerun reports
its use to its maker and loads fonts and news. Rerun's servers answer whoever reaches them, also the
page of another site whose name leads to this computer (DNS rebinding). So they listen where such a
page cannot find them, and the browser gets their data through the server of the page.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import socket
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from pathlib import Path
from subprocess import DEVNULL, Popen
from typing import Any
from urllib.parse import quote

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.extensions import optional
from cardbox_tracker.common.files import atomic_path

APPLICATION = "cardbox_tracker"
THIS_COMPUTER, PORT = "127.0.0.1", 9090

_POLICY = "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:"
_OWN = re.compile(r"(http://)?(localhost|127\.0\.0\.1)(:\d+)?")
_ASKED = "Accept", "Content-Type", "X-Grpc-Web"
_ANSWERED = "Content-Type", "Content-Encoding", "Content-Length", "Grpc-Status", "Grpc-Message"
_TIMEOUT_S = 10.0
# Elsewhere there is no other address for this computer alone.
_HIDDEN = (
    str(ip_address(THIS_COMPUTER) + 1 + secrets.randbelow(2**24 - 3))
    if sys.platform.startswith("linux")
    else THIS_COMPUTER
)
"""An address of this computer that, with a random port, nobody can guess."""


def rerun() -> Any:
    """Return the module rerun, or raise CardboxError with the command that installs it."""
    given = "the viewer needs the library rerun-sdk", "view", " (170 MB)"
    for name in ("rerun.blueprint", "rerun.urdf"):
        optional(name, *given)
    return optional("rerun", *given)


def rerun_program() -> tuple[str, ...]:
    """Return the command of Rerun, without the Python program around it."""
    import rerun_cli

    return (str(Path(rerun_cli.__file__).with_name("rerun")),)


@contextmanager
def recording(blueprint: Any, save: Path | None, web: bool) -> Iterator[tuple[Any, str]]:
    """Context of a stream and its address: to a ``save`` .rrd file, a ``web`` browser or a window.

    The file is written atomically at the end; the address is empty without ``web``. Raises
    CardboxError if rerun-sdk is not installed, the file cannot be written, or neither a port nor a
    window can be opened.
    """
    rr = rerun()
    if save is None and not web and not _has_display():
        raise CardboxError(
            "there is no display for the viewer's window; give --web for a browser, or --save "
            "FILE.rrd to look at it elsewhere with 'rerun FILE.rrd'"
        )
    with ExitStack() as stack:
        # A constant name makes the recordings of one bag identical.
        stream = rr.RecordingStream(APPLICATION, recording_id=APPLICATION)
        path = None if save is None else stack.enter_context(atomic_path(save))
        address = ""
        try:
            sinks: list[Any] = [] if path is None else [rr.FileSink(path)]
            if web:
                data_port = _free_port()
                sinks.append(rr.GrpcServerSink(bind_ip=_HIDDEN, port=data_port))
                page = stack.enter_context(web_page(rerun_program(), data_port))
                address = f"{page}?url={quote(f'rerun+{page}/proxy', safe='')}"
            elif path is None:
                sinks.append(rr.GrpcSink(f"rerun+http://{_HIDDEN}:{_window()}/proxy"))
            stream.set_sinks(*sinks, default_blueprint=blueprint)
        except (OSError, RuntimeError, ValueError) as error:
            raise CardboxError(f"cannot open the viewer: {error}") from None
        try:
            yield stream, address
        finally:
            stream.flush()
            stream.disconnect()


def _has_display() -> bool:
    is_x11 = sys.platform.startswith("linux")
    return not is_x11 or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _window() -> int:
    """Open a window, which stays when this process ends; return the port of its data."""
    port = _free_port()
    words = "--bind", _HIDDEN, "--port", str(port), "--expect-data-soon"
    own = {**os.environ, "RERUN_APP_ONLY": "true"}  # it asks nothing
    _wait_for(port, Popen([*rerun_program(), *words], env=own, start_new_session=True))
    return port


@contextmanager
def web_page(program: Sequence[str], data_port: int, port: int = PORT) -> Iterator[str]:
    """Context of the page of the command ``program`` on ``port``, 0 for any; gives its address.

    The page asks for its data there, too; they come from ``data_port``. Raises OSError if ``port``
    is in use.
    """
    files_port = _free_port()
    try:
        server = ThreadingHTTPServer((THIS_COMPUTER, port), _Page)
        server.ports = {"GET": files_port, "POST": data_port}  # type: ignore[attr-defined]
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        message = f"port {port} is in use; end the other 'cardbox view --web' or program there"
        raise OSError(error.errno, message) from error
    with server, _files(program, files_port):
        thread = threading.Thread(target=server.serve_forever, name="web page", daemon=True)
        thread.start()
        try:
            yield f"http://localhost:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def _files(program: Sequence[str], port: int) -> Iterator[None]:
    """Context of Rerun's server for this computer; its server in Python listens to all."""
    words = "--serve-web", "--bind", _HIDDEN
    numbers = "--web-viewer-port", str(port), "--port", str(_free_port())
    # Rerun reports its use to its maker, but not from tests.
    quiet = {**os.environ, "CI": "on"}
    command = [*program, *words, *numbers]
    with Popen(command, stdout=DEVNULL, stderr=DEVNULL, env=quiet) as process:
        try:
            _wait_for(port, process)
            yield
        finally:
            process.kill()


def _wait_for(port: int, process: Popen[bytes]) -> None:
    end_s = time.monotonic() + _TIMEOUT_S
    while not _listens(port):
        if process.poll() is not None or time.monotonic() > end_s:
            raise OSError("Rerun does not start; install rerun-sdk anew")
        time.sleep(0.05)


def _free_port() -> int:
    with socket.socket() as one:
        one.bind((_HIDDEN, 0))
        return int(one.getsockname()[1])


def _listens(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex((_HIDDEN, port)) == 0


class _Page(BaseHTTPRequestHandler):
    """Passes files and data on from Rerun's own servers, with the policy."""

    def do_GET(self) -> None:
        """Answer the page of this server, but not one of another site that leads to it."""
        sites = *self.headers.get_all("Host", [""]), *self.headers.get_all("Origin", ())
        if not all(map(_OWN.fullmatch, sites)):
            self.send_error(403, "give http://localhost as the address")
            return
        port = self.server.ports[self.command]  # type: ignore[attr-defined]
        # New data may come at any time.
        timeout_s = _TIMEOUT_S if self.command == "GET" else None
        with closing(HTTPConnection(_HIDDEN, port, timeout=timeout_s)) as connection:
            try:
                body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                asked = {name: self.headers[name] for name in _ASKED if name in self.headers}
                connection.request(self.command, self.path, body, asked)
                answer = connection.getresponse()
            except (OSError, HTTPException, ValueError) as error:  # bytes that are no ASCII
                self.send_error(502, f"the viewer's files cannot be read: {error}")
                return
            # A browser that closes its page ends the transfer.
            with suppress(OSError, HTTPException):
                self.send_response(answer.status)
                for name in _ANSWERED:
                    if (value := answer.getheader(name)) is not None:
                        self.send_header(name, value)
                self.send_header("Content-Security-Policy", _POLICY)
                self.end_headers()
                while content := answer.read1(1 << 16):
                    self.wfile.write(content)

    do_POST = do_GET

    def log_message(self, format: str, *args: object) -> None:
        """Write nothing to the terminal for each request."""
