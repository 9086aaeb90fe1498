"""The camera's pitch, from a person who stands upright before the detector, as in films."""

from __future__ import annotations

import math

from std_msgs.msg import Float64

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.measuring.standing_camera import middles, standing_camera
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode

# People stand still for some time, and move about between.
_IMAGES = 10


class CameraPitch:
    """Looks for the pitch until a standing person shows it, and latches it."""

    def __init__(self, node: CardboxNode) -> None:
        """Advertise ``~/camera_pitch`` for ``node``."""
        self._node = node
        self._publisher = node.advertise(Float64, "~/camera_pitch", qos.LATCHED)
        self.restart()

    def restart(self) -> None:
        """Look again, because the camera is another one."""
        self._seen: list[Detection] = []
        self._is_found = False

    def see(self, found: Detection, camera: Camera) -> None:
        """Add a person in the image of ``camera``."""
        if self._is_found:
            return
        self._seen.append(found)
        if len(self._seen) < _IMAGES:
            return
        standing = standing_camera(middles(self._seen), camera)
        self._seen.clear()
        if standing is None or not standing.is_pitch_found:
            return
        self._is_found = True
        self._publisher.publish(Float64(data=standing.pitch_rad))
        degrees = math.degrees(standing.pitch_rad)
        self._node.get_logger().info(
            f"camera pitch {abs(degrees):.0f} degrees {'down' if degrees >= 0 else 'up'} (standard "
            f"deviation {math.degrees(standing.pitch_stddev_rad):.0f}), found from the person "
            "standing upright"
        )
