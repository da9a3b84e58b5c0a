"""The table of fields of the deck that no parameter represents, and lines that make the first ones parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Details, Figure, Heading, Paragraph, Table, columns, row
from femtune.document.figures.elements import elements_svg
from femtune.document.numbers import NONE, counted, short, signed_percent, with_unit
from femtune.steps.judge.record.parts import RESERVED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.document.document import Block
    from femtune.steps.judge.record.missing import MissingField, MissingResults
    from femtune.steps.report_source import ReportSource

_MOST_LINES = 3
"""Fields of which lines are given where none was refitted."""
_MOST_ALIKE = 3
"""Fields that look alike, in a row of the table."""


def missing_blocks(source: ReportSource) -> Iterable[Block]:
    """Nothing for results without this test."""
    judged = source.results.judgement
    missing = judged.missing if judged else None
    if missing is None:
        return
    yield from blocks_of(missing, source.arrays)


def blocks_of(found: MissingResults, arrays: Mapping[str, NDArray]) -> Iterable[Block]:
    """A sentence, the first fields in a table, the mesh coloured by what they explain, and lines for the study.

    Parameters
    ----------
    arrays : of the record, by key
    """
    yield Heading("Fields of the deck that are no parameters")
    if found.p_value is None:
        yield Paragraph(f"Not tested: {found.reason}.", "muted")
        return
    yield Paragraph(_sentence(found))
    freed = any(f.refit is not None for f in found.fields)
    heads = columns(
        "Field", "Kind", ">Change", ">Usual range", ">p value", *([">Factor if freed", ">χ² if freed"] if freed else [])
    )
    note = (
        "Each one is tested by itself, by linear extrapolation from the end of the update. The p value takes account "
        "of the number of fields, and of the two other tests of the fit. A change beyond the usual range is not shown. "
        f"χ² without any of them: {short(found.chi_square)}."
    )
    for field in found.fields:
        refit = field.refit
        if refit is not None and refit.mode:
            note += (
                f" Only test mode {refit.mode} asks for {field.name}: its part of χ² changes from "
                f"{short(refit.mode_before)} to {short(refit.mode_after)}, and without this mode the p value of the "
                f"field by itself is {short(refit.p_without_mode)}. A mode that was identified badly looks the same."
            )
            break
    yield Table("", heads, tuple(_row(f)[: len(heads)] for f in found.fields), note)
    if found.corners_key is not None and found.gain_key is not None:
        yield Figure(
            partial(
                elements_svg, arrays[found.corners_key], arrays[found.gain_key], "explains nothing",
                "explains most",
            ), _CAPTION,
            f"mesh coloured by what a change of each element explains; most: {found.fields[0].name}",
        )  # fmt: skip
    refitted = [f for f in found.fields if f.refit is not None] or found.fields[:_MOST_LINES]
    lines = "\n\n".join(f.lines for f in refitted if f.lines)
    if lines and found.p_value < RESERVED:
        yield Details("Lines for the study that make these fields parameters: add one of them and run again", lines)


_CAPTION = (
    "Elements, springs and masses, coloured by the gain of likelihood that a change of one of their fields inside the "
    "usual range brings."
)


def _sentence(found: MissingResults) -> str:
    tested = (
        f"{counted(found.tested, 'candidate')} were tested: fields of the deck, their parts, missing masses, supports"
    )
    unseen = f"; {found.invisible} more have no effect that the parameters do not represent" if found.invisible else ""
    left = f"; {found.left_out} were left out because there are too many" if found.left_out else ""
    assert found.p_value is not None
    if found.p_value >= RESERVED:
        return f"{tested}{unseen}{left}. None would explain the residuals better than noise does."
    return f"{tested}{unseen}{left}. The first ones explain more of the residuals than noise does."


def _row(f: MissingField) -> tuple[Cell, ...]:
    more = len(f.alike) - _MOST_ALIKE
    alike = [*f.alike[:_MOST_ALIKE], *([f"{more} more"] if more > 0 else [])]
    name = f"{f.name}; looks like: {', '.join(alike)}" if alike else f.name
    change, usual = _change(f)
    if f.refit is None:
        return row(name, f.what, change, usual, short(f.p_value), NONE, NONE)
    factor = f"{f.refit.factor:.3f}" if f.largest_mass is None else _mass(f, f.refit.factor)
    factor = factor if f.stiffness is None else _stiffness(f, f.refit.factor)
    factor += " (limit)" if f.refit.at_bound else ""
    return row(name, f.what, change, usual, short(f.p_value), factor, short(f.refit.chi_square))


def _change(f: MissingField) -> tuple[str, str]:
    """The change that is asked for, and the usual range."""
    unknown = "increase" if f.increase else "decrease"
    if f.largest_mass is not None:
        change = unknown if f.change_percent is None else _mass(f, 0.01 * f.change_percent)
        return change, f"up to {_mass(f, 1.0)}"
    if f.stiffness is not None:
        change = (
            "rigid"
            if not f.increase
            else "softer"
            if f.change_percent is None
            else _stiffness(f, 0.01 * f.change_percent)
        )
        return change, f"from {_stiffness(f, 1.0)}"
    usual = f"{signed_percent(f.lower_percent)} … {signed_percent(f.upper_percent)} %"
    return unknown if f.change_percent is None else f"{signed_percent(f.change_percent)} %", usual


def _stiffness(f: MissingField, compliance: float) -> str:
    assert f.stiffness is not None
    return with_unit(f"{f.stiffness / compliance:.2g}", f.stiffness_unit) if compliance > 0.0 else "rigid"


def _mass(f: MissingField, share: float) -> str:
    assert f.largest_mass is not None
    return with_unit(f"{share * f.largest_mass:.2g}", f.mass_unit)
