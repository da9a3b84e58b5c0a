"""Pairing of test and model modes: one to one, by optimal assignment, clusters as subspaces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.correlation.order import OtherOrder, better_order, in_ascending_order, scatter
from femtune.errors import ErrorCollector, FemtuneError, Notice
from femtune.modal import ModeSet, Rotation, clusters, rotate_to
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.shape_criteria import check_shapes, mac_where_defined
from femtune.modal.subspace import projection

# ----------------------------------------------------------------------------------------------------
# What a pairing chooses from: scores and frequency errors of every test mode with every model mode.


INVISIBLE = 1e-6
"""A model mode that moves the sensors less than this fraction of the most visible mode cannot be seen there."""

_LEAST_RATIO = 1e-6
"""Ratio of frequencies, model over test, below which all are alike: those of rigid-body modes are round-off."""


@dataclass(frozen=True)
class CandidatePairs:
    """Scores before anything is paired.

    Parameters
    ----------
    score : (t, m) MAC, for members of a cluster the share of the test shape in the cluster's subspace; NaN where
        undefined
    frequency_error : (t, m) (model − test)/test
    groups : clusters of two or more close model modes, by position
    """

    score: Reals
    frequency_error: Reals
    groups: tuple[tuple[int, ...], ...]
    visible: NDArray[np.bool_]
    notices: tuple[Notice, ...]


def candidates(test: ModeSet, model: ModeSet, relative_gap: float) -> CandidatePairs:
    """Compare every test mode with every model mode (errors ``correlate.dofs-differ``, ``modal.zero-shape``)."""
    _check_dofs(test, model)
    check_shapes(test.shapes, "the test")
    visible = visible_modes(model)
    groups, notices = _groups(model, visible, _measured_rows(test), relative_gap)
    score = mac_where_defined(test.shapes, np.where(visible, model.shapes, 0.0))
    for group in groups:
        score[:, group] = projection(model.shapes[:, group], test.shapes)[:, None]
    return CandidatePairs(score, frequency_errors(test.freq_hz, model.freq_hz), groups, visible, notices)


def frequency_errors(test_hz: Reals, model_hz: Reals) -> Reals:
    """(model − test)/test of every combination, (t, m); infinite where the test says 0 Hz."""
    t, m = np.meshgrid(test_hz, model_hz, indexing="ij")
    return np.where(t > 0.0, m - t, np.inf) / np.where(t > 0.0, t, 1.0)


def closeness(test: ModeSet, model: ModeSet) -> tuple[Reals, Reals]:
    """MAC, zero where it is undefined, and ln²(model/test) of the frequencies, (t, m) each."""
    visible = visible_modes(model)
    mac = np.nan_to_num(mac_where_defined(test.shapes, np.where(visible, model.shapes, 0.0)))
    return mac, log_distance(frequency_errors(test.freq_hz, model.freq_hz))


def log_distance(frequency_error: Reals) -> Reals:
    """ln²(model/test) of relative errors, a convex function of the difference of the logarithms."""
    return np.asarray(np.log(np.maximum(1.0 + frequency_error, _LEAST_RATIO)) ** 2)


def visible_modes(model: ModeSet) -> NDArray[np.bool_]:
    """(m,) True where a mode moves the sensors; the others (torsion seen by axial sensors …) have no MAC."""
    size = np.sqrt(np.sum(np.where(np.isnan(model.shapes), 0.0, np.abs(model.shapes)) ** 2, axis=0))
    return np.asarray(size > INVISIBLE * size.max(initial=0.0))


def _check_dofs(test: ModeSet, model: ModeSet) -> None:
    if test.dofs != model.dofs:
        raise FemtuneError(
            "correlate.dofs-differ", values={"test": f"{len(test.dofs)} DOFs", "model": f"{len(model.dofs)} DOFs"}
        )


def _measured_rows(test: ModeSet) -> int:
    """The fewest entries that any test mode has."""
    return int(np.min(np.sum(~np.isnan(test.shapes), axis=0), initial=len(test.dofs)))


def _groups(
    model: ModeSet, visible: NDArray[np.bool_], rows: int, relative_gap: float
) -> tuple[tuple[tuple[int, ...], ...], tuple[Notice, ...]]:
    """Clusters of visible modes; one with as many modes as sensors is not used, for any shape lies in its span."""
    at = np.flatnonzero(visible)
    chains = [tuple(int(at[i]) for i in chain) for chain in clusters(model.freq_hz[at], relative_gap)]
    chains = [chain for chain in chains if len(chain) > 1]
    usable = tuple(chain for chain in chains if len(chain) < rows)
    notices = tuple(_crowded(model, chain, rows) for chain in chains if 2 * len(chain) > rows)
    return usable, notices


def _crowded(model: ModeSet, chain: tuple[int, ...], rows: int) -> Notice:
    modes = ", ".join(model.labels[i] for i in chain)
    code = "correlate.crowded-cluster/one-by-one" if len(chain) >= rows else "correlate.crowded-cluster"
    return Notice(code, count=len(chain), modes=modes, dofs=rows, mac=len(chain) / rows)


# ----------------------------------------------------------------------------------------------------
# Why a test mode found no partner, in words.


def reason_unpaired(
    i: int,
    test: ModeSet,
    model: ModeSet,
    found: CandidatePairs,
    chosen: Mapping[int, int],
    refused: Mapping[int, float],
    gates: tuple[float, float],
) -> str:
    """Best candidate of a test mode, its MAC and frequency error, and the reason why it was not paired.

    `refused` holds MACs after rotation of test modes that a cluster gave back; `gates` are (frequency, MAC).
    """
    if not np.isfinite(found.score[i]).any():
        return "all model modes are zero at the measured DOFs of this mode"
    j = _best(i, found, gates)
    solved, reached = float(model.freq_hz.max()), float(test.freq_hz.max())
    if test.freq_hz[i] > solved and abs(found.frequency_error[i, j]) > gates[0]:
        return (
            f"the model is solved to {solved:.4g} Hz, the test reaches {reached:.4g} Hz: increase max_hz or count in "
            "[modes]"
        )
    head = (
        f"the best candidate is {_named(j, model, found)} ({model.freq_hz[j]:.4g} Hz): "
        f"MAC {found.score[i, j]:.2f}, frequency error {100 * found.frequency_error[i, j]:+.1f} %"
    )
    return f"{head}; {_obstacle(i, j, test, model, found, chosen, refused, gates)}"


def _named(j: int, model: ModeSet, found: CandidatePairs) -> str:
    group = _companions(j, found)
    names = ", ".join(model.labels[k] for k in group)
    return f"model mode {names}" if len(group) == 1 else f"the cluster of model modes {names}"


def _best(i: int, found: CandidatePairs, gates: tuple[float, float]) -> int:
    """The candidate with the largest MAC among those that pass both gates, else among all."""
    score = np.nan_to_num(found.score[i], nan=-1.0)
    passes = (np.abs(found.frequency_error[i]) <= gates[0]) & (score >= gates[1])
    return int(np.argmax(score + 2.0 * passes))


def _obstacle(
    i: int,
    j: int,
    test: ModeSet,
    model: ModeSet,
    found: CandidatePairs,
    chosen: Mapping[int, int],
    refused: Mapping[int, float],
    gates: tuple[float, float],
) -> str:
    failed = []
    if abs(found.frequency_error[i, j]) > gates[0]:
        failed.append(f"the frequency difference exceeds the frequency gate of {100 * gates[0]:.3g} %")
    if not found.score[i, j] >= gates[1]:
        failed.append(f"the MAC is below the MAC gate of {gates[1]:.2f}")
    if failed:
        return " and ".join(failed)
    if i in refused:
        return f"the MAC after rotation within its cluster is {refused[i]:.2f}, below the gate of {gates[1]:.2f}"
    return _taken(j, test, found, chosen)


def _taken(j: int, test: ModeSet, found: CandidatePairs, chosen: Mapping[int, int]) -> str:
    holders = [test.labels[i] for i, k in chosen.items() if k in _companions(j, found)]
    return (
        f"it is paired with test mode {', '.join(holders)}"
        if holders
        else "the assignment as a whole is better without it"
    )


def _companions(j: int, found: CandidatePairs) -> tuple[int, ...]:
    """The cluster of a model mode, itself included."""
    return next((group for group in found.groups if j in group), (j,))


def no_pairs(test: ModeSet, reasons: Mapping[int, str], source: str = "") -> FemtuneError:
    """The error ``correlate.no-pairs`` for a caller that cannot go on without pairs.

    Parameters
    ----------
    reasons : why each test mode is unpaired, by position
    source : which test, for the message
    """
    shown = list(reasons.items())[:8]
    values = {f"test mode {test.labels[i]} ({test.freq_hz[i]:.4g} Hz)": reason for i, reason in shown}
    if len(reasons) > len(shown):
        values["…"] = f"and {len(reasons) - len(shown)} more"
    return FemtuneError("correlate.no-pairs", values=values, modes=len(test), source=" of " + source if source else "")


# ----------------------------------------------------------------------------------------------------
# Frequencies without shapes.


def _pairs_in_order(
    test: ModeSet,
    model: ModeSet,
    fixed: Sequence[tuple[int, int]],
    left_out: Mapping[int, str],
    gates: tuple[float, float],
    rigid: int,
) -> Pairing:
    """Pairs by ascending order of the frequencies and by hand, and what their order leaves open."""
    errors = ErrorCollector()
    for name, size, used in (("test", len(test), [i for i, _ in fixed]), ("model", len(model), [j for _, j in fixed])):
        with errors.catch():
            _check_fixed(name, size, used)
    with errors.catch():
        # a mode that is left out may be paired by hand all the same: this says where the order goes on
        _check_left_out(len(test), set(), left_out)
    errors.raise_if_any()
    by_hand = {i for i, _ in fixed}
    partners = in_ascending_order(test.freq_hz, len(model), fixed, rigid)
    error = frequency_errors(test.freq_hz, model.freq_hz)
    pairs, unpaired = [], []
    for i in range(len(test)):
        j = partners.get(i)
        if i in left_out:
            unpaired.append(Unpaired(i, left_out[i], left_out=True))
        elif j is None:
            unpaired.append(Unpaired(i, "in ascending order the model has no further mode for it"))
        elif i not in by_hand and abs(error[i, j]) > gates[0]:
            reason = (
                f"in ascending order its partner is model mode {model.labels[j]} ({model.freq_hz[j]:.4g} Hz): the "
                f"frequency error of {100 * error[i, j]:+.1f} % exceeds the frequency gate of {100 * gates[0]:.3g} %"
            )
            unpaired.append(Unpaired(i, reason))
        else:
            pairs.append(Pair(i, j, np.nan, np.nan, float(error[i, j]), i in by_hand))
    paired = {pair.model for pair in pairs}
    alone = tuple(j for j in range(len(model)) if j not in paired)
    notices = _order_notices(test, model, partners, len(by_hand), rigid)
    return Pairing(tuple(pairs), tuple(unpaired), alone, (), *gates, notices)


def _order_notices(test: ModeSet, model: ModeSet, partners: Chosen, by_hand: int, rigid: int) -> tuple[Notice, ...]:
    ordered = len(test) - by_hand
    code = "correlate.without-shapes" if ordered else "correlate.without-shapes/by-hand"
    told = Notice(code, count=ordered, modes=len(test), by_hand=by_hand)
    better = better_order(test.freq_hz, model.freq_hz, partners, rigid)
    return (told,) if better is None else (told, _doubtful(test, model, partners, better))


def _doubtful(test: ModeSet, model: ModeSet, partners: Chosen, better: OtherOrder) -> Notice:
    """The other order, with the entry of `pairs` that makes it: all modes above continue from there."""
    modes = model if better.of_model else test
    names = ", ".join(f"{modes.labels[k]} ({modes.freq_hz[k]:.4g} Hz)" for k in better.skipped)
    first = min((i for i, j in better.partners.items() if partners.get(i) != j), key=lambda i: float(test.freq_hz[i]))
    return Notice(
        "correlate.order-doubtful" if better.of_model else "correlate.order-doubtful/test",
        modes=names,
        before=100.0 * scatter(test.freq_hz, model.freq_hz, partners),
        after=100.0 * better.scatter,
        test=test.labels[first],
        model=better.partners[first] + 1,
    )


Allowed = NDArray[np.bool_]
Chosen = dict[int, int]
"""Model position of each paired test position."""

_ORDER_WEIGHT = 0.1
"""Weight of ln²(model/test) beside the MAC. Two pairs whose frequencies are 10 % apart on both sides are crossed if the
sum of their MACs grows by 0.002 or more, which is what noise of some percent on the shapes changes."""
_LEAST_WORTH = 1e-9
"""Worth of a pair that passes the gates, at least, so that it is made where nothing better is left."""


@dataclass(frozen=True)
class Pair:
    """One test mode and the model mode that it is compared with (positions from 0).

    Parameters
    ----------
    mac : of the test shape and the model's, rotated where they belong to a cluster; NaN if undefined
    mac_unrotated : with the model's own vector
    frequency_error : (model − test)/test
    fixed : True where the user paired them by hand
    cluster : position in `Pairing.clusters`, or None
    """

    test: int
    model: int
    mac: float
    mac_unrotated: float
    frequency_error: float
    fixed: bool = False
    cluster: int | None = None


@dataclass(frozen=True)
class Unpaired:
    """A test mode without partner and the reason in words; `left_out` where the user decided so, `suspension` where it
    is a mode of the suspension of a free structure."""

    test: int
    reason: str
    left_out: bool = False
    suspension: bool = False


@dataclass(frozen=True)
class ClusterMatch:
    """Test modes compared with a cluster of close model modes.

    Column k of `rotation.aligned` is paired with test mode ``test[k]``; the pair's model position is ``paired[k]``.
    """

    test: tuple[int, ...]
    model: tuple[int, ...]
    paired: tuple[int, ...]
    rotation: Rotation


@dataclass(frozen=True)
class Pairing:
    """The outcome of `pair_modes`; every test mode is in `pairs` or in `unpaired_test`. `groups` are the clusters of
    close model modes, by position."""

    pairs: tuple[Pair, ...]
    unpaired_test: tuple[Unpaired, ...]
    unpaired_model: tuple[int, ...]
    clusters: tuple[ClusterMatch, ...]
    frequency_gate: float
    mac_gate: float
    notices: tuple[Notice, ...] = ()
    never: tuple[tuple[int, int], ...] = ()
    groups: tuple[tuple[int, ...], ...] = ()

    @property
    def test_indices(self) -> tuple[int, ...]:
        """Test positions of the pairs, ascending."""
        return tuple(pair.test for pair in self.pairs)

    @property
    def model_indices(self) -> tuple[int, ...]:
        """Model positions of the pairs, in the order of `test_indices`."""
        return tuple(pair.model for pair in self.pairs)

    @property
    def suspension_count(self) -> int:
        """Number of modes of the suspension."""
        return sum(u.suspension for u in self.unpaired_test)

    @property
    def key(self) -> tuple[tuple[int, int], ...]:
        """(test, model) of every pair: two pairings are the same where their keys are equal."""
        return tuple(zip(self.test_indices, self.model_indices))


def pair_modes(
    test: ModeSet,
    model: ModeSet,
    *,
    frequency_gate: float = 0.30,
    mac_gate: float = 0.50,
    fixed: Sequence[tuple[int, int]] = (),
    never: Sequence[tuple[int, int]] = (),
    left_out: Mapping[int, str] | None = None,
    relative_gap: float = 0.01,
    rigid: int = 0,
) -> Pairing:
    """Pair test and model modes so that the sum of the MACs that pass both gates is largest.

    Frequencies without shapes (no DOFs) are paired in ascending order; left-out modes keep their place in it.

    Parameters
    ----------
    test, model : modes at the same DOFs; the model's real and mass-normalised over the whole model
    frequency_gate : largest |model − test|/test
    mac_gate : smallest MAC (after rotation, within clusters)
    fixed : (test, model) positions paired by hand, regardless of the gates
    never : (test, model) positions that are not paired
    left_out : reason for each test position that is not to be paired
    relative_gap : neighbours this close belong to one cluster, see `femtune.modal.clusters`
    rigid : number of rigid-body modes of the model, its first modes, which the order of frequencies passes over

    Raises
    ------
    FemtuneError : ``correlate.gate``, ``correlate.dofs-differ``, ``correlate.fixed-pair``, ``correlate.left-out``,
        ``modal.zero-shape`` for a test mode without motion
    """
    left_out = dict(left_out or {})
    _check_gates(frequency_gate, mac_gate)
    if not len(test.dofs):
        gates = (frequency_gate, mac_gate)
        return _without_never(model, _pairs_in_order(test, model, fixed, left_out, gates, rigid), never)
    _check_requests(len(test), len(model), fixed, left_out)
    comparison = candidates(test, model, relative_gap)
    allowed = (np.abs(comparison.frequency_error) <= frequency_gate) & (np.nan_to_num(comparison.score) >= mac_gate)
    allowed[list(left_out)] = False
    forbidden = tuple(_forbid(test, model, comparison, allowed, never))
    chosen, matches, refused = _settle(test, model, comparison, allowed, dict(fixed), mac_gate)
    pairs = _pairs(test, model, comparison, chosen, matches, dict(fixed))
    gates = (frequency_gate, mac_gate)
    unpaired = tuple(
        Unpaired(
            i,
            left_out.get(i)
            or reason_unpaired(i, test, model, comparison, chosen, refused, gates)
            + _forbidden(i, model, comparison, never),
            i in left_out,
        )
        for i in range(len(test))
        if i not in chosen
    )
    alone = tuple(j for j in range(len(model)) if j not in chosen.values())
    notices = (*comparison.notices, *forbidden)
    return Pairing(pairs, unpaired, alone, matches, *gates, notices, tuple(never), comparison.groups)


def _forbid(
    test: ModeSet, model: ModeSet, found: CandidatePairs, allowed: Allowed, never: Sequence[tuple[int, int]]
) -> Iterator[Notice]:
    """Switch off pairs in place; of a cluster all its modes, whose shapes are compared as one subspace."""
    told = set()
    for i, j in never:
        if i < len(test) and j < len(model):
            group = _companions(j, found)
            allowed[i, list(group)] = False
            if len(group) > 1 and (i, group) not in told:
                told.add((i, group))
                modes = ", ".join(model.labels[k] for k in group)
                yield Notice("correlate.never-cluster", test=test.labels[i], model=model.labels[j], modes=modes)


def _forbidden(i: int, model: ModeSet, found: CandidatePairs, never: Sequence[tuple[int, int]]) -> str:
    own = [j for test, j in never if test == i and j < len(model)]
    if not own:
        return ""
    close = " and so with its whole cluster" if any(len(_companions(j, found)) > 1 for j in own) else ""
    return f"; the study forbids its pair with model mode {', '.join(model.labels[j] for j in own)}{close}"


def _without_never(model: ModeSet, found: Pairing, never: Sequence[tuple[int, int]]) -> Pairing:
    """Pairs by the order of the frequencies without those that the study forbids; the order of the others stays."""
    found = replace(found, never=tuple(never))
    refused = [pair for pair in found.pairs if (pair.test, pair.model) in set(never)]
    if not refused:
        return found
    told = [
        Unpaired(p.test, f"in ascending order its partner is model mode {model.labels[p.model]}; the study forbids it")
        for p in refused
    ]
    return replace(
        found,
        pairs=tuple(pair for pair in found.pairs if pair not in refused),
        unpaired_test=tuple(sorted((*found.unpaired_test, *told), key=lambda one: one.test)),
        unpaired_model=tuple(sorted((*found.unpaired_model, *(pair.model for pair in refused)))),
    )


def _check_gates(frequency_gate: float, mac_gate: float) -> None:
    """Gates are fractions; 30 for 30 % would let everything pass unseen (inf is a wish to have no gate)."""
    if not (0.0 < frequency_gate <= 5.0 or frequency_gate == np.inf) or not 0.0 <= mac_gate <= 1.0:
        raise FemtuneError("correlate.gate", values={"frequency_gate": frequency_gate, "mac_gate": mac_gate})


def _check_requests(t: int, m: int, fixed: Sequence[tuple[int, int]], left_out: Mapping[int, str]) -> None:
    errors = ErrorCollector()
    for name, size, used in (("test", t, [i for i, _ in fixed]), ("model", m, [j for _, j in fixed])):
        with errors.catch():
            _check_fixed(name, size, used)
    with errors.catch():
        _check_left_out(t, {i for i, _ in fixed}, left_out)
    errors.raise_if_any()


def _check_fixed(name: str, size: int, used: Sequence[int]) -> None:
    bad = sorted({i for i in used if not 0 <= i < size or used.count(i) > 1})
    if bad:
        raise FemtuneError(
            "correlate.fixed-pair",
            values={f"{name} mode (from 1)": ", ".join(str(i + 1) for i in bad), f"{name} modes": size},
            side=name,
        )


def _check_left_out(t: int, fixed: set[int], left_out: Mapping[int, str]) -> None:
    bad = sorted(i for i, reason in left_out.items() if not 0 <= i < t or i in fixed or not reason.strip())
    if bad:
        raise FemtuneError(
            "correlate.left-out", values={"test mode (from 1)": ", ".join(str(i + 1) for i in bad), "test modes": t}
        )


def _settle(
    test: ModeSet, model: ModeSet, found: CandidatePairs, allowed: Allowed, fixed: Chosen, mac_gate: float
) -> tuple[Chosen, tuple[ClusterMatch, ...], dict[int, float]]:
    """Assign, rotate, and take back the worst member of a cluster whose MAC after rotation fails the gate."""
    allowed = allowed.copy()
    refused: dict[int, float] = {}
    while True:
        chosen = _assign(found, allowed, fixed)
        matches = _matches(test, model, found.groups, chosen, allowed, fixed)
        value, i, group = _worst(test, matches, fixed)
        if value >= mac_gate:
            within = {i: j for match in matches for i, j in zip(match.test, match.paired)}
            return {**chosen, **within}, matches, refused
        allowed[i, group] = False
        refused[i] = value


def _assign(found: CandidatePairs, allowed: Allowed, fixed: Chosen) -> Chosen:
    """Assignment of largest total score; pairs that are not allowed are worth nothing and are dropped.

    The frequency counts by the square of ln(model/test). Since this is a convex function of a difference, pairs in the
    order of their frequencies have the smallest sum: order decides where the MACs do not.
    """
    worth = np.nan_to_num(found.score) - _ORDER_WEIGHT * log_distance(found.frequency_error)
    worth = np.maximum(worth, _LEAST_WORTH)
    gain = np.where(allowed, worth, 0.0)
    gain[list(fixed), :] = 0.0
    gain[:, list(fixed.values())] = 0.0
    rows, columns = linear_sum_assignment(gain, maximize=True)
    free = {int(i): int(j) for i, j in zip(rows, columns) if gain[i, j] > 0.0}
    return {**free, **fixed}


def _matches(
    test: ModeSet,
    model: ModeSet,
    groups: Sequence[tuple[int, ...]],
    chosen: Chosen,
    allowed: Allowed,
    fixed: Chosen,
) -> tuple[ClusterMatch, ...]:
    """Rotate each cluster to the test modes that were assigned to it."""
    matches = []
    for group in groups:
        mine = tuple(sorted(i for i, j in chosen.items() if j in group))
        if mine:
            rotation = rotate_to(model.shapes[:, group], test.shapes[:, mine])
            paired = _members(rotation, mine, group, allowed, fixed)
            matches.append(ClusterMatch(mine, group, paired, rotation))
    return tuple(matches)


def _members(
    rotation: Rotation, mine: tuple[int, ...], group: tuple[int, ...], allowed: Allowed, fixed: Chosen
) -> tuple[int, ...]:
    """Member of the cluster for each test mode: fixed by hand, else inside the gates, else the nearest vector."""
    gain = np.abs(rotation.q) + 10.0 * allowed[np.ix_(mine, group)].T
    for k, i in enumerate(mine):
        if i in fixed:
            gain[group.index(fixed[i]), k] += 1000.0
    members, columns = linear_sum_assignment(gain, maximize=True)
    of_column = {int(k): group[j] for j, k in zip(members, columns)}
    return tuple(of_column[k] for k in range(len(mine)))


def _worst(test: ModeSet, matches: Sequence[ClusterMatch], fixed: Chosen) -> tuple[float, int, list[int]]:
    """Lowest MAC after rotation of a pair that is not fixed: value, test position, members of the cluster."""
    worst = (np.inf, -1, [0])
    for match in matches:
        values = rotated_macs(test, match)
        for i, value in zip(match.test, values):
            if i not in fixed and not value >= worst[0]:
                worst = (float(np.nan_to_num(value)), i, list(match.model))
    return worst


def rotated_macs(test: ModeSet, match: ClusterMatch) -> Reals:
    """MAC of each test mode of a cluster with its rotated model vector."""
    return np.diag(mac_where_defined(test.shapes[:, match.test], match.rotation.aligned))


def _pairs(
    test: ModeSet,
    model: ModeSet,
    found: CandidatePairs,
    chosen: Chosen,
    matches: Sequence[ClusterMatch],
    fixed: Chosen,
) -> tuple[Pair, ...]:
    plain = mac_where_defined(test.shapes, np.where(found.visible, model.shapes, 0.0))
    rotated = {
        i: (c, float(value))
        for c, match in enumerate(matches)
        for i, value in zip(match.test, rotated_macs(test, match))
    }
    pairs = []
    for i, j in sorted(chosen.items()):
        plain_mac = float(plain[i, j])
        cluster, value = rotated.get(i, (None, plain_mac))
        pairs.append(Pair(i, j, value, plain_mac, float(found.frequency_error[i, j]), i in fixed, cluster))
    return tuple(pairs)
