"""The live model in the report: what it is made of, how far it can be trusted, and its data for the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Cell, Column, Paragraph, Table, row
from femtune.document.numbers import counted, short
from femtune.document.page_view import (
    LiveCertificateView,
    LiveCheckView,
    LiveConfigurationView,
    LiveCriterionView,
    LiveDrawsView,
    LiveFunctionsView,
    LiveMassView,
    LiveOtherView,
    LiveParameterView,
    LivePartView,
    LiveRegionView,
    LiveTermView,
    LiveView,
    as_stored,
    single,
)
from femtune.units import unit_system

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from femtune.document.document import Block
    from femtune.steps.live.record import (
        LiveCertificate,
        LiveConfiguration,
        LiveDraws,
        LiveFunctions,
        LivePart,
        LiveRegion,
        LiveResults,
        LiveTermRecord,
    )
    from femtune.steps.report_source import ReportSource


def live(source: ReportSource) -> list[Block]:
    """The section."""
    found = source.results.live
    if found is None:
        return [Paragraph("Not computed.")]
    if found.reason:
        return [Paragraph(f"No live model: {found.reason}.")]
    return [_certificate(found), *_remarks(found)]


def _certificate(found: LiveResults) -> Table:
    wide = "ranges of the sliders" if found.narrowed else "bounds"
    functions = any(f.region or f.bounds for c in found.configurations for f in c.functions)
    last = ("FRFs, %",) if functions else ()
    heads = (
        Column("Configuration"), Column("Order", "right"), Column("Where"), Column("Compared with"),
        *(Column(title, "right") for title in ("Points", "Frequency, %", "MAC", "χ², %", *last)),
    )  # fmt: skip
    rows = tuple(
        row(
            c.configuration, str(c.order), where, _other(one), *_errors(one),
            *([_of_functions(c, one, of_region)] if last else []),
        )
        for c in found.configurations
        for where, of_region, one in (
            ("95 % region", True, c.region), ("95 % region", True, c.region_full),
            (wide, False, c.bounds), (wide, False, c.bounds_full),
        )
        if one is not None
    )  # fmt: skip
    note = (
        "Largest differences between the live model and another one at points where both were solved, with the numbers "
        "as they are stored in this page. The points of the ranges are random points and corners. χ² is the sum that "
        "the page computes itself; a χ² below 1 counts as 1. Modes closer than 0.1 % in frequency are compared as one "
        "subspace. When the page is opened, it first solves points whose frequencies are stored. If it finds other "
        "values, it says so and shows no live model."
    )
    if functions:
        note += (
            " χ² in this table is that of the modes alone. FRFs are always compared with the full model, at some of "
            "the points: root of the sum of squares of the differences over the lines, relative to that of the "
            "function."
        )
    return Table("Errors of the live model", heads, rows, note)


def _other(c: LiveCertificate) -> str:
    if c.compared_with == "full model":
        return f"full model, {c.compared_order:,} DOFs"
    return f"reduced model of order {c.compared_order:,}"


def _errors(c: LiveCertificate) -> tuple[Cell | str, ...]:
    corners = f" ({c.corners} corners)" if c.corners else ""
    without = f", {c.without_modes} without modes" if c.without_modes else ""
    sizes = ("–" if v is None else _size(v) for v in (c.frequency_percent, c.mac, c.chi_square_percent))
    return f"{c.points}{corners}{without}", *sizes


def _of_functions(c: LiveConfiguration, one: LiveCertificate, of_region: bool) -> str:
    """The error of the functions, in the row of what they were compared with; that of the other is empty."""
    whole = c.region_full if of_region else c.bounds_full
    found = [e for f in c.functions if (e := f.region if of_region else f.bounds) is not None]
    if not found or (whole is not None and one is not whole):
        return "–"
    worst = max(found, key=lambda e: e.percent)
    return f"{_size(worst.percent)} ({', '.join([worst.function] * bool(worst.function) + [f'{worst.points} points'])})"


def _size(error: float) -> str:
    return "< 0.001" if error < 1e-3 else short(error)


def _remarks(found: LiveResults) -> list[Block]:
    out = [
        "The intervals, the tests of the fit (score and neighbour tests among them) and the verdict of this report are "
        "those of the update; they do not follow the sliders."
    ]
    if found.narrowed:
        out.append(f"The sliders end before the bounds: {found.narrowed}.")
    if found.others:
        kinds = ", ".join(o.kind for o in found.others)
        out.append(f"Not computed again, so that their part of χ² keeps the value of the update: {kinds}.")
    reasons = dict.fromkeys(c.functions_reason for c in found.configurations if c.functions_reason)
    if reasons:
        out.append(f"Measured FRFs are not computed again: {'; '.join(reasons)}.")
    masses = [m for c in found.configurations if (m := c.reduced_mass) is not None]
    if masses:
        worst = max(masses, key=lambda m: m.difference)
        out.append(
            "Criteria of orthogonality follow with the mass that the page reduces to the sensors: it differs from that "
            f"of the full model by {_size(worst.difference)} in an orthogonality at most, at "
            f"{counted(worst.points, 'point')} of both ranges."
        )
    if found.solutions:
        out.append(f"The live model took {counted(found.solutions, 'more solution')} of the full model.")
    return [Paragraph(" ".join(out), "muted")]


# ----------------------------------------------------------------------------------------------------
# Data for the page.


def live_view(source: ReportSource) -> LiveView | None:
    """The data of the live model; None without one."""
    found = source.results.live
    if found is None or found.reason or not found.configurations:
        return None
    return LiveView(
        parameters=tuple(
            LiveParameterView(p.name, p.unit, p.nominal, p.updated, p.lower, p.upper, p.scale, p.interval_95)
            for p in found.parameters
        ),
        narrowed=bool(found.narrowed),
        rejected=_rejected(source),
        mass_unit=_mass_unit(source.results.study.units),
        x=_floats(source, found.x_key),
        region=None if found.region is None else _region(source, found.region),
        draws=None if found.draws is None else _draws(source, found.draws),
        configurations=tuple(_configuration(source, c) for c in found.configurations),
        others=tuple(LiveOtherView(o.kind, o.chi_square) for o in found.others),
    )


def _rejected(source: ReportSource) -> bool:
    """Whether the residuals of the update are no noise of the stated size, at the 1 % level."""
    update = source.results.update
    return update is not None and update.goodness is not None and update.goodness.verdict == "fail"


def _mass_unit(units: str) -> str:
    """Of units length-mass-time; "" where none are declared."""
    parts = units.split("-")
    return parts[1] if len(parts) == 3 else ""


def _floats(source: ReportSource, key: str | None) -> tuple[float, ...]:
    return tuple(_array(source, key).ravel().tolist())


def _array(source: ReportSource, key: str | None) -> NDArray:
    found = source.array(key)
    return np.zeros(0) if found is None else found


def _region(source: ReportSource, region: LiveRegion) -> LiveRegionView:
    keys = (region.at_key, region.rows_key, region.offset_key, region.centre_key, region.precision_key)
    at, rows, offset, centre, precision = (_floats(source, key) for key in keys)
    return LiveRegionView(region.moving, at, rows, offset, region.limit, centre, precision, region.radius_square)


def _draws(source: ReportSource, draws: LiveDraws) -> LiveDrawsView:
    linear = None if draws.linear_key is None else _floats(source, draws.linear_key)
    factors = {f.kind: f.factor for f in draws.factors}
    x = as_stored(_array(source, draws.x_key))
    return LiveDrawsView(draws.source, x, linear, draws.degrees, factors, draws.reason)


def _configuration(source: ReportSource, c: LiveConfiguration) -> LiveConfigurationView:
    polynomials, weights = (_floats(source, key) for key in (c.polynomials_key, c.weights_key))
    return LiveConfigurationView(
        configuration=c.configuration, order=c.order, count=c.count, shift=c.shift,
        theta=_floats(source, c.theta_key), terms=tuple(_term(t, polynomials) for t in c.terms),
        triangles=as_stored(_array(source, c.triangles_key)), sensors=as_stored(_array(source, c.sensors_key)),
        test_labels=c.test_labels, test_freq_hz=c.test_freq_hz,
        test_shapes=as_stored(_array(source, c.test_shapes_key)),
        sensor_labels=c.sensor_labels,
        mass_points=c.mass_points, mass_reason=c.mass_reason,
        mass_rows=None if c.mass_rows_key is None else as_stored(_array(source, c.mass_rows_key)),
        pairs=tuple((p.test, p.mode, p.modes) for p in c.pairs),
        parts=tuple(_part(p, weights) for p in c.parts),
        region=tuple(_errors_view(k) for k in (c.region_full, c.region) if k is not None),
        bounds=tuple(_errors_view(k) for k in (c.bounds_full, c.bounds) if k is not None),
        checks=tuple(
            LiveCheckView(_floats(source, k.x_key), _floats(source, k.eigenvalues_key), k.chi_square, k.functions)
            for k in c.checks
        ),
        functions=tuple(_functions(source, f) for f in c.functions),
        functions_reason=c.functions_reason,
        criteria=tuple(_criteria(source, c)),
        mass=None if c.mass is None else LiveMassView(
            c.mass.updated, c.mass.slopes, tuple((w.mass, w.sd) for w in c.mass.weighed)
        ),
        mass_sensors=() if c.reduced_mass is None else c.reduced_mass.sensors,
    )  # fmt: skip


def _functions(source: ReportSource, f: LiveFunctions) -> LiveFunctionsView:
    test = _array(source, f.test_values_key)
    note = f"Damping of the model: {f.damping}. " + (f"One of {f.every} lines is shown." if f.every > 1 else "")
    found = (("region", f.region), ("bounds", f.bounds))
    return LiveFunctionsView(
        kind=f.kind, ordinate=f.kind.capitalize() + (f", {f.unit}" if f.unit else ""), look=f.look, outputs=f.outputs,
        inputs=f.inputs, freq_hz=as_stored(_array(source, f.freq_key)), test_real=single(test.real),
        test_imaginary=single(test.imag), output_rows=as_stored(_array(source, f.outputs_key)),
        input_rows=as_stored(_array(source, f.inputs_key)), modes=f.modes, ratios=f.damping_ratios,
        ratios_hz=f.damping_hz, hysteretic=f.hysteretic, loss_factor=f.loss_factor, si=_to_si(source), label=f.label,
        form=f.form, every=f.every,
        sd=None if f.sd_key is None else single(_array(source, f.sd_key)),
        shift=None if f.shift_key is None else single(_array(source, f.shift_key)), note=note.strip(),
        errors=tuple((where, e.points, e.percent, e.function) for where, e in found if e is not None),
    )  # fmt: skip


def _to_si(source: ReportSource) -> float:
    """Metre per newton of a unit of length per unit of force."""
    units = unit_system(source.results.study.units)
    return units.length / units.force


_OF_PAIRS = {"frequency error": "frequency", "MAC": "mac"}
_OF_MASS = {
    "cross-orthogonality, diagonal": "diagonal", "cross-orthogonality, off the diagonal": "off_diagonal",
    "self-orthogonality of the test, off the diagonal": "self",
}  # fmt: skip
_OF_FRFS = {
    "FRAC": "frac", "FDAC at equal frequencies, mean over the lines": "fdac",
    "level error of an FRF, mean over the lines": "mean_db", "level error of an FRF, largest": "max_db",
    "resonance frequency error in the FRFs": "resonance",
}  # fmt: skip
LIVE_QUANTITIES = _OF_PAIRS | _OF_MASS | _OF_FRFS
"""Quantities of criteria that the page computes, as `femtune.validation.criteria` names them, and their words there."""


def _criteria(source: ReportSource, c: LiveConfiguration) -> Iterator[LiveCriterionView]:
    """Those of the pairs at the end of the update, and those of FRFs that the update did not use."""
    known = _OF_PAIRS | (_OF_MASS if c.reduced_mass is not None else {})
    found = [one for one in source.results.correlations if one.configuration == c.configuration]
    for one in found[-1].criteria if found else ():
        yield LiveCriterionView(
            one.name, known.get(one.name.removesuffix(f", {one.standard}"), ""), one.sense == "at most", one.limit,
            one.unit, one.measured, one.verdict, one.remark,
        )  # fmt: skip
    validation = source.results.validation
    for v in () if validation is None else validation.verdicts:
        word = _OF_FRFS.get(v.criterion.removesuffix(f", {v.standard}"))
        if v.configuration == c.configuration and word is not None:
            yield LiveCriterionView(
                f"{v.criterion}, {v.data}", word, v.sense == "at most", v.required, v.unit, v.measured, v.verdict,
                v.remark,
            )  # fmt: skip


def _errors_view(c: LiveCertificate) -> LiveCertificateView:
    return LiveCertificateView(
        "the full model" if c.compared_with == "full model" else f"the reduced model of order {c.compared_order}",
        c.points, c.corners, c.without_modes, c.frequency_percent, c.mac, c.chi_square_percent,
    )  # fmt: skip


def _term(t: LiveTermRecord, polynomials: tuple[float, ...]) -> LiveTermView:
    size = int(np.prod(t.shape))
    return LiveTermView(t.kind, t.parameters, t.shape, polynomials[t.first : t.first + size], t.scale)


def _part(p: LivePart, weights: tuple[float, ...]) -> LivePartView:
    first, n = p.weights_first, p.weights_size
    own = None if first is None else weights[first : first + n * n]
    return LivePartView(p.kind, p.quantity, p.form, p.test, p.sd, p.sensors, own, p.common)
