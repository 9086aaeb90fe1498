"""Settings of the background model and of the silhouettes cut out with it."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.settings import Settings, setting


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
        "smallest standard deviation that is assumed of a pixel",
        unit="grey levels",
        limits=(0.0, 100.0),
    )
    clean_up: bool = setting(
        True, "false applies equation (1) alone: all settings after this one have no effect"
    )
    smoothing_px: float = setting(
        0.6,
        "standard deviation of the Gaussian that smooths the difference before the threshold; "
        "it lowers the noise and with it the specks",
        unit="px",
        limits=(0.0, 20.0),
    )
    min_contrast: float = setting(
        7.0,
        "a smoothed difference below this is never foreground",
        unit="grey levels",
        limits=(0.0, 255.0),
    )
    shadow: float = setting(
        0.13,
        "a pixel that is darker than the background by less than this fraction is a shadow, not "
        "the person; 0 is off",
        limits=(0.0, 1.0),
    )
    soft_shadow: float = setting(
        0.07,
        "a darker pixel is also a shadow where the brightness relative to the background changes "
        "by less than this fraction within 5x5 px, all the way from the background; 0 is off",
        limits=(0.0, 1.0),
    )
    darkest_shadow: float = setting(
        0.4,
        "a pixel that is darker than the background by more than this fraction is no soft shadow",
        limits=(0.0, 1.0),
    )
    color: bool = setting(
        True,
        "a pixel is also foreground if its colour differs; only for images in colour",
    )
    min_color_contrast: float = setting(
        7.0,
        "a colour difference (Cr, Cb) below this is never foreground",
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
        "8 neighbours, so that smoothing does not widen the outline; 0 is off",
        limits=(0.0, 1.0),
    )
    flicker: float = setting(
        0.1,
        "with follow off: a brightness change of the whole scene up to this fraction is "
        "compensated; 0 is off",
        limits=(0.0, 1.0),
    )
    follow: bool = setting(
        True,
        "follow the light of the scene: drift, automatic gain and white balance, a lamp; the "
        "person never becomes background",
    )
    min_area: float = setting(
        0.004,
        "foreground regions smaller than this fraction of the image are dropped",
        limits=(0.0, 1.0),
    )
    max_hole: float = setting(
        0.0008,
        "holes smaller than this fraction of the image are filled",
        limits=(0.0, 1.0),
    )
    absorb_after: int = setting(
        300,
        "images after which a region of the silhouette in and near which nothing moves, such as a "
        "door left open, becomes background; a person sways; of more than 20 images a second not "
        "all count; 0: never",
        limits=(0, 1000000),
    )
