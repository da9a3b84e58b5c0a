"""The page of a mutation test: counts, and every survivor with the reason why it is let live."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from operators import Mutant
from trial import Outcome


@dataclass(frozen=True)
class Judgement:
    """What a reader of the code said of a mutant that survived.

    Parameters
    ----------
    equivalent : no result can tell the mutant from the code, within rounding
    why : one sentence
    """

    equivalent: bool
    why: str


def judgements(path: Path) -> dict[str, Judgement]:
    """By the key of the mutant."""
    rows = tomllib.loads(path.read_text(encoding="utf-8")).get("survivor", [])
    return {row["mutant"]: Judgement(row["equivalent"], row["why"]) for row in rows}


def page(found: Sequence[tuple[Mutant, Outcome]], of: int, seed: int, judged: dict[str, Judgement]) -> str:
    """Markdown."""
    survivors = [m for m, outcome in found if outcome is Outcome.SURVIVED]
    equivalent = [m for m in survivors if m.key in judged and judged[m.key].equivalent]
    others = [m for m in survivors if m not in equivalent]
    counted = len(found) - len(equivalent)
    by_time = sum(outcome is Outcome.KILLED_BY_TIME for _, outcome in found)
    lines = [
        "# Mutation test",
        "",
        "Do the tests notice a small error in the numerical code? `make mutants` changes one operator, number, sign,",
        "name or argument at a time and runs the tests that execute the changed line. A mutant is killed when a test",
        "fails. Text, type annotations, error messages and code that reaches other programs are not mutated.",
        "",
        f"- Sample: {len(found)} of {of} mutants, seed {seed}.",
        f"- Killed: {len(found) - len(survivors)}, {by_time} of them by the limit on processor time.",
        f"- Survived: {len(survivors)}; {len(equivalent)} of them are equivalent to the code.",
        f"- Killed of the {counted} that are not equivalent: {100.0 * (1.0 - len(others) / max(counted, 1)):.1f} %.",
        "",
    ]
    lines += _by_folder(found, equivalent)
    lines += _table("Survivors that are not equivalent", others, judged)
    lines += _table("Equivalent mutants", equivalent, judged)
    return "\n".join(lines)


def _by_folder(found: Sequence[tuple[Mutant, Outcome]], equivalent: Sequence[Mutant]) -> list[str]:
    counted = Counter(_folder(m) for m, _ in found if m not in equivalent)
    killed = Counter(_folder(m) for m, outcome in found if outcome is not Outcome.SURVIVED)
    rows = [f"| {folder} | {counted[folder]} | {killed[folder]} |" for folder in sorted(counted)]
    return ["| folder | mutants, not equivalent | killed |", "| --- | ---: | ---: |", *rows, ""]


def _folder(mutant: Mutant) -> str:
    return Path(mutant.file).parts[2]


def _table(title: str, mutants: Sequence[Mutant], judged: dict[str, Judgement]) -> list[str]:
    if not mutants:
        return []
    unknown = Judgement(False, "not judged")
    rows = [
        f"| {_place(m)} | {_code(m.before)} → {_code(m.after)} | {judged.get(m.key, unknown).why} |"
        for m in sorted(mutants, key=lambda m: (m.file, m.line))
    ]
    return [f"## {title}", "", "| place | change | reason |", "| --- | --- | --- |", *rows, ""]


def _place(mutant: Mutant) -> str:
    file = Path(mutant.file).relative_to("src/femtune")
    return f"`{file}` {mutant.function}".strip()


def _code(text: str) -> str:
    one_line = " ".join(text.split()).replace("|", "\\|")
    return f"`{one_line}`"
