"""How often faults of decks, studies and tests are reported: python run.py [--decks DIR] [--evidence DIR].

Each kind of fault is planted in each of ten small decks that can have it, and `femtune check` must name its cause. The
level is the share of sound models that raise an alarm: the ten decks, and those of a folder.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from decks import DECKS, Model
from faults import FAULTS, Fault, sound

from femtune.errors import FemtuneError
from femtune.steps.check.run import check_study
from femtune.study.study import load_study

NAME = "benchmark_health.md"
ALARMS = frozenset(code for fault in FAULTS for code in fault.codes) - {"deck.inactive-set", "study.units-doubtful"}
"""Codes that count as an alarm in a sound model. Public decks declare no units, and some select no supports."""


@dataclass(frozen=True)
class Trial:
    """A fault in a deck, and what was told."""

    deck: str
    fault: str
    codes: tuple[str, ...]
    found: bool


def trial(number: int, fault: Fault, folder: Path) -> Trial | None:
    """A fault in one of the decks; None if the deck cannot have it."""
    planted = sound(DECKS[number](), folder)
    if not fault.plant(planted):
        return None
    problems = check_study(planted.write(folder)).record.problems
    codes = tuple(dict.fromkeys(p.code for p in problems))
    return Trial(planted.model.name, fault.name, codes, bool(set(codes) & set(fault.codes)))


def trials(folder: Path) -> Iterator[Trial]:
    """All faults in all decks."""
    for number in range(len(DECKS)):
        for k, fault in enumerate(FAULTS):
            found = trial(number, fault, folder / f"{number}-{k}")
            if found is not None:
                yield found


def alarms_of_sound_decks(folder: Path, decks: Sequence[Callable[[], Model]] = DECKS) -> dict[str, list[str]]:
    """Alarms of the ten decks as they are."""
    found: dict[str, list[str]] = {}
    for i, build in enumerate(decks):
        model = build()
        problems = check_study(sound(model, folder / str(i)).write(folder / str(i))).record.problems
        found[model.name] = [p.code for p in problems if p.code in ALARMS]
    return found


def alarms_of_files(decks: Path) -> dict[str, list[str]]:
    """Alarms of all decks of a folder that can be read."""
    found: dict[str, list[str]] = {}
    for path in sorted(p for p in decks.rglob("*") if p.suffix in (".bdf", ".dat", ".nas")):
        try:
            study = load_study(path)
        except FemtuneError:
            continue
        notices = (*study.built.notices, *study.notices)
        found[str(path.relative_to(decks))] = [n.code for n in notices if n.level != "info" and n.code in ALARMS]
    return found


def page(tried: Sequence[Trial], sound_decks: dict[str, list[str]], files: dict[str, list[str]]) -> str:
    """The page of the results."""
    found = sum(t.found for t in tried)
    false = [name for name, codes in {**sound_decks, **files}.items() if codes]
    count = len(sound_decks) + len(files)
    rows = []
    for fault in FAULTS:
        mine = [t for t in tried if t.fault == fault.name]
        missed = ", ".join(t.deck for t in mine if not t.found) or "–"
        rows.append(f"| {fault.name} | `{fault.codes[0]}` | {sum(t.found for t in mine)} of {len(mine)} | {missed} |")
    lines = [
        "# Benchmark: faults that are reported",
        "",
        f"{len(FAULTS)} kinds of faults were planted in ten small decks, each in every deck that can have it.",
        f"`femtune check` named the cause in {found} of {len(tried)} ({100 * found / len(tried):.1f} %).",
        f"Of {count} sound models {len(false)} raised an alarm{': ' + ', '.join(false) if false else ''}.",
        "",
        "| fault | reported as | found | missed in |",
        "| --- | --- | --- | --- |",
        *rows,
        "",
        f"Sound models: the ten decks with their studies, and {len(files)} public decks that can be read.",
        "`make bench-health` repeats this.",
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    """Plant, check, write the page."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--decks", type=Path, help="a folder of sound decks")
    asked.add_argument("--evidence", type=Path, help="the folder for the page")
    given = asked.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tried, sound_decks = list(trials(folder)), alarms_of_sound_decks(folder / "sound")
    text = page(tried, sound_decks, {} if given.decks is None else alarms_of_files(given.decks))
    if given.evidence is not None:
        (given.evidence / NAME).write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
