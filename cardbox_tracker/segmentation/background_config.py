"""Settings of the background model and of the silhouette extraction."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.common.settings import Settings, setting


@dataclass(frozen=True)
class BackgroundConfig(Settings):
    """Settings of the background model and of the silhouette extraction."""

    learn_images: int = setting(30, "images of the empty scene to learn from", limits=(2, 10000))
    threshold: float = setting(
        2.0,
        "a pixel is foreground if it differs from the background by this many standard deviations "
        "or more, equation (1)",
        limits=(0.1, 50.0),
    )
    clean_up: bool = setting(
        True, "clean the silhouette; false: apply equation (1) alone, without the settings below"
    )
    min_contrast: float = setting(
        7.0,
        "least smoothed difference of a foreground pixel",
        unit="grey levels",
        limits=(0.0, 255.0),
    )
    shadow: float = setting(
        0.13,
        "a pixel that is darker than the background by less than this fraction is a shadow; 0: off",
        limits=(0.0, 1.0),
    )
    soft_shadow: float = setting(
        0.07,
        "a darker pixel is also a shadow if it is connected to the background by pixels whose "
        "relative brightness changes by less than this fraction within 5x5 px; 0: off",
        limits=(0.0, 1.0),
    )
    color: bool = setting(
        True,
        "a pixel of a colour image is also foreground if its colour differs",
    )
    follow: bool = setting(
        True,
        "adapt to changes of the light (drift, automatic gain and white balance, a lamp); the "
        "person never becomes background",
    )
    absorb_after: int = setting(
        300,
        "images after which a region of the silhouette without motion in and near it, such as an "
        "open door, becomes background; at most 20 images a second count; 0: never",
        limits=(0, 1000000),
    )
