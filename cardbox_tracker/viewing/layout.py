"""Arranges the views of the entities that :mod:`.scene` logs: image and 3D beside plots."""

from __future__ import annotations

from typing import Any

from cardbox_tracker.body.neck import NECK_NAMES
from cardbox_tracker.body.posture import JOINT_NAMES, PLACE_NAMES
from cardbox_tracker.description.urdf import ROOT_LINK
from cardbox_tracker.viewing.library import rerun

IMAGE, JOINTS, ERROR, STATE = "image", "joints", "error", "state"
"""Entities of the views."""

_FLAT = (IMAGE, JOINTS, ERROR, STATE)

ROOT_FRAME = f"person/{ROOT_LINK}"
"""Frame of the 3D view."""

GROUPS: dict[str, tuple[str, ...]] = {
    "left_arm": tuple(name for name in JOINT_NAMES if name.startswith("left")),
    "right_arm": tuple(name for name in JOINT_NAMES if name.startswith("right")),
    "torso": tuple(name for name in JOINT_NAMES[1:] if name.startswith("torso")),
    "head": NECK_NAMES,
    "place": ("torso_y", *PLACE_NAMES),
}
"""Joints by plot: angles in degrees, the place in metres."""


SPREAD = "within_two_deviations"
"""Entity below a plot that contains the uncertainty of its joints."""


# The viewpoint is beside the camera and looks at a person two metres before it.
_EYE_M, _TARGET_M = (0.1, -1.1, 0.5), (2.0, 0.35, -0.1)


def plot_of(joint: str) -> tuple[str, int]:
    """Return the plot of a joint, and the joint's index in it."""
    for group, joints in GROUPS.items():
        if joint in joints:
            return group, joints.index(joint)
    return "other", 0


def layout() -> Any:
    """Return the blueprint of the views.

    Raises:
        CardboxError: rerun-sdk is not installed.
    """
    rr = rerun()
    views = rr.blueprint
    where = views.SpatialInformation(target_frame=ROOT_FRAME)
    legend = views.PlotLegend(corner=views.Corner2D.RightTop)
    plots = [
        views.TimeSeriesView(
            origin=f"{JOINTS}/{name}", name=f"{name.replace('_', ' ')} [{unit}]", plot_legend=legend
        )
        for name, unit in zip(GROUPS, ("deg", "deg", "deg", "deg", "m"), strict=True)
    ]
    return views.Blueprint(
        views.Horizontal(
            views.Vertical(
                views.Spatial2DView(origin=IMAGE, name="image"),
                views.Spatial3DView(
                    origin="/",
                    contents=["+ /**", *(f"- /{name}/**" for name in _FLAT)],
                    name="measured body",
                    spatial_information=where,
                    eye_controls=views.EyeControls3D(
                        position=_EYE_M, look_target=_TARGET_M, eye_up=(0.0, 0.0, 1.0)
                    ),
                ),
            ),
            views.Vertical(
                *plots[:2],
                views.Tabs(*plots[2:]),
                views.TimeSeriesView(origin=ERROR, name="error [cm]"),
                views.TextLogView(origin=STATE, name="state"),
                row_shares=[3, 3, 3, 2, 1],
            ),
        ),
        views.TimePanel(timeline="time", state="collapsed"),
        collapse_panels=True,
    )
