"""What streams of people and of robots share: lines of JSON, their pace, and ZMQ."""

from __future__ import annotations

import importlib
import json
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeVar

from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.person.sizes import FloatArray

T = TypeVar("T")


def joints_packet(
    stamp_ns: int, names: Sequence[str], positions: FloatArray, lower: FloatArray, upper: FloatArray
) -> bytes:
    """Return a line of JSON: positions and limits (n,) of a robot's joints, rad or m."""
    values = {"positions": positions, "lower": lower, "upper": upper}
    rounded = {name: one.round(6).tolist() for name, one in values.items()}
    return line({"stamp_ns": stamp_ns, "names": names, **rounded})


def line(content: dict[str, Any]) -> bytes:
    """Return a line of JSON; it has no value that is not finite."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def optional(name: str) -> Any:
    """Return a module of the extra ``teleoperation``.

    Raises:
        CardboxError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise CardboxError(
            f"this stream needs the Python packages pyzmq and msgpack ({error}); install them with "
            "pip install 'cardbox_tracker[teleoperation]'"
        ) from None


def in_real_time(items: Iterable[T], rate_hz: float) -> Iterator[T]:
    """Yield ``items`` at a rate by the clock; one that is late does not delay the others."""
    begun_s = time.monotonic()
    for number, item in enumerate(items):
        time.sleep(max(begun_s + number / rate_hz - time.monotonic(), 0.0))
        yield item


class ZmqSender:
    """Publishes packets by ZMQ; who subscribes later misses the first ones."""

    def __init__(self, address: str) -> None:
        """Listen on ``address``, such as ``tcp://127.0.0.1:5556``.

        Raises:
            CardboxError: pyzmq is not installed, or the address cannot be used.
        """
        zmq = optional("zmq")
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.PUB)
        self._socket.linger = 0
        try:
            self._socket.bind(address)
        except zmq.ZMQError as error:
            self.close()
            raise CardboxError(
                f"cannot listen on {quoted(address)}: {error}; give an address as "
                "tcp://127.0.0.1:5556, whose port is free"
            ) from None

    def send(self, packet: bytes) -> None:
        """Publish a packet; this never waits."""
        self._socket.send(packet)

    def close(self) -> None:
        """Free the address."""
        self._socket.close()
        self._context.term()
