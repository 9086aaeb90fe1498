"""The model over the image of any camera of a tracker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cardbox_tracker.body.posture import PLACE, POSTURE
from cardbox_tracker.drawing.overlay import ImageArray, draw_overlay
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker


def draw_camera_overlay(
    picture: ImageArray, number: int, estimate: Estimate, tracker: Tracker
) -> ImageArray:
    """Return a picture with the model over it; that of a further camera is turned upright.

    Args:
        picture: (H, W) grey or (H, W, 3) bgr, of the camera.
        number: of the camera; 0 is the first one.
        estimate: what ``tracker`` found at that time.
        tracker: it knows the person and the cameras.
    """
    if number == 0:
        return draw_overlay(picture, tracker.body, tracker.camera, estimate)
    view = tracker.views[number - 1]
    if estimate.posture is not None and estimate.keypoints_m is not None:
        place_m = np.zeros(2) if estimate.offset_m is None else estimate.offset_m
        state = view.states(np.concatenate([estimate.posture, place_m]))
        points_m = view.points(tracker.camera.optical_to_reference(estimate.keypoints_m))
        estimate = replace(
            estimate,
            posture=state[POSTURE],
            offset_m=state[PLACE],
            keypoints_m=view.camera.reference_to_optical(points_m),
        )
    return draw_overlay(view.upright(picture), view.body, view.camera, estimate)
