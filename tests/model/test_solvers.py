"""The sparse solvers behind their one interface: one analysis, many factors, choice, and memory."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.model.linear import memory
from femtune.model.linear.symmetric import SymmetricMatrix, symmetric
from femtune.model.solvers import cholmod, pardiso
from femtune.model.solvers import factorise as choice
from femtune.model.solvers import listing as solver_list
from femtune.model.solvers.factorise import analyse, available_solvers, factorise
from femtune.model.solvers.interface import SingularMatrixError

with_pardiso = pytest.mark.skipif(
    "PARDISO" not in available_solvers(), reason="the Math Kernel Library is not installed (extra 'fast')"
)
solvers = pytest.mark.parametrize("solver", available_solvers())


def net(n: int, shift: float = 0.0) -> SymmetricMatrix:
    """A fixed n × n net of unit springs less a shift: eigenvalues 4 sin²(iπ/2(n+1)) + 4 sin²(jπ/2(n+1)) − shift."""
    chain = sp.diags_array([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    one = sp.eye_array(n)
    return symmetric(sp.kron(chain, one) + sp.kron(one, chain) - shift * sp.eye_array(n * n))


def values(n: int) -> np.ndarray:
    chain = 4.0 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1))) ** 2
    return np.add.outer(chain, chain).ravel()


@pytest.mark.quick(0)
@solvers
def test_many_factors_of_one_analysis_live_side_by_side(solver: str) -> None:
    """More of them than a handle has slots, made, used and dropped in changing order."""
    shifts = np.linspace(-1.0, 5.0, 11) + 0.0123
    analysis = analyse(net(20), solver)
    made = [analysis.factorise(net(20, shift)) for shift in shifts]
    b = np.random.default_rng(0).standard_normal((400, 3))
    for drop in (3, 0, 6):
        made[drop] = analysis.factorise(net(20, shifts[drop]))
        for shift, factor in zip(shifts, made):
            assert factor.negative_pivots == (values(20) < shift).sum()
            np.testing.assert_allclose(net(20, shift) @ factor.solve(b), b, atol=1e-9)


@with_pardiso
def test_a_pattern_is_analysed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    phases = []
    run = pardiso.PardisoHandle.run

    def watched(handle, phase, *given):
        # an older pattern may be released meanwhile
        if phase > 0:
            phases.append(phase)
        return run(handle, phase, *given)

    monkeypatch.setattr(pardiso.PardisoHandle, "run", watched)
    first, second = factorise(net(23), "PARDISO"), factorise(net(23, 0.5), "PARDISO")
    assert analyse(net(23), "pardiso") is analyse(net(23), "PARDISO")
    assert phases == [11, 22, 22]
    first.solve(np.ones((529, 8)))
    second.solve(np.ones(529) + 1j)
    assert phases == [11, 22, 22, 33, 33]


@pytest.mark.slow
@with_pardiso
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc")
def test_memory_of_a_dropped_factor_goes() -> None:
    """In a process of its own whose allocators keep nothing back: what others left free would hide what is taken.

    With one thread: from two on the forecast has 17 MB of work space more, three times such a small factor.
    """
    env = {**os.environ, "MALLOC_MMAP_THRESHOLD_": "65536", "MKL_DISABLE_FAST_MM": "1", "MKL_NUM_THREADS": "1"}
    found = subprocess.run([sys.executable, "-c", _MEMORY], env=env, capture_output=True, text=True, check=True)
    forecast, with_five, without = map(int, found.stdout.split())
    assert 0.4 < with_five / (5 * forecast) < 1.6
    assert without < 0.3 * with_five


_MEMORY = """
import gc, os
import scipy.sparse as sp
from femtune.model.solvers.factorise import analyse
from femtune.model.linear.symmetric import symmetric

def taken():
    gc.collect()
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

