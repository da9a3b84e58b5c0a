"""How good the channels of measured FRFs are, judged by the functions themselves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Reals
from femtune.identification.input_known import InputKnown, identify_frfs
from femtune.identification.kinds import ChannelRule
from femtune.identification.window import with_window
from femtune.modal import FrfSet

_WORDS = {
    "coherence": "the lowest coherence",
    "noise": "the highest relative noise",
    "fit": "the largest error of the identified system",
}


@dataclass(frozen=True, eq=False)
class Quality:
    """Quality of the outputs of a test, or of its inputs where it has one output and several inputs.

    Parameters
    ----------
    rule : "coherence": mean coherence over inputs and lines; "noise": see `relative_noise`; "fit": error of an
        identified system over all inputs and lines, relative to the functions there
    values : (channels,) NaN for channels that were not measured
    of_inputs : whether the channels are the inputs, as with a moved hammer and one sensor
    """

    rule: ChannelRule
    values: Reals
    of_inputs: bool = False

    @property
    def order(self) -> list[int]:
        """Positions of the measured channels, the worst first."""
        known = np.flatnonzero(np.isfinite(self.values))
        badness = -self.values if self.rule == "coherence" else self.values
        return sorted((int(i) for i in known), key=lambda i: (-badness[i], i))

    @property
    def words(self) -> str:
        """The name of the measure that ranks them."""
        return _WORDS[self.rule]


def quality(frfs: FrfSet, rule: ChannelRule | None = None, asked: InputKnown | None = None) -> Quality:
    """By coherence where the functions have it and no rule is given, otherwise by noise.

    Functions without coherence have none by that rule.

    Parameters
    ----------
    asked : options of the identification for "fit" (errors as `identify_frfs`)
    """
    chosen: ChannelRule = rule or ("noise" if frfs.coherence is None else "coherence")
    of_inputs = _one_output(frfs)
    if chosen == "fit":
        asked = asked or InputKnown()
        found = identify_frfs(frfs, asked)
        left = with_window(found.system, asked.decay).frf(found.measured.freq_hz).values - found.measured.values
        # together, since functions across the axes of a structure are nearly zero
        miss, size = (np.linalg.norm(_by_channel(v, of_inputs), axis=(1, 2)) for v in (left, found.measured.values))
        return Quality(chosen, np.divide(miss, size, out=np.full(len(size), np.nan), where=size > 0.0), of_inputs)
    if chosen == "noise":
        return Quality(chosen, relative_noise(_by_channel(frfs.values, of_inputs)), of_inputs)
    coherence = np.full(frfs.values.shape, np.nan) if frfs.coherence is None else frfs.coherence
    known = np.where(np.isfinite(frfs.values), coherence, np.nan)
    return Quality(chosen, np.array([_mean(one) for one in _by_channel(known, of_inputs)]), of_inputs)


def _one_output(frfs: FrfSet) -> bool:
    """Whether one output was measured with several inputs."""
    return int(np.isfinite(frfs.values).any(axis=(1, 2)).sum()) == 1 and len(frfs.references) > 1


def _by_channel(values: NDArray[Any], of_inputs: bool) -> NDArray[Any]:
    return values.swapaxes(0, 1) if of_inputs else values


def relative_noise(values: Complexes) -> Reals:
    """(channels,) noise relative to the magnitude, from the scatter between neighbouring lines.

    A value differs from the mean of its neighbours by √1.5 times the noise of one value, and by the curvature of the
    function. The median over all lines and inputs leaves the few lines at resonances out, where the curvature counts;
    the lines must be closer to each other than the half-power bandwidths.

    Parameters
    ----------
    values : (channels, others, lines) of FRFs
    """
    step = np.abs(values[:, :, 1:-1] - 0.5 * (values[:, :, :-2] + values[:, :, 2:])) / np.sqrt(1.5)
    size = np.abs(values[:, :, 1:-1])
    ratio = np.divide(step, size, out=np.full(step.shape, np.nan), where=size > 0.0)
    # the magnitude of a complex normal value has the median √(2 ln 2) σ
    return np.array([_median(one) for one in ratio]) / np.sqrt(2.0 * np.log(2.0))


def _mean(values: Reals) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def _median(values: Reals) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")
