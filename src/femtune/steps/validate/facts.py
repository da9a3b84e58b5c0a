"""Validation on data that the update did not use, as records."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.files.study_file.residual import FrequencyResidual, FrfResidual
from femtune.residuals import state_at
from femtune.steps.correlate.criteria import criteria_profile, of_frfs
from femtune.steps.info.checks import mesh_not_checked
from femtune.steps.validate.frf_validation import predicted_frfs, predicted_resonances
from femtune.steps.vibration.record import VibrationResults
from femtune.steps.vibration.run import vibration_verdicts
from femtune.study.cases import HELD_OUT
from femtune.study.same_test import is_same_test
from femtune.validation import (
    assess,
    frequency_miss,
    goodness_of_fit,
    held_out_sensors,
    not_tested,
)
from femtune.validation.criteria import (
    FREQUENCY,
    OF_FRFS,
    OF_VIBRATION,
    OWN,
    RMS,
    SELF,
    SHAPE,
    SWEEP_AMPLITUDE,
    SWEEP_FREQUENCY,
)
from femtune.validation.frfs import assess_frfs

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.correlation import Correlation
    from femtune.files.study_file import ConfigurationEntry
    from femtune.model import EigenSolution
    from femtune.steps.correlate.versions import ModelRecords
    from femtune.steps.respond.record import ResponseResults
    from femtune.steps.validate.frf_validation import UnusedFrfs
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study
    from femtune.updating import UpdateResult
    from femtune.validation import (
        CriteriaProfile,
        Criterion,
        FrequencyMiss,
        GoodnessOfFit,
        HeldOutSensors,
        Verdict,
    )
from typing import TYPE_CHECKING

from femtune.judge.whitened import prior_blocks
from femtune.steps.validate.record.validation import (
    GoodnessResults,
    HeldOutShape,
    KindOfResiduals,
    Prediction,
    ValidationResults,
    ValidationVerdict,
)
from femtune.updating.covariance import parameter_covariance

if TYPE_CHECKING:
    from femtune.correlation import Correlation
    from femtune.steps.judge.record.parts import PartRecord
    from femtune.study.study import Study
    from femtune.updating import UpdateResult


def judged_tests(case: StudyCase) -> list[int]:
    """Positions of the test modes that the update did not use and that the criteria refer to."""
    if case.modal is None:
        return []
    kept = range(len(case.modal.test)) if case.entry.use == "validation" else case.held.modes
    return sorted(set(kept) - set(case.modal.left_out))


@dataclass(frozen=True)
class Sensitivities:
    """∂(f/f_test)/∂x of the predicted frequencies, by configuration and position of the test mode."""

    found: dict[tuple[str, int], Reals] = field(default_factory=dict)

    def add(self, case: StudyCase, solution: EigenSolution) -> None:
        """Those of a configuration at its solved modes; nothing where it has no mode to judge by."""
        tests = judged_tests(case)
        if case.modal is None or not tests:
            return
        state = state_at(case.modal, solution.point.x, solution)
        groups = tuple(group for group in state.groups if set(group[0]) & set(tests))
        for pair in replace(state, groups=groups).pairs(derivatives=True):
            omega, test = np.sqrt(max(pair.eigenvalue, 0.0)), 2.0 * np.pi * pair.test_hz
            if omega > 0.0:
                self.found[case.name, pair.position] = pair.eigenvalue_gradient / (2.0 * omega * test)


@dataclass(frozen=True)
class Predictions:
    """The update's result as a prediction.

    `covariance` (k, k) is of the normalised parameters; combinations that the data leave open have their prior spread.
    """

    sensitivities: Sensitivities
    covariance: Reals

    def miss(self, study: Study, case: StudyCase, test: int, error: float) -> FrequencyMiss | None:
        """Error of a predicted frequency with its standard deviation; None if that is not known."""
        gradient = self.sensitivities.found.get((case.name, test))
        if gradient is None:
            return None
        return frequency_miss(error, gradient, self.covariance, scatter_of_test(study, case, test) or 0.0)

    def misses(self, study: Study, case: StudyCase, c: Correlation) -> list[tuple[int, FrequencyMiss]]:
        """Those of all pairs of a configuration, by position of the test mode."""
        pairs = zip(c.pairing.pairs, c.frequency_errors)
        misses = ((p.test, self.miss(study, case, p.test, float(error))) for p, error in pairs)
        return [(test, miss) for test, miss in misses if miss is not None]


def scatter_of_test(study: Study, case: StudyCase, test: int) -> float | None:
    """Relative standard deviation of a measured frequency: of [validate], the test's own, or that of the residuals."""
    stated = study.file.validation.frequency_sd
    if stated is not None:
        return stated
    assert case.modal is not None
    known = case.modal.test.freq_sd_hz
    if known is not None and known[test] > 0.0:
        return float(known[test] / case.modal.test.freq_hz[test])
    entries = [c.entry for c in study.file.comparisons if isinstance(c.entry, FrequencyResidual)]
    # of residuals of frequencies in this configuration, else in the others, the largest one
    of_case = [e for e in entries if e.is_in(case.name, several=False, used=True)]
    return max((e.sd_of_frequency for e in of_case or entries if e.sd_of_frequency is not None), default=None)


