"""Arranges the views of the entities that :mod:`.scene` logs: image and 3D beside plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from cardbox_tracker.body.skeleton import CLAVICLE_NAMES, JOINT_NAMES, NECK_NAMES, PLACE_NAMES
from cardbox_tracker.body.urdf import ROOT_LINK
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
    "shoulders": CLAVICLE_NAMES,
}
"""Joints by plot: angles in degrees, place and rise of the shoulders in metres."""


SPREAD = "within_two_deviations"
"""Entity below a plot that contains the uncertainty of its joints."""


# The viewpoint is beside the camera and looks at a person two metres before it.
_EYE_M, _TARGET_M = (0.1, -1.1, 0.5), (2.0, 0.35, -0.1)


class Column(NamedTuple):
    """One of the results that are shown beside each other.

    Attributes:
        prefix: before its entities and frames: a word and a slash, or empty.
        name: of the result, in titles and legends; empty if it is shown alone.
        is_pale: whether its plots are pale, to distinguish them from those of another result.
    """

    prefix: str = ""
    name: str = ""
    is_pale: bool = False

    def named(self, text: str) -> str:
        """Return ``text`` with the name of the result before it."""
        return f"{self.name} {text}".strip()

    def geometry(self, robot: str) -> str:
        """Return the entity of the shapes of ``person`` or a robot, which must be a single word."""
        return f"{self.prefix}{robot}".replace("/", "_")


ALONE = Column()
"""A result that is shown alone."""


def columns(names: Sequence[str]) -> tuple[Column, ...]:
    """Return the columns of two named results, or that of a single one."""
    if len(names) < 2:
        return (ALONE,)
    first, second = names
    return Column("first/", first), Column("second/", second, is_pale=True)


def plot_of(joint: str) -> tuple[str, int]:
    """Return the plot of a joint, and the joint's index in it."""
    for group, joints in GROUPS.items():
        if joint in joints:
            return group, joints.index(joint)
    return "other", 0


def layout(
    shown: Sequence[Column] = (ALONE,), has_truth: bool = False, is_live: bool = False
) -> Any:
    """Return the blueprint of the views.

    Args:
        shown: one or two results. Two have their joints in the same plots, without uncertainty.
        has_truth: whether there is a view of the errors.
        is_live: whether the viewer follows the newest result; otherwise it plays from the start.

    Raises:
        CardboxError: rerun-sdk is not installed.
    """
    views = rerun().blueprint
    # The heights of plots with joints, errors and states.
    error, shares = ([_plot(shown, ERROR, "error [cm]")], [2]) if has_truth else ([], [])
    units = ("deg", "deg", "deg", "deg", "m", "m")
    plots = [
        _plot(shown, f"{JOINTS}/{name}", f"{name.replace('_', ' ')} [{unit}]")
        for name, unit in zip(GROUPS, units, strict=True)
    ]
    states = views.TextLogView(
        origin="/", contents=[f"+ /{one.prefix}{STATE}" for one in shown], name="state"
    )
    right = views.Vertical(
        *plots[:2],
        views.Tabs(*plots[2:]),
        *error,
        states,
        row_shares=[3, 3, 3, *shares, 2],
    )
    return views.Blueprint(
        views.Horizontal(
            *(_scene(column) for column in shown),
            right,
            column_shares=[1.0] * len(shown) + [1.0 if len(shown) == 1 else 1.3],
        ),
        views.TimePanel(
            timeline="time",
            state="collapsed",
            play_state="following" if is_live else "playing",
        ),
        collapse_panels=True,
    )


def _scene(column: Column) -> Any:
    """Return the image and the body of a result."""
    views = rerun().blueprint
    prefix = column.prefix
    title = f"{column.name}: " if column.name else ""
    return views.Vertical(
        views.Spatial2DView(origin=f"{prefix}{IMAGE}", name=f"{title}image"),
        views.Spatial3DView(
            origin="/",
            contents=[
                *(f"+ /{prefix}**", f"+ /{column.geometry('person')}/**"),
                *(f"- /{prefix}{name}/**" for name in _FLAT),
            ],
            name=f"{title}measured body",
            spatial_information=views.SpatialInformation(target_frame=f"{prefix}{ROOT_FRAME}"),
            eye_controls=views.EyeControls3D(
                position=_EYE_M, look_target=_TARGET_M, eye_up=(0.0, 0.0, 1.0)
            ),
        ),
    )


def _plot(shown: Sequence[Column], entity: str, title: str) -> Any:
    """Return the plot of an entity of all results; that of two has no room for uncertainty."""
    views = rerun().blueprint
    contents = [f"+ /{column.prefix}{entity}/**" for column in shown]
    if len(shown) > 1:
        contents += [f"- /{column.prefix}{entity}/{SPREAD}/**" for column in shown]
    legend = views.PlotLegend(corner=views.Corner2D.RightTop)
    return views.TimeSeriesView(origin="/", contents=contents, name=title, plot_legend=legend)
