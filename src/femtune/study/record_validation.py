"""Records of validation: predictions beside measurements that were not used, verdicts on them, what was not tested."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.correlate import Correlation
from femtune.files.study_file import ConfigurationEntry
from femtune.study.cases import StudyCase
from femtune.study.criteria import criteria_profile
from femtune.study.held_out import HELD_OUT
from femtune.study.load import Study
from femtune.study.predict import Predictions, judged_tests
from femtune.study.results_validation import HeldOutShape, Prediction, ValidationResults, ValidationVerdict
from femtune.study.stages import StageRecords
from femtune.validate import CriteriaProfile, FrequencyMiss, HeldOutSensors, Verdict, assess, held_out_sensors
from femtune.validate.criteria import FREQUENCY, SELF, SHAPE

_FORCED = "damping and forced response: only natural frequencies and mode shapes were compared"
_LINEARITY = "linearity: the test's modes were taken as those of one linear structure"
_MESH = "mesh convergence: the deck's mesh was taken as it is; refinement = true in [checks] refines it once"
_NOTHING = "the updated model on data that were not used: the study holds out neither a configuration, nor modes"
_UNUSED = "this configuration was not used in the update"


@dataclass(frozen=True)
class Scope:
    """Some data that the update did not use: a kind of data in one configuration."""

    case: StudyCase
    data: str
    tests: tuple[int, ...]
    sensors: bool = False


def validation(
    study: Study, before: StageRecords, after: StageRecords, predicted: Predictions | None = None
) -> ValidationResults:
    """Modes that the update did not use beside their predictions, verdicts on them, and what was not tested."""
    asked, scopes = criteria_profile(study), list(scopes_of(study))
    shapes = {s: _sensors(s, after) for s in scopes if s.sensors}
    verdicts = (v for s in scopes for v in _verdicts(study, s, asked, after, predicted, shapes.get(s)))
    return ValidationResults(
        predictions=tuple(p for c in study.cases for p in _predictions(study, c, before, after, predicted)),
        not_tested=tuple(_not_tested(study, scopes, after)),
        profile=asked.name,
        verdicts=tuple(verdicts),
        held_out_sensors=tuple(f"{s.case.name}: {name}" for s, found in shapes.items() for name in found.sensors),
        shapes=tuple(shape for s, found in shapes.items() for shape in _shapes(s, found)),
    )


def scopes_of(study: Study) -> Iterable[Scope]:
    """Kinds of data that were kept from the update, each in its configuration."""
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
        return _difference(case.entry, [c.entry for c in study.cases if c.used is not None])
    assert case.modal is not None
    used = case.modal.test.freq_hz[sorted(set(range(len(case.modal.test))) - case.held.modes)]
    hz = case.modal.test.freq_hz[test]
    return "held-out modes" if used.min() <= hz <= used.max() else "beyond the frequencies used"


def _difference(entry: ConfigurationEntry, used: Sequence[ConfigurationEntry]) -> str:
    """In what a configuration differs from every one that was used."""
    structure = all((e.masses, e.elements_off) != (entry.masses, entry.elements_off) for e in used)
    supports = all(_supports(e) != _supports(entry) for e in used)
    words = ["modified structure"] * structure + ["other boundary conditions"] * supports
    return ", ".join(words) or "another test"


def _supports(entry: ConfigurationEntry) -> tuple[object, ...]:
    return entry.spc, entry.mpc, entry.supports_added, entry.supports_removed


def _sensors(scope: Scope, after: StageRecords) -> HeldOutSensors:
    return held_out_sensors(after.raw[scope.case.name], scope.case.held.sensors, scope.tests)


def _shapes(scope: Scope, found: HeldOutSensors) -> Iterable[HeldOutShape]:
    for label, error, noise in zip(found.labels, found.error, found.noise):
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
    after: StageRecords,
    predicted: Predictions | None,
    sensors: HeldOutSensors | None,
) -> Iterable[ValidationVerdict]:
    # held-out sensors say nothing of frequencies, and without them there is no error at them
    skipped = (FREQUENCY, SELF) if scope.sensors else (SHAPE,)
    criteria = [c for c in asked.criteria if c.quantity not in skipped]
    c = after.raw[scope.case.name]
    misses = [] if predicted is None else predicted.misses(study, scope.case, c)
    return (_verdict(scope, v) for v in assess(c, criteria, scope.tests, misses, sensors))


def _verdict(scope: Scope, v: Verdict) -> ValidationVerdict:
    c = v.criterion
    scale = 100.0 if c.percent else 1.0
    return ValidationVerdict(
        configuration=scope.case.name,
        data=scope.data,
        criterion=f"{c.quantity}, {c.standard}",
        required=scale * v.required,
        sense="at most" if c.at_most else "at least",
        measured=None if v.measured is None or not np.isfinite(v.measured) else scale * v.measured,
        unit="%" if c.percent else "",
        verdict=v.outcome.value,
        remark=v.remark,
        noise=v.noise,
        sentence=f"{scope.case.name}, {scope.data}: {v.sentence}",
    )


def _predictions(
    study: Study, case: StudyCase, before: StageRecords, after: StageRecords, predicted: Predictions | None
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
    """What is known of the scatter of a pair's error."""
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
        mac=None if j is None or not np.isfinite(c.mac[i, j]) else float(c.mac[i, j]),
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
    row = np.nan_to_num(c.mac[i], nan=-1.0)
    return False, int(np.argmax(row)) if len(row) and row.max() > 0.0 else None


def _not_tested(study: Study, scopes: Sequence[Scope], after: StageRecords) -> Iterable[str]:
    yield from (f"{c.name}: it has no test with modes" for c in study.cases if c.modal is None)
    kinds = {word for s in scopes for word in s.data.split(", ")}
    if not kinds:
        yield _NOTHING
    else:
        yield from _kinds_not_tested(kinds)
    if not any(r.frfs is not None and r.frfs.test_values_key for r in after.responses):
        yield _FORCED
    yield from (_LINEARITY, *([] if study.file.checks.refinement else [_MESH]))


def _kinds_not_tested(kinds: set[str]) -> Iterable[str]:
    if "modified structure" not in kinds:
        yield "a modified structure: no configuration that was kept has other masses or elements"
    if "other boundary conditions" not in kinds:
        yield "other boundary conditions: no configuration that was kept has other supports"
    if "beyond the frequencies used" not in kinds:
        yield "frequencies beyond those used: no mode above or below them was held out"
