"""The study of a subframe in one or two states: FRFs of tests with one damping ratio on both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from structures.subframe import MOUNT_INERTIA, MOUNT_MASS
from structures.subframe_campaign import SETS, Laboratory, Measured, State, half_width

EQUALISED, WEIGHT, FLOOR = 0.01, 0.05, 0.01
"""Damping ratio on both sides, and the weights of the equalised FRFs."""


@dataclass(frozen=True)
class Compared:
    """The test of one state.

    Parameters
    ----------
    measured : its lines, all of which are identified
    band_hz : what is compared
    left_out_hz : modes of the model that the test does not show, at the initial values
    """

    state: State
    measured: Measured
    band_hz: tuple[float, float]
    left_out_hz: tuple[float, ...] = ()


@dataclass(frozen=True)
class Plan:
    """One study.

    Parameters
    ----------
    lab : the structure, its parameters and channels
    tests : in one or both states
    bootstraps : runs; 0 for none
    order : of the largest model of the identification
    lines : in a half bandwidth
    """

    lab: Laboratory
    tests: tuple[Compared, ...]
    bootstraps: int = 0
    order: int = 60
    lines: float = 2.0


def held_out(outputs: Sequence[str]) -> list[str]:
    """Channels that the update does not use, 18 of 47, over the whole structure."""
    count = round(18 / 47 * len(outputs))
    return [outputs[int((i + 0.5) * len(outputs) / count)] for i in range(count)]


def study(plan: Plan) -> str:
    """Damping equalised on both sides, from the values of the deck."""
    parts = [_head(plan), *(_configuration(plan, t) for t in plan.tests), *(_residual(plan, t) for t in plan.tests)]
    parts += [
        f"[[hold_out]]\noutputs = {_quoted(held_out(plan.lab.outputs))}\n",
        f"[equalise]\ndamping = {EQUALISED}\nlargest_order = {plan.order}\nlines = {plan.lines}\n",
    ]
    if plan.bootstraps:
        parts.append(f"[bootstrap]\nruns = {plan.bootstraps}\nchecked = 0\n")
    return "\n".join([*parts, *_parameters(plan.lab)])


def _head(plan: Plan) -> str:
    highest = max(test.band_hz[1] for test in plan.tests)
    return f"""[study]
title = "Subframe, {plan.lab.channels} channels, {len(plan.lab.inputs)} inputs, {plan.lab.parameters} parameters"
deck = "subframe.bdf"
units = "m-kg-s"

[modes]
max_hz = {highest}

[sensors]
by_id = true                     # the files have no coordinates; the deck has a grid point for each sensor

[reduction]
"""


def _configuration(plan: Plan, test: Compared) -> str:
    own = ""
    if test.state.loaded:
        inertia = [MOUNT_INERTIA] * 3
        masses = (f"{{ node = {n}, mass = {MOUNT_MASS}, inertia = {inertia} }}" for n in plan.lab.mesh.mounts)
        own = f"masses = [{', '.join(masses)}]\n"
    return f'[[configuration]]\nname = "{test.state.name}"\ntest = "{test.state.name}.uff"\n{own}'


def _residual(plan: Plan, test: Compared) -> str:
    held = held_out(plan.lab.outputs)
    left_out = f"leave_out_modes_hz = {list(test.left_out_hz)}\n" if test.left_out_hz else ""
    return f"""[[residual]]
kind = "frf"
configuration = "{test.state.name}"
outputs = {_quoted([name for name in plan.lab.outputs if name not in held])}
from_hz = {test.band_hz[0]}
to_hz = {test.band_hz[1]}
sd = {WEIGHT}
floor = {FLOOR}
{left_out}"""


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
