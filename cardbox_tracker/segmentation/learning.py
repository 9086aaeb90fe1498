"""Learns the empty scene from the first images, once it is still, or around a person."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.health import WATCHES
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.segmentation.partial_scene import PartialScene
from cardbox_tracker.segmentation.scene_motion import SceneMotion

ImageArray = NDArray[np.uint8]


class Learning:
    """Learns from every image, regardless of its content (``always``)."""

    def __init__(self, images: int) -> None:
        self.images = images
        self._learner = BackgroundLearner()

    @property
    def count(self) -> int:
        """Number of images learned so far."""
        return self._learner.count

    def add(self, image: ImageArray) -> None:
        """Learn from one prepared image, grey (H, W) or bgr (H, W, 3)."""
        self._learner.add(image)

    def has_enough(self) -> bool:
        """Return whether the scene is learned."""
        return self.count >= self.images

    def model(self) -> BackgroundModel:
        """Return the learned background; ValueError if fewer than two images were added."""
        return self._learner.model()

    def values(self) -> dict[str, str]:
        """Return the progress, for the diagnostics."""
        return {"background learned from": f"{self.count}/{self.images}"}

    def waits_for(self, topic: str) -> str:
        """Describe the images that are needed on ``topic`` and the action of the user."""
        return (
            f"{self.images} images of the empty scene on {topic} "
            "(learning the background: nobody may be in view)"
        )


class StillLearning(Learning):
    """Starts again when something moves, so that no person is learned (``still``).

    A still scene is learned as in :class:`Learning`.
    """

    def __init__(self, images: int) -> None:
        super().__init__(images)
        self._motion = SceneMotion(images)
        self._moving = 0.0

    def add(self, image: ImageArray) -> None:
        """Learn from one prepared image, or start again if something has moved."""
        share = self._motion.add(brightness_of(image))
        if WATCHES["motion"].is_beyond(share):
            self._moving = share
            self._motion = SceneMotion(self.images)
            self._learner = BackgroundLearner()
        else:
            super().add(image)

    def values(self) -> dict[str, str]:
        """Return the progress and the share of the image that moved last."""
        moved = f"{100 * self._moving:.1f}"
        return super().values() | {"moved while learning (% of the image)": moved}

    def waits_for(self, topic: str) -> str:
        """Describe the images that are needed and the motion that delays them."""
        if self._moving == 0.0:
            return super().waits_for(topic)
        return WATCHES["motion"].words.format(topic=topic, images=self.images)


class PersonInViewLearning(Learning):
    """Learns the scene around a person, and the rest once they step aside (``person_in_view``)."""

    def __init__(self, images: int) -> None:
        super().__init__(images)
        self._motion = SceneMotion(images)
        self._scene = PartialScene()
        self._seen = 0

    @property
    def count(self) -> int:
        """Number of images added so far."""
        return self._seen

    def add(self, image: ImageArray) -> None:
        """Add one prepared image; after ``images`` of them, learn the part that was not hidden."""
        self._motion.add(brightness_of(image))
        super().add(image)
        self._seen += 1
        if self._learner.count >= self.images and not self.has_enough():
            moved = self._motion.moved
            if moved is not None:
                self._scene.add(self._learner.model(), moved)
            self._motion = SceneMotion(self.images)
            self._learner = BackgroundLearner()

    def has_enough(self) -> bool:
        """Return whether every part of the scene was seen without the person."""
        return self._scene.is_whole

    def model(self) -> BackgroundModel:
        """Return the combined scene; ValueError if a part of the scene was not seen yet."""
        return self._scene.model()

    def values(self) -> dict[str, str]:
        """Return the progress and the share of the scene that the person hides."""
        hidden = f"{100 * self._scene.hidden:.1f}"
        return super().values() | {"hidden by the person (% of the image)": hidden}

    def waits_for(self, topic: str) -> str:
        """Describe the action of the person."""
        if self._scene.hidden == 1.0:
            return (
                f"{self.images} images on {topic} (learning the background around you: stand "
                "where you are)"
            )
        return (
            f"a view of what you hide on {topic} (learning the background): step aside by twice "
            f"your width, or leave the image, and stay there for {2 * self.images} images"
        )


WAYS: dict[str, type[Learning]] = {
    "still": StillLearning,
    "person_in_view": PersonInViewLearning,
    "always": Learning,
}
"""Classes by the name of the method; the first one is the default."""
