"""Loads the optional library rerun-sdk and opens its recordings."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

from cardbox_tracker.applications.viewing.web_page import THIS_COMPUTER, web_page
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import atomic_path

APPLICATION = "cardbox_tracker"


def rerun() -> Any:
    """Return the module rerun.

    Raises:
        CardboxError: the library is not installed; the text gives the command.
    """
    try:
        import rerun as module
        import rerun.blueprint
        import rerun.urdf
    except ImportError as error:
        raise CardboxError(
            f"the viewer needs the library rerun-sdk ({error}); install it with "
            "'pip install cardbox_tracker[view]' (170 MB)"
        ) from None
    return module


@contextmanager
def recording(blueprint: Any, save: Path | None, web: bool) -> Iterator[tuple[Any, str]]:
    """Context of a stream to a file, to a browser, or by default to a window.

    Args:
        blueprint: arrangement of the views.
        save: .rrd file, which is written atomically at the end.
        web: serve the viewer to a browser while the context lasts.

    Yields:
        The stream, and the address for a browser, which is empty without ``web``.

    Raises:
        CardboxError: rerun-sdk is not installed, the file cannot be written, or neither a port nor
            a window can be opened.
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
                page = stack.enter_context(web_page(rr))
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
