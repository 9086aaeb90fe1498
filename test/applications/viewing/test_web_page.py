"""The viewer's page may contact this computer only."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest

from cardbox_tracker.applications.viewing.viewer import THIS_COMPUTER, web_page


class Files(BaseHTTPRequestHandler):
    """Stands for the server of Rerun."""

    def do_GET(self) -> None:
        self.send_response(200 if self.path == "/viewer.js" else 404)
        self.send_header("Content-Type", "text/javascript")
        self.end_headers()
        self.wfile.write(b"1 + 1")

    def log_message(self, format: str, *args: object) -> None: ...


class Library:
    """Stands for the module rerun."""

    def serve_web_viewer(self, *, web_port: int, open_browser: bool) -> None:
        assert not open_browser
        self.server = ThreadingHTTPServer((THIS_COMPUTER, web_port), Files)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


@pytest.fixture
def library() -> Iterator[Library]:
    found = Library()
    yield found
    found.server.server_close()


def test_files_are_passed_on_with_a_policy(library: Library) -> None:
    with web_page(library, port=0) as address:
        with urlopen(f"{address}/viewer.js") as answer:
            assert answer.read() == b"1 + 1"
            assert answer.headers["Content-Type"] == "text/javascript"
            allowed = answer.headers["Content-Security-Policy"]
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"{address}/other")
        library.server.shutdown()
        library.server.server_close()
        with pytest.raises(HTTPError, match="502"):
            urlopen(f"{address}/viewer.js")
    hosts = {word for word in allowed.replace(";", "").split() if "//" in word}
    assert hosts == {"http://127.0.0.1:*"}
    assert "*" not in allowed.split()


def test_a_port_in_use_is_an_error(library: Library) -> None:
    with web_page(library, port=0) as address:
        port = int(address.rpartition(":")[2])
        with (
            pytest.raises(OSError, match=f"port {port} is in use; end"),
            web_page(Library(), port=port),
        ):
            pass
