"""Table of what a change of each constant changes.

    python -m lab.tools.constants DATA POINTS.csv [--only tracking/legs.py ...] --output FILE.md

A constant is a name of a module in ``FOLDERS`` with numbers that follow from no other constant and
are no indices. Those that compiled code uses, or a module while it is imported, are only counted:
for each of them, everything would be compiled or imported again. POINTS.csv has a detector's points
of the film.
"""

from __future__ import annotations

import argparse
import ast
import io
import multiprocessing
import sys
import threading
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import cardbox_tracker
from cardbox_tracker.commands.track import track
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.tracking.estimate import TRACKING
from cardbox_tracker.tracking.precompile import compile_for_films

PACKAGE = Path(cardbox_tracker.__file__).parent
FOLDERS = "search", "terms", "tracking", "measuring", "segmentation"
FILM = "real_gestures/P0_24_lopen"
CASES: Mapping[str, Mapping[str, Any]] = {
    FILM: {},
    "person_a": {},
    "two_people_crossing": {"people": 2},
    "two_webcams": {"cameras": ("cam0", "cam1")},
}
GIVEN = {"background": (0.0, 1.5), "stature_m": 1.75, "start_s": 6.0, "end_s": 6.6}
HEADER = """# Constants

`python -m lab.tools.constants DATA POINTS.csv --output FILE.md` makes this table. It halves one
constant at a time if it is from 0.5 to 1, doubles it else, and tracks 0.6 s of the recordings,
until one changes.
*Shape* is the mean way, cm, of shoulders, elbows and hands relative to the middle of the shoulders,
*place* that of the middle, *state* the share of images, %, that become `tracking` or no longer are.
Changes by another seed, which are noise: {noise}.

{count} constants in {lines} lines of code; {kinds}.

| constant | value | changes |
|---|---|---|
"""


def constants_of(text: str) -> Iterator[tuple[str, str, bool]]:
    """Yield name and value of a module's constants, and whether they are used before it runs."""
    body = ast.parse(text).body
    early = set[str]()
    for node in body:
        is_function = isinstance(node, ast.FunctionDef | ast.ClassDef)
        marks = " ".join(map(ast.unparse, getattr(node, "decorator_list", ())))
        if not is_function or "kernel" in marks or "inlined" in marks:
            read = (one for one in ast.walk(node) if isinstance(one, ast.Name))
            early |= {one.id for one in read if isinstance(one.ctx, ast.Load)}
    for node in body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        names = [one.id for one in ast.walk(target) if isinstance(one, ast.Name)]
        parts = node.value.elts if isinstance(node.value, ast.Tuple) else []
        values = parts if len(names) == len(parts) > 1 else [node.value] * len(names)
        if [getattr(one, "value", None) for one in values] != list(range(len(names))):
            for name, value in zip(names, values, strict=True):
                if name.isupper() and _is_free(value):
                    yield name, ast.unparse(value), name in early


def _is_free(value: ast.expr) -> bool:
    """Return whether a value has a fraction, or a whole number and no other constant."""
    within = list(ast.walk(value))
    kinds = {type(one.value) for one in within if isinstance(one, ast.Constant)}
    names = [one.id for one in within if isinstance(one, ast.Name)]
    return float in kinds or (int in kinds and not any(n.isupper() or n == "range" for n in names))


def code_lines(text: str) -> int:
    """Return the number of lines of a module that have more than comments and strings."""
    kinds = tokenize.NAME, tokenize.OP, tokenize.NUMBER
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return len({token.start[0] for token in tokens if token.type in kinds})


