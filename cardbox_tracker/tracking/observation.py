"""The input of the tracker: one camera's data at one time, as named channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.camera.given_arrays import depth_from, image_from, silhouette_from
from cardbox_tracker.camera.view import View
from cardbox_tracker.common.settings import all_of_kind
from cardbox_tracker.detectors.image_points import ImagePoints, whole_ns
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.term import DepthImage, Image, Silhouette


class Channel(NamedTuple):
    """How the data of one kind gets from an :class:`Observation` into a frame."""

    #: takes the data, its name in errors, and height and width of the camera; returns data that
    #: terms can use, or raises ValueError.
    checked: Callable[[Any, str, tuple[int, int]], Any]
    #: takes the view of a camera and the data; returns the data of the upright image.
    upright: Callable[[View, Any], Any]


def points_from(given: Any, name: str, size: tuple[int, int]) -> ImagePoints:
    """Return a detector's points, or raise ValueError."""
    if not isinstance(given, ImagePoints):
        raise ValueError(
            f"{name} are of the type {type(given).__name__}; expected ImagePoints, such as "
            "ImagePoints.of(...), or None"
        )
    return given


def pixels_from(given: Any, name: str, size: tuple[int, int]) -> FloatArray:
    """Return columns and rows (N, 2), px, nan for unknown points, or raise ValueError."""
    pixels = np.asarray(given)
    if pixels.dtype.kind not in "iuf" or pixels.ndim != 2 or pixels.shape[1] != 2:
        raise ValueError(
            f"{name} has the shape {pixels.shape} and the type {pixels.dtype}; expected column and "
            "row of each point, (N, 2)"
        )
    return pixels.astype(np.float64)


def _upright_points(view: View, found: ImagePoints) -> ImagePoints:
    return replace(found, px=view.upright_px(found.px))


CHANNELS: dict[str, Channel] = {
    "silhouette": Channel(silhouette_from, lambda view, mask: view.upright(mask, is_mask=True)),
    "covered": Channel(silhouette_from, lambda view, mask: view.upright(mask, is_mask=True)),
    "image": Channel(image_from, View.upright),
    "depth_m": Channel(depth_from, View.upright),
    "points": Channel(points_from, _upright_points),
    "people": Channel(
        lambda given, name, _: all_of_kind(name, given, ImagePoints),
        lambda view, found: tuple(_upright_points(view, one) for one in found),
    ),
}
"""The channels by name. A line ``CHANNELS["name"] = Channel(pixels_from, View.upright_px)`` adds
another one, which ``Observation(..., name=...)`` then takes and terms read as ``frame["name"]``."""


class Observation:
    """The data of one camera at one time.

    An observation without a silhouette stands for a camera without data at this time. The tracker
    converts arrays of other types, or refuses them with a ValueError; see
    :mod:`cardbox_tracker.camera.given_arrays`.

    Attributes:
        channels: data by the names of :data:`CHANNELS`; missing ones have no data.
        stamp_ns: time of the data, ns; None if it is unknown.
        picture: returns the image at its full resolution, which hands need; that of the channel
            ``image`` without another one.
        is_cut: whether a film is cut here, so that nothing is where it was before.
    """

    __slots__ = ("channels", "is_cut", "picture", "stamp_ns")

    def __init__(
        self,
        silhouette: Silhouette | None = None,
        image: Image | None = None,
        depth_m: DepthImage | None = None,
        stamp_ns: int | None = None,
        points: ImagePoints | None = None,
        picture: Callable[[], Image] | None = None,
        is_cut: bool = False,
        **more: Any,
    ) -> None:
        """Take the data of one time; what there is not is None.

        ``silhouette`` is (H, W), 0 or 255, of the camera's size, or a mask of another numeric type;
        ``image`` (H, W) grey or (H, W, 3) bgr, for terms that use it; ``depth_m`` (H, W), metres
        along the optical axis, for the term ``Depth``, in which unknown depths are not above 0 or
        not finite. Further channels are ``people``, the joints of each of several people for a
        :class:`~.session.Session`, and ``covered``, the pixels (H, W), 0 or 255, of other people,
        which may hide this one.

        Raises ValueError if there is no channel of a name, or the stamp is no whole number.
        """
        given = {
            "silhouette": silhouette,
            "image": image,
            "depth_m": depth_m,
            "points": points,
            **more,
        }
        for name in given.keys() - CHANNELS.keys():
            raise ValueError(
                f"an observation has no channel {name!r}; expected any of {', '.join(CHANNELS)}, "
                "or add it to CHANNELS"
            )
        self.channels = {name: data for name, data in given.items() if data is not None}
        self.stamp_ns = whole_ns(stamp_ns, "an observation")
        self.is_cut = is_cut
        self.picture = (lambda: image) if picture is None and image is not None else picture

    def having(self, **given: Any) -> Observation:
        """Return the observation with other channels, or another ``stamp_ns``."""
        kept = {"stamp_ns": self.stamp_ns, "picture": self.picture, "is_cut": self.is_cut}
        return Observation(**{**kept, **self.channels, **given})

    @property
    def silhouette(self) -> Silhouette | None:
        """The silhouette as it was given."""
        return self.channels.get("silhouette")

    @property
    def image(self) -> Image | None:
        """The image as it was given."""
        return self.channels.get("image")

    @property
    def depth_m(self) -> DepthImage | None:
        """The depth image as it was given."""
        return self.channels.get("depth_m")

    @property
    def points(self) -> ImagePoints | None:
        """The detector's points."""
        return self.channels.get("points")


Observations = Sequence[Observation | None]
"""One observation for each camera, the first camera first; None for a camera without data."""


def listed(
    given: Observations | Observation | Silhouette,
    cameras: int,
    image: Image | None = None,
    stamp_ns: int | None = None,
) -> Observations:
    """Return what was given for up to this number of cameras, as :meth:`.Tracker.track` takes it.

    Raises ValueError if the types or the number of observations are impossible.
    """
    if isinstance(given, np.ndarray):
        given = Observation(given, image, stamp_ns=stamp_ns)
    elif image is not None or stamp_ns is not None:
        raise ValueError("give image and stamp_ns in the observations, not beside them")
    if isinstance(given, Observation):
        given = (given,)
    if not isinstance(given, Sequence):
        raise ValueError(
            f"the observations are of the type {type(given).__name__}; expected a silhouette as a "
            "numpy array, an Observation, or a list with one for each camera"
        )
    if not 1 <= len(given) <= cameras:
        raise ValueError(
            f"there are {len(given)} observations; expected one for each of {cameras} cameras"
        )
    for one in given:
        if one is not None and not isinstance(one, Observation):
            raise ValueError(
                f"an observation is of the type {type(one).__name__}; expected an Observation, "
                "such as Observation(silhouette), or None"
            )
    return given


def stamp_of(observations: Observations) -> int | None:
    """Return the stamp of the first camera, or else the earliest one, ns; None if none is known."""
    first, *others = (None if one is None else one.stamp_ns for one in observations)
    if first is not None:
        return first
    return min((stamp_ns for stamp_ns in others if stamp_ns is not None), default=None)
