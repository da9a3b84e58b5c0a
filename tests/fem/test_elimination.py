"""Elimination of dependent DOFs: random chains and loops, held DOFs, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.dofs import Dof
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.elimination import eliminate
from femtune.fem.structure import ConstraintRows


def describe(dof: int) -> Dof:
    return Dof(dof // 6 + 1, ("X", "Y", "Z", "RX", "RY", "RZ")[dof % 6])


def equations(
    entries: list[dict[int, float]], dependents: list[int], owners: list[int] | None = None
) -> ConstraintRows:
    row = [i for i, e in enumerate(entries) for _ in e]
    dof = [d for e in entries for d in e]
    coefficient = [c for e in entries for c in e.values()]
    owner = owners or [0] * len(entries)
    return ConstraintRows(
        np.array(dependents, dtype=np.int64), np.array(row, dtype=np.int64), np.array(dof, dtype=np.int64),
        np.array(coefficient, dtype=float), np.array(owner, dtype=np.int64),
    )  # fmt: skip


@pytest.mark.slow
@given(seed=st.integers(0, 10**6), n=st.integers(4, 30), loops=st.booleans())
def test_every_equation_is_fulfilled(seed: int, n: int, loops: bool):
    rng = np.random.default_rng(seed)
    order = rng.permutation(n)
    m = int(rng.integers(0, n - 1))
    dependents, entries = order[:m], []
    for i, d in enumerate(dependents):
        # chains lean on later DOFs of the order only; loops on any
        pool = np.setdiff1d(order if loops else order[i + 1 :], [d])
        on = rng.choice(pool, size=min(len(pool), int(rng.integers(1, 4))), replace=False)
        entries.append({int(d): float(rng.uniform(4.0, 5.0))} | {int(k): float(rng.uniform(-1, 1)) for k in on})
    shuffle = rng.permutation(m)
    rows = equations([entries[i] for i in shuffle], [int(dependents[i]) for i in shuffle])
    held = [int(k) for k in order[m:] if rng.random() < 0.2]
    found = eliminate(n, rows, held, describe)
    T = found.T.toarray()
    A = np.zeros((m, n))
    np.add.at(A, (rows.row, rows.dof), rows.coefficient)
    assert np.abs(A @ T).max(initial=0.0) < 1e-12
    assert not T[held].any()
    np.testing.assert_array_equal(T[found.free], np.eye(len(found.free)))
    assert len(found.free) == n - m - len(held)


def test_long_chain_ends():
    n = 3000
    rows = equations([{i: 1.0, i + 1: -1.0} for i in range(n - 1)], list(range(n - 1)))
    T = eliminate(n, rows, [], describe).T
    assert T.shape == (n, 1)
    np.testing.assert_allclose(T.toarray(), 1.0)


def test_loop_with_a_solution_by_hand():
    """u0 = ½u1 + u2 and u1 = ½u0 give u0 = 4/3 u2, u1 = 2/3 u2."""
    rows = equations([{0: 1.0, 1: -0.5, 2: -1.0}, {1: 1.0, 0: -0.5}], [0, 1])
    T = eliminate(3, rows, [], describe).T.toarray()
    np.testing.assert_allclose(T[:, 0], [4 / 3, 2 / 3, 1.0])


def test_nothing_to_do():
    found = eliminate(4, equations([], []), [2, 2], describe)
    np.testing.assert_array_equal(found.free, [0, 1, 3])
    assert found.T.shape == (4, 3)


BAD = {
    "constraint.dependent-twice": (equations([{0: 1.0, 1: -1.0}, {0: 1.0, 2: -1.0}], [0, 0], [5, 6]), []),
    "constraint.dependent-held": (equations([{7: 1.0, 1: -1.0}], [7], [5]), [7]),
    "constraint.zero-coefficient": (equations([{7: 0.0, 1: -1.0}], [7]), []),
    "constraint.circular": (equations([{0: 1.0, 1: -1.0}, {1: 1.0, 0: -1.0}], [0, 1], [5, 6]), []),
}


@pytest.mark.parametrize("code", BAD)
def test_refusals_name_dof_and_owner(code: str):
    rows, held = BAD[code]
    with pytest.raises(FemtuneError) as caught:
        eliminate(12, rows, held, describe)
    assert caught.value.code == code
    assert "component" in caught.value.what
    assert ("MPC" if code == "constraint.zero-coefficient" else "rigid element") in str(caught.value.where)


def test_several_refusals_are_shown_together():
    rows = equations([{0: 1.0, 1: -1.0}, {0: 1.0, 2: -1.0}, {7: 1.0, 1: 1.0}], [0, 0, 7], [5, 6, 8])
    with pytest.raises(FemtuneErrors) as caught:
        eliminate(12, rows, [7], describe)
    assert [e.code for e in caught.value.errors] == ["constraint.dependent-twice", "constraint.dependent-held"]