_FORCED = "damping and forced response: only natural frequencies and mode shapes were compared"


_NO_RESPONSE = "forced response: no measured FRFs were compared with those of the model"


_DAMPING = "modal damping: no damping ratio of a test mode was compared with that of the model"


_LEVELS = "forced response levels: all measured FRFs were used in the update; none was held out to compare its level"


_LINEARITY = "linearity: the test modes were assumed to be those of one linear structure"


_MASS = (
    "total mass: a common factor on all stiffnesses and masses changes no value that is compared, and nothing was "
    'weighed (weighed_mass in the configuration, or a [[residual]] of kind "mass"); updated values are relative to the '
    "masses of the deck, and an error of these shows neither in residuals nor in standard deviations"
)


_NOTHING = "prediction of data that the update did not use: no configurations or modes were held out"


_NO_SWEEP = 'the study has no [[vibration]] of kind "sweep"'
_NO_RANDOM = 'the study has no [[vibration]] of kind "random"'


_NO_DATA = {
    SHAPE: "no sensors were held out", SWEEP_FREQUENCY: _NO_SWEEP, SWEEP_AMPLITUDE: _NO_SWEEP, RMS: _NO_RANDOM,
}  # fmt: skip
"""Why the criterion of a quantity has no verdict."""


_VIBRATION = "vibration test"


_UNUSED = "this configuration was not used in the update"


@dataclass(frozen=True)
class Scope:
    """Some data that the update did not use: a kind of data in one configuration."""

    case: StudyCase
    data: str
    tests: tuple[int, ...]
    sensors: bool = False


def validation(
    study: Study,
    before: ModelRecords,
    after: ModelRecords,
    predicted: Predictions | None = None,
    frfs: Sequence[UnusedFrfs] = (),
    vibrations: Sequence[VibrationResults] = (),
) -> ValidationResults:
    """Predictions of modes and FRFs that the update did not use, verdicts on them, and what was not tested."""
    asked, scopes = criteria_profile(study), list(scopes_of(study))
    shapes = {s: _sensors(s, after) for s in scopes if s.sensors}
    verdicts = [v for s in scopes for v in _verdicts(study, s, asked, after, predicted, shapes.get(s))]
    verdicts += [v for one in frfs for v in _frf_verdicts(study, one)]
    shaken = ((one, v) for one in vibrations for v in vibration_verdicts(study, one))
    verdicts += [_verdict(one.configuration, _VIBRATION, after, before) for one, (after, before) in shaken]
    return ValidationResults(
        predictions=tuple(p for c in study.cases for p in _predictions(study, c, before, after, predicted)),
        not_tested=(
            *_not_tested(study, scopes, after, frfs, vibrations),
            *_without_data(asked, verdicts),
        ),
        profile=asked.name,
        verdicts=tuple(verdicts),
        frfs=tuple(f for one in frfs for f in predicted_frfs(one, _frf_data(study, one.case))),
        resonances=tuple(r for one in frfs for r in predicted_resonances(one)),
        vibrations=tuple(vibrations),
        curves=tuple(c for one in frfs for c in one.curves(_frf_data(study, one.case))),
        held_out_sensors=tuple(
            f"{s.case.name}: {name}" for s, shape_results in shapes.items() for name in shape_results.sensors
        ),
        shapes=tuple(shape for s, shape_results in shapes.items() for shape in _shapes(s, shape_results)),
    )


def _without_data(asked: CriteriaProfile, verdicts: Iterable[ValidationVerdict]) -> Iterable[str]:
    """Limits of the study that no verdict refers to."""
    judged = {v.criterion for v in verdicts}
    for c in asked.criteria:
        if c.standard == OWN and _name(c) not in judged:
            yield f"{c.quantity}: {_NO_DATA.get(c.quantity, 'no data for this criterion were held out of the update')}"


