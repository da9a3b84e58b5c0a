"""Mass beside weighed mass, rigid motions, completeness of modes, cards, held DOFs."""

from __future__ import annotations

from femtune.report.document import (
    AlertBox,
    Block,
    Cell,
    Heading,
    Listing,
    Paragraph,
    Table,
    columns,
    row,
    table_or_none,
)
from femtune.report.numbers import NONE, counted, freq, short, signed_percent, value
from femtune.report.source import Source
from femtune.study.results_base import Stage
from femtune.study.results_model import ModelConfiguration, ModelFacts, ModelModes

_MOTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
_LISTED = 60
_STAGES: dict[Stage, str] = {"before": "before", "after": "after", "after as written": "written deck"}


def checks(source: Source) -> list[Block]:
    """Everything that was checked about the model before it was trusted."""
    model = source.results.model
    if model is None:
        return [Paragraph("Not run: the model was not built.")]
    return [
        _mass(model),
        *_inertia(model),
        _rigid_body(model),
        *_grounding(model),
        _modes(source),
        *_cards(model),
        *_held(model),
        Heading("Notices while reading"),
        *(AlertBox(n.level, n.code, n.sentence, n.where) for n in model.notices),
        *([] if model.notices else [Paragraph("There were none.")]),
    ]


def _mass(model: ModelFacts) -> Block:
    heads = columns(
        "Configuration",
        ">Grids",
        ">Free DOFs",
        ">Mass",
        ">Weighed",
        ">Difference %",
        ">Centre x",
        ">y",
        ">z",
        "Supports",
    )
    return Table("Mass and supports (units of the study)", heads, tuple(_mass_row(c) for c in model.configurations))


def _mass_row(c: ModelConfiguration) -> tuple[Cell, ...]:
    return row(
        c.configuration,
        str(c.grids),
        str(c.free_dofs),
        value(c.mass),
        value(c.weighed_mass, "not weighed"),
        signed_percent(c.mass_difference_percent),
        *map(short, c.centre_of_gravity),
        "; ".join(c.supports) or "free",
    )


def _inertia(model: ModelFacts) -> list[Block]:
    heads = columns("Configuration", ">Ixx", ">Iyy", ">Izz", ">Ixy", ">Ixz", ">Iyz")
    rows = [
        row(c.configuration, *(short(c.inertia[i][j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))))
        for c in model.configurations
    ]
    return [Table("Inertia about the centre of gravity (entries of the tensor)", heads, tuple(rows))]


def _rigid_body(model: ModelFacts) -> Block:
    heads = columns("Configuration", *(f">{m}" for m in _MOTIONS), "Verdict", "In words")
    rows = [
        row(c.configuration, *_energies(c), c.rigid_body_check.verdict, c.rigid_body_check.sentence)
        for c in model.configurations
    ]
    note = "Strain energy of six rigid motions of the model without supports, relative to its parts; zero is perfect."
    return Table("Rigid-body check", heads, tuple(rows), note)


def _energies(c: ModelConfiguration) -> list[str]:
    energies = c.rigid_body_check.relative_energies
    return [short(e) for e in energies] if len(energies) == len(_MOTIONS) else [NONE] * len(_MOTIONS)


def _grounding(model: ModelFacts) -> list[Block]:
    rows = [
        row(c.configuration, g.dof, short(g.force)) for c in model.configurations for g in c.rigid_body_check.worst_dofs
    ]
    heads = columns("Configuration", "DOF", ">Force or moment")
    return [Table("Where rigid motions meet forces", heads, tuple(rows))] if rows else []


def _modes(source: Source) -> Block:
    heads = columns("Configuration", "Stage", ">Modes", ">Rigid-body", ">Shift Hz", ">Below it", ">Counted", "In words")
    rows = [_sturm(m) for m in source.results.modes]
    return table_or_none("Was a mode missed? (Sturm count)", heads, rows, "Modes were not solved: not run.")


def _sturm(m: ModelModes) -> tuple[Cell, ...]:
    counted_ = str(m.sturm_count) if m.sturm_count is not None else "not tested"
    below = str(m.modes_below_shift) if m.modes_below_shift is not None else NONE
    agree = m.sturm_count is not None and m.sturm_count == m.modes_below_shift
    words = m.sturm_sentence or ("no mode was missed" if agree else NONE)
    return row(
        m.configuration, _STAGES[m.stage], str(len(m.freq_hz)), str(m.rigid_body_modes),
        freq(m.sturm_shift_hz), below, counted_, words,
    )  # fmt: skip


def _cards(model: ModelFacts) -> list[Block]:
    used = ", ".join(f"{c.name} {c.count}" for c in model.cards_read) or "none"
    ignored = [row(c.name, str(c.count), f"{c.first_file}:{c.first_line}", c.reason) for c in model.cards_ignored]
    params = [
        row(p.name, p.value, "understood" if p.understood else "ignored", p.remark or NONE)
        for p in model.deck_parameters
    ]
    return [
        Heading("Cards"),
        Paragraph(f"Read: {used}."),
        table_or_none(
            "Cards ignored", columns("Card", ">Count", "First at", "Reason"), ignored, "No card was ignored."
        ),
        table_or_none("PARAM", columns("Name", "Value", "Effect", "Remark"), params, "The deck has no PARAM."),
    ]  # fmt: skip


def _held(model: ModelFacts) -> list[Block]:
    """Many DOFs held for the same reason share a sentence; the results file lists each."""
    lines = [line for c in model.configurations for line in _held_in(c)]
    return [Heading("DOFs held by AUTOSPC"), Listing(tuple(lines)) if lines else Paragraph("None was held.")]


def _held_in(c: ModelConfiguration) -> list[str]:
    reasons = dict.fromkeys(h.reason for h in c.held_dofs)
    return [
        _held_line(c.configuration, reason, [h.dof for h in c.held_dofs if h.reason == reason]) for reason in reasons
    ]


def _held_line(configuration: str, reason: str, dofs: list[str]) -> str:
    more = f" … and {len(dofs) - _LISTED} more in results.json" if len(dofs) > _LISTED else ""
    return f"{configuration}, {counted(len(dofs), 'DOF')}, {reason}: {' '.join(dofs[:_LISTED])}{more}"
