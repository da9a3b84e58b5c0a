"""The study of a family of subframes: one configuration and one specimen for each component."""

from __future__ import annotations

from dataclasses import dataclass

from structures.subframe_campaign import Laboratory
from structures.subframe_study import Compared, bootstrap, equalise, head, parameters, residual


@dataclass(frozen=True)
class Effort:
    """What a study spends.

    Parameters
    ----------
    order : of the largest model of the identification
    lines : in a half bandwidth
    starts, samples : of the search
    bootstraps : runs; 0 for none
    components : that are tested
    """

    order: int = 30
    lines: float = 2.0
    starts: int = 1
    samples: int = 0
    bootstraps: int = 0
    components: int = 3


def specimen(component: int) -> str:
    """The name of a component, of its configuration and of its test."""
    return f"ID{component + 1}"


def family(lab: Laboratory, test: Compared, effort: Effort) -> str:
    """All components jointly and separately, from the values of the deck, with damping equalised on both sides."""
    names = [specimen(i) for i in range(effort.components)]
    return "\n".join([
        head(lab, test.band_hz[1]),
        *(f'[[configuration]]\nname = "{n}"\nspecimen = "{n}"\ntest = "{n}.uff"\n' for n in names),
        residual(lab, test),
        equalise(effort.order, effort.lines),
        f"[update]\nstarts = {effort.starts}\nsamples = {effort.samples}\n",
        bootstrap(effort.bootstraps),
        parameters(lab, individual=True),
    ])  # fmt: skip


def single(lab: Laboratory, test: Compared, order: int) -> str:
    """One component: damping equalised on both sides, then the measured FRFs."""
    return "\n".join([
        head(lab, test.band_hz[1]), f'[test]\nfile = "{specimen(0)}.uff"\n', residual(lab, test),
        equalise(order, 1.0, "raw"), "[update]\nlook_further = false\n", parameters(lab),
    ])  # fmt: skip
