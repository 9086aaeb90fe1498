"""What all tests share: three processes for a whole run, a ROS domain for each graph of nodes."""

from __future__ import annotations

import contextlib
import functools
import importlib
import itertools
import os
import signal
import socket
import sys
import warnings
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# As in the programs, before NumPy is imported; processes that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common import garbage
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.terms import joint_points_kernels as kernels
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.precompile import compile_all

with contextlib.suppress(ImportError), warnings.catch_warnings():
    # What rclpy imports with the first message uses modules that Python has deprecated.
    warnings.simplefilter("ignore", DeprecationWarning)
    importlib.import_module("lark")

# Collecting makes half a million objects that stay; searching them took seconds of each process.
garbage.search_seldom()

# Otherwise each process of a run would compile 800 files of the tests and the package anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# How long an example takes says nothing of the program on a busy machine.
settings.register_profile("untimed", deadline=None)
settings.register_profile(
    "long",
    deadline=None,
    max_examples=int(os.environ.get("RELIABILITY_EXAMPLES", "1")),
    suppress_health_check=list(HealthCheck),
    database=None,
)
settings.load_profile("long" if "RELIABILITY_EXAMPLES" in os.environ else "untimed")

# A shell that starts a command in the background has it ignore Ctrl-C, and so would all it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

TESTS = Path(__file__).parent
# One more than the cores of a small machine, since the tests with nodes mostly wait.
PROCESSES = 3
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
# Above 101, domains collide with ephemeral ports.
MOST_DOMAINS = 100

# These compute longest; begun first, none of them is left over at the end for one process alone.
LONGEST = (
    *("test_project_files.py", "test_package.py", "tracking", "measuring", "commands"),
    *("reliability", "lab", "search", "terms", "applications", "ros", "recordings"),
)
# Files that compute between two files of tests that wait for nodes.
BETWEEN = 10


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Divide a run of all files among processes; whoever names files or -n decides themselves.

    Files stay whole, since their tests share graphs.
    """
    if (
        config.pluginmanager.hasplugin("xdist")
        and not hasattr(config, "workerinput")
        and config.args_source == pytest.Config.ArgsSource.TESTPATHS
        and config.option.numprocesses is None
        and not config.option.usepdb
    ):
        config.option.numprocesses = PROCESSES
        config.option.dist = "loadfile"
        config.option.loadscopereorder = False


def pytest_pycollect_makemodule(module_path: Path) -> None:
    """Skip the tests of nodes where ROS is not installed; they import it."""
    if module_path.relative_to(TESTS).parts[0] in ("ros", "system"):
        pytest.importorskip("rclpy", reason="rclpy is not installed")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files that take longest first, and spread those that wait, so that no core is idle."""
    if not items or not hasattr(items[0].config, "workerinput"):
        return
    folder = {i.path: i.path.relative_to(TESTS).parts[0] for i in items}
    waiting = [path for path in folder if folder[path] == "system"]
    order = {name: rank for rank, name in enumerate(LONGEST)}
    computing = sorted(
        folder.keys() - set(waiting), key=lambda path: (order.get(folder[path], len(order)), path)
    )
    places = {path: float(BETWEEN * place) for place, path in enumerate(waiting)}
    places |= {path: place + 0.5 for place, path in enumerate(computing)}
    items.sort(key=lambda item: places[item.path])


def pytest_collection_finish() -> None:
    """Search for garbage among what the tests make."""
    garbage.keep_all()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Note the promise that a test is of, and how many inputs it tried, for 'make reliability'."""
    marker = item.get_closest_marker("promise")
    if marker is None:
        return (yield)
    tried = itertools.count()
    handle = getattr(getattr(item, "obj", None), "hypothesis", None)
    if handle is not None:
        inner = handle.inner_test

        @functools.wraps(inner)
        def counted(*given: Any, **named: Any) -> Any:
            next(tried)
            return inner(*given, **named)

        handle.inner_test = counted
    else:
        next(tried)
    try:
        return (yield)
    finally:
        if handle is not None:
            handle.inner_test = inner
        item.user_properties.append(("promise", marker.args[0]))
        # A test may know better, such as how many images it has sent.
        if "tried" not in dict(item.user_properties):
            item.user_properties.append(("tried", next(tried)))


def _domains() -> Iterator[int]:
    """Domains that no other process of this run has, nor any other run on this machine."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    share = MOST_DOMAINS // workers
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
    for number in itertools.count(zlib.crc32(run.encode())):
        domain = 1 + WORKER * share + number % share
        if _is_free(domain):
            yield domain


def _is_free(domain: int) -> bool:
    """Return whether no DDS participant has taken the domain's first port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 7410 + 250 * domain))
        except OSError:
            return False
    return True


_DOMAINS = _domains()
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(next(_DOMAINS))


@pytest.fixture
def ros_domain() -> int:
    """A ROS domain with nobody else in it."""
    return next(_DOMAINS)


@pytest.fixture(scope="session")
def ros_domains() -> Iterator[int]:
    """What gives further such domains."""
    return _DOMAINS


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels() -> None:
    """Compile once, before nodes of several tests would do so at the same time.

    It takes a minute where nothing is in the cache; each process begins with another preset and
    finds the rest done by the other.
    """
    presets = deque(PRESETS)
    presets.rotate(WORKER)
    compile_all(tuple(presets))


Detect = Callable[..., ImagePoints]


def _rows() -> dict[str, int]:
    """Index of the projected joint by the name of a point."""
    rows = {"left_hip": 8, "right_hip": 8, "left_ear": 9, "right_ear": 9}
    for first, side in ((0, "left"), (4, "right")):
        for joint, name in enumerate(("shoulder", "elbow", "wrist", "index")):
            rows[f"{side}_{name}"] = first + joint
        rows[f"{side}_little_finger"] = first + 3
    return rows


def _detected(
    body: BodyModel,
    camera: Camera,
    state: np.ndarray,
    score: float = 0.9,
    stamp_ns: int | None = None,
) -> ImagePoints:
    """Return the points of a state (12,) or (14,) before a camera with the body's pitch."""
    whole, pixels = np.zeros(N_STATE), np.empty((kernels.N_POINTS, 3))
    whole[: len(state)] = state
    kernels.project(whole, body_tuple(body, camera, WholeBodyCostConfig()), pixels)
    found = {name: (pixels[row, 0], pixels[row, 1], score) for name, row in _rows().items()}
    return ImagePoints.of(found, stamp_ns)


@pytest.fixture(scope="session")
def detected() -> Detect:
    """See :func:`_detected`."""
    return _detected
