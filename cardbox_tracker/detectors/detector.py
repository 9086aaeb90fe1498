"""The detector, which finds the person in image after image of one camera."""

from __future__ import annotations

import pickle
import weakref
import zlib
from tempfile import SpooledTemporaryFile
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.model_files import ModelFiles, installed_models
from cardbox_tracker.detectors.own_network import OwnModel, OwnNetwork
from cardbox_tracker.detectors.people_network import PeopleNetwork
from cardbox_tracker.detectors.pose_network import (
    Detection,
    PoseNetwork,
    image_points,
    silhouette_of,
)

Image = NDArray[np.uint8]

MEDIAPIPE = "mediapipe"
"""Name of the detector whose networks ``cardbox detector --install`` installs."""


class Detector(NamedTuple):
    """The installed detector, or one of the user's own; ``start()`` makes it ready for a camera."""

    models: ModelFiles | OwnModel  #: its network files, or the class of one's own
    #: number of people whom it finds at most; 0 for the one whom it follows.
    people: int = 0

    @classmethod
    def installed(cls, people: int = 0) -> Detector:
        """Return the installed detector; raise CardboxError if it is not installed."""
        return cls(installed_models(), people=people)

    def start(self) -> PersonDetector:
        """Return a detector for the images of one camera.

        Raises CardboxError if the networks cannot be loaded.
        """
        if isinstance(self.models, OwnModel):
            network: PoseNetwork = OwnNetwork(self.models)
        else:
            network = PoseNetwork(*self.models)
        return PersonDetector(network, PeopleNetwork(network, self.people) if self.people else None)


class Found(NamedTuple):
    """The people in an image; the channels of an :class:`~cardbox_tracker.Observation`."""

    silhouette: Image  #: (H, W), 255 where one of them is, else 0
    people: tuple[ImagePoints, ...]  #: the points of each of several people

    @property
    def points(self) -> ImagePoints | None:
        """The points of the one who is followed; None if nobody is seen."""
        return self.people[0] if self.people else None


class PersonDetector:
    """Finds the person in image after image of a camera; ``missed`` counts those without one."""

    def __init__(self, network: PoseNetwork, people: PeopleNetwork | None = None) -> None:
        """Use the networks for one camera alone, because they follow the people."""
        self._network, self._people = network, people
        self.missed = 0

    def restart(self) -> None:
        """Forget the last image, so that results depend on the following images alone."""
        self._network.forget()
        if self._people is not None:
            self._people.forget()
        self.missed = 0

    def start_anew(self) -> None:
        """Forget the people because a film is cut."""
        self._network.start_anew()
        if self._people is not None:
            self._people.forget()

    def __call__(self, image: Image, stamp_ns: int | None = None) -> Detection | None:
        """Return the person in an image (H, W) or (H, W, 3), bgr, of a time; None if not seen."""
        found = self._network(color(image), stamp_ns)
        self.missed += found is None
        return found

    def all_in(self, stamp_ns: int, image: Image) -> list[Detection]:
        """Return all people in an image as above, or the one who is followed, of a time, ns."""
        if self._people is None:
            person = self(image, stamp_ns)
            return [] if person is None else [person]
        own = self._network if isinstance(self._network, OwnNetwork) else None
        found = own.people_in(color(image)) if own else self._people(color(image), stamp_ns)
        self.missed += not found
        return found

    def detect(self, image: Image, stamp_ns: int) -> Found:
        """Return what an image as above, of a time, ns, shows, as an observation takes it."""
        found = self.all_in(stamp_ns, image)
        return Found(silhouette_of(found, image.shape), tuple(map(image_points, found)))

    @property
    def remark(self) -> str:
        """A remark about several people in the images; empty if there were none."""
        if not self._network.several:
            return ""
        return (
            "the detector sees several people and follows the most certain one; --person "
            "left|right|largest|X,Y chooses, and --people follows all"
        )


def color(image: Image) -> Image:
    """Return an image (H, W) or (H, W, 3) as (H, W, 3)."""
    return image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)


# Bytes that are kept in memory: some ten minutes of a film.
_IN_MEMORY = 64 * 1024 * 1024


class KeptDetections:
    """The detector of one camera, whose results a second pass over a recording need not find again.

    The scene is measured before the first image is tracked, and networks take most of the time. A
    temporary file keeps what they find, masks with one bit a pixel.
    """

    def __init__(self, detector: PersonDetector) -> None:
        """Use a detector for the images of a recording."""
        self.detector = detector
        self._span: tuple[float, float] | None = None
        self._is_whole = False
        self._places: dict[int, int] = {}
        self._file = SpooledTemporaryFile(_IN_MEMORY)  # noqa: SIM115
        weakref.finalize(self, self._file.close)

    def start(self, start_s: float, end_s: float) -> None:
        """Begin a pass over the images of a span, seconds from the start of the recording."""
        if self._is_whole and self._span == (start_s, end_s):
            return
        # Detections depend on the images before, so those of another span do not count.
        self.detector.restart()
        self._span, self._is_whole = (start_s, end_s), False
        self._places.clear()
        self._file.seek(0)
        self._file.truncate()

    def end(self) -> None:
        """End a pass in which all images of the span were seen."""
        self._is_whole = True

    def __call__(
        self, number: int, stamp_ns: int, image: NDArray[np.uint8], is_cut: bool = False
    ) -> list[Detection]:
        """Return the people in an image (H, W) or (H, W, 3), bgr, of a number in the recording.

        Where the film is cut, whoever is there is new.
        """
        if number in self._places:
            self._file.seek(self._places[number])
            return [_unpacked(*one) for one in pickle.load(self._file)]
        if is_cut:
            self.detector.start_anew()
        found = self.detector.all_in(stamp_ns, image)
        self._file.seek(0, 2)
        self._places[number] = self._file.tell()
        pickle.dump([_packed(one) for one in found], self._file)
        return found


def _packed(found: Detection) -> tuple[Detection, tuple[int, ...], bytes]:
    bits = zlib.compress(np.packbits(found.silhouette() > 0).tobytes(), 1)
    return found._replace(mask=np.zeros(0, np.uint8)), found.mask.shape, bits


def _unpacked(found: Detection, shape: tuple[int, ...], bits: bytes) -> Detection:
    flat = np.unpackbits(np.frombuffer(zlib.decompress(bits), np.uint8), count=int(np.prod(shape)))
    return found._replace(mask=255 * flat.reshape(shape))
