"""The record of an identification, from its modes, poles and fits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune import __version__
from femtune.identification.harmonics import multiples
from femtune.steps.identify.record import HarmonicLine, Identification, IdentifiedMode, LinearityResults, PoleCluster
from femtune.steps.info.facts import alert_of
from femtune.study.record import InputFile

if TYPE_CHECKING:
    from femtune.steps.identify.identified import Found


def identification(
    identified: Found, title: str, inputs: tuple[InputFile, ...], units: str, linearity: LinearityResults | None = None
) -> Identification:
    """The record of what was found in measured files."""
    clusters = tuple(
        PoleCluster(freq_hz=c.freq_hz, damping_ratio=c.damping_ratio, chosen=c.chosen, reason=c.reason)
        for c in identified.candidates
    )
    return Identification(
        femtune_version=__version__,
        title=title,
        source=inputs[0],
        units=units,
        dofs=tuple(str(dof) for dof in identified.modes.dofs),
        normalisation=identified.modes.normalisation,
        modes=tuple(_mode(identified, i) for i in range(len(identified.modes))),
        clusters=clusters,
        largest_misfit_percent=None if identified.misfit_percent is None else float(identified.misfit_percent.max()),
        alerts=tuple(alert_of(notice) for notice in identified.notices),
        harmonics=tuple(
            HarmonicLine(freq_hz=e.freq_hz, kurtosis=e.kurtosis, width_hz=e.width_hz, share=e.share, multiple=word)
            for e, word in zip(identified.lines, multiples(identified.lines))
        ),
        inputs=inputs,
        linearity=linearity,
    )


def _mode(identified: Found, i: int) -> IdentifiedMode:
    modes = identified.modes
    verdict = identified.of_input[i] if identified.of_input else None
    return IdentifiedMode(
        label=modes.labels[i],
        freq_hz=float(modes.freq_hz[i]),
        freq_sd_hz=_at(modes.freq_sd_hz, i),
        damping_ratio=_at(modes.damping_ratio, i),
        damping_sd=_at(modes.damping_sd, i),
        by_method={name: _at(freq, i) for name, freq in identified.by_method.items()},
        phase_collinearity=_at(identified.collinearity, i),
        estimates=None if identified.found_in is None else int(identified.found_in[i]),
        of_input=None if verdict is None else verdict.of_input,
        doubtful=any(r.doubtful for r in identified.remarks if r.mode == i),
        remark=_remark(identified, i),
    )


def _remark(identified: Found, i: int) -> str:
    verdict = identified.of_input[i] if identified.of_input else None
    alone = identified.only_method(i)
    said = [
        "" if verdict is None else verdict.sentence,
        *(r.notice.what for r in identified.remarks if r.mode == i),
        "" if alone is None else f"only the method {alone} found the mode",
    ]
    return "; ".join(part for part in said if part)


def _at(values: np.ndarray | None, i: int) -> float | None:
    return None if values is None or not np.isfinite(values[i]) else float(values[i])
