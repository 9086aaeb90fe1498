"""The parameters of the nodes that feed the others: ``camera``, ``play_bag``, ``stereo_depth``."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.ros.nodes.shared_parameters import (
    image_transport_parameter,
    max_megapixels_parameter,
)
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, parameter
from cardbox_tracker.vision.stereo import NEAREST_M


@dataclass(frozen=True)
class CameraParameters(NodeParameters):
    """Publish a V4L2 device or a video file."""

    device: str = parameter(
        "/dev/video0", "V4L2 device; not used when a file is given", read_only=True
    )
    file: str = parameter("", "video file to play instead of a device", read_only=True)
    loop: bool = parameter(False, "play the file again and again", effect="end of the file")
    width: int = parameter(
        640, "width to ask the device for", unit="px", limits=(32, 8192), read_only=True
    )
    height: int = parameter(
        480, "height to ask the device for", unit="px", limits=(32, 8192), read_only=True
    )
    rate_hz: float = parameter(
        15.0,
        "images a second; 0 takes the file's own rate",
        unit="Hz",
        limits=(0.0, 240.0),
        read_only=True,
    )
    encoding: str = parameter(
        "mono8",
        "mono8 is all the tracker needs and a third of the bytes; bgr8 for colour",
        choices=("mono8", "bgr8"),
    )
    frame_id: str = parameter("camera_optical_frame", "name of the camera's optical frame")
    calibration_file: str = parameter("", "YAML file of camera_calibration", read_only=True)
    horizontal_fov_deg: float = parameter(
        0.0,
        "without a calibration file: assume an ideal lens of this field of view; 0: publish the "
        "camera as uncalibrated",
        unit="deg",
        limits=(0.0, 170.0),
        read_only=True,
    )
    settle_s: float = parameter(
        2.0,
        "time for the automatic exposure before it is locked; the background must not change",
        unit="s",
        limits=(0.0, 60.0),
        read_only=True,
    )
    lock_exposure: bool = parameter(
        True, "switch exposure and white balance to manual where the device allows", read_only=True
    )

    def check(self) -> None:
        """Raise ValueError where values do not go together."""
        if not self.device and not self.file:
            raise ValueError("device and file are both empty; give one, such as /dev/video0")


@dataclass(frozen=True)
class PlayBagParameters(NodeParameters):
    """Play a recording."""

    bag: str = parameter("", "rosbag2 folder or .mcap file to play", read_only=True)
    rate: float = parameter(
        1.0, "speed; 2 plays twice as fast", limits=(0.01, 100.0), effect="at once"
    )
    loop: bool = parameter(
        False, "play again and again; the stamps start over too", effect="end of the bag"
    )
    topics: list[str] = parameter([], "topics to play; all if empty", read_only=True)
    start_s: float = parameter(
        0.0,
        "play from this time on, from the bag's start",
        unit="s",
        limits=(0.0, 1e6),
        read_only=True,
    )
    duration_s: float = parameter(
        0.0, "play this long; 0: to the end of the bag", unit="s", limits=(0.0, 1e6), read_only=True
    )
    pause_at: list[float] = parameter(
        [], "pause at these times from the bag's start, s, until play_bag/resume", read_only=True
    )
    wait_for_subscribers: bool = parameter(
        True, "begin when somebody subscribes to a played image topic", read_only=True
    )
    wait_for_topics: list[str] = parameter(
        [],
        "begin when somebody publishes these topics, such as keypoints: at its very first start "
        "the tracker compiles for half a minute",
        read_only=True,
    )
    delay_s: float = parameter(
        0.5,
        "the first message is sent when no subscriber has come or gone for this time, so that "
        "none misses the beginning; for 3 s while images of a further camera have none",
        unit="s",
        limits=(0.0, 600.0),
        read_only=True,
    )

    def check(self) -> None:
        """Raise ValueError where values do not go together."""
        if not self.bag:
            raise ValueError("no bag is given; run 'play_bag BAG' or set the parameter 'bag'")


@dataclass(frozen=True)
class StereoDepthParameters(NodeParameters):
    """Measure depth in a rectified pair of cameras."""

    image_transport: str = image_transport_parameter()
    width: int = parameter(
        320, "width at which depth is measured", unit="px", limits=(32, 4096), read_only=True
    )
    nearest_m: float = parameter(
        NEAREST_M,
        "nearer things are not found; the time grows with what this costs",
        unit="m",
        limits=(0.1, 20.0),
    )
    tolerance_s: float = parameter(
        0.005,
        "a left and a right image whose stamps differ by no more are a pair",
        unit="s",
        limits=(0.0, 1.0),
    )
    max_megapixels: float = max_megapixels_parameter()
