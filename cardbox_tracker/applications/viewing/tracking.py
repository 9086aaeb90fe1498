"""Shows a recording while it is tracked."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.applications.drawing.overlay import draw_overlay, readable_scale
from cardbox_tracker.applications.viewing.feed import Feed
from cardbox_tracker.body.model_file import dumps_body_model
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.outputs import joint_deviations, joint_values
from cardbox_tracker.recordings.silhouettes import RecordedFrame


class ShownTracking:
    """Observer of :func:`~cardbox_tracker.recordings.track.track_recording` that shows each image.

    Attributes:
        count: number of images with a posture.
    """

    def __init__(self, feed: Feed) -> None:
        """Start with no images."""
        self._feed = feed
        self._described: object = None
        self.count = 0

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Show one image."""
        feed, stamp_ns = self._feed, frame.stamp_ns
        if tracker.body is not self._described:
            feed.model(dumps_body_model(tracker.body), "the tracker")
        self._described = tracker.body
        feed.state(stamp_ns, estimate.state)
        scale = readable_scale(frame.picture)
        overlay = draw_overlay(frame.picture, tracker.body, tracker.camera, estimate, scale)
        feed.image(stamp_ns, overlay)
        joints, deviations = joint_values(estimate), joint_deviations(estimate)
        if joints is not None and deviations is not None:
            self.count += 1
            feed.joints(stamp_ns, joints)
            feed.deviations(stamp_ns, deviations)
        if estimate.keypoint_states is not None:
            feed.keypoint_states(stamp_ns, estimate.keypoint_states)
        if estimate.keypoints_m is not None:
            feed.keypoints(stamp_ns, np.asarray(estimate.keypoints_m))
