"""Opens recordings of the optional library rerun-sdk: to a file, in a window or in a browser.

A content security policy restricts the browser to this computer, since the page of Rerun reports
its use to its maker and loads fonts and news.
"""

from __future__ import annotations

import errno
import os
import socket
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from subprocess import DEVNULL, Popen
from typing import Any
from urllib.parse import quote

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.extensions import optional
from cardbox_tracker.common.files import atomic_path

APPLICATION = "cardbox_tracker"
THIS_COMPUTER, PORT = "127.0.0.1", 9090

_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob: http://127.0.0.1:*"
)
_TIMEOUT_S = 10.0


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
                server = rr.GrpcServerSink(bind_ip=THIS_COMPUTER)
                sinks.append(server)
                page = stack.enter_context(web_page(rerun_program()))
                address = f"{page}?url={quote(server.uri, safe='')}"
            if sinks:
                stream.set_sinks(*sinks, default_blueprint=blueprint)
            else:
                stream.spawn(default_blueprint=blueprint)
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


@contextmanager
def web_page(program: Sequence[str], port: int = PORT) -> Iterator[str]:
    """Context of the page of the command ``program`` on ``port``, 0 for any; gives its address.

    Raises OSError if the port is in use.
    """
    files_port = _free_port()
    try:
        server = ThreadingHTTPServer((THIS_COMPUTER, port), partial(_Page, files_port))
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
    words = "--serve-web", "--bind", THIS_COMPUTER
    numbers = "--web-viewer-port", str(port), "--port", str(_free_port())
    # Rerun reports its use to its maker, but not from tests.
    quiet = {**os.environ, "CI": "on"}
    command = [*program, *words, *numbers]
    with Popen(command, stdout=DEVNULL, stderr=DEVNULL, env=quiet) as process:
        try:
            end_s = time.monotonic() + _TIMEOUT_S
            while not _listens(port):
                if process.poll() is not None or time.monotonic() > end_s:
                    raise OSError("Rerun does not serve its files; install rerun-sdk anew")
                time.sleep(0.05)
            yield
        finally:
            process.kill()


def _free_port() -> int:
    with socket.socket() as one:
        one.bind((THIS_COMPUTER, 0))
        return int(one.getsockname()[1])


def _listens(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex((THIS_COMPUTER, port)) == 0


class _Page(BaseHTTPRequestHandler):
    """Passes files on from Rerun's own server, with the policy."""

    def __init__(self, files_port: int, *of_server: Any) -> None:
        self._files_port = files_port
        super().__init__(*of_server)

    def do_GET(self) -> None:
        """Answer with the file, but not to another site whose name leads to this computer."""
        host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host")
        if host not in ("localhost", THIS_COMPUTER):
            self.send_error(403, "give http://localhost as the address")
            return
        connection = HTTPConnection(THIS_COMPUTER, self._files_port, timeout=_TIMEOUT_S)
        try:
            connection.request("GET", self.path)
            answer = connection.getresponse()
            content = answer.read()
        except (OSError, HTTPException, ValueError) as error:  # bytes that are no ASCII
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
