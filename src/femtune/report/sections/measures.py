"""Measures that help to choose parameters: order, information, likeness, energies."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Heading, Listing, Table, columns, row
from femtune.report.numbers import NONE, freq, percent, short, unit_fraction
from femtune.study.results_select import GroupEnergy, ModeEnergies, SelectionMeasures

_MOST_MODES = 10


def measures(found: SelectionMeasures | None) -> list[Block]:
    """Sentences and tables; nothing for results without them."""
    if found is None:
        return []
    words = [Listing(found.sentences)] if found.sentences else []
    return [
        Heading("Which parameters to choose"),
        *words,
        choice_table(found),
        *alike_table(found),
        *energy_tables(found),
    ]


def choice_table(found: SelectionMeasures) -> Table:
    """Order of the projection, and what the data know of each."""
    heads = columns("Parameter", ">Order", ">Left %", "Chosen", ">σ alone", ">σ together", ">D-order", ">A-order")
    order = {s.parameter: i for i, s in enumerate(found.subset)}
    rows = []
    for p in sorted(found.information, key=lambda p: order.get(p.parameter, len(order))):
        at = order.get(p.parameter)
        step = None if at is None else found.subset[at]
        taken = (NONE, NONE, "no effect of its own") if step is None or at is None else (
            str(at + 1), percent(step.left_percent), "yes" if step.chosen else "no")  # fmt: skip
        sds = short(p.sd_alone), short(p.sd_together)
        rows.append(row(p.parameter, *taken, *sds, str(p.d_rank), str(p.a_rank)))
    note = (
        "Order: by what each adds to explaining the residual (orthogonal projection); chosen: by more than chance. "
        "σ in units of the prior's: with all other parameters known, and with all unknown; – where others replace it."
    )
    return Table("Choice of parameters", heads, tuple(rows), note)


def alike_table(found: SelectionMeasures) -> list[Block]:
    """Parameters that do nearly the same."""
    rows = [row(f"{p.first}, {p.second}", unit_fraction(p.cosine), NONE) for p in found.pairs]
    rows += [row(", ".join(d.parameters), NONE, short(d.condition_index, "∞")) for d in found.dependences]
    heads = columns("Parameters", ">Cosine", ">Condition index")
    index = short(found.collinearity_index, "∞")
    note = f"Collinearity index of all: {index} (1: all independent; above 15: not all at once)."
    return [Table("Parameters that are alike", heads, tuple(rows), note)] if rows else []


def energy_tables(found: SelectionMeasures) -> list[Block]:
    """A table for each of the first modes."""
    shown = found.energies[:_MOST_MODES]
    more = len(found.energies) - len(shown)
    tables: list[Block] = [_energy(mode) for mode in shown]
    return [*tables, *([Listing((f"{more} more modes in the results.",))] if more > 0 else [])]


def _energy(mode: ModeEnergies) -> Table:
    heads = columns("Group", ">Strain energy %", ">Kinetic energy %", ">Contradiction %")
    title = f"Energies: {mode.configuration}, mode {mode.test_label} ({freq(mode.freq_hz)} Hz)"
    note = ""
    if mode.contradiction_percent is not None:
        note = f"Size of the contradiction: {short(mode.contradiction_percent)} % of the expanded mode."
    return Table(title, heads, tuple(map(_group, mode.groups)), note)


def _group(g: GroupEnergy) -> tuple[Cell, ...]:
    return row(g.group, percent(g.strain_percent), percent(g.kinetic_percent), percent(g.residual_percent))
