"""Parameters of several nodes: each call makes the field of one of them."""

from __future__ import annotations

from functools import partial

from cardbox_tracker.camera.camera import WORKING_SIZE
from cardbox_tracker.ros.runtime.parameter_fields import at_start

cameras_parameter = partial(
    at_start,
    [],
    "namespaces of the cameras that see the person, such as cam0 and cam1 for "
    "cam0/silhouette and cam1/silhouette; results are in the first one's frame; empty: one "
    "camera, without a namespace of its own",
)

extrinsics_parameter = partial(
    at_start,
    "",
    "file with the cameras' poses: a camchain of Kalibr (YAML), a camera group of aniposelib "
    "(TOML) or R and T of OpenCV's stereoCalibrate (FileStorage); not needed for a "
    "rectified pair or with /tf_static; empty: none",
)

depth_parameter = partial(
    at_start,
    "",
    "topic of depth images (16UC1, 32FC1 or compressedDepth) from the (first) camera's "
    "position, with its field of view or a CameraInfo on TOPIC/camera_info; empty: none",
)

camera_roll_parameter = partial(
    at_start,
    0.0,
    "how far the camera is turned clockwise about its axis, seen from behind it: 180 if its "
    "top is below, 90 or -90 on its side; silhouettes are those of the level camera, results "
    "those of the camera as it stands; background, detector, initializer and tracker need the "
    "same value",
    unit="degrees",
    limits=(-180.0, 180.0),
)

width_parameter = partial(
    at_start,
    WORKING_SIZE[0],
    "images are used with about width times height pixels, in their own aspect ratio",
    unit="px",
    limits=(32, 4096),
)

height_parameter = partial(
    at_start,
    WORKING_SIZE[1],
    "see width",
    unit="px",
    limits=(32, 4096),
)

image_transport_parameter = partial(
    at_start,
    "raw",
    "raw subscribes to image_raw, compressed to image_raw/compressed",
    choices=("raw", "compressed"),
)
