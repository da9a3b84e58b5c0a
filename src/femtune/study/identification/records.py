"""Records of an identification, as ``identified.json`` holds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune import __version__
from femtune.results.base import Alert, InputFile, Record
from femtune.results.model import alert_of
from femtune.study.identification.levels import LinearityResults

if TYPE_CHECKING:
    from femtune.study.identification.found import Found


class IdentifiedMode(Record):
    """One mode."""

    label: str
    """Its name."""
    freq_hz: float
    """Natural frequency."""
    freq_sd_hz: float | None
    """Standard deviation of it, None if the method gives none."""
    damping_ratio: float | None
    """Fraction of critical damping, None if the method gives none."""
    damping_sd: float | None
    """Standard deviation of it."""
    by_method: dict[str, float | None]
    """Frequency by each method, None if it did not find the mode."""
    phase_collinearity: float | None
    """Phase collinearity of the complex shape: 1 if it is real except for a factor; None if it is not known."""
    estimates: int | None
    """Number of estimates (methods and fragments) that contain it, None with only one estimate."""
    of_input: bool | None
    """True if the excitation has the same peak, None if it was not recorded."""
    doubtful: bool
    """True if its damping or its modal mass is not that of a mode of a structure."""
    remark: str
    """Remarks on its origin, its damping, modal mass and shape, and on the methods that found it."""


class PoleCluster(Record):
    """Poles that are stable from order to order."""

    freq_hz: float
    """Median."""
    damping_ratio: float
    """Median."""
    chosen: bool
    """True if it was chosen as a mode."""
    reason: str
    """The reason."""


class Identification(Record):
    """An identification without its arrays."""

    femtune_version: str
    """Version that wrote it."""
    title: str
    """Its title."""
    source: InputFile
    """The record or the functions."""
    units: str
    """length-mass-s."""
    dofs: tuple[str, ...]
    """Rows of the shapes."""
    normalisation: str
    """Of the shapes: mass, unit-norm or unit-max."""
    modes: tuple[IdentifiedMode, ...]
    """The identified modes."""
    clusters: tuple[PoleCluster, ...]
    """The clusters from which the modes were chosen."""
    largest_misfit_percent: float | None
    """Relative error of the synthesised function with the poorest fit; None if the input is not known."""
    alerts: tuple[Alert, ...]
    """Alerts."""
    linearity: LinearityResults | None = None
    """Comparison of tests at several levels of force; None if only one level was measured."""


def identification(
    found: Found, title: str, source: InputFile, units: str, linearity: LinearityResults | None = None
) -> Identification:
    """The record of what was found."""
    clusters = tuple(
        PoleCluster(freq_hz=c.freq_hz, damping_ratio=c.damping_ratio, chosen=c.chosen, reason=c.reason)
        for c in found.candidates
    )
    return Identification(
        femtune_version=__version__,
        title=title,
        source=source,
        units=units,
        dofs=tuple(str(dof) for dof in found.modes.dofs),
        normalisation=found.modes.normalisation,
        modes=tuple(_mode(found, i) for i in range(len(found.modes))),
        clusters=clusters,
        largest_misfit_percent=None if found.misfit_percent is None else float(found.misfit_percent.max()),
        alerts=tuple(alert_of(notice) for notice in found.notices),
        linearity=linearity,
    )


def _mode(found: Found, i: int) -> IdentifiedMode:
    modes = found.modes
    verdict = found.of_input[i] if found.of_input else None
    return IdentifiedMode(
        label=modes.labels[i],
        freq_hz=float(modes.freq_hz[i]),
        freq_sd_hz=_at(modes.freq_sd_hz, i),
        damping_ratio=_at(modes.damping_ratio, i),
        damping_sd=_at(modes.damping_sd, i),
        by_method={name: _at(freq, i) for name, freq in found.by_method.items()},
        phase_collinearity=_at(found.collinearity, i),
        estimates=None if found.found_in is None else int(found.found_in[i]),
        of_input=None if verdict is None else verdict.of_input,
        doubtful=any(r.doubtful for r in found.remarks if r.mode == i),
        remark=_remark(found, i),
    )


def _remark(found: Found, i: int) -> str:
    verdict = found.of_input[i] if found.of_input else None
    alone = found.only_method(i)
    said = [
        "" if verdict is None else verdict.sentence,
        *(r.notice.what for r in found.remarks if r.mode == i),
        "" if alone is None else f"only the method {alone} found the mode",
    ]
    return "; ".join(part for part in said if part)


def _at(values: np.ndarray | None, i: int) -> float | None:
    return None if values is None or not np.isfinite(values[i]) else float(values[i])
