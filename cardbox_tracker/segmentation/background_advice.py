"""Advice about the camera's images: losses, brightness and distance."""

from __future__ import annotations

from dataclasses import dataclass

# The default shared-memory segment of Fast DDS holds half a megabyte, less its own data.
_LARGE_IMAGE_BYTES = 400_000
_LOSS_TO_WARN = 0.1
# Well above the noise of a median over the image.
_DRIFT_TO_WARN_GREY_LEVELS = 12.0
# A person who is wholly in view covers less of the image.
_COVERAGE_TO_WARN = 0.6


@dataclass(frozen=True)
class Findings:
    """Measurements of the images.

    Attributes:
        topic: the images' topic.
        loss: share of them that never arrived.
        image_bytes: size of one.
        drift: how much brighter they are than the background, grey levels.
        follows: True if the light is followed.
        covered: share of the image that is foreground.
        within_m: pixels nearer than this are foreground, m; 0: the learned background decides.
    """

    topic: str
    loss: float
    image_bytes: int
    drift: float
    follows: bool
    covered: float
    within_m: float = 0.0


def advice(findings: Findings) -> dict[str, str]:
    """Return what a user should do about the images, a text for each kind of trouble."""
    texts = {}
    if findings.loss > _LOSS_TO_WARN and findings.image_bytes > _LARGE_IMAGE_BYTES:
        texts["loss"] = (
            f"{100 * findings.loss:.0f} % of the images on {findings.topic} "
            f"({findings.image_bytes // 1000} kB each) are lost on the way: start all nodes "
            "with FASTRTPS_DEFAULT_PROFILES_FILE set to this package's "
            "config/fastdds_large_images.xml, or use smaller, grey or compressed images"
        )
    if findings.within_m > 0.0:
        if findings.covered > _COVERAGE_TO_WARN:
            texts["depth"] = (
                f"most of the image is nearer than within_m, {findings.within_m:g} m: choose it "
                "between the person and the wall, and let nothing else stand before it"
            )
        return texts
    drifted = not findings.follows and abs(findings.drift) > _DRIFT_TO_WARN_GREY_LEVELS
    if drifted or findings.covered > _COVERAGE_TO_WARN:
        texts["brightness"] = (
            "the whole scene changed its brightness: switch the camera's automatic exposure "
            "and white balance off (v4l2-ctl -c auto_exposure=1,white_balance_automatic=0), "
            "then call background/learn with nobody in view"
        )
    return texts