def changed(value: Any) -> Any:
    """Return half of numbers from 0.5 to 1, the double of others, and so those of a container."""
    if isinstance(value, Mapping):
        return {key: changed(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(map(changed, value))
    if isinstance(value, bool) or not isinstance(value, int | float | np.ndarray | np.number):
        return value
    is_share = not isinstance(value, int) and np.all(abs(np.abs(value) - 0.75) <= 0.25)
    return value / 2 if is_share else value * 2


def tracked(case: str, options: Any, change: tuple[str, str], seed: int) -> tuple[Any, set[Any]]:
    """Track a case with a constant of a module changed, unless its name is empty.

    Return the table's numbers, keypoints (m, 6, 3, n) and states (m, n) of m people in n images, or
    the name of an error; and the names that functions used, each with its file and with None.
    """
    module, name = change
    if name:
        before = getattr(import_module(module), name)
        for one in [one for one in sys.modules.values() if vars(one).get(name) is before]:
            setattr(one, name, changed(before))
    codes = set[CodeType]()

    def see(frame: FrameType, *_: Any) -> None:
        codes.add(frame.f_code)

    if not name:
        threading.setprofile(see)
        sys.setprofile(see)
    more = {"detector": str(options.points)} if case == FILM else {}
    try:
        result = track(options.data / case / "bag", seed=seed, **GIVEN, **CASES[case], **more)
    except Exception as error:
        return type(error).__name__, set()
    sys.setprofile(None)
    people = list((result.people or {1: result}).values())
    at = [[[p.numbers[f"{k}_{x}"] for x in "xyz"] for k in KEYPOINT_NAMES] for p in people]
    states = np.array([p.state for p in people]) == TRACKING
    used = {(file, n) for code in codes for file in (code.co_filename, None) for n in code.co_names}
    return (np.array([list(p.numbers.values()) for p in people]), np.array(at), states), used


def compared(before: Any, now: Any) -> str:
    """Return the change of shape, place and states in words; "" if all numbers are the same."""
    if isinstance(now, str) or now[0].shape != before[0].shape:
        return now if isinstance(now, str) else "other people or images"
    if all(map(np.array_equal, map(np.nan_to_num, before), map(np.nan_to_num, now))):
        return ""
    way_cm = 100 * (now[1] - before[1])
    middle_cm = way_cm[:, [0, 3]].mean(axis=1, keepdims=True)
    shape, place = (np.nanmean(np.linalg.norm(w, axis=2)) for w in (way_cm - middle_cm, middle_cm))
    return f"shape {shape:.1f}, place {place:.1f}, state {100 * (before[2] != now[2]).mean():.0f}"


def _apart(case: str, options: Any, change: tuple[str, str] = ("", ""), seed: int = 0) -> Any:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(tracked, (case, options, change, seed))


def main() -> None:
    """Change the constants, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path, help="folder of the recordings")
    parser.add_argument("points", type=Path, help="points of the film")
    parser.add_argument("--only", nargs="+", default=FOLDERS, help="files or folders")
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()
    files = {p: p.read_text("utf-8") for f in FOLDERS for p in sorted((PACKAGE / f).glob("*.py"))}
    found = {file: list(constants_of(text)) for file, text in files.items()}
    count, lines = sum(map(len, found.values())), sum(map(code_lines, files.values()))
    print(f"{count} constants in {lines} lines of code, {1000 * count / lines:.0f} in 1000")
    compile_for_films()
    for file in files:
        import_module(f"cardbox_tracker.{file.parent.name}.{file.stem}")
    cases = {case: _apart(case, options) for case in CASES}
    noise = {
        case: compared(base, _apart(case, options, seed=1)[0]) for case, (base, _) in cases.items()
    }
    shown_noise = "; ".join(f"`{case}` {change}" for case, change in noise.items())
    rows, kinds = list[str](), Counter[str]()
    for file, constants in found.items():
        place = f"{file.parent.name}/{file.name}"
        for name, value, is_early in constants if place.startswith(tuple(options.only)) else ():
            changes, tried = "", list[str]()
            for case, (base, used) in cases.items() if not is_early else ():
                if not changes and (str(file) if name[0] == "_" else None, name) in used:
                    module = f"cardbox_tracker.{file.parent.name}.{file.stem}"
                    changes = compared(base, _apart(case, options, (module, name))[0])
                    tried.append(case)
            none = "not used on these recordings" if not tried else "nothing"
            none = "not changed: compiled, or used at import" if is_early else none
            kinds["changes" if changes else none.split(":")[0]] += 1
            where = f" (`{'`, `'.join(tried[-1:] if changes else tried)}`)" if tried else ""
            rows.append(f"| `{place}` `{name}` | `{value}` | {changes or none}{where} |\n")
            print(rows[-1], end="", flush=True)
    shown = ", ".join(f"{kind}: {number}" for kind, number in kinds.items())
    header = HEADER.format(noise=shown_noise, count=count, lines=lines, kinds=shown)
    write_file(options.output, "".join([header, *rows]))


if __name__ == "__main__":
    main()