n = 160
chain, one = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)), sp.eye_array(n)
matrix = symmetric(sp.kron(chain, one) + sp.kron(one, chain))
analysis = analyse(matrix, "PARDISO")
analysis.factorise(matrix)
before = taken()
kept = [analysis.factorise(matrix) for _ in range(5)]
with_five = taken() - before
kept.clear()
print(analysis.factor_bytes, with_five, taken() - before)
"""


@solvers
def test_the_forecast_of_an_analysis_stays(solver: str) -> None:
    analysis = analyse(net(50), solver)
    forecast = analysis.factor_bytes
    kept = [analysis.factorise(net(50)) for _ in range(3)]
    assert analysis.factor_bytes == forecast
    kept.clear()
    assert analysis.factor_bytes == forecast


@solvers
@pytest.mark.parametrize("order", ["C", "F"])
def test_what_is_solved_stays_as_it_was(solver: str, order: Any) -> None:
    b = np.array(np.random.default_rng(1).standard_normal((400, 5)), order=order)
    kept, factor = b.copy(), factorise(net(20, 0.3), solver)
    x = factor.solve(b)
    np.testing.assert_array_equal(b, kept)
    np.testing.assert_allclose(factor.solve(b[:, 2]), x[:, 2], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(factor.solve(b[:, ::2]), x[:, ::2], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(factor.solve(b * 2j), x * 2j, rtol=1e-12, atol=1e-12)
    assert factor.solve(b[:, :0]).shape == (400, 0)


@solvers
def test_a_zero_pivot_is_told(solver: str) -> None:
    data = sp.diags_array([1.0, 0.0, 2.0]).tocsr()
    if solver in {"PARDISO", "CHOLMOD"}:  # it replaces the pivot and says so, or another does
        assert factorise(data, solver).negative_pivots is None
    else:
        with pytest.raises(SingularMatrixError):
            factorise(data, solver)


@solvers
def test_too_little_memory_is_said_before_the_work(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    analysis = analyse(net(40), solver)
    monkeypatch.setattr(memory, "free_memory", lambda: 1000)
    monkeypatch.setattr(memory, "NEGLIGIBLE_BYTES", 0)
    with pytest.raises(FemtuneError, match=r"factorising 1,600 equations needs about") as caught:
        analysis.factorise(net(40))
    assert caught.value.code == "model.memory"
    assert caught.value.values == {"needed_bytes": analysis.factor_bytes, "free_bytes": 1000}
    assert "FEMTUNE_EIGENSOLVER=slepc" in caught.value.hint


@with_pardiso
def test_memory_for_the_ordering_is_asked_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 1000)
    monkeypatch.setattr(memory, "NEGLIGIBLE_BYTES", 0)
    with pytest.raises(FemtuneError, match="ordering 1,681 equations"):
        analyse(net(41), "PARDISO")


@pytest.mark.parametrize("size", [10, 60])
def test_the_rough_forecast_is_below_what_superlu_takes(size: int) -> None:
    """Entries of L and U at twelve bytes, of a surface, and at most five times the forecast."""
    analysis = analyse(net(size), "SuperLU")
    taken = 12 * analysis.factorise(net(size)).factors.nnz  # type: ignore[attr-defined]
    assert analysis.factor_bytes is not None
    assert 0.2 < analysis.factor_bytes / taken < 1.5


@pytest.mark.parametrize(("name", "expected"), [("superlu", "SuperLU"), ("SuperLU", "SuperLU"), ("pardiso", "PARDISO")])
def test_the_environment_names_the_solver(name: str, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if expected not in available_solvers():
        pytest.skip(f"{expected} is not available")
    monkeypatch.setenv("FEMTUNE_SOLVER", name)
    assert factorise(net(60)).name == expected
    assert factorise(net(4), "SuperLU").name == "SuperLU"


@pytest.mark.parametrize("seed", range(40))
def test_dense_factors_of_small_matrices(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    half = rng.standard_normal((n, n)) * (rng.random((n, n)) < 0.4)
    A = half + half.T + np.diag(rng.standard_normal(n))
    # of pairs of pivots too: nothing on the diagonal
    A[np.diag_indices(n)] *= seed % 2 or n == 1
    A += 1e-3 * np.eye(n)[::-1]
    factor, b = factorise(sp.csr_array(A)), rng.standard_normal((n, 3))
    assert factor.name == "dense"
    assert factor.negative_pivots == (np.linalg.eigvalsh(A) < 0.0).sum()
    for right in (b, b[:, 0], b[:, :1] + 2j, b[:, :0]):
        solved = factor.solve(right)
        assert solved.shape == right.shape
        np.testing.assert_allclose(A @ solved, right, atol=1e-6 * np.linalg.cond(A))


def test_a_singular_small_matrix_has_no_dense_factors():
    with pytest.raises(SingularMatrixError):
        factorise(sp.csr_array(np.diag([1.0, 0.0, -1.0])))


def test_a_small_matrix_that_is_singular_to_rounding_has_no_factors() -> None:
    """Springs of 0.1, 0.2 and 0.3 between four free points: elimination leaves 1e-17 in place of zero."""
    chain = np.zeros((4, 4))
    for i, k in enumerate((0.1, 0.2, 0.3)):
        chain[i : i + 2, i : i + 2] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    with pytest.raises(SingularMatrixError):
        factorise(sp.csr_array(chain))
    # a soft spring to ground is no rounding
    chain[3, 3] += 1e-9
    assert factorise(sp.csr_array(chain)).negative_pivots == 0


def test_a_small_matrix_with_an_entry_that_is_no_number_has_no_factors() -> None:
    with pytest.raises(SingularMatrixError, match="not a finite number"):
        factorise(sp.csr_array(np.diag([1.0, np.nan, 2.0])))


def test_automatic_is_by_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEMTUNE_SOLVER", "automatic")
    assert (analyse(net(10)).name, analyse(net(20)).name) == ("dense", "SuperLU")
    assert analyse(net(60)).name == available_solvers()[0]


@pytest.mark.parametrize(("name", "hint"), [("SuperLUX", "did you mean 'SuperLU'?"), ("HAL", "known: CHOLMOD")])
def test_an_unknown_name_in_the_environment_is_refused(name: str, hint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEMTUNE_SOLVER", name)
    with pytest.raises(FemtuneError) as caught:
        factorise(net(4))
    assert caught.value.code == "solver.unavailable"
    assert hint in caught.value.hint


class NotPositiveDefiniteError(Exception):
    """As the wrapper of CHOLMOD raises it."""


class Symbolic:
    """The part of the wrapper's interface that is used, on dense matrices."""

    def cholesky(self, lower: sp.csc_matrix) -> Any:
        half = lower.toarray()
        assert not np.triu(half, 1).any()
        try:
            L = np.linalg.cholesky(half + np.tril(half, -1).T)
        except np.linalg.LinAlgError as error:
            raise NotPositiveDefiniteError from error
        return SimpleNamespace(solve_A=lambda b: np.linalg.solve(L.T, np.linalg.solve(L, b)))


