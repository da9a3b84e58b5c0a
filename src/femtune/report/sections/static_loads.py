"""Static displacements under load cases."""

from __future__ import annotations

from femtune.report.document import Block, Column, Table, row
from femtune.report.numbers import NONE, value
from femtune.report.source import Source
from femtune.study.results_response import ResponseResults, StaticResults


def static_loads(source: Source) -> list[Block]:
    """A table each configuration and load; [] without loads."""
    return load_blocks(list(source.results.responses), source.results.study.units.partition("-")[0])


def load_blocks(found: list[ResponseResults], length_unit: str = "") -> list[Block]:
    """The tables of these records; the unit is "" where nobody declares one."""
    names = list(dict.fromkeys(r.configuration for r in found))
    tables: list[Block] = []
    for name in names:
        stages = [r for r in found if r.configuration == name]
        tables += [
            _table(name, len(names) > 1, [s.loads[k] for s in stages], length_unit) for k in range(len(stages[0].loads))
        ]
    return tables


def _table(name: str, named: bool, stages: list[StaticResults], unit: str) -> Table:
    last = stages[-1]
    words = ("Displacement",) if len(stages) == 1 else ("Before", "After")
    turns = any("R" in d.output for d in last.displacements)
    shown = f", {unit}{' or rad' if turns else ''}" if unit else ""
    heads = (Column("Output"), *(Column(word + shown, "right") for word in words))
    rows = tuple(
        row(d.output, *(value(s.displacements[i].value, NONE) for s in stages))
        for i, d in enumerate(last.displacements)
    )
    relief = " The structure is free: motion relative to its rigid motion, loads balanced by inertia."
    note = f"Forces: {', '.join(last.forces)}." + (relief if last.inertia_relief else "")
    return Table(f"{name}: {last.load}" if named else last.load, heads, rows, note)
