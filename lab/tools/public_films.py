"""Public films of people whom nobody measured: get them, track them, and draw sheets to judge.

    python -m lab.tools.public_films FOLDER [FILM...] [--from URL]

``public_films.csv`` beside this file has repository, commit, path and licence of each film, with
the options that a newcomer would guess, and the verdicts of whoever looked at the sheets. What is
in FOLDER already is neither fetched nor tracked again. Each sheet has ``MOMENTS`` images evenly
over the film, with model and states. The table is printed. Films stay outside of this repository:
many have no licence, and faces can be recognized.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.commands.main import main as cardbox
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.recordings.result_reader import Results, read_results
from lab.pages import table

Image = NDArray[np.uint8]
Row = Mapping[str, str]

MOMENTS = 8
"""Images of a film that are judged, evenly over its time."""
LIST = Path(__file__).with_suffix(".csv")

_TILE_PX, _LINE_PX = 420, 20
_SURE = ("tracking", "tracked")
_QUANTITIES = {"shape": "state", "vertical": "vertical_state", "distance": "place_state"}


def get(film: Row, path: Path, source: str) -> None:
    """Write a film of ``LIST`` to ``path``; of its repository, only this file comes.

    Raises CardboxError if the repository at ``source``/OWNER/NAME does not give it.
    """
    clone = path.with_name(f"{film['repository'].replace('/', '+')}.git")
    git = ["git", "-C", str(clone)]
    url = f"{source}/{film['repository']}"
    commands = [
        ["git", "init", "--quiet", "--bare", str(clone)],
        [*git, "config", "remote.origin.url", url],
        [*git, "config", "remote.origin.promisor", "true"],
        [*git, "fetch", "--quiet", "--depth=1", "--filter=blob:none", "origin", film["commit"]],
        [*git, "cat-file", "blob", f"{film['commit']}:{film['path']}"],
    ]
    for command in commands:
        done = subprocess.run(command, capture_output=True, check=False)
        if done.returncode:
            why = done.stderr.decode(errors="replace").strip()
            raise CardboxError(f"{film['name']} does not come from {url}: {why}")
    write_file(path, done.stdout)


def moments(count: int) -> list[int]:
    """Return the numbers of the images of a film of ``count`` that are judged."""
    return [int((moment + 0.5) * count / MOMENTS) for moment in range(MOMENTS)]


def sheet(overlay: Path, results: Results) -> Image:
    """Return the moments of an overlay film as a picture, each with its states below it."""
    wanted, tiles = moments(len(results.state)), list[Image]()
    film = cv2.VideoCapture(str(overlay))
    for number in range(len(results.state)):
        is_there, image = film.read()
        if not is_there:
            break
        if number not in wanted:
            continue
        scale = _TILE_PX / max(image.shape[:2])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        lines = [f"{number}: {results.state[number]}", results.texts_of("state_reason")[number]]
        for name in ("vertical_state", "place_state", "left_hand_state", "right_hand_state"):
            lines.append(f"{name[: -len('_state')]} {results.texts_of(name)[number]}")
        strip = np.zeros((_LINE_PX * len(lines), small.shape[1], 3), np.uint8)
        for at, line in enumerate(lines, 1):
            place = (2, _LINE_PX * at - 5)
            cv2.putText(strip, line, place, 0, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
        tiles.append(np.vstack([small, strip]))
    rows = [np.hstack(tiles[at : at + 4]) for at in range(0, len(tiles) // 4 * 4, 4)]
    return np.asarray(np.vstack(rows), np.uint8)


def figures(film: Row, results: Results) -> Iterator[object]:
    """Yield the cells of a film's row: shares of sure images, %, and those of the judged moments.

    Of shape and distance, ``LIST`` has a letter for each moment: ``+`` right, ``-`` wrong, and
    ``?`` where the eye cannot tell. Their cells are how many right ones are sure, and how many of
    the wrong ones.
    """
    yield from (film["name"], film["kind"], len(results.state))
    sure = {}
    for name, column in _QUANTITIES.items():
        texts = results.state if column == "state" else results.texts_of(column)
        sure[name] = [text in _SURE for text in texts]
        yield f"{np.mean(sure[name]):.0%}"
    hands = [results.texts_of(f"{side}_hand_state") for side in ("left", "right")]
    yield f"{np.mean([text in _SURE for text in sum(hands, ())]):.0%}"
    for name in ("shape", "distance"):
        judged = [
            (verdict, sure[name][at])
            for verdict, at in zip(film[name], moments(len(results.state)), strict=False)
        ]
        for letter in "+-":
            of = [is_sure for verdict, is_sure in judged if verdict == letter]
            yield f"{sum(of)} of {len(of)}"


def main(arguments: list[str] | None = None) -> int:
    """Get and track the films, draw the sheets, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the films")
    parser.add_argument("films", nargs="*", metavar="FILM", help="names; by default all")
    parser.add_argument("--from", dest="source", default="https://github.com", metavar="URL")
    options = parser.parse_args(arguments)
    with LIST.open(encoding="utf-8", newline="") as file:
        films = [
            row for row in csv.DictReader(file) if not options.films or row["name"] in options.films
        ]
    options.folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for film in films:
        path = options.folder / f"{film['name']}{Path(film['path']).suffix}"
        if not path.exists():
            get(film, path, options.source)
        csv_path = options.folder / f"{film['name']}.csv"
        overlay = options.folder / f"{film['name']}.overlay.mp4"
        if not csv_path.exists():
            outputs = ["--csv", str(csv_path), "--video", str(overlay), "--detector", "mediapipe"]
            cardbox(["track", str(path), *film["options"].split(), *outputs, "--force"])
        results = read_results(csv_path)
        encoded = cv2.imencode(".jpg", sheet(overlay, results))[1]
        write_file(options.folder / f"{film['name']}.sheet.jpg", encoded.tobytes())
        rows.append(list(figures(film, results)))
    print(table(HEADER, rows))
    return 0


HEADER = (
    *("film", "kind", "images", "shape", "vertical", "distance", "hands"),
    *("right shape and sure", "wrong shape and sure"),
    *("right distance and sure", "wrong distance and sure"),
)
"""Columns of the table."""


if __name__ == "__main__":
    raise SystemExit(main())
