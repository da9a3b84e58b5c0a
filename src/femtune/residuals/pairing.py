"""Test modes and model modes of a case paired, followed from point to point, and changes of the pairing in words."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.correlation import Pairing, pair_modes
from femtune.correlation.order import other_orders, scatter
from femtune.correlation.pairing import closeness, visible_modes
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import EigenSolution
from femtune.residuals.case import ComparedCase, Group


def solve_case(case: ComparedCase, x: NDArray) -> EigenSolution:
    """Modes of the case at a normalised parameter vector."""
    return case.solver.modes(case.configured.at(x), case.count, case.max_hz)


def modes_at_sensors(case: ComparedCase, solution: EigenSolution) -> ModeSet:
    """The wanted model modes sampled at the sensors."""
    shapes = case.sensors @ solution.shapes[:, : solution.wanted]
    return ModeSet(solution.freq_hz, shapes, case.test.dofs, normalisation="mass", source="model")


def pair_case(case: ComparedCase, solution: EigenSolution) -> Pairing:
    """Pair the test's modes with the model's."""
    return pair_modes(
        case.test,
        modes_at_sensors(case, solution),
        frequency_gate=case.rules.frequency_gate,
        mac_gate=case.rules.mac_gate,
        relative_gap=case.rules.relative_gap,
        fixed=case.fixed,
        never=case.never,
        left_out=case.left_out,
        rigid=0 if len(case.test.dofs) else rigid_count(case, solution),
    )


_RIGID = 0.01
"""Frequency over the lowest one of the test below which a mode of the model is a rigid-body mode, full or reduced."""


def rigid_count(case: ComparedCase, solution: EigenSolution) -> int:
    """Number of modes far below all of the test, which are rigid-body modes but for rounding."""
    return int(np.sum(solution.freq_hz < _RIGID * np.min(case.test.freq_hz, initial=np.inf)))


def groups_of(pairing: Pairing) -> tuple[Group, ...]:
    """Single pairs and whole clusters, by test position."""
    singles: list[Group] = [((p.test,), (p.model,)) for p in pairing.pairs if p.cluster is None]
    clusters: list[Group] = [(tuple(c.test), tuple(c.model)) for c in pairing.clusters]
    return tuple(sorted(singles + clusters))


def track(groups: tuple[Group, ...], old: EigenSolution, new: EigenSolution) -> tuple[Group, ...]:
    """The same motions at another point: each old model mode is followed to the new one nearest to it (by M).

    Raises
    ------
    FemtuneError : ``residual.modes-lost`` if the model has fewer modes there than are followed
    """
    members = [j for _, models in groups for j in models]
    if not members:
        return groups
    if new.shapes.shape[1] < len(members):
        raise FemtuneError("residual.modes-lost", modes=new.shapes.shape[1], paired=len(members))
    overlap = old.shapes[:, members].T @ (new.point.mass @ new.shapes)
    followed = dict(zip(members, linear_sum_assignment(-(overlap**2))[1].tolist()))
    return tuple((tests, tuple(followed[j] for j in models)) for tests, models in groups)


def keep_paired(before: tuple[Group, ...], fresh: tuple[Group, ...]) -> tuple[Group, ...]:
    """Fresh groups, plus tracked ones whose test modes the gates would drop now and whose model modes are free.

    A mode that left the residual would lower the objective without any gain: where a test mode would still lose its
    partner to another one, all groups stay as they were tracked.
    """
    tests = {i for group, _ in fresh for i in group}
    models = {j for _, group in fresh for j in group}
    kept = [g for g in before if not tests & set(g[0]) and not models & set(g[1])]
    pairs = tuple(sorted([*fresh, *kept]))
    lost = {i for group, _ in before for i in group} - {i for group, _ in pairs for i in group}
    return before if lost else pairs


Joined = tuple[frozenset[int], ...]
"""Sets of test modes of one case that are compared as one subspace each, however close they are."""


def join(groups: tuple[Group, ...], joined: Iterable[frozenset[int]]) -> tuple[Group, ...]:
    """Groups in which all that have a test mode of one of the sets are one group."""
    for tests in joined:
        inside = [g for g in groups if tests & set(g[0])]
        one = tuple(sorted(i for g in inside for i in g[0])), tuple(sorted(j for g in inside for j in g[1]))
        groups = tuple(sorted([*(g for g in groups if g not in inside), *([one] if inside else [])]))
    return groups


def alternating(changes: Sequence[tuple[tuple[Group, ...], tuple[Group, ...]]]) -> Joined:
    """Sets of test modes whose partners or groups changed, from groups before and after each change at one point.

    Test modes belong together if they were in one group, or had one partner.
    """
    clusters: list[set[int]] = []
    for before, after in changes:
        changed = set(before) ^ set(after)
        for tests, models in changed:
            near = {i for other, theirs in changed if set(models) & set(theirs) for i in other} | set(tests)
            touched = [known for known in clusters if known & near]
            clusters = [known for known in clusters if known not in touched] + [near.union(*touched)]
    return tuple(frozenset(known) for known in clusters if len(known) > 1)


# ----------------------------------------------------------------------------------------------------
# Pairings other than the one that was chosen.


LOW_MAC = 0.9
"""MAC of a pair below which another partner is considered; the usual criterion of a good pair."""
_OPEN = 0.1
"""Loss of the sum of MACs up to which another pairing is open whatever the MACs are."""
_OPEN_WHERE_LOW = 0.6
"""The same where one of the pairs has a low MAC: at a wrong minimum the shapes of close modes are mixed, and the right
partner may look worse by much."""
_OPEN_RATIO = 1.35
"""Ratio of frequencies up to which a model mode is considered as another partner, about that of the frequency gate."""


@dataclass(frozen=True)
class OtherPairing:
    """Groups of a case in which one or two test modes have other partners.

    Parameters
    ----------
    case : position of the case in the problem
    groups : of that case
    loss : of the sum of MACs; smaller or negative values are more likely
    sentence : the other pairs, in words
    """

    case: int
    groups: tuple[Group, ...]
    loss: float
    sentence: str


def other_pairings(
    position: int, case: ComparedCase, groups: Sequence[Group], solution: EigenSolution
) -> list[OtherPairing]:
    """Exchanges of partners that the MACs leave open, the most likely first; of pairs that are fixed by hand none.

    Two test modes exchange their partners, or one takes a model mode that has none. It is open where the sum of MACs
    hardly changes, or one of the MACs is low. Close modes that are compared as subspaces keep theirs.
    """
    if not len(case.test):
        return []
    model = modes_at_sensors(case, solution)
    if not len(case.test.dofs):
        return _other_orders(position, case, groups, solution)
    mac, distance = closeness(case.test, model)
    fixed = {i for i, _ in case.fixed}
    partner = {g[0][0]: g[1][0] for g in groups if len(g[0]) == len(g[1]) == 1 and g[0][0] not in fixed}
    taken = {j for _, models in groups for j in models}
    free = [int(j) for j in np.flatnonzero(visible_modes(model)) if j not in taken]
    near = _near(case, distance)
    pairings: list[OtherPairing] = []

    def consider(new: dict[int, int], sentence: str) -> None:
        loss = sum(mac[i, partner[i]] - mac[i, j] for i, j in new.items())
        low = min(mac[i, partner[i]] for i in new) < LOW_MAC
        if all(near[i, j] for i, j in new.items()) and loss <= (_OPEN_WHERE_LOW if low else _OPEN):
            others = [g for g in groups if not (len(g[0]) == 1 and g[0][0] in new)]
            changed = tuple(sorted([*others, *(((i,), (j,)) for i, j in new.items())]))
            pairings.append(OtherPairing(position, changed, float(loss), f"{case.name}: {sentence}"))

    for i, j in partner.items():
        for k in free:
            consider({i: k}, _with(case, {i: k}))
        for other, k in partner.items():
            if other > i:
                consider({i: k, other: j}, _with(case, {i: k, other: j}))
    return sorted(pairings, key=lambda one: (one.loss, one.sentence))


def _near(case: ComparedCase, distance: Reals) -> NDArray[np.bool_]:
    """(t, m) pairs whose frequencies are near enough, without those that the study forbids."""
    near = np.asarray(distance <= np.log(_OPEN_RATIO) ** 2)
    for i, j in case.never:
        if j < near.shape[1]:
            near[i, j] = False
    return near


def _other_orders(
    position: int, case: ComparedCase, groups: Sequence[Group], solution: EigenSolution
) -> list[OtherPairing]:
    """Of frequencies without shapes: orders in which the test misses a mode of the model; with pairs that are fixed by
    hand none. `loss` is the growth of the scatter of the frequencies."""
    if case.fixed:
        return []
    partners = {g[0][0]: g[1][0] for g in groups}
    hz, model_hz = case.test.freq_hz, solution.freq_hz[: solution.wanted]
    now = scatter(hz, model_hz, partners)
    return [
        OtherPairing(
            position,
            tuple(sorted(((i,), (j,)) for i, j in one.partners.items())),
            one.scatter - now,
            f"{case.name}: {_missed(one.skipped[0], model_hz)}",
        )
        for one in other_orders(hz, model_hz, partners, rigid_count(case, solution))
        if one.of_model and not set(case.never) & set(one.partners.items())
    ]


def _missed(j: int, model_hz: NDArray) -> str:
    return f"model mode {j + 1} ({model_hz[j]:.4g} Hz) without a partner, and the test modes above it one mode higher"


def crossed(case: ComparedCase, groups: Sequence[Group]) -> bool:
    """True if test modes of higher frequencies have model modes of lower ones as partners, close modes apart."""
    first = [min(models) for tests, models in sorted(groups, key=lambda g: float(case.test.freq_hz[list(g[0])].min()))]
    return first != sorted(first)


def in_order(case: ComparedCase, groups: Sequence[Group]) -> tuple[Group, ...]:
    """Test modes and their model modes paired one by one by the order of their frequencies; with pairs that are fixed
    or forbidden by hand the groups as they are."""
    if case.fixed or case.never:
        return tuple(groups)
    tests = sorted((i for group, _ in groups for i in group), key=lambda i: float(case.test.freq_hz[i]))
    models = sorted(j for _, group in groups for j in group)
    return tuple(sorted(((i,), (j,)) for i, j in zip(tests, models)))


def _with(case: ComparedCase, pairs: dict[int, int]) -> str:
    return " and ".join(f"test mode {case.test.labels[i]} with model mode {j + 1}" for i, j in pairs.items())


def completed(
    case: ComparedCase, groups: tuple[Group, ...], solution: EigenSolution, tests: Collection[int]
) -> tuple[Group, ...] | None:
    """Groups in which all of some test modes have a partner, whatever the gates say; None without enough model modes.

    Two points at which different test modes find partners are compared by the same comparisons thus.
    """
    missing = sorted(set(tests) - {i for group, _ in groups for i in group})
    if not missing:
        return groups
    taken = {j for _, models in groups for j in models}
    free = [j for j in range(solution.wanted) if j not in taken]
    if len(free) < len(missing):
        return None
    mac, distance = closeness(case.test, modes_at_sensors(case, solution))
    worth = (mac - distance)[np.ix_(missing, free)]
    rows, columns = linear_sum_assignment(worth, maximize=True)
    return tuple(sorted([*groups, *(((missing[r],), (free[c],)) for r, c in zip(rows, columns))]))


def describe_change(case: ComparedCase, before: tuple[Group, ...], after: tuple[Group, ...]) -> list[str]:
    """Sentences on test modes whose partners changed."""
    old, new = ({i: models for tests, models in groups for i in tests} for groups in (before, after))
    sentences = []
    for i in sorted(old.keys() | new.keys()):
        if old.get(i) != new.get(i):
            partners = f"{_partner(old.get(i))} before, {_partner(new.get(i))} now"
            sentences.append(f"{case.name}: test mode {case.test.labels[i]} {partners}")
    return sentences


def describe_joined(case: ComparedCase, joined: Joined) -> list[str]:
    """Sentences on test modes that are compared as one subspace from here on."""
    return [
        f"{case.name}: test modes {' and '.join(case.test.labels[i] for i in sorted(tests))} are compared as one "
        "subspace from here on, because their pairing alternated"
        for tests in joined
    ]


def _partner(models: tuple[int, ...] | None) -> str:
    if not models:
        return "without partner"
    return "with model mode " + " and ".join(str(j + 1) for j in models)
