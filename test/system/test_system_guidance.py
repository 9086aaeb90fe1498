"""One call of ``initialize`` guides a person through all postures and answers with the sizes."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Bool, Header, String
from std_srvs.srv import Trigger

from cardbox_tracker.applications.drawing.guidance import FIT_BGR
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.messages.results import mean_iou_of
from cardbox_tracker.ros.runtime import qos


class Person:
    """A simulated person who follows the instructions of the status."""

    def __init__(self, graph: Any, scene: Any) -> None:
        self.graph, self.scene = graph, scene
        self.posture: str | None = None
        self.obeys = True
        self.mistakes: dict[str, str] = {}
        # The queue holds every line even if this process reads slowly.
        lines = copy(qos.LATCHED)
        lines.depth = 1000
        self.statuses = graph.collect(String, "initializer/status", lines)
        sentences = copy(qos.RESULT)
        sentences.depth = 1000
        self.said = graph.collect(String, "initializer/say", sentences)
        self.guiding = graph.collect(Bool, "initializer/guiding", lines)
        self.results = graph.collect(DiagnosticStatus, "initializer/result", lines)
        self.images = graph.node.create_publisher(Image, "silhouette", qos.SILHOUETTE)
        self.infos = graph.node.create_publisher(
            CameraInfo, "silhouette/camera_info", qos.SILHOUETTE
        )
        graph.node.create_timer(0.05, self.show)

    def show(self) -> None:
        line = self.statuses[-1].data if self.statuses else ""
        if self.obeys and line.split(":")[0] in ("front", "side", "arms"):
            asked = line.split(":")[0]
            self.posture = self.mistakes.get(asked, asked)
        header = Header(frame_id="optical", stamp=self.graph.next_stamp())
        self.infos.publish(camera_info_message(header, self.scene.camera))
        self.images.publish(image_message(header, self.scene.silhouette(self.posture), "mono8"))


@pytest.fixture(scope="module")
def person(graph: Any, scene: Any) -> Person:
    graph.start("initializer", count_down_s=1, attempts=2, person_distance_m=2.3)
    person = Person(graph, scene)
    graph.wait(lambda: graph.node.count_subscribers("silhouette") == 1, "the initializer")
    return person


def test_guidance_gives_up_with_the_reason_when_nobody_comes(person: Person) -> None:
    person.obeys, person.posture = False, None
    person.graph.spin(0.5)
    response = person.graph.call("initializer/initialize")
    assert not response.success and "nobody is in the image" in response.message
    lines = [status.data for status in person.statuses]
    assert any(line.startswith("front: not captured: ") for line in lines)
    person.graph.wait(lambda: person.results, "the result")
    assert person.results[-1].level == DiagnosticStatus.ERROR
    assert person.results[-1].message == response.message
    person.graph.wait(lambda: len(person.guiding) == 3, "the end of the guidance")
    assert [message.data for message in person.guiding] == [False, True, False]


def test_whoever_mixes_the_postures_up_is_told_which(person: Person) -> None:
    person.obeys, person.mistakes = True, {"front": "side", "side": "front"}
    before = len(person.results)
    response = person.graph.call("initializer/initialize")
    person.mistakes = {}
    expected = response.message
    assert not response.success and "reference 'front': it looks like 'side'" in expected
    person.graph.wait(lambda: len(person.results) > before, "the result")
    assert person.results[-1].level == DiagnosticStatus.ERROR
    assert person.results[-1].message == expected
    person.graph.wait(lambda: person.statuses[-1].data == expected, "the last line")


def test_one_call_guides_captures_and_measures(person: Person) -> None:
    person.obeys, graph = True, person.graph
    person.statuses.clear()
    overlays = graph.collect(Image, "overlay", qos.SENSOR_DATA)
    client = graph.node.create_client(Trigger, "initializer/initialize")
    graph.wait(client.service_is_ready, "service")
    first = client.call_async(Trigger.Request())
    graph.wait(lambda: person.statuses, "the count-down")

    second = client.call_async(Trigger.Request())
    graph.wait(second.done, "the second answer, before the first")
    assert not second.result().success and "already running" in second.result().message
    assert not first.done()

    graph.wait(first.done, "the answer")
    assert first.result().success, first.result().message
    graph.wait(lambda: person.results[-1].level == DiagnosticStatus.OK, "the result")
    fit = {entry.key: float(entry.value) for entry in person.results[-1].values}
    assert set(fit) == {"mean iou", "iou front", "iou side", "iou arms"}
    assert mean_iou_of(person.results[-1]) == fit["mean iou"] > 0.6
    assert fit["mean iou"] == pytest.approx(sum(list(fit.values())[1:]) / 3, abs=1e-4)
    lines = [status.data for status in person.statuses]
    for name, words in (("front", "face the camera"), ("side", "left"), ("arms", "sideways")):
        assert any(line.startswith(f"{name}: ") and words in line for line in lines), lines
        assert any(line.startswith(f"{name}: captured") for line in lines), lines
    assert any(line.startswith("measuring") for line in lines)
    assert overlays, "nothing was drawn for the person"
    guides = [np.array(o.data).reshape(o.height, o.width, 3) for o in overlays if o.width == 640]
    # The target outline is green when the person stands in it.
    assert any((guide == FIT_BGR["fits"]).all(axis=2).sum() > 500 for guide in guides)
    spoken = [message.data for message in person.said]
    for words in ("Now turn left, arms as before", "Hold still", "Good."):
        assert words in spoken, spoken
    graph.wait(lambda: person.said[-1].data == "Thank you. Done.", "the last words")


def test_no_guide_is_drawn_once_it_is_over(person: Person) -> None:
    graph = person.graph
    overlays = graph.collect(Image, "overlay", qos.SENSOR_DATA)
    graph.wait(lambda: not person.statuses[-1].data.startswith("measuring"), "the last line")
    graph.spin(1.0)
    assert not overlays


def test_an_initialization_can_be_cancelled(person: Person) -> None:
    graph = person.graph
    client = graph.node.create_client(Trigger, "initializer/initialize")
    graph.wait(client.service_is_ready, "initialize")
    answer = client.call_async(Trigger.Request())
    graph.wait(lambda: person.statuses[-1].data.startswith("front: face"), "the count-down")
    assert graph.call("initializer/cancel").success
    graph.wait(answer.done, "the answer")
    assert not answer.result().success and "was cancelled" in answer.result().message
    graph.wait(lambda: person.said[-1].data == "Stopped.", "the last words")
    graph.wait(lambda: not person.guiding[-1].data, "the end of the guidance")
    again = graph.call("initializer/cancel")
    assert not again.success and "no initialization is running" in again.message


def test_a_call_before_the_first_silhouette_waits_for_it(own_graph: Any, scene: Any) -> None:
    own_graph.start("initializer", count_down_s=1, person_distance_m=2.3)
    client = own_graph.node.create_client(Trigger, "initializer/initialize")
    own_graph.wait(client.service_is_ready, "service")
    statuses = own_graph.collect(String, "initializer/status", qos.LATCHED)
    answer = client.call_async(Trigger.Request())
    own_graph.wait(lambda: statuses, "the words")
    assert statuses[-1].data.startswith("waiting for the first silhouette on /silhouette")
    Person(own_graph, scene)
    own_graph.wait(answer.done, "the answer")
    assert answer.result().success, answer.result().message


def test_a_call_without_a_background_node_is_refused_after_a_while(own_graph: Any) -> None:
    process = own_graph.start("initializer")
    response = own_graph.call("initializer/initialize")
    assert not response.success
    assert "no silhouette was received yet on /silhouette" in response.message
    assert "waiting for the first silhouette on /silhouette: 5 s so far" in process.text()
