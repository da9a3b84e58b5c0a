"""Measured damping on the modes of the updated model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model import EigenSolution, damping_by_mode
from femtune.model.response import frf
from femtune.residuals.frf.measured_damping import MeasuredDamping, measured_damping
from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.steps.correlate.facts import array_prefix
from femtune.steps.info.facts import alert_of
from femtune.validation.frfs import squared_deviation

if TYPE_CHECKING:
    from femtune.arrays import Complexes
    from femtune.identification.redrawn import RedrawnTest
    from femtune.residuals import CaseState, Evaluation, Residual
from femtune.steps.equalise.record import MappedDamping, MappedMode


def mapped_damping(start: Evaluation, end: Evaluation, arrays: dict[str, NDArray[Any]]) -> tuple[MappedDamping, ...]:
    """The records of all configurations with an identified test; the FRFs are put into `arrays`.

    Raises
    ------
    FemtuneError : ``correlate.no-damping`` where no mode of the updated model is paired; as `frf`
    """
    records: list[MappedDamping] = []
    for i, (before, after) in enumerate(zip(start.states, end.states)):
        for residual, test in identified_residuals(after.case.on_full_model.residuals):
            key = f"{array_prefix('after', after.case.name, i + 1)}/mapped_damping"
            if not any(f.freq_key == f"{key}_hz" for f in records):
                records.append(_record(residual, test, before, after, key, arrays))
    return tuple(records)


def identified_residuals(residuals: Iterable[Residual]) -> Iterator[tuple[FrfResidual, RedrawnTest]]:
    """FRF residuals that compare an identified test, or measured FRFs with its damping."""
    for one in residuals:
        residual = settled(one)
        if isinstance(residual, FrfResidual) and (test := residual.identified or residual.damped_by) is not None:
            yield residual, test


def _record(
    residual: FrfResidual, test: RedrawnTest, before: CaseState, after: CaseState, key: str, arrays: dict[str, Any]
) -> MappedDamping:
    measured, lines = test.measured, test.measured.freq_hz
    rows, columns = (
        a.align(b)[0]
        for a, b in (
            (residual.measured.responses, measured.responses),
            (residual.measured.references, measured.references),
        )
    )
    raw = measured.values[np.ix_(rows, columns)]
    identified = test.functions_at(lines)[np.ix_(rows, columns)]
    solution, damping, values = _functions(residual, test, after, guided=residual.damped_by is not None)
    arrays |= {f"{key}_hz": lines, f"{key}_test": raw, f"{key}_identified": identified, f"{key}_after": values}
    try:
        _, lacking, first = _functions(residual, test, before)
        arrays[f"{key}_before"] = first
    except FemtuneError:
        # the nominal model may be so far off that none of its modes is paired
        first, lacking = None, None
    return MappedDamping(
        configuration=residual.configuration,
        equalised_percent=100.0 * test.damping_ratio,
        modes=(*_modes(damping, solution), *_lacking(damping, f"{key}_heights", arrays)),
        alerts=tuple(map(alert_of, damping.pairing.notices)),
        missing_before=() if lacking is None else tuple(_lacking(lacking, f"{key}_heights_before", arrays)),
        deviation_before=None if first is None else _deviation(first, raw),
        deviation_after=_deviation(values, raw),
        deviation_identified=_deviation(identified, raw),
        kind=measured.kind,
        outputs=tuple(residual.measured.responses.labels()),
        inputs=tuple(residual.measured.references.labels()),
        freq_key=f"{key}_hz",
        test_values_key=f"{key}_test",
        identified_values_key=f"{key}_identified",
        before_values_key=None if first is None else f"{key}_before",
        after_values_key=f"{key}_after",
    )


def _deviation(values: Complexes, raw: Complexes) -> float:
    return float(np.nanmean(squared_deviation(values, raw, np.isfinite(raw))))


def _functions(
    residual: FrfResidual, test: RedrawnTest, state: CaseState, *, guided: bool = False
) -> tuple[EigenSolution, MeasuredDamping, Complexes]:
    """Modes of the full model at a state, their measured damping, and its FRFs at the measured lines."""
    solution = residual.way.model(state, residual.highest_hz)
    assert isinstance(solution, EigenSolution)
    damping = measured_damping(residual, test, solution, guided=guided)
    ports = residual.places.ports(solution.point.configured, residual.measured)
    functions = frf(
        solution, ports, test.measured.freq_hz, test.measured.kind, residual.way.method,  # type: ignore[arg-type]
        damping=damping_by_mode(damping.ratios.tolist()), residual_vectors=residual.way.residual_vectors,
        decay=test.decay,
    )  # fmt: skip
    return solution, damping, functions.values


def _modes(damping: MeasuredDamping, solution: EigenSolution) -> Iterable[MappedMode]:
    """Modes of the test."""
    zeta, partners = damping.test.damping_ratio, {p.test: p for p in damping.pairing.pairs}
    reasons = {u.test: u.reason for u in damping.pairing.unpaired_test}
    assert zeta is not None
    for i, hertz in enumerate(damping.test.freq_hz):
        pair = partners.get(i)
        yield MappedMode(
            test_hz=float(hertz),
            mode=None if pair is None else pair.model + 1,
            model_hz=None if pair is None else float(solution.freq_hz[pair.model]),
            mac=None if pair is None else float(pair.mac),
            measured_percent=100.0 * float(zeta[i]),
            mapped_percent=None if pair is None else 100.0 * float(damping.ratios[pair.model]),
            reason=reasons.get(i, ""),
            found_hz=float(hertz) if pair is not None and pair.model in damping.found else None,
        )


def _lacking(damping: MeasuredDamping, key: str, arrays: dict[str, Any]) -> Iterable[MappedMode]:
    """Modes of the model without a partner; their heights are put into `arrays`."""
    for one in damping.lacking:
        array_key = f"{key}_{one.mode + 1}"
        arrays[array_key] = one.over_noise
        yield MappedMode(
            test_hz=None, mode=one.mode + 1, model_hz=one.freq_hz, mac=None, measured_percent=None,
            mapped_percent=100.0 * one.damping_ratio, above_noise=one.above_noise, seen_in=one.seen_in,
            heights_key=array_key,
        )  # fmt: skip
