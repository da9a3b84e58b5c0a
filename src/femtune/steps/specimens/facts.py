"""The comparison of nominally identical specimens, as records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.steps.update.facts.update import citations
from femtune.steps.validate.facts import scatter_of_test
from femtune.uncertainty import adjusted, common_test, common_test_of_estimates, spread_of
from femtune.uncertainty.specimens import PAPERS, SIGNIFICANCE

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.info.record.model import ModelModes
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study
    from femtune.uncertainty import CommonTest
    from femtune.updating import UpdateResult
from femtune.steps.specimens.record import (
    CommonTestRecord,
    SpecimenFrequency,
    SpecimenMode,
    SpecimenParameter,
    SpecimenResults,
    SpecimenUpdate,
    SpecimenValue,
    SpreadRecord,
)

_LEAST_SPECIMENS = 2
"""Values from which a spread is computed: one value has none."""


_LEAST_PROBABILITY = 1e-6
"""Probability below which only this limit is stated: the distribution is not known so accurately in its tails."""


@dataclass(frozen=True, eq=False)
class Compared:
    """What is known of the modes before and after the update."""

    before: Sequence[CorrelationResults]
    after: Sequence[CorrelationResults]
    modes_before: Sequence[ModelModes]
    modes_after: Sequence[ModelModes]


def specimen_results(
    study: Study, joint: UpdateResult, separate: Mapping[str, UpdateResult], compared: Compared
) -> SpecimenResults | None:
    """The specimens of a study after its update; None where it has none."""
    if study.specimens is None:
        return None
    return SpecimenResults(
        specimens=study.specimens.names,
        not_calibrated=tuple(name for name in study.specimens.names if name not in calibrated_specimens(study)),
        separate=tuple(_separate(study, joint, name, update) for name, update in separate.items()),
        parameters=tuple(_with_verdicts(list(_parameters(study, joint, separate)))),
        frequencies=tuple(_frequencies(study, compared)),
        common=_common(study, joint, separate),
        citations=citations(PAPERS),
    )


def calibrated_specimens(study: Study) -> set[str]:
    """Specimens with data that the update uses."""
    return {case.entry.specimen or "" for case in study.cases if case.used is not None}


def _separate(study: Study, joint: UpdateResult, name: str, update: UpdateResult) -> SpecimenUpdate:
    return SpecimenUpdate(
        specimen=name,
        ok=update.status.ok,
        message=update.status.value,
        chi_square_joint=_squares(study, joint, name),
        chi_square=_squares(study, update, name),
        residuals=len(update.after.residuals),
    )


def _squares(study: Study, update: UpdateResult, specimen: str) -> float:
    cases = {case.name for case in study.cases if case.entry.specimen == specimen}
    return sum(value for (configuration, _, _), value in update.after.squares.items() if configuration in cases)


def _common(study: Study, joint: UpdateResult, separate: Mapping[str, UpdateResult]) -> CommonTestRecord | None:
    assert study.specimens is not None
    shared = [p for p in study.parameters.free if study.in_study(p.name) == p.name]
    if not separate or not shared:
        return None
    after = [update.after for update in separate.values()]
    if any(b.samples is not None and b.without_distribution for at in after for b in at.weighted):
        test = _of_estimates([p.name for p in shared], list(separate.values()))
        if test is None:
            return None
    else:
        freedom = sum(at.independent for at in after) - sum(len(update.active) for update in separate.values())
        squares = sum(_squares(study, update, name) for name, update in separate.items())
        restrictions = len(shared) * (len(separate) - 1)
        test = common_test(sum(_squares(study, joint, name) for name in separate), squares, restrictions, freedom)
    chance = f"than chance explains ({_probability(test.p_value)})"
    words = (
        f"the separate calibrations fit better {chance}: some common parameter differs between the specimens"
        if test.p_value < SIGNIFICANCE
        else f"the separate calibrations fit no better {chance}: nothing contradicts the common parameters"
    )
    return CommonTestRecord(
        increase=test.increase, restrictions=test.restrictions, p_value=test.p_value, scaled=test.scaled, sentence=words
    )


def _of_estimates(names: Sequence[str], separate: Sequence[UpdateResult]) -> CommonTest | None:
    """The test by the separate values, of the parameters that all calibrations determine; None if there are none."""
    at = [[found.parameters.index(name) for name in names] for found in separate]
    known = np.all([np.isfinite(found.covariance.sd[rows]) for found, rows in zip(separate, at)], axis=0)
    if not known.any() or len(separate) < _LEAST_SPECIMENS:
        return None
    rows = [np.array(one)[known] for one in at]
    return common_test_of_estimates(
        [found.x[one] for found, one in zip(separate, rows)],
        [found.covariance.matrix[np.ix_(one, one)] for found, one in zip(separate, rows)],
    )


def _parameters(study: Study, joint: UpdateResult, separate: Mapping[str, UpdateResult]) -> Iterable[SpecimenParameter]:
    assert study.specimens is not None
    by_name = {p.name: p for p in joint.parameters.free}
    for name in dict.fromkeys(study.in_study(p.name) for p in joint.parameters.free):
        expanded = study.specimens.expand(name)
        individual = name in study.specimens.individual
        names = expanded if individual else expanded * len(study.specimens.names)
        values = tuple(_value(s, p, joint, separate.get(s)) for s, p in zip(study.specimens.names, names))
        p = by_name[names[0]]
        known = [n for s, n in zip(study.specimens.names, names) if s in calibrated_specimens(study)]
        yield SpecimenParameter(
            name=name, unit=p.unit, individual=individual, nominal=p.nominal, values=values,
            spread=_joint_spread(joint, known) if individual else _separate_spread(values),
        )  # fmt: skip


def _value(specimen: str, name: str, joint: UpdateResult, separate: UpdateResult | None) -> SpecimenValue:
    sd, alone = joint.sd[name], np.nan if separate is None else separate.sd[name]
    return SpecimenValue(
        specimen=specimen,
        parameter=name,
        value=joint.values[name],
        sd=float(sd) if np.isfinite(sd) else None,
        at_bound=name in joint.at_bound,
        separate_value=None if separate is None else separate.values[name],
        separate_sd=float(alone) if np.isfinite(alone) else None,
        separate_at_bound=separate is not None and name in separate.at_bound,
    )


def _joint_spread(joint: UpdateResult, names: Sequence[str]) -> SpreadRecord | None:
    """The covariance of individual values is full, because they share the common parameters."""
    if len(names) < _LEAST_SPECIMENS:
        return None
    at = [joint.parameters.index(name) for name in names]
    scale = joint.parameters.scale[at]
    covariance = joint.covariance.matrix[np.ix_(at, at)] * np.outer(scale, scale)
    return spread_record(np.array([joint.values[name] for name in names]), covariance)


def _separate_spread(values: Sequence[SpecimenValue]) -> SpreadRecord | None:
    estimates = [(v.separate_value, v.separate_sd) for v in values if v.separate_value is not None]
    sd = np.array([np.nan if s is None else s for _, s in estimates])
    return spread_record(np.array([float(v) for v, _ in estimates]), np.diag(sd**2))


def spread_record(values: Reals, covariance: Reals | None) -> SpreadRecord | None:
    """Spread of values (n,) with the covariance (n, n) of their errors; those without standard deviation are left out
    of the test, all are where `covariance` is None."""
    if len(values) < _LEAST_SPECIMENS:
        return None
    mean, sd = float(np.mean(values)), float(np.std(values, ddof=1))
    known = np.zeros(len(values), bool) if covariance is None else np.diag(covariance) > 0.0
    spread = None
    if covariance is not None and known.sum() >= _LEAST_SPECIMENS:
        spread = spread_of(values[known], covariance[np.ix_(known, known)])
    return SpreadRecord(
        mean=mean,
        sd=sd,
        cov_percent=100.0 * sd / abs(mean) if mean else None,
        stated_sd=None if spread is None else spread.stated_sd,
        real_sd=None if spread is None else spread.real_sd,
        chi_square=None if spread is None else spread.chi_square,
        degrees_of_freedom=None if spread is None else spread.freedom,
        p_value=None if spread is None else spread.p_value,
        p_adjusted=None,
        verdict="not tested",
        sentence="" if covariance is None else "not tested: fewer than two values have a standard deviation",
    )


def _with_verdicts(parameters: Sequence[SpecimenParameter]) -> Iterable[SpecimenParameter]:
    """Individual parameters and common ones are families of tests of their own."""
    for individual in (True, False):
        mine = [p for p in parameters if p.individual is individual]
        spreads = _judged([p.spread for p in mine])
        yield from (p.model_copy(update={"spread": spread}) for p, spread in zip(mine, spreads))


def _judged(spreads: Sequence[SpreadRecord | None]) -> list[SpreadRecord | None]:
    """The spreads with verdicts that take into account how many of them are tested."""
    tested = [s.p_value for s in spreads if s is not None and s.p_value is not None]
    several = iter(adjusted(tested))
    return [_verdict(s, next(several)) if s is not None and s.p_value is not None else s for s in spreads]


def _probability(p: float) -> str:
    return f"p = {p:.2g}" if p >= _LEAST_PROBABILITY else f"p < {_LEAST_PROBABILITY:g}"


def _verdict(spread: SpreadRecord, p: float) -> SpreadRecord:
    real = p < SIGNIFICANCE
    words = (
        f"real: larger than the uncertainty of the values explains ({_probability(p)})"
        if real
        else f"explained by the uncertainty of the values ({_probability(p)})"
    )
    return spread.model_copy(update={"p_adjusted": p, "verdict": "real" if real else "explained", "sentence": words})


def _frequencies(study: Study, compared: Compared) -> Iterable[SpecimenFrequency]:
    states: dict[object, list[StudyCase]] = {}
    for case in study.cases:
        states.setdefault(case.configured.configuration.state, []).append(case)
    for cases in states.values():
        rows = list(_of_state(study, cases, compared))
        spreads = _judged([row.test for row in rows])
        yield from (row.model_copy(update={"test": spread}) for row, spread in zip(rows, spreads))


def _of_state(study: Study, cases: Sequence[StudyCase], compared: Compared) -> Iterable[SpecimenFrequency]:
    """Modes that were measured on some specimen; without measured modes those of the models, by number."""
    initial = next((m for m in compared.modes_before if m.configuration == cases[0].name), None)
    if initial is None:
        return
    before = {case.name: _pairs(compared.before, case.name) for case in cases}
    after = {case.name: _pairs(compared.after, case.name) for case in cases}
    calibrated = calibrated_specimens(study)
    numbers = {p.model_number for name in before for p in (before[name] or after[name]).values()}
    by_number = not numbers
    for number in sorted(numbers or range(initial.rigid_body_modes + 1, len(initial.freq_hz) + 1)):
        if number > len(initial.freq_hz):
            continue
        modes = []
        for case in cases:
            if by_number:
                modes.append(_model_mode(case, compared.modes_after, number))
            else:
                modes.append(_measured_mode(case, before[case.name], after[case.name], number))
        yield SpecimenFrequency(
            configurations=tuple(case.name for case in cases),
            mode=number,
            before_hz=initial.freq_hz[number - 1],
            modes=tuple(modes),
            test=_test_spread(study, cases, modes),
            model=spread_record(
                np.array([m.after_hz for m in modes if m.after_hz is not None and m.specimen in calibrated]), None
            ),
        )


def _pairs(correlations: Sequence[CorrelationResults], name: str) -> dict[str, ModePairRecord]:
    return {p.test_label: p for c in correlations if c.configuration == name for p in c.pairs}


def _measured_mode(
    case: StudyCase, before: Mapping[str, ModePairRecord], after: Mapping[str, ModePairRecord], number: int
) -> SpecimenMode:
    """The test mode that is paired with a mode of the initial model; with one of the updated model if it was paired
    with none before."""
    at_first = {p.model_number: label for label, p in before.items()}
    later = {p.model_number: label for label, p in after.items() if label not in before}
    label = at_first.get(number, later.get(number, ""))
    pair, first = after.get(label), before.get(label)
    known = pair or first
    return SpecimenMode(
        specimen=case.entry.specimen or "",
        configuration=case.name,
        test_label=label,
        test_hz=None if known is None else known.test_freq_hz,
        after_hz=None if pair is None else pair.model_freq_hz,
    )


def _model_mode(case: StudyCase, modes: Sequence[ModelModes], number: int) -> SpecimenMode:
    frequencies = next((m.freq_hz for m in modes if m.configuration == case.name), ())
    hz = frequencies[number - 1] if number <= len(frequencies) else None
    return SpecimenMode(
        specimen=case.entry.specimen or "", configuration=case.name, test_label="", test_hz=None, after_hz=hz
    )


def _test_spread(study: Study, cases: Sequence[StudyCase], modes: Sequence[SpecimenMode]) -> SpreadRecord | None:
    values, sd = [], []
    for case, mode in zip(cases, modes):
        if mode.test_hz is not None and case.modal is not None:
            relative = scatter_of_test(study, case, case.modal.test.labels.index(mode.test_label))
            values.append(mode.test_hz)
            sd.append(np.nan if relative is None else relative * mode.test_hz)
    return spread_record(np.array(values), np.diag(np.square(sd)) if sd else None)
