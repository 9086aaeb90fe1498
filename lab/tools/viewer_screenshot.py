"""Draw a picture of ``cardbox view`` without a graphics card or a screen.

python -m lab.tools.viewer_screenshot FILE.rrd OUT.jpg

The tool needs rerun-sdk and, on Debian, the packages xvfb and mesa-vulkan-drivers. The viewer draws
with the software renderer llvmpipe on a virtual screen.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

_SOFTWARE = "/usr/share/vulkan/icd.d/lvp_icd.x86_64.json"
_SIZE = "1300x860"
_WIDTH_PX, _QUALITY = 1300, 78
_LIMIT_S = 300


def main(args: list[str] | None = None) -> int:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, metavar="FILE.rrd")
    parser.add_argument("output", type=Path, metavar="OUT.jpg")
    given = parser.parse_args(args)
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "shot.png"
        # The pointer begins in the middle of the screen, so a large screen keeps it off the window.
        screen = ["xvfb-run", "--auto-servernum", "--server-args=-screen 0 4000x3000x24"]
        viewer = [sys.executable, "-m", "rerun_cli", str(given.recording), "--port=auto"]
        subprocess.run(
            [*screen, *viewer, f"--window-size={_SIZE}", f"--screenshot-to={shot}"],
            check=True,
            timeout=_LIMIT_S,
            env={**os.environ, "VK_ICD_FILENAMES": _SOFTWARE, "XDG_RUNTIME_DIR": folder},
        )
        image = cv2.imread(str(shot))
    if image is None:
        print("the viewer drew nothing", file=sys.stderr)
        return 1
    height = round(image.shape[0] * _WIDTH_PX / image.shape[1])
    small = cv2.resize(image, (_WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(given.output), small, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    print(f"wrote {given.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
