"""``cardbox call`` calls services like ``ros2 service call``."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cardbox_tracker.commands.main import main
from cardbox_tracker.ros.runtime import qos

CALL = """
import sys
from cardbox_tracker.commands.main import main
from cardbox_tracker.ros.runtime import call
call._FIND_S = float(sys.argv[1])
sys.exit(main(sys.argv[2:]))
"""


def called(graph: Any, service: str, find_s: float = 10.0) -> subprocess.CompletedProcess[str]:
    """Run ``cardbox call``, which waits ``find_s`` for a service, while the graph's node spins."""
    process = subprocess.Popen(
        [sys.executable, "-c", CALL, str(find_s), "call", service],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "ROS_DOMAIN_ID": str(graph.domain)},
    )
    try:
        graph.wait(lambda: process.poll() is not None, "the end of the call")
    finally:
        process.kill()
        out, err = process.communicate()
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def offer(graph: Any, place: str, success: bool, text: str) -> None:
    """Offer the service ``place``/do, which publishes a line on ``place``/status first."""
    status = graph.node.create_publisher(String, f"{place}/status", qos.LATCHED)
    status.publish(String(data="of an earlier call"))

    def do(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        status.publish(String(data="counting"))
        response.success, response.message = success, text
        return response

    graph.node.create_service(Trigger, f"{place}/do", do)


def test_the_answer_is_printed(graph: Any) -> None:
    offer(graph, "/eye/willing", True, "done as asked")
    result = called(graph, "/eye/willing/do")
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "done as asked"
    assert "of an earlier call" not in result.stdout


def test_a_refusal_is_told_in_the_nodes_own_words(graph: Any) -> None:
    offer(graph, "unwilling", False, "the person is not there")
    result = called(graph, "unwilling/do")
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1] == "cardbox call: the person is not there"
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("name", ["", "no name", "//do"])
def test_what_is_no_name_of_a_service_is_told(name: str, capsys: pytest.CaptureFixture) -> None:
    assert main(["call", name]) == 1
    assert f"{name!r} is not a valid name" in capsys.readouterr().err


@pytest.mark.slow
def test_a_service_that_is_not_there_is_answered_with_those_that_are(graph: Any) -> None:
    offer(graph, "/eye/other", True, "")
    result = called(graph, "/eye/missing/do", find_s=3.0)
    assert result.returncode == 1
    assert "for the service /eye/missing/do" in result.stdout
    assert "nobody offers the service /eye/missing/do" in result.stderr
    assert "/eye/other/do" in result.stderr
    assert result.stderr.count("missing") == 1
