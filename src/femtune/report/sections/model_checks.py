"""What an update cannot mend: mass, lumping, mesh."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.report.document import Block, Table, columns, row
from femtune.report.numbers import NONE, short
from femtune.report.sections.verdict_cell import verdict_cell
from femtune.study.results_checks import ModelCheck


def model_check_table(checks: Sequence[ModelCheck]) -> list[Block]:
    """A row each check; configurations with the same outcome in the same words share one."""
    joined: dict[tuple[str, str, str, str, str], list[str]] = {}
    for c in checks:
        measured = NONE if c.measured is None else f"{short(c.measured)} %"
        key = (c.check, f"≤ {short(c.limit)} %", measured, c.verdict, c.sentence)
        joined.setdefault(key, []).append(c.configuration)
    heads = columns("Configuration", "Check", ">Required", ">Found", "Verdict", "In words")
    rows = tuple(
        row(", ".join(names), check, limit, measured, verdict_cell(verdict), sentence)
        for (check, limit, measured, verdict, sentence), names in joined.items()
    )
    note = "An update cannot mend these: their errors end in its parameters."
    return [Table("Mass and mesh before the update", heads, rows, note)] if rows else []
