"""Facts of the deck and of each configuration of the model on the terminal; layout of tables to its width."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import (
    AlertBox,
    Document,
    Heading,
    KeyNumber,
    KeyNumbers,
    Listing,
    Paragraph,
    Section,
    Table,
    columns,
    row,
    without_column,
)
from femtune.document.numbers import NOT_TESTED, counted, listed, signed_percent, value, with_unit
from femtune.steps.info.page import (
    beside_deck_tables,
    cards,
    grounding_dofs,
    grounding_elements,
    held_lines,
    model_check_table,
    named_sets,
    rigid_body_table,
    shape_blocks,
    support_words,
)
from femtune.steps.report_source import Subject

if TYPE_CHECKING:
    from femtune.document.document import Block, Level, Tone
    from femtune.steps.info.record.model import (
        DampingFacts,
        DampingField,
        DeckParameterRecord,
        ModelConfiguration,
        ModelFacts,
    )
    from femtune.study.record import Alert


def damping_blocks(facts: ModelFacts) -> list[Block]:
    """A line for the whole model, one for the modes, and a table by card and field; nothing where it is not known."""
    damping = facts.damping
    if damping is None:
        return []
    lines = [line for line in (_overall(damping), _modal(damping)) if line]
    blocks: list[Block] = [Paragraph(line) for line in lines]
    if damping.fields:
        return [*blocks, _table(damping.fields)]
    return blocks or [Paragraph("Damping: the deck defines none.", "muted")]


def _overall(damping: DampingFacts) -> str:
    """PARAM G, W3 and W4; a G of zero is shown too, as an update may start from it."""
    given = {"G": damping.overall_loss_factor, "W3": damping.overall_omega_rad_s, "W4": damping.element_omega_rad_s}
    units = {"G": "", "W3": " rad/s", "W4": " rad/s"}
    words = ", ".join(f"{name} = {value(x)}{units[name]}" for name, x in given.items() if x is not None)
    return f"Damping of the whole model: {words}." if words else ""


def _modal(damping: DampingFacts) -> str:
    return f"Damping of modes (SDAMPING), {damping.modal_damping}." if damping.modal_damping else ""


def _table(fields: tuple[DampingField, ...]) -> Table:
    rows = [row(f.field, f.kind, str(f.cards), _range(f), str(f.elements)) for f in fields]
    return Table("Damping", columns("Field", "Kind", ">Cards", ">Values", ">Elements"), tuple(rows))


def _range(field: DampingField) -> str:
    low, high = value(field.lowest), value(field.highest)
    return low if low == high else f"{low} to {high}"


_ORDER: tuple[Level, ...] = ("problem", "warning")
_IN_TABLES = ("deck.ignored-cards", "deck.ignored-param", "deck.dof-set")
"""Notices that repeat the tables of cards, PARAMs and named sets."""

_MOST_ROWS = 5
"""First rows of a table that are shown on the terminal; a note gives the number of the others."""
_AXES = ("x", "y", "z")
_ENTRY_ROUNDING = 1e-9
"""Entries of the mass matrix below this fraction of the largest are rounding and are shown as zero."""


def info_document(subject: Subject, facts: ModelFacts) -> Document:
    """Cards, PARAMs and notices, then one section for each configuration."""
    level: Level = "info" if all(c.rigid_body_check.verdict == "pass" for c in facts.configurations) else "warning"
    deck = Section("deck", f"{subject.word} {subject.deck}", tuple(_deck(subject, facts)))
    each = (Section(c.configuration, c.configuration, tuple(_configuration(subject, c))) for c in facts.configurations)
    return subject.document(_verdict(facts), level, (deck, *each))


def _verdict(facts: ModelFacts) -> str:
    remarks: dict[str, list[str]] = {}
    for c in facts.configurations:
        remarks.setdefault(c.rigid_body_check.verdict, []).append(c.configuration)
    words = {"pass": "passed", "fail": "failed", "not tested": NOT_TESTED}
    if len(facts.configurations) == 1:
        return f"Rigid-body check: {words[next(iter(remarks))]}."
    parts = [f"{words[verdict]} in {listed(names)}" for verdict, names in remarks.items()]
    return f"Rigid-body check: {'; '.join(parts)}." if parts else "There is no configuration."


def _deck(subject: Subject, facts: ModelFacts) -> list[Block]:
    return [
        *(cards(_beside(subject, facts)) if subject.has_cards else []),
        *named_sets(facts),
        *_parameters(facts.deck_parameters),
        *damping_blocks(facts),
        *model_check_table(facts.checks),
        *shape_blocks(facts),
        *beside_deck_tables(facts.beside_deck),
        *_notices(facts.notices),
    ]


def _beside(subject: Subject, facts: ModelFacts) -> ModelFacts:
    """Files named as seen from the folder of the deck."""
    folder = Path(subject.deck).parent

    def near(name: str) -> str:
        return str(Path(name).relative_to(folder)) if Path(name).is_relative_to(folder) else name

    ignored = tuple(c.model_copy(update={"first_file": near(c.first_file)}) for c in facts.cards_ignored)
    return facts.model_copy(update={"cards_ignored": ignored})


def _parameters(parameters: tuple[DeckParameterRecord, ...]) -> list[Block]:
    """A line each effect, those with the same remark together."""
    groups: dict[str, list[str]] = {}
    for p in sorted(parameters, key=lambda p: not p.understood):
        remark = f" ({p.remark})" if p.remark else ""
        head = f"PARAM {'understood' if p.understood else 'ignored'}{remark}"
        groups.setdefault(head, []).append(f"{p.name}={p.value}" if p.value else p.name)
    return [Paragraph(f"{head}: {', '.join(names)}.") for head, names in groups.items()]


def _notices(notices: tuple[Alert, ...]) -> list[Block]:
    """Problems and warnings in full, the others by kind, but for those that repeat the tables."""
    loud = sorted((n for n in notices if n.level in _ORDER), key=lambda n: _ORDER.index(n.level))
    boxes = alert_boxes(loud)
    quiet = [n for n in notices if n.level not in _ORDER and n.code not in _IN_TABLES]
    counts = Counter(n.code for n in quiet)
    return boxes + [_quiet(n, counts[n.code]) for n in {n.code: n for n in reversed(quiet)}.values()]


def _quiet(first: Alert, count: int) -> Block:
    more = f"; and {counted(count - 1, 'more notice')} of this kind" if count > 1 else ""
    return AlertBox("info", first.code, f"{first.sentence}{more}", first.where)


def _configuration(subject: Subject, c: ModelConfiguration) -> list[Block]:
    return [
        KeyNumbers((*_facts(c), *_mass(subject, c))),
        *_inertia(subject, c),
        *_rigid_body(c),
        *_held(c),
    ]


def _facts(c: ModelConfiguration) -> list[KeyNumber]:
    return [
        KeyNumber("Changes to the deck", "; ".join(c.overlay) or "none"),
        KeyNumber("Grids", str(c.grids)),
        KeyNumber("Free DOFs", str(c.free_dofs)),
        KeyNumber("Supports", _supports(c)),
        *([KeyNumber("Constraints", "; ".join(c.constraints))] if c.constraints else []),
        *([KeyNumber("AUTOSPC", f"{counted(len(c.held_dofs), 'DOF')} constrained")] if c.held_dofs else []),
    ]


def _supports(c: ModelConfiguration) -> str:
    state, words = support_words(c)
    return words if c.supports else f"none: {words or state}"


def _mass(subject: Subject, c: ModelConfiguration) -> list[KeyNumber]:
    weighed = "not measured"
    if c.weighed_mass is not None:
        difference = signed_percent(c.mass_difference_percent)
        weighed = f"measured {with_unit(value(c.weighed_mass), subject.mass_unit)}, difference {difference} %"
    return [
        KeyNumber(
            "Mass", f"{'not known' if c.mass is None else with_unit(value(c.mass), subject.mass_unit)}, {weighed}"
        ),
        KeyNumber("Centre of gravity", _centre(subject, c)),
    ]


def _centre(subject: Subject, c: ModelConfiguration) -> str:
    if c.inertia is None or c.centre_of_gravity is None:
        return "not known"
    # the radius of gyration is the length beside which a coordinate is rounding
    radius = abs(max(abs(v) for line in c.inertia for v in line) / c.mass) ** 0.5 if c.mass else 0.0
    return with_unit(", ".join(_clean(v, radius) for v in c.centre_of_gravity), subject.length_unit)


def _clean(number: float, scale: float) -> str:
    return value(number if abs(number) > _ENTRY_ROUNDING * scale else 0.0)


def _inertia(subject: Subject, c: ModelConfiguration) -> list[Table]:
    if c.inertia is None:
        return []
    scale = max(abs(v) for line in c.inertia for v in line)
    rows = [row(axis, *(_clean(v, scale) for v in line)) for axis, line in zip(_AXES, c.inertia, strict=True)]
    unit = f", {subject.mass_unit}·{subject.length_unit}²" if subject.mass_unit else ""
    return [Table(f"Inertia about the centre of gravity{unit}", columns("", *(f">{a}" for a in _AXES)), tuple(rows))]


def _rigid_body(c: ModelConfiguration) -> list[Block]:
    """The sentence; numbers and places only where the check was not passed."""
    check = c.rigid_body_check
    tone: Tone = "good" if check.verdict == "pass" else "poor"
    blocks: list[Block] = [Paragraph(f"Rigid-body check, {check.verdict}: {check.sentence}.", tone)]
    if check.verdict == "pass":
        return blocks
    energies = [without_column(rigid_body_table([c]), "Verdict")] if check.verdict == "fail" else []
    tables = [*(without_column(e, "Explanation") for e in energies), *grounding_elements([c]), *grounding_dofs([c])]
    return blocks + [_beginning(without_column(table, "Configuration")) for table in tables]


def _beginning(table: Table) -> Table:
    """The first rows of a table, and how many more there are."""
    more = len(table.rows) - _MOST_ROWS
    rest = f"and {counted(more, 'more row')}. " if more > 0 else ""
    return replace(table, rows=table.rows[:_MOST_ROWS], note=f"{rest}{table.note}")


def _held(c: ModelConfiguration) -> list[Block]:
    lines = held_lines(c)
    return [Heading("DOFs constrained by AUTOSPC"), Listing(tuple(lines))] if lines else []
