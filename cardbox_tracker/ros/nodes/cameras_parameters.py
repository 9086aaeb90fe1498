"""The parameters of several cameras, which tracker and initializer share."""

from __future__ import annotations

from typing import Any

from cardbox_tracker.ros.runtime.parameter_fields import parameter


def cameras_parameter() -> Any:
    """Return the field of the cameras' namespaces."""
    return parameter(
        [],
        "namespaces of the cameras that see the person, such as cam0 and cam1 for "
        "cam0/silhouette and cam1/silhouette; results are in the first one's frame; empty: one "
        "camera, without a namespace of its own",
        read_only=True,
    )


def extrinsics_parameter() -> Any:
    """Return the field of the file that says where the cameras stand."""
    return parameter(
        "",
        "where the cameras stand: a camchain of Kalibr (YAML) or a camera group of aniposelib "
        "(TOML); not needed for a rectified pair or with /tf_static; empty: none",
        read_only=True,
    )
