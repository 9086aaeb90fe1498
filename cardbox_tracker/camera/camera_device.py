"""Opens devices and video files with OpenCV, lists a device's modes and locks its exposure."""

from __future__ import annotations

from pathlib import Path

import cv2

from cardbox_tracker.common.errors import CameraError

# V4L2's menu: 1 is manual, 3 is automatic (aperture priority).
_V4L2_MANUAL, _V4L2_AUTOMATIC = 1, 3
_SIZES = ((320, 240), (640, 480), (800, 600), (1280, 720), (1920, 1080))
_DEVICES, _NAMES = Path("/dev"), Path("/sys/class/video4linux")


def open_device(device: str) -> cv2.VideoCapture:
    """Open a V4L2 device such as ``/dev/video0`` or ``0``; raise CameraError if that fails."""
    path = Path(f"/dev/video{device}" if device.isdigit() else device)
    if not path.exists():
        found = ", ".join(sorted(str(other) for other in Path("/dev").glob("video*")))
        raise CameraError(
            f"there is no camera {path}; found: {found or 'none at all'}. Plug it in, set the "
            "parameter 'device', or play a video with the parameter 'file'"
        )
    capture = cv2.VideoCapture(str(path), cv2.CAP_V4L2)
    if not capture.isOpened():
        raise CameraError(
            f"the camera {path} cannot be opened; it may be in use by another program, or this "
            "user is not in the group 'video'"
        )
    return capture


def open_video(name: str) -> cv2.VideoCapture:
    """Open a video file; raise CameraError if it does not exist or OpenCV cannot read it."""
    path = Path(name).expanduser()
    if not path.is_file():
        raise CameraError(f"there is no video {path}; set the parameter 'file' to one that exists")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise CameraError(
            f"OpenCV cannot read {path} as a video; expected for example MP4, AVI or MKV: "
            "convert it with 'ffmpeg -i INPUT OUTPUT.mp4'"
        )
    return capture


def lock_exposure(capture: cv2.VideoCapture) -> dict[str, bool]:
    """Keep exposure and white balance as they are; return by name whether the device does."""
    exposure = capture.get(cv2.CAP_PROP_EXPOSURE)
    fixed = capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _V4L2_MANUAL)
    if fixed and exposure > 0:
        capture.set(cv2.CAP_PROP_EXPOSURE, exposure)
    balanced = capture.set(cv2.CAP_PROP_AUTO_WB, 0)
    return {"exposure": bool(fixed), "white balance": bool(balanced)}


def describe_devices(devices: Path = _DEVICES, names: Path = _NAMES) -> str:
    """Return a readable list of the cameras and their modes; ``names`` is the kernel's folder."""
    found = sorted(devices.glob("video*"), key=lambda path: (len(path.name), path.name))
    if not found:
        return f"no camera: there is no {devices}/video*; plug one in"
    return "\n".join(f"{path}{_name(names / path.name)}: {_offer(path)}" for path in found)


def _name(folder: Path) -> str:
    try:
        return f" ({(folder / 'name').read_text(encoding='utf-8').strip()})"
    except OSError:
        return ""


def _offer(path: Path) -> str:
    try:
        capture = open_device(str(path))
    except CameraError:
        # A camera also has devices that deliver no images.
        return "delivers no images, or is in use"
    try:
        return describe_capture(capture)
    finally:
        capture.release()


def describe_capture(capture: cv2.VideoCapture) -> str:
    """Return sizes, rates and controls of an open device, whose controls are automatic then."""
    modes: dict[tuple[int, int], float] = {}
    for width, height in _SIZES:
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        size = (
            int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        )
        modes[size] = capture.get(cv2.CAP_PROP_FPS)
    offered = ", ".join(f"{w}x{h} at {fps:g} Hz" for (w, h), fps in sorted(modes.items()))
    allowed = lock_exposure(capture)
    capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _V4L2_AUTOMATIC)
    capture.set(cv2.CAP_PROP_AUTO_WB, 1)
    manual = "; ".join(
        f"{what} {'can' if can else 'cannot'} be set to manual" for what, can in allowed.items()
    )
    return f"{offered}; {manual}"
