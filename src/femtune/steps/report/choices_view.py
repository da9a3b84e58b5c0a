"""Data of the page for choices by hand: what can be chosen, what is chosen already, and the files that it is of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.document.page_view import (
    ChoicesView,
    FieldChoiceView,
    InputView,
    ModeChoicesView,
    single,
)
from femtune.steps.correlate.page.correlation import shown_columns

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.report_source import ReportSource


def choices_view(source: ReportSource) -> ChoicesView | None:
    """The choices at the initial values; None where no modes were compared, or the files are not known."""
    results = source.results
    compared = [c for c in results.correlations if c.stage == "before"]
    if not compared:
        return None
    inputs = tuple(
        InputView(file.path, file.sha256)
        for file in results.provenance.input_files
        if file.sha256 and file.path != results.study.choices_file
    )
    if not inputs:
        return None
    fields = _fields(source)
    chosen = {one.name for one in fields if one.chosen}
    kept = tuple(p.name for p in results.parameters if p.name not in chosen)
    return ChoicesView(inputs, tuple(_modes(source, c) for c in compared), tuple(fields), kept)


def _modes(source: ReportSource, c: CorrelationResults) -> ModeChoicesView:
    shown = shown_columns(c)
    mac = source.array(c.mac_key)
    values = np.full((len(c.mac_test_labels), len(shown)), np.nan) if mac is None else np.asarray(mac)[:, shown]
    sensors = [s for s in source.results.sensors if s.configuration == c.configuration]
    off = tuple(one.test_dof for s in sensors for one in s.unmatched)
    return ModeChoicesView(
        configuration=c.configuration,
        test_labels=c.mac_test_labels,
        test_freq_hz=c.mac_test_freq_hz,
        numbers=tuple(c.mac_model_numbers[j] for j in shown),
        model_freq_hz=tuple(c.mac_model_freq_hz[j] for j in shown),
        # −1 where there is none, as in the window of moving shapes
        mac=single(np.nan_to_num(values, nan=-1.0)),
        pairs=tuple((p.test_label, p.model_number) for p in c.pairs),
        fixed=tuple((p.test_label, p.model_number) for p in c.pairs if p.fixed_by_hand),
        never=tuple((p.test_label, p.model_number) for p in c.never_pairs),
        close=c.close_modes,
        left_out=tuple((m.test_label, m.reason) for m in c.left_out if m.test_label in c.mac_test_labels),
        sensors=tuple(one.test_dof for s in sensors for one in s.matched) + off,
        off=off,
    )


def _fields(source: ReportSource) -> list[FieldChoiceView]:
    """Fields that can become parameters, those that are some with their own names and bounds."""
    model, results = source.results.model, source.results
    known = {
        p.fields[0]: p
        for p in results.parameters
        if p.fields and not p.unit and not p.tie and p.elements is None and p.lower is not None
    }
    taken = {field for p in results.parameters for field in p.fields}
    found = []
    for one in model.fields if model is not None else ():
        p = known.get(one.field)
        if p is not None and p.lower is not None and p.upper is not None and p.lower > 0.0:
            found.append(FieldChoiceView(p.name, one.field, one.what, one.value, p.lower, p.upper, True, p.fields[1:]))
        elif one.field not in taken:
            found.append(FieldChoiceView(one.name, one.field, one.what, one.value, one.lower, one.upper, False))
    return found
