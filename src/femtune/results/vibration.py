"""Vibration tests that the update did not use, beside the updated model, as records with verdicts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.assembly.error_places import errors_at
from femtune.errors import ErrorCollector, FemtuneError
from femtune.files.vibration_table import read_vibration_table
from femtune.model.damping import constant_damping
from femtune.model.response import make_ports
from femtune.model.vibration import (
    ModalTransfer,
    Spectrum,
    Sweep,
    base_transfer,
    force_transfer,
    response_rms,
    swept_response,
)
from femtune.results.base import Record
from femtune.results.criteria import of_vibration
from femtune.results.solved import solve
from femtune.validation import judge, not_tested
from femtune.validation.criteria import RMS, SWEEP_AMPLITUDE, SWEEP_FREQUENCY

if TYPE_CHECKING:
    from femtune.assembly.cases import StudyCase
    from femtune.assembly.study import Study
    from femtune.files.study_file import VibrationEntry
    from femtune.model import EigenSolution, ModalDamping
    from femtune.validation import Criterion, Verdict


class VibrationPoint(Record):
    """A point of a vibration test: the updated model beside what was measured."""

    output: str
    """Degree of freedom."""
    peak: float | None
    """Largest amplitude of the model in a sweep, over the band that was measured; None for random vibration."""
    peak_hz: float | None
    """Its frequency, Hz."""
    peak_at_end: bool = False
    """True if it lies at an end of the band, which then contains no resonance."""
    rms: float | None
    """Root mean square of the model in random vibration, over the band that was measured; None for a sweep."""
    test_peak: float | None = None
    """Largest measured amplitude in the same band; None if nothing was measured."""
    test_peak_hz: float | None = None
    """Its frequency, Hz."""
    test_peak_at_end: bool = False
    """True if it lies at an end of the band, which then contains no resonance."""
    test_rms: float | None = None
    """Measured root mean square; None if nothing was measured."""


class VibrationResults(Record):
    """A sine sweep or a random vibration test of the updated model."""

    name: str
    """Name of the test."""
    kind: str
    """"sweep" or "random"."""
    configuration: str
    """Name of the configuration."""
    excitation: str
    """Excitation in words."""
    points: tuple[VibrationPoint, ...]
    """One record a point; none if it could not be computed."""
    problem: str = ""
    """Why it could not be computed; "" otherwise."""


Curve = tuple[Reals, Reals]


@dataclass(frozen=True, eq=False)
class VibrationTest:
    """A vibration test of a study.

    Parameters
    ----------
    excitation : of random vibration over the band that was measured
    damping : of the modes
    measured : the measured curves, over the frequencies of the excitation; None if nothing was measured
    """

    entry: VibrationEntry
    excitation: Sweep | Spectrum
    damping: ModalDamping
    measured: Curve | None

    def case(self, study: Study) -> StudyCase:
        """Its configuration."""
        return _case(study, self.entry)

    def points(self, modes: EigenSolution) -> Iterable[VibrationPoint]:
        """Its points, by the modes of the model (errors ``vibration.*``)."""
        transfer = _transfer(self.entry, modes, self.damping)
        if isinstance(self.excitation, Sweep):
            return _swept(self.excitation, transfer, self.measured)
        return _random(self.excitation, transfer, self.measured)


def _case(study: Study, entry: VibrationEntry) -> StudyCase:
    return next(c for c in study.cases if entry.configuration in (None, c.name))


def _transfer(entry: VibrationEntry, modes: EigenSolution, damping: ModalDamping) -> ModalTransfer:
    ports = make_ports(modes.point.configured, [entry.input or entry.outputs[0]], entry.outputs)
    if entry.base is not None:
        return base_transfer(modes, ports, entry.base, damping)
    return force_transfer(modes, ports, damping)


@dataclass(frozen=True, eq=False)
class VibrationTests:
    """The vibration tests of a study with their measured curves."""

    tests: tuple[VibrationTest, ...] = ()

    @classmethod
    def of(cls, study: Study) -> VibrationTests:
        """Read the files, and check all that can be checked without modes.

        Raises
        ------
        FemtuneError : ``vibration.*``, ``response.held-port``, ``model.unknown-node``; all tests together
        """
        errors, found = ErrorCollector(), []
        for i, entry in enumerate(study.file.vibration):
            with errors.catch(), errors_at(study.file.where("vibration", i)):
                found.append(_read(study, entry))
        errors.raise_if_any()
        return cls(tuple(found))

    def check(self, study: Study, x: Reals, solved: Mapping[str, EigenSolution]) -> None:
        """Check the tests against the modes at normalised parameters, by configuration in `solved` as far as known.

        Raises
        ------
        FemtuneError : ``vibration.damping``, ``vibration.no-base``
        """
        errors = ErrorCollector()
        for i, test in enumerate(self.tests):
            case = test.case(study)
            modes = solved.get(case.name) or solve(study, case, x)
            with errors.catch(), errors_at(study.file.where("vibration", i)):
                _transfer(test.entry, modes, test.damping)
        errors.raise_if_any()

    def beside(self, study: Study, x: Reals) -> tuple[VibrationResults, ...]:
        """All tests with the model at normalised parameters."""
        return tuple(_beside(study, test, x) for test in self.tests)


def _read(study: Study, entry: VibrationEntry) -> VibrationTest:
    measured = None
    if entry.measured is not None:
        measured = read_vibration_table(study.file.path_of(entry.measured), len(entry.outputs))
    make_ports(_case(study, entry).configured, [entry.input or entry.outputs[0]], entry.outputs)
    damping = study.built.modal_damping
    if entry.damping_ratio is not None:
        damping = constant_damping(entry.damping_ratio)
    if damping is None:
        raise FemtuneError("vibration.no-damping", name=entry.name)
    if entry.kind == "random":
        spectrum = Spectrum(np.array(entry.spectrum_hz), np.array(entry.spectrum))
        return VibrationTest(entry, _common_spectrum(entry, spectrum, measured), damping, measured)
    assert entry.from_hz is not None
    assert entry.to_hz is not None
    assert entry.rate is not None
    sweep = Sweep(entry.from_hz, entry.to_hz, entry.rate, entry.law, entry.amplitude)
    return VibrationTest(entry, sweep, damping, _within_sweep(entry, sweep, measured))


def _common_spectrum(entry: VibrationEntry, whole: Spectrum, measured: Curve | None) -> Spectrum:
    """The excitation over the measured band (errors ``vibration.spectrum``, ``vibration.no-overlap``)."""
    assert len(whole.pieces)
    found = whole if measured is None else whole.within(measured[0][0], measured[0][-1])
    if found is None:
        raise FemtuneError("vibration.no-overlap", name=entry.name)
    return found


def _within_sweep(entry: VibrationEntry, sweep: Sweep, measured: Curve | None) -> Curve | None:
    """The measured curves within the band of a sweep (errors ``vibration.sweep``, ``vibration.no-overlap``)."""
    swept = np.sort(sweep.steps()[0])
    if measured is None:
        return None
    hz, values = measured
    inside = (hz >= swept[0]) & (hz <= swept[-1])
    if not inside.any():
        raise FemtuneError("vibration.no-overlap", name=entry.name)
    hz, values = hz[inside], values[:, inside]
    if min(len(hz), int(np.sum((swept >= hz[0]) & (swept <= hz[-1])))) < _FEWEST_LINES:
        raise FemtuneError("vibration.no-overlap/lines", name=entry.name, fewest=_FEWEST_LINES)
    return hz, values


_FEWEST_LINES = 3
"""Fewer lines have no maximum between their ends."""


def _beside(study: Study, test: VibrationTest, x: Reals) -> VibrationResults:
    entry, case = test.entry, test.case(study)
    motion = f"base {entry.base}" if entry.base is not None else f"force at {entry.input}"
    facts = {"name": entry.name, "kind": entry.kind, "configuration": case.name}
    try:
        points = tuple(test.points(solve(study, case, x)))
    except FemtuneError as error:
        return VibrationResults(**facts, excitation=motion, points=(), problem=f"{error.what} ({error.code})")
    return VibrationResults(**facts, excitation=f"{motion}, {_words(entry)}", points=points)


def _words(entry: VibrationEntry) -> str:
    if entry.kind == "random":
        return f"{entry.spectrum_hz[0]:g} to {entry.spectrum_hz[-1]:g} Hz"
    unit = "octaves per minute" if entry.law == "logarithmic" else "Hz/s"
    return f"{entry.from_hz:g} to {entry.to_hz:g} Hz with {entry.rate:g} {unit}, amplitude {entry.amplitude:g}"


def _swept(sweep: Sweep, transfer: ModalTransfer, measured: Curve | None) -> Iterable[VibrationPoint]:
    hz, envelope = swept_response(transfer, sweep)
    if measured is not None:
        seen = (hz >= measured[0][0]) & (hz <= measured[0][-1])
        hz, envelope = hz[seen], envelope[:, seen]
    for i, output in enumerate(transfer.outputs):
        peak, peak_hz, at_end = _largest(hz, envelope[i])
        point = VibrationPoint(output=output, peak=peak, peak_hz=peak_hz, peak_at_end=at_end, rms=None)
        if measured is not None:
            peak, peak_hz, at_end = _largest(measured[0], measured[1][i])
            point = point.model_copy(update={"test_peak": peak, "test_peak_hz": peak_hz, "test_peak_at_end": at_end})
        yield point


def _largest(hz: Reals, curve: Reals) -> tuple[float, float, bool]:
    """The largest value, its frequency, and whether it is the first or the last one."""
    top = int(np.argmax(curve))
    return float(curve[top]), float(hz[top]), top in (0, len(hz) - 1)


def _random(spectrum: Spectrum, transfer: ModalTransfer, measured: Curve | None) -> Iterable[VibrationPoint]:
    rms = response_rms(transfer, [spectrum])
    for i, output in enumerate(transfer.outputs):
        test = None
        if measured is not None:
            seen = Spectrum(measured[0], measured[1][i]).within(spectrum.freq_hz[0], spectrum.freq_hz[-1])
            test = None if seen is None else seen.root_mean_square
        yield VibrationPoint(output=output, peak=None, peak_hz=None, rms=float(rms[i]), test_rms=test)


# ----------------------------------------------------------------------------------------------------
# Verdicts.


def vibration_verdicts(study: Study, found: VibrationResults) -> Iterable[Verdict]:
    """A verdict on each criterion of this kind of test, by the worst point that has what is compared."""
    for criterion in of_vibration(study):
        if (criterion.quantity == RMS) == (found.kind == "random"):
            yield not_tested(criterion, found.problem) if found.problem else _verdict(criterion, found)


def _verdict(criterion: Criterion, found: VibrationResults) -> Verdict:
    errors, flat = [], []
    for point in found.points:
        where = _no_resonance(point) if criterion.quantity == SWEEP_FREQUENCY else ""
        error = _ERRORS[criterion.quantity](point)
        if where:
            flat.append(f"{point.output}: {where}")
        elif error is not None:
            errors.append((error, point.output))
    if errors:
        worst, output = max(errors)
        return judge(criterion, worst, "; ".join([f"{found.name}, {output}", *flat]))
    return not_tested(criterion, f"{found.name}: {'; '.join(flat) or 'nothing was measured'}")


def _no_resonance(p: VibrationPoint) -> str:
    """Which curve has its maximum at an end of the band, in words; "" where neither has."""
    if p.test_peak_hz is None or p.peak_hz is None:
        return ""
    if p.test_peak_at_end:
        curve, hz = "measured", p.test_peak_hz
    elif p.peak_at_end:
        curve, hz = "computed", p.peak_hz
    else:
        return ""
    return f"the maximum of the {curve} curve lies at an end of the band ({hz:.4g} Hz), not at a resonance"


def _relative(model: float | None, test: float | None) -> float | None:
    return None if model is None or test is None else abs(model / test - 1.0)


_ERRORS: dict[str, Callable[[VibrationPoint], float | None]] = {
    SWEEP_FREQUENCY: lambda p: _relative(p.peak_hz, p.test_peak_hz),
    SWEEP_AMPLITUDE: lambda p: _relative(p.peak, p.test_peak),
    RMS: lambda p: _relative(p.rms, p.test_rms),
}
