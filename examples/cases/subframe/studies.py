"""The study of a subframe: FRFs of a test with one damping ratio on both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from structures.subframe_campaign import SETS, Laboratory, Measured, State, half_width

EQUALISED, WEIGHT, FLOOR = 0.01, 0.05, 0.01
"""Damping ratio on both sides, and the weights of the equalised FRFs."""


@dataclass(frozen=True)
class Compared:
    """The test of one state: measured lines, and the band that is compared, in Hz."""

    state: State
    measured: Measured
    band_hz: tuple[float, float]


@dataclass(frozen=True)
class Effort:
    """Model order of the identification, lines in a half bandwidth, starts and samples of the search."""

    order: int
    lines: float
    starts: int
    samples: int


def held_out(outputs: Sequence[str]) -> list[str]:
    """Eighteen of 47 channels, over the whole structure."""
    count = round(18 / 47 * len(outputs))
    return [outputs[int((i + 0.5) * len(outputs) / count)] for i in range(count)]


def equalised(lab: Laboratory, test: Compared, effort: Effort) -> str:
    """Damping equalised on both sides, from the values of the deck."""
    low, high = test.measured.band_hz
    return "\n".join([
        _head(lab, test), _residual(lab, test),
        "[equalise]", f"damping = {EQUALISED}", f"band_hz = [{low}, {high}]", f"largest_order = {effort.order}",
        f"lines = {effort.lines}", "",
        "[update]", f"starts = {effort.starts}", f"samples = {effort.samples}", "",
        *_parameters(lab),
    ])  # fmt: skip


def _head(lab: Laboratory, test: Compared) -> str:
    return f"""[study]
title = "Subframe, {lab.channels} channels and {len(lab.inputs)} inputs"
deck = "subframe.bdf"
units = "m-kg-s"

[modes]
max_hz = {test.measured.band_hz[1]}

[test]
file = "{test.state.name}.uff"

[sensors]
by_id = true                     # the file has no coordinates; the deck has a grid point for each sensor

[reduction]
"""


def _residual(lab: Laboratory, test: Compared) -> str:
    held = held_out(lab.outputs)
    return f"""[[residual]]
kind = "frf"
outputs = {_quoted([name for name in lab.outputs if name not in held])}
from_hz = {test.band_hz[0]}
to_hz = {test.band_hz[1]}
sd = {WEIGHT}
floor = {FLOOR}

[[hold_out]]
outputs = {_quoted(held)}
"""


def _parameters(lab: Laboratory) -> list[str]:
    tables = []
    for name, entries in SETS[lab.parameters].items():
        fields = [f"{card} {number} {'T' if card == 'PSHELL' else 'E'}" for card, number in entries]
        half = half_width(name)
        tables.append(f"""[[parameter]]
name = "{name}"
fields = {_quoted(fields)}
lower = {1.0 - half:.6g}
upper = {1.0 + half:.6g}
""")
    return tables


def _quoted(texts: Sequence[str]) -> str:
    return "[" + ", ".join(f'"{text}"' for text in texts) + "]"
