"""The badges of the README: ``python -m lab.tools.badges`` writes them to ``docs/images/badges``.

Their values come from ``package.xml`` and ``setup.py``; no network service is used.
"""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from cardbox_tracker.common.files import write_file

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "images" / "badges"

_LETTER_PX, _MARGIN_PX = 7, 12
_SVG = """\
<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="20" role="img">
  <title>{label}: {value}</title>
  <rect width="{width}" height="20" rx="3" fill="#555"/>
  <path d="M{split} 0h{rest}a3 3 0 0 1 3 3v14a3 3 0 0 1-3 3h-{rest}z" fill="{color}"/>
  <g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11" text-anchor="middle">
    <text x="{first}" y="14">{label}</text>
    <text x="{second}" y="14">{value}</text>
  </g>
</svg>
"""


def badges() -> dict[str, str]:
    """Return the text of each SVG file by its name."""
    licence = ElementTree.parse(ROOT / "package.xml").getroot().findtext("license", "")
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    versions = re.findall(r"Python :: (3\.\d+)\"", setup)
    (distro,) = set(re.findall(r"ros-([a-z]+)-rclpy", setup))
    return {
        "licence.svg": _badge("licence", licence, "#2b6cb0"),
        "ros.svg": _badge("ROS 2", distro.capitalize(), "#22314e"),
        "python.svg": _badge("Python", f"{versions[0]} to {versions[-1]}", "#2f855a"),
    }


def _badge(label: str, value: str, color: str) -> str:
    split, second = (_LETTER_PX * len(text) + _MARGIN_PX for text in (label, value))
    return _SVG.format(
        label=label,
        value=value,
        color=color,
        width=split + second,
        split=split,
        rest=second - 3,
        first=split // 2,
        second=split + second // 2,
    )


def main() -> int:
    """Write the files."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, text in badges().items():
        write_file(FOLDER / name, text)
        print(f"wrote {FOLDER / name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
