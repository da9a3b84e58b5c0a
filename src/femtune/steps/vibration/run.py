"""Sweeps, random vibration and transient tests compared with the model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import ErrorCollector, FemtuneError
from femtune.files.vibration_table import read_signal, read_vibration_table
from femtune.model.damping import constant_damping, damping_table
from femtune.model.eigen.default_count import MOST_MODES
from femtune.model.response import make_ports
from femtune.model.vibration import (
    ModalTransfer,
    Spectrum,
    Sweep,
    base_transfer,
    force_transfer,
    response_density,
    response_rms,
    swept_response,
    transient_response,
)
from femtune.steps.correlate.criteria import of_vibration
from femtune.steps.vibration.solver_on_base import solver_transfer
from femtune.study.error_places import errors_at, errors_at_grid
from femtune.validation import judge, not_tested
from femtune.validation.criteria import RMS, SWEEP_AMPLITUDE, SWEEP_FREQUENCY, TRANSIENT_PEAK

if TYPE_CHECKING:
    from femtune.files.study_file import VibrationEntry
    from femtune.model import EigenSolution
    from femtune.model.response.modal_damping import DampingRatios
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study
    from femtune.validation import Criterion, Verdict
from femtune.steps.vibration.record import VibrationCurves, VibrationPoint, VibrationResults

Curve = tuple[Reals, Reals]


Band = tuple[float, float]


Arrays = dict[str, NDArray]


_MOST_STORED_LINES = {"sweep": 3000, "random": 3000, "transient": 20_000}
"""Lines of a curve in the arrays of the results, by kind of test.