def _name(criterion: Criterion) -> str:
    return f"{criterion.quantity}, {criterion.standard}"


def scopes_of(study: Study) -> Iterable[Scope]:
    """Kinds of data that the update did not use, each in its configuration."""
    for case in study.cases:
        if case.modal is None:
            continue
        by_data: dict[str, list[int]] = {}
        for i in judged_tests(case):
            by_data.setdefault(_data(study, case, i), []).append(i)
        yield from (Scope(case, data, tuple(tests)) for data, tests in by_data.items())
        if case.held.sensors:
            used = set(range(len(case.modal.test))) - set(case.modal.left_out) - case.held.modes
            yield Scope(case, "held-out sensors", tuple(sorted(used)), sensors=True)


def _data(study: Study, case: StudyCase, test: int) -> str:
    if case.entry.use == "validation":
        return _difference(study, case)
    assert case.modal is not None
    used = case.modal.test.freq_hz[sorted(set(range(len(case.modal.test))) - case.held.modes)]
    hz = case.modal.test.freq_hz[test]
    return "held-out modes" if used.min() <= hz <= used.max() else "beyond the frequencies used"


SAME_TEST = "same test, held out"
"""Data of a configuration for validation that are of a test that the update uses: other modes or channels of it."""


def _difference(study: Study, case: StudyCase) -> str:
    """In what a configuration differs from every one that was used."""
    used_cases = [c for c in study.cases if c.used is not None]
    if is_same_test(case, used_cases):
        return SAME_TEST
    entry, used = case.entry, [c.entry for c in used_cases]
    structure = all((e.masses, e.elements_off) != (entry.masses, entry.elements_off) for e in used)
    supports = all(_supports(e) != _supports(entry) for e in used)
    words = ["modified structure"] * structure + ["other boundary conditions"] * supports
    return ", ".join(words) or "another test"


def _supports(entry: ConfigurationEntry) -> tuple[object, ...]:
    return entry.spc, entry.mpc, entry.supports_added, entry.supports_removed


def _sensors(scope: Scope, after: ModelRecords) -> HeldOutSensors:
    return held_out_sensors(after.raw[scope.case.name], scope.case.held.sensors, scope.tests)


def _shapes(scope: Scope, held_out: HeldOutSensors) -> Iterable[HeldOutShape]:
    for label, error, noise in zip(held_out.labels, held_out.error, held_out.noise):
        yield HeldOutShape(
            configuration=scope.case.name,
            test_label=label,
            error_percent=100.0 * float(error) if np.isfinite(error) else None,
            noise_percent=100.0 * float(noise) if np.isfinite(noise) else None,
        )


def _verdicts(
    study: Study,
    scope: Scope,
    asked: CriteriaProfile,
    after: ModelRecords,
    predicted: Predictions | None,
    sensors: HeldOutSensors | None,
) -> Iterable[ValidationVerdict]:
    # held-out sensors say nothing of frequencies, and without them there is no error at them
    skipped = (FREQUENCY, SELF) if scope.sensors else (SHAPE,)
    criteria = [c for c in asked.criteria if c.quantity not in (*skipped, *OF_FRFS, *OF_VIBRATION)]
    c = after.raw[scope.case.name]
    misses = [] if predicted is None else predicted.misses(study, scope.case, c)
    assessed = assess(c, criteria, scope.tests, misses, sensors)
    return (_verdict(scope.case.name, scope.data, v) for v in assessed)


def _frf_data(study: Study, case: StudyCase) -> str:
    if case.entry.use == "validation":
        return _difference(study, case)
    return "unused FRFs"


def _frf_verdicts(study: Study, one: UnusedFrfs) -> Iterable[ValidationVerdict]:
    """Verdicts on the FRFs of a configuration."""
    criteria = of_frfs(study)
    predicted = one.found
    verdicts = (not_tested(c, one.why) for c in criteria) if predicted is None else assess_frfs(predicted, criteria)
    return (_verdict(one.case.name, _frf_data(study, one.case), v) for v in verdicts)


def _verdict(configuration: str, data: str, v: Verdict, before: Verdict | None = None) -> ValidationVerdict:
    c = v.criterion
    scale = 100.0 if c.percent else 1.0
    return ValidationVerdict(
        configuration=configuration,
        data=data,
        criterion=_name(c),
        required=scale * v.required,
        sense="at most" if c.at_most else "at least",
        measured=None if v.measured is None or not np.isfinite(v.measured) else scale * v.measured,
        unit=c.unit,
        verdict=v.outcome.value,
        remark=v.remark,
        noise=v.noise,
        sentence=f"{configuration}, {data}: {v.sentence}",
        standard=c.standard,
        before=None if before is None or before.measured is None else scale * before.measured,
        before_verdict=None if before is None else before.outcome.value,
    )


