"""The study of a subframe in one or two states: FRFs of tests with one damping ratio on both sides."""

from __future__ import annotations

from dataclasses import dataclass

from structures.subframe import MOUNT_INERTIA, MOUNT_MASS
from structures.subframe_campaign import Laboratory
from structures.subframe_study import Compared, bootstrap, equalise, head, parameters, residual


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
    then : what follows the update with equal damping, "raw" or "nothing"
    """

    lab: Laboratory
    tests: tuple[Compared, ...]
    bootstraps: int = 0
    order: int = 60
    lines: float = 2.0
    then: str = "nothing"


def study(plan: Plan) -> str:
    """Damping equalised on both sides, from the values of the deck."""
    return "\n".join([
        head(plan.lab, max(test.band_hz[1] for test in plan.tests)),
        *(_configuration(plan, t) for t in plan.tests),
        *(residual(plan.lab, t, t.state.name) for t in plan.tests),
        equalise(plan.order, plan.lines, plan.then),
        bootstrap(plan.bootstraps),
        parameters(plan.lab),
    ])  # fmt: skip


def _configuration(plan: Plan, test: Compared) -> str:
    own = ""
    if test.state.loaded:
        inertia = [MOUNT_INERTIA] * 3
        masses = (f"{{ node = {n}, mass = {MOUNT_MASS}, inertia = {inertia} }}" for n in plan.lab.mesh.mounts)
        own = f"masses = [{', '.join(masses)}]\n"
    return f'[[configuration]]\nname = "{test.state.name}"\ntest = "{test.state.name}.uff"\n{own}'
