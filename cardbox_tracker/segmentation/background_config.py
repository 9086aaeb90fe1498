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
    min_stddev: float = setting(
        1.5,
        "least standard deviation of a pixel",
        unit="grey levels",
        limits=(0.0, 100.0),
    )
    clean_up: bool = setting(
        True, "clean the silhouette; false: apply equation (1) alone, without the settings below"
    )
    smoothing_px: float = setting(
        0.6,
        "standard deviation of the Gaussian that smooths the difference before the threshold, "
        "against noise and specks",
        unit="px",
        limits=(0.0, 20.0),
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
    darkest_shadow: float = setting(
        0.4,
        "largest darkening of a soft shadow, as a fraction of the background's brightness",
        limits=(0.0, 1.0),
    )
    color: bool = setting(
        True,
        "a pixel of a colour image is also foreground if its colour differs",
    )
    min_color_contrast: float = setting(
        7.0,
        "least colour difference (Cr, Cb) of a foreground pixel",
        unit="grey levels",
        limits=(0.1, 255.0),
    )
    color_edge: float = setting(
        0.45,
        "a colour difference is dropped if it is less than this fraction of the largest within "
        "6 px, because JPEG smears colours over an outline",
        limits=(0.0, 1.0),
    )
    # Smoothing spreads a strong contrast beyond the outline, which ``edge`` reverses.
    edge: float = setting(
        0.35,
        "a pixel is dropped if its difference is less than this fraction of the largest among its "
        "8 neighbours, so that smoothing does not widen the outline; 0: off",
        limits=(0.0, 1.0),
    )
    flicker: float = setting(
        0.1,
        "largest brightness change of the whole scene that is compensated if follow is off, as a "
        "fraction; 0: off",
        limits=(0.0, 1.0),
    )
    follow: bool = setting(
        True,
        "adapt to changes of the light (drift, automatic gain and white balance, a lamp); the "
        "person never becomes background",
    )
    min_area: float = setting(
        0.004,
        "least area of a foreground region, as a fraction of the image",
        limits=(0.0, 1.0),
    )
    max_hole: float = setting(
        0.0008,
        "area below which a hole is filled, as a fraction of the image",
        limits=(0.0, 1.0),
    )
    absorb_after: int = setting(
        300,
        "images after which a region of the silhouette without motion in and near it, such as an "
        "open door, becomes background; at most 20 images a second count; 0: never",
        limits=(0, 1000000),
    )
