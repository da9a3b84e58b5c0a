"""Studies of the subframe: FRFs of simulated tests with one damping ratio on both sides, and what they find.

Both examples of the subframe use them; see `structures.subframe_campaign` for the laboratory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.modal import FrfSet
from femtune.steps.run.result import RunResult
from femtune.steps.validate.record.frf_deviation import ChannelDeviation, DataSet
from structures.subframe_campaign import SETS, Laboratory, Measured, State, deviation_sd, half_width

EQUALISED, WEIGHT, FLOOR = 0.01, 0.05, 0.01
"""Damping ratio on both sides; σ of the equalised FRFs, relative to a value and to the largest of its FRF."""
MAC, WITHIN, LIMIT, SHARE = 0.95, 2.0, 3.0, 0.9
"""Least MAC of the pairs; standard deviations within which this share of the errors lies, and all but one."""


@dataclass(frozen=True)
class Compared:
    """The test of one state.

    Parameters
    ----------
    measured : its lines
    band_hz : what is compared
    end_hz : where the lines end that are identified: at the smallest response between these limits, so that a group of
        close modes stays outside; None: at the last line. Lines well above the compared band are worth having: the
        modes there are identified and get the damping ratio of the model
    left_out_hz : modes of the model that the test does not show, at the initial values
    """

    state: State
    measured: Measured
    band_hz: tuple[float, float]
    end_hz: tuple[float, float] | None = None
    left_out_hz: tuple[float, ...] = ()

    def test(self, lab: Laboratory, component: int) -> FrfSet:
        """The simulated test of a component, up to where it is identified."""
        whole = lab.test(self.state, component, self.measured)
        if self.end_hz is None:
            return whole
        lines = whole.freq_hz
        inside = (lines >= self.end_hz[0]) & (lines <= self.end_hz[1])
        size = np.where(inside, np.sum(np.abs(whole.values) ** 2, axis=(0, 1)), np.inf)
        kept = lines <= lines[np.argmin(size)]
        return replace(whole, freq_hz=lines[kept], values=whole.values[:, :, kept])


def held_out(outputs: Sequence[str]) -> list[str]:
    """Channels that the update does not use, 18 of 47, over the whole structure."""
    count = round(18 / 47 * len(outputs))
    return [outputs[int((i + 0.5) * len(outputs) / count)] for i in range(count)]


def head(lab: Laboratory, max_hz: float) -> str:
    """The first tables of a study."""
    return f"""[study]
title = "Subframe, {lab.channels} channels, {len(lab.inputs)} inputs, {lab.parameters} parameters"
deck = "subframe.bdf"
units = "m-kg-s"

[modes]
max_hz = {max_hz}

[sensors]
by_id = true                     # the files have no coordinates; the deck has a grid point for each sensor

[reduction]

[[hold_out]]
outputs = {quoted(held_out(lab.outputs))}
"""


def residual(lab: Laboratory, test: Compared, configuration: str = "") -> str:
    """FRFs of a configuration, or of all."""
    held = held_out(lab.outputs)
    own = f'configuration = "{configuration}"\n' if configuration else ""
    left_out = f"leave_out_modes_hz = {list(test.left_out_hz)}\n" if test.left_out_hz else ""
    return f"""[[residual]]
kind = "frf"
{own}outputs = {quoted([name for name in lab.outputs if name not in held])}
from_hz = {test.band_hz[0]}
to_hz = {test.band_hz[1]}
sd = {WEIGHT}
floor = {FLOOR}
{left_out}"""


def equalise(order: int, lines: float, then: str = "nothing") -> str:
    """One damping ratio on both sides; the largest order of the identification, and lines in a half bandwidth."""
    return f'[equalise]\ndamping = {EQUALISED}\nlargest_order = {order}\nlines = {lines}\nthen = "{then}"\n'


def bootstrap(runs: int) -> str:
    """Frequency lines of the measured FRFs drawn with replacement; "" for no runs."""
    return f"[bootstrap]\nruns = {runs}\nchecked = 0\n" if runs else ""


def parameters(lab: Laboratory, individual: bool = False) -> str:
    """Factors on the deck with their bounds; all but those of the laboratory's common ones may be individual."""
    tables = []
    for name, entries in SETS[lab.parameters].items():
        fields = [f"{card} {number} {'T' if card == 'PSHELL' else 'E'}" for card, number in entries]
        half = half_width(name)
        own = "individual = true\n" if individual and name not in lab.common else ""
        tables.append(f"""[[parameter]]
name = "{name}"
fields = {quoted(fields)}
{own}lower = {1.0 - half:.6g}
upper = {1.0 + half:.6g}
""")
    return "\n".join(tables)


def quoted(texts: Sequence[str]) -> str:
    """A list of texts in a study."""
    return "[" + ", ".join(f'"{text}"' for text in texts) + "]"


# ----------------------------------------------------------------------------------------------------
# What a study finds.


@dataclass(frozen=True)
class Estimate:
    """A parameter of one component, as a factor on the deck."""

    component: int
    name: str
    truth: float
    value: float
    sd: float

    @property
    def z(self) -> float:
        """Error in stated standard deviations."""
        return (self.value - self.truth) / self.sd


def channels(run: RunResult, data: DataSet) -> list[ChannelDeviation]:
    """FRFs of the calibration or of the validation set."""
    found = run.results.validation
    assert found is not None
    assert found.deviations is not None
    return [c for c in found.deviations.channels if c.data == data]


def risen(run: RunResult, tests: dict[str, tuple[Compared, FrfSet]]) -> list[str]:
    """Held-out FRFs whose δ has risen by more than two standard deviations of its noise."""
    sd: dict[tuple[str, str, str], float] = {}
    for name, (test, frfs) in tests.items():
        labels = [(o, i) for o in frfs.responses.labels() for i in frfs.references.labels()]
        found = deviation_sd(frfs, test.measured, test.band_hz).ravel().tolist()
        sd |= {(name, *label): one for label, one in zip(labels, found)}
    return [
        f"{c.configuration} {c.output} by {c.input}"
        for c in channels(run, "validation")
        if c.after > c.before + WITHIN * sd[c.configuration, c.output, c.input]
    ]


def verdict(met: bool) -> str:
    """Of a criterion, in words."""
    return "met" if met else "not met"
