"""Sections of the report: sine sweeps, random vibration and transients compared with the initial and updated model."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Figure, Heading, Paragraph, Table, columns, row
from femtune.document.figures.vibration import VibrationCurve, VibrationPanel, vibration_svg
from femtune.document.numbers import NONE, as_sentence, freq, short, signed_percent

if TYPE_CHECKING:
    from collections.abc import Callable

    from femtune.document.document import Block
    from femtune.steps.report_source import ReportSource
    from femtune.steps.validate.record.validation import ValidationResults
    from femtune.steps.vibration.record import VibrationPoint, VibrationResults


def vibration_blocks(source: ReportSource, validation: ValidationResults) -> list[Block]:
    """A table and a picture for each test, or the reason why there is none."""
    return [block for test in validation.vibrations for block in _blocks(source, test)]


def _blocks(source: ReportSource, test: VibrationResults) -> list[Block]:
    head = Heading(f"{test.name}: {test.excitation} ({test.configuration})")
    if test.problem:
        return [head, Paragraph(f"Not computed: {test.problem}")]
    damping = as_sentence(test.damping)
    stated = f"Source: {as_sentence(test.damping_source)}" if test.damping_source else "Its source is not stated."
    band = ""
    if test.compared_hz is not None:
        band = f" Compared from {test.compared_hz[0]:g} to {test.compared_hz[1]:g} Hz."
    if test.compared_s is not None:
        band = f" Compared from {test.compared_s[0]:g} to {test.compared_s[1]:g} s."
    table = _TABLES[test.kind](test)
    return [head, Paragraph(f"{damping} {stated}{band}{_modes(test)}"), table, *_figure(source, test)]


def _modes(test: VibrationResults) -> str:
    """The modes of the response, and what their truncation costs."""
    if test.modes is None or test.truncation_percent is None:
        return ""
    return (
        f" {test.modes} {'mode' if test.modes == 1 else 'modes'} up to {test.modes_to_hz:.4g} Hz, for excitation up to "
        f"{test.highest_hz:.4g} Hz; the upper ones change a level by {short(test.truncation_percent)} % at most."
    )


_LEVELS = (">Test", ">Before", ">After", ">Error before %", ">Error %")


def _sweep_peaks(test: VibrationResults) -> Block:
    more = (">Test Hz", ">Before Hz", ">After Hz", ">Frequency error before %", ">Frequency error %")
    heads = columns("Point", *_LEVELS, *more)
    rows = tuple(
        row(
            p.output, *_three(p, "peak"), freq(p.test_peak_hz), freq(p.before_peak_hz), freq(p.peak_hz),
            *_frequency_errors(p),
        )
        for p in test.points
    )  # fmt: skip
    return Table("Largest response in the sweep", heads, rows)


def _frequency_errors(p: VibrationPoint) -> tuple[str, str]:
    before, after = _errors(p, "peak_hz")
    ends = (p.before_peak_at_end or p.test_peak_at_end, p.peak_at_end or p.test_peak_at_end)
    return tuple("no resonance" if end else error for end, error in zip(ends, (before, after)))  # type: ignore[return-value]


def _rms(test: VibrationResults) -> Block:
    heads = columns("Point", ">Test RMS", ">RMS before", ">RMS after", ">Error before %", ">Error %")
    return Table("Random vibration", heads, tuple(row(p.output, *_three(p, "rms")) for p in test.points))


def _transient_peaks(test: VibrationResults) -> Block:
    heads = columns("Point", *_LEVELS, ">Test s", ">Before s", ">After s")
    rows = tuple(
        row(p.output, *_three(p, "peak"), short(p.test_peak_s), short(p.before_peak_s), short(p.peak_s))
        for p in test.points
    )
    return Table("Largest magnitude in the transient", heads, rows)


_TABLES: dict[str, Callable[[VibrationResults], Block]] = {
    "sweep": _sweep_peaks, "random": _rms, "transient": _transient_peaks,
}  # fmt: skip


def _three(p: VibrationPoint, name: str) -> tuple[str, ...]:
    """Test, before and after, and the two errors."""
    values = (short(getattr(p, head + name)) for head in ("test_", "before_", ""))
    return (*values, *_errors(p, name))


def _errors(p: VibrationPoint, name: str) -> tuple[str, str]:
    test = getattr(p, f"test_{name}")
    models = (getattr(p, head + name) for head in ("before_", ""))
    before, after = (NONE if m is None or test is None else signed_percent(100.0 * (m / test - 1.0)) for m in models)
    return before, after


def _figure(source: ReportSource, test: VibrationResults) -> list[Block]:
    """Test, initial and updated model of each point over frequency or time."""
    keys = test.curves
    if keys is None:
        return []
    of = {
        "test": (keys.test_lines_key, keys.test_key),
        "before": (keys.before_lines_key, keys.before_key),
        "after": (keys.after_lines_key, keys.after_key),
    }
    curves = [
        (look, np.asarray(source.array(at)), np.asarray(source.array(values)))
        for look, (at, values) in of.items()
        if at is not None and values is not None
    ]
    ordinate = {"sweep": "amplitude", "random": "spectral density", "transient": "response"}[test.kind]
    panels = [
        VibrationPanel(
            p.output, ordinate, tuple(VibrationCurve(look, lines, values[i]) for look, lines, values in curves),
            test.compared_hz, in_time=test.kind == "transient",
        )
        for i, p in enumerate(test.points)
    ]  # fmt: skip
    alt = f"Responses of {test.name}: test, model before and after the update"
    return [Figure(partial(vibration_svg, panels), f"{test.name}, {test.excitation}.", alt, wide=True)]