They show the resonances; all lines would multiply the size of the results.
"""


MODES_TO = 3.0
"""Modes are computed up to this many times the highest excited frequency, and at least as many as [modes] has. A mode
beyond follows the base, or a force, within 1/9 of its own static response; of large models 200 are computed at most."""
_CHECKED_FROM = 0.75
"""Part of the computed range above which modes are left out to estimate what the modes beyond the range contribute."""
_ENERGY_OF_TRANSIENT = 0.999
"""Part of the energy of a transient that its frequencies up to the highest one hold."""


@dataclass(frozen=True, eq=False)
class VibrationTest:
    """A vibration test of a study.

    Parameters
    ----------
    excitation : a sweep, a spectrum, or times and values of a transient
    damping, damping_words : of the modes
    band : frequencies, or times, over which model and test are compared
    measured : the measured curves; None if nothing was measured
    """

    entry: VibrationEntry
    excitation: Sweep | Spectrum | Curve
    damping: DampingRatios
    damping_words: str
    band: Band
    measured: Curve | None

    def case(self, study: Study) -> StudyCase:
        """Its configuration."""
        return _case(study, self.entry)

    @cached_property
    def highest_hz(self) -> float:
        """Highest frequency that is excited; of a transient the one below which nearly all its energy lies."""
        if isinstance(self.excitation, Sweep | Spectrum):
            return _excited(self.excitation)[1]
        times, signal = self.excitation
        energy = np.cumsum(np.abs(np.fft.rfft(signal)) ** 2)
        line = int(np.searchsorted(energy, _ENERGY_OF_TRANSIENT * energy[-1]))
        return float(np.fft.rfftfreq(len(signal), (times[-1] - times[0]) / (len(times) - 1))[line])


def _case(study: Study, entry: VibrationEntry) -> StudyCase:
    return next(c for c in study.cases if entry.configuration in (None, c.name))


def _transfer(study: Study, test: VibrationTest, x: Reals, known: EigenSolution | None = None) -> ModalTransfer:
    """Of the model at normalised parameters, whose modes may be known, or of a run of the solver."""
    entry = test.entry
    if study.source.needs_runs:
        return solver_transfer(study, entry, x, test.damping)
    modes = _modes(study, test, x, known)
    ports = make_ports(modes.point.configured, [entry.input or entry.outputs[0]], entry.outputs)
    if entry.base is not None:
        return base_transfer(modes, ports, entry.base, test.damping)
    return force_transfer(modes, ports, test.damping)


def _modes(study: Study, test: VibrationTest, x: Reals, known: EigenSolution | None) -> EigenSolution:
    """The modes that the excitation needs, whatever number [modes] states for the correlation."""
    wanted_hz = MODES_TO * test.highest_hz
    if known is not None and known.freq_hz.max(initial=0.0) >= wanted_hz:
        return known
    case = test.case(study)
    solver = study.solver if case.compared is None else case.compared.solver
    with errors_at_grid(study.built):
        modes = solver.modes(case.configured.at(x), study.file.modes.count or 1, wanted_hz)
    return modes if known is None or modes.wanted > known.wanted else known


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
        errors, residuals = ErrorCollector(), []
        for i, entry in enumerate(study.file.vibration):
            with errors.catch(), errors_at(study.file.where("vibration", i)):
                residuals.append(_read(study, entry))
        errors.raise_if_any()
        return cls(tuple(residuals))

    def check(self, study: Study, x: Reals, solved: Mapping[str, EigenSolution]) -> None:
        """Check the tests against the modes at normalised parameters, by configuration in `solved` as far as known.

        Raises
        ------
        FemtuneError : ``vibration.damping``, ``vibration.no-base``; ``external.*``, ``vibration.solver``
        """
        errors = ErrorCollector()
        for i, test in enumerate(self.tests):
            with errors.catch(), errors_at(study.file.where("vibration", i)):
                _transfer(study, test, x, solved.get(test.case(study).name))
        errors.raise_if_any()

    def beside(self, study: Study, before: Reals, after: Reals, arrays: Arrays) -> tuple[VibrationResults, ...]:
        """All tests with the model at the initial and the updated normalised parameters; curves go into `arrays`."""
        of = enumerate(self.tests)
        return tuple(_beside(study, test, (before, after), (f"vibration_{i}", arrays)) for i, test in of)


def _read(study: Study, entry: VibrationEntry) -> VibrationTest:
    path, measured, excitation = study.file.path_of, None, None
    if entry.measured is not None:
        measured = read_vibration_table(path(entry.measured), len(entry.outputs), history=entry.kind == "transient")
    if study.source.needs_runs:
        DofSet.parse(entry.outputs)
    else:
        make_ports(_case(study, entry).configured, [entry.input or entry.outputs[0]], entry.outputs)
    damping, words = _damping(study, entry)
    excitation = _excitation(study, entry)
    band = _band(entry, excitation, measured)
    if isinstance(excitation, Sweep):
        lines = [np.sort(excitation.steps()[0]), *([] if measured is None else [measured[0]])]
        if measured is not None and min(int(np.sum((hz >= band[0]) & (hz <= band[1]))) for hz in lines) < _LEAST_LINES:
            raise FemtuneError("vibration.no-overlap/lines", name=entry.name, fewest=_LEAST_LINES)
    return VibrationTest(entry, excitation, damping, words, band, measured)


_LEAST_LINES = 3
"""Lines in the band from which a curve is compared: fewer have no maximum between their ends."""


def _excitation(study: Study, entry: VibrationEntry) -> Sweep | Spectrum | Curve:
    """Errors ``vibration.sweep``, ``vibration.spectrum``, ``vibration.signal``, ``vibration.file``."""
    if entry.signal is not None and entry.kind == "transient":
        return read_signal(study.file.path_of(entry.signal))
    if entry.kind == "random":
        spectrum = Spectrum(np.array(entry.spectrum_hz), np.array(entry.spectrum))
        assert len(spectrum.pieces)
        return spectrum
    assert entry.from_hz is not None
    assert entry.to_hz is not None
    assert entry.rate is not None
    return Sweep(entry.from_hz, entry.to_hz, entry.rate, entry.law, entry.amplitude)


def _beside(
    study: Study, test: VibrationTest, points: tuple[Reals, Reals], keep: tuple[str, Arrays]
) -> VibrationResults:
    entry, case = test.entry, test.case(study)
    motion = f"base {entry.base}" if entry.base is not None else f"force at {entry.input}"
    facts: dict[str, Any] = {
        "name": entry.name, "kind": entry.kind, "configuration": case.name, "damping": test.damping_words,
        "damping_source": entry.damping_source or "",
    }  # fmt: skip
    try:
        before, after = (_transfer(study, test, x) for x in points)
        responses = [_response(test, transfer) for transfer in (before, after)]
        fewer = _response(
            test, after.accelerations_below(_CHECKED_FROM * min(after.highest_hz, MODES_TO * test.highest_hz))
        )
        measured = _measured_levels(entry, test.measured, test.band)
    except FemtuneError as error:
        return VibrationResults(**facts, excitation=motion, points=(), problem=f"{error.what} ({error.code})")
    levels = zip(
        after.outputs, responses[0].levels, responses[1].levels, measured or [{}] * len(after.outputs), strict=True
    )
    return VibrationResults(
        **facts,
        excitation=f"{motion}, {_words(entry)}",
        points=tuple(
            VibrationPoint(output=output, **{**_NO_LEVELS, **of_after}, **_named("before", of_before),
                           **_named("test", of_test))
            for output, of_before, of_after, of_test in levels
        ),
        modes=len(after.poles),
        modes_to_hz=after.highest_hz,
        highest_hz=test.highest_hz,
        truncation_percent=100.0 * _largest_change(fewer.levels, responses[1].levels),
        chosen_modes=not study.source.needs_runs and len(after.poles) < MOST_MODES,
        compared_hz=None if entry.kind == "transient" else test.band,
        compared_s=test.band if entry.kind == "transient" else None,
        curves=_kept((keep[0], entry.kind), keep[1], responses[0].curve, responses[1].curve, test.measured),
    )  # fmt: skip


def _largest_change(fewer: list[dict[str, Any]], levels: list[dict[str, Any]]) -> float:
    """Largest relative change of a level by the upper modes."""
    names = ("rms", "peak")
    pairs = [(a[n], b[n]) for a, b in zip(fewer, levels, strict=True) for n in names if b.get(n)]
    return max((abs(a / b - 1.0) for a, b in pairs), default=0.0)


_NO_LEVELS: dict[str, Any] = {"peak": None, "peak_hz": None, "rms": None}


@dataclass(frozen=True, eq=False)
class Response:
    """Levels of each output in the band that is compared, by name, and the whole curve."""

    levels: list[dict[str, Any]]
    curve: Curve


def _damping(study: Study, entry: VibrationEntry) -> tuple[DampingRatios, str]:
    """Damping of the modes, and in words (error ``vibration.no-damping``)."""
    if isinstance(entry.damping_ratio, tuple):
        ratios, hz = entry.damping_ratio, entry.damping_hz
        words = ", ".join(f"{100.0 * r:.3g} % at {f:.4g} Hz" for f, r in zip(hz, ratios, strict=True))
        return damping_table(hz, ratios, flat=True), f"damping ratio {words}, linear between them"
    if entry.damping_ratio is not None:
        return constant_damping(entry.damping_ratio), f"damping ratio {100.0 * entry.damping_ratio:.3g} % of all modes"
    if study.built.modal_damping is None:
        raise FemtuneError("vibration.no-damping", name=entry.name)
    return study.built.modal_damping, "modal damping of the deck (SDAMPING)"


def _band(entry: VibrationEntry, excitation: Sweep | Spectrum | Curve, measured: Curve | None) -> Band:
    """What excitation, measured curve and `band_hz` have in common (error ``vibration.no-overlap``)."""
    bands = {"excitation": _excited(excitation)}
    if measured is not None:
        bands["measured curve"] = float(measured[0][0]), float(measured[0][-1])
    if entry.band_hz is not None and entry.kind != "transient":
        bands["band_hz"] = entry.band_hz
    low, high = max(b[0] for b in bands.values()), min(b[1] for b in bands.values())
    if not low < high:
        unit = "s" if entry.kind == "transient" else "Hz"
        ranges = {name: f"{first:.6g} to {last:.6g} {unit}" for name, (first, last) in bands.items()}
        raise FemtuneError("vibration.no-overlap", values=ranges, name=entry.name)
    return low, high


def _excited(excitation: Sweep | Spectrum | Curve) -> Band:
    if isinstance(excitation, Sweep):
        return min(excitation.from_hz, excitation.to_hz), max(excitation.from_hz, excitation.to_hz)
    lines = excitation.freq_hz if isinstance(excitation, Spectrum) else excitation[0]
    return float(lines[0]), float(lines[-1])


def _words(entry: VibrationEntry) -> str:
    if entry.kind == "transient":
        return f"signal {entry.signal}"
    if entry.kind == "random":
        return f"{entry.spectrum_hz[0]:g} to {entry.spectrum_hz[-1]:g} Hz"
    unit = "octaves per minute" if entry.law == "logarithmic" else "Hz/s"
    return f"{entry.from_hz:g} to {entry.to_hz:g} Hz with {entry.rate:g} {unit}, amplitude {entry.amplitude:g}"


def _response(test: VibrationTest, transfer: ModalTransfer) -> Response:
    excitation = test.excitation
    if isinstance(excitation, Spectrum):
        return _random(excitation, transfer, test.band)
    if isinstance(excitation, Sweep):
        curve = swept_response(transfer, excitation)
    else:
        times, signal = excitation
        curve = times, transient_response(transfer, signal, float(times[-1] - times[0]) / (len(times) - 1))
    return Response(_peaks(test.entry, curve, test.band), curve)


def _peaks(entry: VibrationEntry, curve: Curve, band: Band) -> list[dict[str, Any]]:
    """Largest amplitudes or magnitudes, with their frequencies or times."""
    seen = (curve[0] >= band[0]) & (curve[0] <= band[1])
    lines, sizes = curve[0][seen], np.abs(curve[1][:, seen])
    if not len(lines):
        raise FemtuneError("vibration.no-overlap", name=entry.name)
    tops = np.argmax(sizes, axis=1)
    if entry.kind == "transient":
        return [{"peak": float(v[top]), "peak_s": float(lines[top])} for v, top in zip(sizes, tops, strict=True)]
    return [
        {"peak": float(v[top]), "peak_hz": float(lines[top]), "peak_at_end": top in (0, len(lines) - 1)}
        for v, top in zip(sizes, tops, strict=True)
    ]


def _random(whole: Spectrum, transfer: ModalTransfer, band: Band) -> Response:
    compared = whole.within(*band)
    assert compared is not None
    # lines beside each pole, so that no resonance is missed
    near = np.abs(transfer.poles)[:, None] - np.outer(transfer.poles.real, np.linspace(-6.0, 6.0, 25))
    lines = np.concatenate([np.geomspace(*_excited(whole), 800), near.ravel() / (2.0 * np.pi)])
    lines = np.unique(lines[(lines >= whole.freq_hz[0]) & (lines <= whole.freq_hz[-1])])
    levels = [{"rms": float(rms)} for rms in response_rms(transfer, [compared])]
    return Response(levels, (lines, response_density(transfer, [whole], lines)))


def _measured_levels(entry: VibrationEntry, measured: Curve | None, band: Band) -> list[dict[str, Any]] | None:
    """None where nothing was measured."""
    if measured is None:
        return None
    if entry.kind != "random":
        return _peaks(entry, measured, band)
    spectra = (Spectrum(measured[0], values).within(*band) for values in measured[1])
    return [{"rms": spectrum.root_mean_square} for spectrum in spectra if spectrum is not None]


def _named(head: str, levels: dict[str, Any]) -> dict[str, Any]:
    return {f"{head}_{name}": value for name, value in levels.items()}


def _kept(of: tuple[str, str], arrays: Arrays, before: Curve, after: Curve, test: Curve | None) -> VibrationCurves:
    """Put thinned curves into the arrays under a key, with their largest values; `of` is the key and the kind."""
    key, kind = of
    names: dict[str, str | None] = {"test_lines_key": None, "test_key": None}
    for name, curve in (("before", before), ("after", after), ("test", test)):
        if curve is None:
            continue
        hz, values = curve
        kept = np.arange(0, len(hz), -(-len(hz) // _MOST_STORED_LINES[kind]))
        tops = np.argmax(np.abs(values), axis=1)
        kept = np.unique([*kept, *tops, len(hz) - 1])
        arrays[f"{key}_{name}_lines"], arrays[f"{key}_{name}"] = hz[kept], values[:, kept]
        names |= {f"{name}_lines_key": f"{key}_{name}_lines", f"{name}_key": f"{key}_{name}"}
    return VibrationCurves(**names)  # type: ignore[arg-type]


def vibration_verdicts(study: Study, vibration: VibrationResults) -> Iterable[tuple[Verdict, Verdict | None]]:
    """Verdicts of the updated and of the initial model on each criterion of this kind of test, by the worst point."""
    for criterion in of_vibration(study):
        if vibration.kind != _KINDS[criterion.quantity]:
            continue
        if vibration.problem:
            yield not_tested(criterion, vibration.problem), None
            continue
        yield _verdict(criterion, vibration, ""), _verdict(criterion, vibration, "before_")


def _verdict(criterion: Criterion, vibration: VibrationResults, head: str) -> Verdict:
    """By the worst point that has what is compared; `head` is that of the names of the initial model."""
    errors, flat = [], []
    for point in vibration.points:
        where = _no_resonance(point, head) if criterion.quantity == SWEEP_FREQUENCY else ""
        error = _ERRORS[criterion.quantity](point, head)
        if where:
            flat.append(f"{point.output}: {where}")
        elif error is not None:
            errors.append((error, point.output))
    if errors:
        worst, output = max(errors)
        return judge(criterion, worst, "; ".join([f"{vibration.name}, {output}", *flat]))
    return not_tested(criterion, f"{vibration.name}: {'; '.join(flat) or 'nothing was measured'}")


def _no_resonance(p: VibrationPoint, head: str) -> str:
    """Which curve has its maximum at an end of the band, in words; "" where neither has."""
    hz = getattr(p, f"{head}peak_hz")
    if p.test_peak_hz is None or hz is None:
        return ""
    if p.test_peak_at_end:
        curve, hz = "measured", p.test_peak_hz
    elif getattr(p, f"{head}peak_at_end"):
        curve = "computed"
    else:
        return ""
    return f"the maximum of the {curve} curve lies at an end of the band ({hz:.4g} Hz), not at a resonance"


def _relative(p: VibrationPoint, name: str, head: str) -> float | None:
    model, test = getattr(p, head + name), getattr(p, f"test_{name}")
    return None if model is None or test is None else abs(model / test - 1.0)


_KINDS = {SWEEP_FREQUENCY: "sweep", SWEEP_AMPLITUDE: "sweep", RMS: "random", TRANSIENT_PEAK: "transient"}


_ERRORS: dict[str, Callable[[VibrationPoint, str], float | None]] = {
    SWEEP_FREQUENCY: lambda p, head: _relative(p, "peak_hz", head),
    SWEEP_AMPLITUDE: lambda p, head: _relative(p, "peak", head),
    RMS: lambda p, head: _relative(p, "rms", head),
    TRANSIENT_PEAK: lambda p, head: _relative(p, "peak", head),
}