def _predictions(
    study: Study, case: StudyCase, before: ModelRecords, after: ModelRecords, predicted: Predictions | None
) -> Iterable[Prediction]:
    """Of all test modes that the update did not use, those left out with a reason too."""
    if case.modal is None:
        return
    judged, c = judged_tests(case), after.raw[case.name]
    for i in sorted({*judged, *case.modal.left_out}):
        remark = case.modal.left_out.get(i, HELD_OUT if case.entry.use == "update" else _UNUSED)
        record = prediction(case.name, c, i, remark, before.raw[case.name])
        if i in judged:
            miss = None if predicted is None else predicted.miss(study, case, i, _error(record))
            record = record.model_copy(update={"data": _data(study, case, i), **_scatter(miss, record.paired)})
        yield record


def _error(record: Prediction) -> float:
    return float("nan") if record.freq_error_percent is None else record.freq_error_percent / 100.0


def _scatter(miss: FrequencyMiss | None, paired: bool) -> dict[str, object]:
    """The uncertainty of a pair's error."""
    if miss is None or not paired:
        return {}
    known, finite = miss.parameter_sd is not None, np.isfinite(miss.z)
    return {
        "test_sd_percent": 100.0 * miss.test_sd,
        "parameter_sd_percent": 100.0 * (miss.parameter_sd or 0.0) if known else None,
        "z": miss.z if finite else None,
        "p_value": miss.p_value if finite else None,
        "noise": str(miss),
    }


def _not_tested(
    study: Study,
    scopes: Sequence[Scope],
    after: ModelRecords,
    frfs: Sequence[UnusedFrfs],
    vibrations: Sequence[VibrationResults],
) -> Iterable[str]:
    yield from (f"{c.name}: the configuration has no test with modes" for c in study.cases if c.modal is None)
    of_frfs_only = [_frf_data(study, one.case) for one in frfs if one.found is not None and one.found.matches]
    kinds = {word for s in scopes for word in s.data.split(", ")} | {w for d in of_frfs_only for w in d.split(", ")}
    shaken = any(v.compared for v in vibrations)
    if kinds:
        yield from _kinds_not_tested(kinds)
    elif not shaken:
        yield _NOTHING
    yield from responses_not_tested(study, bool(of_frfs_only) or shaken, after.responses)
    yield _LINEARITY
    if _of_ratio(study):
        yield _MASS
    reason = mesh_not_checked(study)
    if reason:
        yield f"mesh convergence: {reason}"


def _of_ratio(study: Study) -> bool:
    """True if the data determine only the ratio of stiffness to mass: no residual depends on their level, and nothing
    was weighed or added.

    An error that all frequencies share is stated in `common_frequency_sd`, and then shown.
    """
    if study.file.residuals.common_frequency_sd > 0.0:
        return False
    used = [case for case in study.cases if case.used is not None]
    known = any(case.entry.weighed_mass is not None or case.entry.masses for case in used)
    compared = [r for case in used if case.used is not None for r in case.used.residuals]
    return bool(compared) and not known and all(r.of_ratio for r in compared)


def responses_not_tested(study: Study, predicted: bool, responses: Iterable[ResponseResults]) -> tuple[str, ...]:
    """What was not tested of damping and forced response.

    Parameters
    ----------
    predicted : whether FRFs that were not used, or vibration tests, are compared with those of the model
    responses : those of [response] at the end
    """
    with_ratios = any(c.entry.kind in ("complex-eigenvalue", "damping") for c in study.file.comparisons)
    of_modes = () if with_ratios else (_DAMPING,)
    if predicted:
        return of_modes
    if compares_frfs(study):
        return *of_modes, _LEVELS
    measured = any(r.frfs is not None and r.frfs.test_values_key for r in responses)
    if measured:
        return ()
    return (_NO_RESPONSE,) if with_ratios else (_FORCED,)


def compares_frfs(study: Study) -> bool:
    """True if a residual of the study compares measured FRFs line by line."""
    return any(isinstance(c.entry, FrfResidual) for c in study.file.comparisons)