def test_cholmod_gives_indefinite_and_complex_matrices_to_another(monkeypatch: pytest.MonkeyPatch) -> None:
    wrapper = SimpleNamespace(
        analyze=lambda matrix, mode: Symbolic(),
        CholmodNotPositiveDefiniteError=NotPositiveDefiniteError,
        CholmodError=ValueError,
    )
    monkeypatch.setattr(cholmod, "library", lambda: wrapper)
    monkeypatch.setattr(choice, "available_solvers", lambda: ("CHOLMOD", "SuperLU"))
    monkeypatch.setattr(choice, "KEPT_ANALYSES", type(choice.KEPT_ANALYSES)())
    definite, indefinite = factorise(net(9), "CHOLMOD"), factorise(net(9, 2.1), "CHOLMOD")
    assert (definite.name, definite.negative_pivots) == ("CHOLMOD", 0)
    assert (indefinite.name, indefinite.negative_pivots) == ("SuperLU", (values(9) < 2.1).sum())
    for matrix, factor in ((net(9), definite), (net(9, 2.1), indefinite)):
        np.testing.assert_allclose(matrix @ factor.solve(np.ones(81) + 2j), np.ones(81) + 2j, atol=1e-10)
    assert factorise(net(9).full() * (1 + 0.1j), "CHOLMOD").name == "SuperLU"


@pytest.mark.slow
def test_the_list_tells_of_each_solver() -> None:
    found = {facts.name: facts for facts in solver_list.solver_list()}
    assert list(found) == ["PARDISO", "MUMPS", "CHOLMOD", "RSLAB", "SuperLU", "SLEPc"]
    for name, facts in found.items():
        assert facts.at_hand == (not facts.why_not)
        assert facts.licence
        assert facts.installation
        if name != "SLEPc":
            assert facts.at_hand == (name in available_solvers())
    assert found["SuperLU"].at_hand
    for ability, lacking in (("inertia", ["CHOLMOD"]), ("complex_numbers", ["CHOLMOD", "SLEPc"])):
        assert [name for name, facts in found.items() if not getattr(facts, ability)] == lacking
    assert found["SLEPc"].distributed


def test_the_list_tells_why_a_solver_is_not_at_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pardiso, "library", lambda: None)
    monkeypatch.setattr(cholmod, "library", lambda: "scikit-sparse is installed but cannot be loaded: no libcholmod.so")
    monkeypatch.setenv("FEMTUNE_SLEPC_PYTHON", "/no/such/python")
    monkeypatch.setattr(solver_list, "available_solvers", lambda: ("SuperLU",))
    text = solver_list.solver_table(solver_list.solver_list())
    assert "PARDISO: not available" in text
    assert re.search("CHOLMOD: not available: .*no libcholmod.so", text)
    assert re.search("SLEPc: not available: .*slepc4py", text)
    assert 'pip install "femtune[fast]"' in text
