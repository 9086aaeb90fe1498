"""Parameters of several nodes."""

from __future__ import annotations

from typing import Any

from cardbox_tracker.camera.encodings import MOST_PIXELS
from cardbox_tracker.ros.runtime.parameter_fields import AT_START, parameter


def cameras_parameter() -> Any:
    """Return the field of the cameras' namespaces."""
    return parameter(
        [],
        "namespaces of the cameras that see the person, such as cam0 and cam1 for "
        "cam0/silhouette and cam1/silhouette; results are in the first one's frame; empty: one "
        "camera, without a namespace of its own",
        effect=AT_START,
    )


def extrinsics_parameter() -> Any:
    """Return the field of the file with the cameras' poses."""
    return parameter(
        "",
        "file with the cameras' poses: a camchain of Kalibr (YAML) or a camera group of aniposelib "
        "(TOML); not needed for a rectified pair or with /tf_static; empty: none",
        effect=AT_START,
    )


def depth_parameter() -> Any:
    """Return the field of the depth images' topic."""
    return parameter(
        "",
        "topic of depth images (16UC1, 32FC1 or compressedDepth) from the (first) camera's "
        "position, with its field of view or a CameraInfo on TOPIC/camera_info; empty: none",
        effect=AT_START,
    )


def keypoints_parameter() -> Any:
    """Return the field of the source of 2D points."""
    return parameter(
        "",
        "2D points of the person's joints: a topic, below each camera's namespace if there are "
        "several, such as detector/keypoints, or a table FILE.csv (docs/detectors.md); empty: none",
        effect=AT_START,
    )


def camera_roll_parameter() -> Any:
    """Return the field of the roll of the camera."""
    return parameter(
        0.0,
        "how far the camera is turned clockwise about its axis, seen from behind it: 180 if its "
        "top is below, 90 or -90 on its side; silhouettes are those of the level camera, results "
        "those of the camera as it stands; background, detector, initializer and tracker need the "
        "same value",
        unit="degrees",
        limits=(-180.0, 180.0),
        effect=AT_START,
    )


def image_transport_parameter() -> Any:
    """Return the field of the image topic's transport."""
    return parameter(
        "raw",
        "raw subscribes to image_raw, compressed to image_raw/compressed",
        choices=("raw", "compressed"),
        effect=AT_START,
    )


def max_megapixels_parameter() -> Any:
    """Return the field of the largest image that is decoded."""
    return parameter(
        round(MOST_PIXELS / 1e6, 1),
        "larger images, in millions of pixels, are refused before they are decoded, as are images "
        "with sixteen times the pixels of their CameraInfo; a few bytes can expand to gigabytes",
        limits=(0.01, round(MOST_PIXELS / 1e6, 1)),
    )
