"""Further measurements at other force levels: each identified like the first, and compared for nonlinearity."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import convolve1d, uniform_filter1d

from femtune.errors import Notice
from femtune.identification.linearity import ForceLevel, Linearity, LinearityLimits, check_linearity
from femtune.steps.identify.record import LevelFunctions, LevelMode, LevelTrend, LinearityResults

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.identification_file import IdentifyFile, LevelEntry
    from femtune.identification.linearity import FunctionsAtLevel, ModeAtLevels, Trend
    from femtune.steps.identify.identified import Found
    from femtune.steps.identify.setups import IdentifyEach


def level_file(file: IdentifyFile, entry: LevelEntry) -> IdentifyFile:
    """The identification file with the measurement of another level."""
    # poles were picked for the first level only
    changed = {"record": entry.record, "frfs": entry.frfs, "choices": None}
    copy = file.model_copy(update={"identify": file.identify.model_copy(update=changed)})
    copy._path, copy._source = file._path, file._source
    return copy


def linearity_of(file: IdentifyFile, identified: Found, identify: IdentifyEach) -> LinearityResults | None:
    """All levels compared with the first; None without [[level]].

    Parameters
    ----------
    identified : at the level of [identify]
    identify : identifies the measurements of files

    Raises
    ------
    FemtuneError : whatever is wrong with the measurement of a level
    """
    if not file.level:
        return None
    table = file.linearity
    levels = [_level(file, identified, table.force or 1.0, "")]
    files = [level_file(file, entry) for entry in file.level]
    each = identify([(of_level, f"level {of_level.measured_path.name}") for of_level in files])
    levels += [_level(f, one, e.force, e.name or "") for f, one, e in zip(files, each, file.level)]
    limits = LinearityLimits(table.largest_frequency_change, table.largest_damping_change, table.least_frac)
    return _record(check_linearity(levels, limits))


def _level(file: IdentifyFile, identified: Found, force: float, name: str) -> ForceLevel:
    of_structure = [i for i in range(len(identified.modes)) if identified.of_structure(i)]
    shown = name or f"{Path(file.measured_path).name} ({force:g})"
    return ForceLevel(shown, force, identified.modes.select_modes(of_structure), identified.measured, _sd(identified))


_AVERAGED_LINES = 17
"""Lines over which estimates of the noise are averaged.

More lines make them more accurate and blur changes over the frequency.
"""
_FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Coefficients of the fourth difference.

It is zero for a function that is cubic over five lines, so that mainly noise is left.
"""


def _sd(identified: Found) -> Reals | None:
    """√E|error|² of the functions: that of their estimate, else the smaller one of two estimates, line by line.

    One is the size of what the identified modes do not explain, which includes errors of the fit, the other that of the
    fourth difference over neighbouring lines, which includes the curvature of sharp peaks.
    """
    if identified.measured_sd is not None or identified.measured is None:
        return identified.measured_sd
    values, estimates = identified.measured.values, []
    if identified.synthesised is not None:
        estimates.append(np.abs(values - identified.synthesised.values) ** 2)
    if values.shape[2] >= len(_FOURTH_DIFFERENCE):
        rough = (
            np.abs(
                convolve1d(values.real, _FOURTH_DIFFERENCE, axis=2)
                + 1j * convolve1d(values.imag, _FOURTH_DIFFERENCE, axis=2)
            )
            ** 2
        )
        estimates.append(rough / np.sum(_FOURTH_DIFFERENCE**2))
    smooth = [uniform_filter1d(e, _AVERAGED_LINES, axis=2, mode="nearest") for e in estimates]
    return np.asarray(np.sqrt(np.min(smooth, axis=0))) if smooth else None


def linearity_notice(linearity: LinearityResults) -> tuple[Notice, ...]:
    """``frf.not-linear`` where the structure is not linear."""
    return (Notice("frf.not-linear", sentence=linearity.sentence),) if linearity.linear is False else ()


def _record(linearity: Linearity) -> LinearityResults:
    return LinearityResults(
        names=linearity.names,
        forces=linearity.forces,
        modes=tuple(_mode(m) for m in linearity.modes),
        functions=tuple(_functions(f) for f in linearity.functions),
        linear=linearity.linear,
        frequency_limit_percent=100.0 * linearity.limits.frequency,
        damping_limit_percent=100.0 * linearity.limits.damping,
        frac_limit=linearity.limits.frac,
        sentence=_sentence(linearity),
    )


def _mode(m: ModeAtLevels) -> LevelMode:
    return LevelMode(
        label=m.label,
        freq_hz=tuple(_number(v) for v in m.freq_hz),
        damping_ratio=tuple(_number(v) for v in m.damping_ratio),
        mac=tuple(_number(v) for v in m.mac),
        frequency=_trend(m.frequency),
        damping=_trend(m.damping),
        linear=m.linear,
    )


def _trend(t: Trend) -> LevelTrend:
    return LevelTrend(
        largest_percent=_number(100.0 * t.largest),
        sd_percent=_number(100.0 * t.largest_sd),
        per_doubling_percent=_number(100.0 * t.per_doubling),
        per_doubling_sd_percent=_number(100.0 * t.per_doubling_sd),
        beyond_limit=t.beyond,
    )


def _functions(f: FunctionsAtLevel) -> LevelFunctions:
    return LevelFunctions(
        functions=f.functions,
        lines=f.lines,
        frac=_number(f.frac),
        lowest_frac=_number(f.lowest_frac),
        lowest=f.lowest,
        change_percent=_number(100.0 * f.change),
        noise_percent=_number(100.0 * f.noise),
        differing=f.differing,
        reason=f.reason,
    )


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _sentence(linearity: Linearity) -> str:
    if linearity.linear is None:
        return "linearity was not tested: neither modes nor functions could be compared between the levels"
    parts = [_worst(linearity, name) for name in ("frequency", "damping")]
    fracs = [f.frac for f in linearity.functions if not f.reason]
    parts += [f"lowest FRAC between levels {min(fracs):.3f}"] if fracs else []
    verdict = "linear within the limits" if linearity.linear else "not linear"
    return f"the structure is {verdict}: {'; '.join(part for part in parts if part)}"


def _worst(linearity: Linearity, name: str) -> str:
    trends = [(m.label, getattr(m, name)) for m in linearity.modes]
    known = [(label, t) for label, t in trends if np.isfinite(t.largest)]
    if not known:
        return ""
    label, worst = max(known, key=lambda item: (item[1].beyond, abs(item[1].largest)))
    noise = f" ± {100.0 * worst.largest_sd:.2g} %" if np.isfinite(worst.largest_sd) else ""
    word = {"frequency": "frequency", "damping": "damping ratio"}[name]
    return f"largest change of a {word} {100.0 * worst.largest:+.2f} %{noise} (mode {label})"
