"""The tracker's input where several cameras, or a depth image, see the person."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sensor_msgs.msg import Image

from cardbox_tracker.estimation.cost.view import OtherCamera
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.ros.nodes.agreement_watch import AgreementWatch
from cardbox_tracker.ros.nodes.camera_overlays import CameraOverlays
from cardbox_tracker.ros.nodes.camera_poses import CameraPoses
from cardbox_tracker.ros.nodes.camera_views import CameraViews, Seen, Views
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera


class SeveralCameras:
    """Where the cameras of one person stand, what they see, and the overlays of each."""

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        changed: Callable[[Camera | None, Sequence[OtherCamera]], None],
        deliver: Callable[[Image, Sequence[Seen | None]], None],
    ) -> None:
        """Subscribe with ``node``.

        Args:
            node: the tracker.
            settings: its parameters, with ``cameras`` or ``depth``.
            changed: called with the first camera and the further ones when all are known, or
                others than before; with None where nothing says any more where they stand.
            deliver: called with the messages that belong to one time, for :meth:`views`, and
                before them the silhouette whose stamp stands for all.

        Raises:
            CardboxError: the file of the extrinsics cannot be read, or a name is not allowed.
        """
        cameras = settings.cameras or [""]
        self._changed = changed
        self._poses = CameraPoses(node, cameras, settings.extrinsics_file, self._on_poses)
        self._views = CameraViews(node, cameras, settings.depth, settings.use_image, deliver)
        self._overlays = CameraOverlays(node, cameras)
        self._agreement = AgreementWatch([name.strip("/") for name in cameras])
        self._tracker: Tracker | None = None

    @property
    def waits(self) -> bool:
        """Whether silhouettes wait for the images that they are cut out of."""
        return self._views.waits

    @waits.setter
    def waits(self, waits: bool) -> None:
        self._views.waits = waits

    @property
    def source(self) -> str:
        """Where silhouettes come from."""
        return ", ".join(self._views.topics)

    @property
    def missing(self) -> str:
        """Topics of CameraInfo on which nothing was received yet."""
        return ", ".join(self._poses.missing)

    def check(self) -> None:
        """Raise CameraError if all cameras are there, but nothing says where they stand."""
        self._poses.check()

    def views(self, seen: Sequence[Seen | None]) -> Views:
        """Return what was delivered as arrays, once the cameras are known.

        Raises:
            CameraError: none of the silhouettes can be read.
        """
        first = self._poses.first
        assert first is not None
        cameras = [first, *(other.camera for other in self._poses.others)]
        return self._views.views(seen, cameras, self._poses.frame_id)

    def done(self, views: Views, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the overlay of each camera that somebody looks at, of what ``tracker`` found."""
        self._tracker = tracker
        self._overlays.publish(views, estimate, tracker)
        self._agreement.see(tracker.agreement)

    def values(self) -> dict[str, str]:
        """Return rate, age and fit of each camera, for the diagnostics."""
        ious = [] if self._tracker is None else self._tracker.camera_ious()
        return self._views.values(ious) | self._agreement.values()

    def warnings(self) -> dict[str, str]:
        """Return what is wrong with single cameras, by kind."""
        return self._views.warnings() | self._agreement.warnings()

    def _on_poses(self) -> None:
        self._changed(self._poses.first, self._poses.others)
