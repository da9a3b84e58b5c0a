"""Sections of the report: checks of mass, lumping and mesh, completeness of the modes, cards, AUTOSPC."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Cell, Heading, Listing, Paragraph, Table, columns, row, table_or_none
from femtune.document.numbers import NONE, counted, freq, short, signed_percent, value
from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.fem.checks import STRAIN_FREE
from femtune.steps.modes.page.modes import mesh_table, sturm
from femtune.steps.validate.page import verdict_cell

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.info.record.checks import ModelCheck
    from femtune.steps.info.record.model import BesideDeck, ElementShapeTest, ModelConfiguration, ModelFacts
    from femtune.steps.report_source import ReportSource


_WITHOUT_EFFECT = tuple(
    f"deck.{name}"
    for name in (
        "inactive-set",
        "unselected-set",
        "after-enddata",
        "nonstructural-unused",
        "surplus-field",
        "other-section",
    )
)
"""Notices of cards or fields that have no effect although their kind is read."""


def model_check_table(checks: Sequence[ModelCheck]) -> list[Block]:
    """A row each check; configurations with the same outcome in the same words share one."""
    joined: dict[tuple[str, str, str, str, str], list[str]] = {}
    for c in checks:
        measured = NONE if c.measured is None else f"{short(c.measured)} %"
        key = (c.check, f"≤ {short(c.limit)} %", measured, c.verdict, c.sentence)
        joined.setdefault(key, []).append(c.configuration)
    heads = columns("Configuration", "Check", ">Required", ">Found", "Verdict", "Explanation")
    rows = tuple(
        row(", ".join(names), check, limit, measured, verdict_cell(verdict), sentence)
        for (check, limit, measured, verdict, sentence), names in joined.items()
    )
    note = "Updating cannot correct these errors; it would absorb them into the parameters."
    return [Table("Mass and mesh before the update", heads, rows, note)] if rows else []


def shape_blocks(facts: ModelFacts) -> list[Block]:
    """A row each test that some element does not pass, or that all pass; nothing in older results."""
    shapes = facts.element_shapes
    if shapes is None:
        return []
    limits = f" Limits of the deck: {', '.join(shapes.given)}." if shapes.given else ""
    words = ", ".join(f'"{word}"' for word in shapes.ignored)
    limits += f" Ignored words of GEOMCHECK: {words}." if words else ""
    failed = [t for t in shapes.tests if t.beyond]
    if not failed:
        return [Paragraph(f"Shapes of elements: {shapes.sentence}.{limits}")]
    heads = columns("Test", "Measure", ">Limit", ">Beyond it", ">Of", "Worst elements")
    note = f"Names and default limits are the usual ones of Nastran's GEOMCHECK.{limits}"
    return [Table("Elements out of shape", heads, tuple(map(_shape_row, failed)), note)]


_MOST_WORST_ELEMENTS = 3
"""Elements that are listed in a cell of the table; more do not fit one line."""


def _shape_row(test: ElementShapeTest) -> tuple[Cell, ...]:
    unit = "°" if test.unit else ""
    shown = ", ".join(f"{e.card} {e.element} ({short(e.value)}{unit})" for e in test.worst[:_MOST_WORST_ELEMENTS])
    more = " …" if test.beyond > _MOST_WORST_ELEMENTS else ""
    limit = f"{'≥' if test.least else '≤'} {short(test.limit)}{unit}"
    beyond = Cell(str(test.beyond), tone="poor" if test.degenerate else "")
    return row(test.test, test.meaning, limit, beyond, str(test.tested), shown + more)


def mesh_tables(checks: Sequence[ModelCheck]) -> list[Block]:
    """The modes of each configuration whose mesh was checked."""
    with_modes = [c for c in checks if c.modes]
    return [mesh_table(c, len(with_modes) > 1) for c in with_modes]


_MOST_RANGES = 5
"""Ranges of grid points that are listed: AUTOSPC may constrain thousands of DOFs, which must fit into a line or two."""


def held_lines(c: ModelConfiguration) -> list[str]:
    """A sentence each reason: how many, in which directions, at which points; the results list each."""
    reasons = dict.fromkeys(h.reason for h in c.held_dofs)
    return [_line(reason, [h.dof for h in c.held_dofs if h.reason == reason]) for reason in reasons]


def _line(reason: str, names: Sequence[str]) -> str:
    kinds = _by_kind(names)
    groups = [f"{' '.join(directions)} of {_points(nodes)}" for directions, nodes in kinds]
    left = any(len(_ranges(nodes)) > _MOST_RANGES for _, nodes in kinds)
    rest = " (results.json, or femtune info --json, lists each)" if left else ""
    return f"{counted(len(names), 'DOF')}, {reason}: {'; '.join(groups) or ', '.join(names[:_MOST_RANGES])}{rest}"


def _by_kind(names: Iterable[str]) -> list[tuple[tuple[str, ...], list[int]]]:
    """Directions that are held together and the points where they are, most points first; [] for unknown names."""
    by_node: dict[int, list[str]] = {}
    kinds: dict[tuple[str, ...], list[int]] = {}
    try:
        for dof in map(parse_dof, names):
            by_node.setdefault(dof.node, []).append(dof.direction)
    except FemtuneError:
        return []
    for node, directions in sorted(by_node.items()):
        kinds.setdefault(tuple(directions), []).append(node)
    return sorted(kinds.items(), key=lambda kind: -len(kind[1]))


def _points(nodes: Sequence[int]) -> str:
    ranges = _ranges(nodes)
    shown = ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in ranges[:_MOST_RANGES])
    left = sum(b - a + 1 for a, b in ranges[_MOST_RANGES:])
    return f"{counted(len(nodes), 'point')}, {shown}{f' and {left} more' if left else ''}"


def _ranges(nodes: Sequence[int]) -> list[tuple[int, int]]:
    """Runs of numbers without a gap, of ascending numbers."""
    ranges: list[tuple[int, int]] = []
    for node in nodes:
        if ranges and node == ranges[-1][1] + 1:
            ranges[-1] = ranges[-1][0], node
        else:
            ranges.append((node, node))
    return ranges


def beside_deck_tables(comparisons: Sequence[BesideDeck]) -> list[Block]:
    """The elastic modes of the external solver and those of the deck, for page and terminal: one table per input."""
    heads = columns("Mode", ">Solver Hz", ">Deck Hz", ">Difference %", ">MAC", "Alike")
    used = "The update begins with derivatives of the deck."
    unused = "Derivatives are those of the solver alone."
    tables = []
    for each in comparisons:
        rows = tuple(
            row(
                str(m.number), freq(m.freq_hz), freq(m.deck_hz), signed_percent(m.difference_percent),
                NONE if m.mac is None else f"{m.mac:.3f}", "yes" if m.alike else Cell("no", tone="poor"),
            )
            for m in each.modes
            if m.difference_percent is not None
        )  # fmt: skip
        title = f"{each.configuration}: the solver beside femtune's own model of the deck"
        tables.append(Table(title, heads, rows, used if each.derivatives else unused))
    return [table for table in tables if table.rows]


_MOTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
_ENERGY_ROUNDING = 1e-12
"""Relative strain energy below which its value is rounding, so that only the limit is shown."""


def checks(source: ReportSource) -> list[Block]:
    """Everything that was checked about the model before it was trusted."""
    model = source.results.model
    if model is None:
        return [Paragraph("The model was not built.")]
    return [
        _mass(model),
        *model_check_table(source.results.model_checks),
        *mesh_tables(source.results.model_checks),
        *shape_blocks(model),
        *beside_deck_tables(model.beside_deck),
        *_inertia(model),
        rigid_body_table(model.configurations),
        *grounding_elements(model.configurations),
        *grounding_dofs(model.configurations),
        *sturm(source),
        *(_cards(model) if source.results.study.has_deck else []),
        *_held(model),
        Heading("Notices of the deck reader"),
        *alert_boxes(model.notices),
        *([] if model.notices else [Paragraph("There are no notices.")]),
    ]


def _mass(model: ModelFacts) -> Block:
    heads = columns(
        "Configuration",
        ">Grids",
        ">Free DOFs",
        ">Mass",
        ">Measured mass",
        ">Difference %",
        ">Centre x",
        ">y",
        ">z",
        "Supports",
    )
    return Table("Mass and supports (units of the model)", heads, tuple(_mass_row(c) for c in model.configurations))


def _mass_row(c: ModelConfiguration) -> tuple[Cell, ...]:
    return row(
        c.configuration,
        str(c.grids),
        str(c.free_dofs),
        value(c.mass),
        value(c.weighed_mass, "not measured"),
        signed_percent(c.mass_difference_percent),
        *([NONE] * 3 if c.centre_of_gravity is None else map(short, c.centre_of_gravity)),
        ": ".join(filter(None, support_words(c))) if not c.supports else "; ".join(c.supports),
    )


def _inertia(model: ModelFacts) -> list[Block]:
    heads = columns("Configuration", ">Ixx", ">Iyy", ">Izz", ">Ixy", ">Ixz", ">Iyz")
    rows = [
        row(c.configuration, *(short(c.inertia[i][j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))))
        for c in model.configurations
        if c.inertia is not None
    ]
    if not rows:
        return []
    return [Table("Inertia about the centre of gravity (entries of the tensor)", heads, tuple(rows))]


def rigid_body_table(configurations: Sequence[ModelConfiguration]) -> Table:
    """Relative energies of the rigid motions with the verdict."""
    heads = columns("Configuration", *(f">{m}" for m in _MOTIONS), "Verdict", "Explanation")
    rows = [
        row(c.configuration, *_energies(c), c.rigid_body_check.verdict, c.rigid_body_check.sentence)
        for c in configurations
    ]
    note = (
        "Strain energy of the six rigid-body motions of the model without supports, relative to the magnitudes of its "
        "terms; ideally zero."
    )
    return Table("Rigid-body check", heads, tuple(rows), note)


def _energies(c: ModelConfiguration) -> list[str]:
    energies = c.rigid_body_check.relative_energies
    return [_energy(e) for e in energies] if len(energies) == len(_MOTIONS) else [NONE] * len(_MOTIONS)


def _energy(energy: float) -> str:
    """What is rounding is not shown as if it were a number."""
    return f"< {short(_ENERGY_ROUNDING)}" if 0.0 < abs(energy) < _ENERGY_ROUNDING else short(energy)


def grounding_elements(configurations: Sequence[ModelConfiguration]) -> list[Table]:
    """Elements that strain in a rigid motion; [] where there are none."""
    rows = [
        row(c.configuration, f"{g.card} {g.element}", g.motion, short(g.relative_energy))
        for c in configurations
        for g in c.rigid_body_check.grounding_elements
    ]
    heads = columns("Configuration", "Element", "Rigid motion", ">Relative energy")
    note = (
        "Elements that are strained when the model without supports moves as a rigid body: the ten with the largest "
        "strain energy, relative to the sum of the magnitudes of its terms (no unit)."
    )
    return [Table("Elements that constrain the model to ground", heads, tuple(rows), note)] if rows else []


def grounding_dofs(configurations: Sequence[ModelConfiguration]) -> list[Table]:
    """DOFs where a rigid motion meets a force; [] where there are none."""
    rows = [row(c.configuration, g.dof, short(g.force)) for c in configurations for g in c.rigid_body_check.worst_dofs]
    heads = columns("Configuration", "DOF", ">Relative force")
    note = (
        "Residual forces and moments in the worst of the six rigid-body motions, relative to the sum of the magnitudes "
        "of the terms (no unit); the ten largest are listed. Ideally they are zero; above "
        f"{short(STRAIN_FREE)} the model is constrained."
    )
    return [Table("Residual forces in rigid-body motions", heads, tuple(rows), note)] if rows else []


def cards(model: ModelFacts) -> list[Block]:
    """Cards that were read, in one sentence, and a table of those that were ignored."""
    used = ", ".join(f"{c.name} {c.count}" for c in model.cards_read) or "none"
    ignored = [row(c.name, str(c.count), f"{c.first_file}:{c.first_line}", c.reason) for c in model.cards_ignored]
    heads = columns("Card", ">Count", "First occurrence", "Reason")
    # sets, lines and fields without effect are told by notices
    partly = any(a.code.startswith(_WITHOUT_EFFECT) for a in model.notices)
    none = (
        "Every kind of card was read; the remarks below name cards without effect."
        if partly
        else "No card was ignored."
    )
    return [Paragraph(f"Read: {used}."), table_or_none("Cards ignored", heads, ignored, none)]


def named_sets(model: ModelFacts) -> list[Block]:
    """Sets of degrees of freedom that the deck names; [] where there are none."""
    rows = [row(s.name, str(s.dofs), s.effect) for s in model.dof_sets]
    return [Table("Sets of degrees of freedom", columns("Set", ">DOFs", "Effect"), tuple(rows))] if rows else []


def _cards(model: ModelFacts) -> list[Block]:
    params = [
        row(p.name, p.value, "understood" if p.understood else "ignored", p.remark or NONE)
        for p in model.deck_parameters
    ]
    return [
        Heading("Cards"),
        *cards(model),
        *named_sets(model),
        table_or_none("PARAM", columns("Name", "Value", "Effect", "Remark"), params, "The deck has no PARAM entry."),
    ]  # fmt: skip


def _held(model: ModelFacts) -> list[Block]:
    lines = [f"{c.configuration}, {line}" for c in model.configurations for line in held_lines(c)]
    block = Listing(tuple(lines)) if lines else Paragraph("AUTOSPC constrained no DOF.")
    return [Heading("DOFs constrained by AUTOSPC"), block]


def support_words(c: ModelConfiguration) -> tuple[str, str]:
    """How the model is held, in a word, and by what."""
    check = c.rigid_body_check
    if c.supports:
        return "constrained", "; ".join(c.supports)
    if check.grounded and check.verdict == "not tested":
        return "in the matrices", "the constrained DOFs were removed from the matrices"
    return ("none", "but the rigid-body check shows a constraint to ground") if check.grounded else ("free", "")