def _kinds_not_tested(kinds: set[str]) -> Iterable[str]:
    if "modified structure" not in kinds:
        yield "a modified structure: no held-out configuration has other masses or elements"
    if "other boundary conditions" not in kinds:
        yield "other boundary conditions: no held-out configuration has other supports"
    if "beyond the frequencies used" not in kinds:
        yield "frequencies outside the range used: no mode above or below this range was held out"


_ESTIMATED = "their standard deviations are estimated from the residuals themselves"


def untested_residuals(study: Study) -> str:
    """Why the size of the residuals is not tested; "" where the study states their standard deviations."""
    return _ESTIMATED if study.file.residuals.scatter == "estimated" else ""


def goodness(study: Study, result: UpdateResult) -> GoodnessOfFit:
    """The test at the end of an update, by the standard deviations that the study states."""
    if not result.after.has_derivatives:
        return goodness_of_fit([])
    side = result.side
    bounded = result.status.ok and bool(result.at_bound) and not len(side.matrix) and not len(side.held)
    return goodness_of_fit(
        result.after.weighted, prior=prior_blocks(result), untested=untested_residuals(study), bounded=bounded,
        optimum=result.status.ok,
    )  # fmt: skip


def goodness_results(goodness: GoodnessOfFit, worst: PartRecord | None = None) -> GoodnessResults:
    """The test as a record; `worst` is the part of the residuals that is no noise, if there is one."""
    kinds = (KindOfResiduals(kind=k, chi_square=c, degrees_of_freedom=d, p_value=p) for k, c, d, p in goodness.by_kind)
    return GoodnessResults(
        chi_square=goodness.chi_square,
        degrees_of_freedom=goodness.degrees_of_freedom,
        p_value=goodness.p_value,
        runs=goodness.runs,
        runs_p_value=goodness.runs_p_value,
        largest=goodness.largest,
        largest_label=goodness.largest_label,
        by_kind=tuple(kinds),
        verdict="fail" if worst is not None else goodness.outcome.value,
        sentence=goodness.sentence + ("" if worst is None else f"; the worst part is {worst.words} ({worst.numbers})"),
        finding=goodness.finding.name,
        values=goodness.values,
        rank=goodness.rank,
        held=goodness.held,
        held_p_value=goodness.held_p_value,
    )


def predictions(study: Study, result: UpdateResult, sensitivities: Sensitivities) -> Predictions:
    """Predictions of the updated model, with its covariance.

    The covariance is that of the least-squares estimate with the priors of the parameters in addition to the data, so
    that a parameter at a bound and an undetermined combination have a finite standard deviation. The stated standard
    deviations are not increased if the residuals are larger, because modelling errors are not noise.
    """
    sd = np.asarray(result.parameters.prior[1], dtype=float)
    at, free = result.after, np.zeros(len(sd), dtype=bool)
    scatter = study.file.residuals.scatter
    r = at.residuals if scatter == "estimated" else np.zeros_like(at.residuals)
    spread = parameter_covariance(r, at.jacobian, at.kinds, np.diag(1.0 / sd), free, sd, scatter=scatter, lost=at.lost)
    return Predictions(sensitivities, spread.matrix)


def prediction(name: str, c: Correlation, i: int, remark: str, before: Correlation | None = None) -> Prediction:
    """The partner of a test mode; where it has none, the model mode that resembles it most."""
    paired, j = _answer(c, i)
    test_hz = float(c.test.freq_hz[i])
    k = None if before is None else _answer(before, i)[1]
    return Prediction(
        configuration=name,
        test_label=c.test.labels[i],
        test_freq_hz=test_hz,
        model_number=None if j is None else j + 1,
        model_freq_hz=None if j is None else float(c.model.freq_hz[j]),
        freq_error_percent=None if j is None else 100.0 * (float(c.model.freq_hz[j]) / test_hz - 1.0),
        mac=None if j is None or c.one_dof(i) or not np.isfinite(c.mac[i, j]) else float(c.mac[i, j]),
        before_freq_error_percent=(
            None if k is None or before is None else 100.0 * (float(before.model.freq_hz[k]) / test_hz - 1.0)
        ),
        remark=remark,
        paired=paired,
    )


def _answer(c: Correlation, i: int) -> tuple[bool, int | None]:
    """Whether a test mode is paired, and with which model mode, or which one resembles it."""
    for pair in c.pairing.pairs:
        if pair.test == i:
            return True, pair.model
    row = np.full(len(c.model), -1.0) if c.one_dof(i) else np.nan_to_num(c.mac[i], nan=-1.0)
    return False, int(np.argmax(row)) if len(row) and row.max() > 0.0 else None
