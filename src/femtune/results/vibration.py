"""Vibration tests that the update did not use, beside the updated model, as records with verdicts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
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
    from femtune.assembly.study import Study
    from femtune.files.study_file import VibrationEntry
    from femtune.validation import Verdict


class VibrationPoint(Record):
    """A point of a vibration test: the updated model beside what was measured."""

    output: str
    """Degree of freedom."""
    peak: float | None
    """Largest amplitude of the model in a sweep, over the band that was measured; None for random vibration."""
    peak_hz: float | None
    """Its frequency, Hz."""
    rms: float | None
    """Root mean square of the model in random vibration, over the band that was measured; None for a sweep."""
    test_peak: float | None = None
    """Largest measured amplitude; None if nothing was measured."""
    test_peak_hz: float | None = None
    """Its frequency, Hz."""
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
class VibrationTests:
    """The vibration tests of a study with their measured curves, by name."""

    measured: dict[str, Curve] = field(default_factory=dict)

    @classmethod
    def of(cls, study: Study) -> VibrationTests:
        """Read the files (errors ``vibration.file``)."""
        entries = (e for e in study.file.vibration if e.measured is not None)
        return cls({e.name: read_vibration_table(study.file.path_of(str(e.measured)), len(e.outputs)) for e in entries})

    def beside(self, study: Study, x: Reals) -> tuple[VibrationResults, ...]:
        """All tests with the model at normalised parameters."""
        return tuple(self._one(study, entry, x) for entry in study.file.vibration)

    def _one(self, study: Study, entry: VibrationEntry, x: Reals) -> VibrationResults:
        case = next(c for c in study.cases if entry.configuration in (None, c.name))
        motion = f"base {entry.base}" if entry.base is not None else f"force at {entry.input}"
        facts = {"name": entry.name, "kind": entry.kind, "configuration": case.name}
        try:
            modes = solve(study, case, x)
            ports = make_ports(modes.point.configured, [entry.input or entry.outputs[0]], entry.outputs)
            damping = study.built.modal_damping
            if entry.damping_ratio is not None:
                damping = constant_damping(entry.damping_ratio)
            if damping is None:
                raise FemtuneError("vibration.no-damping")
            if entry.base is not None:
                transfer = base_transfer(modes, ports, entry.base, damping)
            else:
                transfer = force_transfer(modes, ports, damping)
            find = _swept if entry.kind == "sweep" else _random
            points = tuple(find(entry, transfer, self.measured.get(entry.name)))
        except FemtuneError as error:
            return VibrationResults(**facts, excitation=motion, points=(), problem=f"{error.what} ({error.code})")
        return VibrationResults(**facts, excitation=f"{motion}, {_words(entry)}", points=points)


def _words(entry: VibrationEntry) -> str:
    if entry.kind == "random":
        return f"{entry.spectrum_hz[0]:g} to {entry.spectrum_hz[-1]:g} Hz"
    unit = "octaves per minute" if entry.law == "logarithmic" else "Hz/s"
    return f"{entry.from_hz:g} to {entry.to_hz:g} Hz with {entry.rate:g} {unit}, amplitude {entry.amplitude:g}"


def _swept(entry: VibrationEntry, transfer: ModalTransfer, measured: Curve | None) -> Iterable[VibrationPoint]:
    assert entry.from_hz is not None
    assert entry.to_hz is not None
    assert entry.rate is not None
    hz, envelope = swept_response(transfer, Sweep(entry.from_hz, entry.to_hz, entry.rate, entry.law, entry.amplitude))
    if measured is not None:
        seen = (hz >= measured[0][0]) & (hz <= measured[0][-1])
        if not seen.any():
            raise FemtuneError("vibration.no-overlap", name=entry.name)
        hz, envelope = hz[seen], envelope[:, seen]
    for i, output in enumerate(transfer.outputs):
        top = int(np.argmax(envelope[i]))
        test = {}
        if measured is not None:
            at = int(np.argmax(measured[1][i]))
            test = {"test_peak": float(measured[1][i][at]), "test_peak_hz": float(measured[0][at])}
        yield VibrationPoint(output=output, peak=float(envelope[i][top]), peak_hz=float(hz[top]), rms=None, **test)


def _random(entry: VibrationEntry, transfer: ModalTransfer, measured: Curve | None) -> Iterable[VibrationPoint]:
    whole = Spectrum(np.array(entry.spectrum_hz), np.array(entry.spectrum))
    spectrum = whole if measured is None else whole.within(measured[0][0], measured[0][-1])
    if spectrum is None:
        raise FemtuneError("vibration.no-overlap", name=entry.name)
    rms = response_rms(transfer, [spectrum])
    for i, output in enumerate(transfer.outputs):
        test = {}
        if measured is not None:
            seen = Spectrum(measured[0], measured[1][i]).within(spectrum.freq_hz[0], spectrum.freq_hz[-1])
            test = {} if seen is None else {"test_rms": seen.root_mean_square}
        yield VibrationPoint(output=output, peak=None, peak_hz=None, rms=float(rms[i]), **test)


# ----------------------------------------------------------------------------------------------------
# Verdicts.


def vibration_verdicts(study: Study, found: VibrationResults) -> Iterable[Verdict]:
    """A verdict on each criterion of this kind of test, by the worst point."""
    for criterion in of_vibration(study):
        if (criterion.quantity == RMS) != (found.kind == "random"):
            continue
        if found.problem:
            yield not_tested(criterion, found.problem)
            continue
        errors = [(error, p.output) for p in found.points if (error := _ERRORS[criterion.quantity](p)) is not None]
        if errors:
            worst, output = max(errors)
            yield judge(criterion, worst, f"{found.name}, {output}")
        else:
            yield not_tested(criterion, f"{found.name}: nothing was measured")


def _relative(model: float | None, test: float | None) -> float | None:
    return None if model is None or test is None else abs(model / test - 1.0)


_ERRORS: dict[str, Callable[[VibrationPoint], float | None]] = {
    SWEEP_FREQUENCY: lambda p: _relative(p.peak_hz, p.test_peak_hz),
    SWEEP_AMPLITUDE: lambda p: _relative(p.peak, p.test_peak),
    RMS: lambda p: _relative(p.rms, p.test_rms),
}
