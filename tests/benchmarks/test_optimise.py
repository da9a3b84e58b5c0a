"""The benchmark of the search: its residual function is what it is called, and its tables count what they say."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

_FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "optimise"
_MODULES = ("objective", "simulated", "families", "solvers", "page", "run")


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The modules of the benchmark, whose names other benchmarks have too."""
    path, before = list(sys.path), {name: sys.modules.pop(name, None) for name in _MODULES}
    sys.path.insert(0, str(_FOLDER))
    yield {name: importlib.import_module(name) for name in _MODULES}
    sys.path[:] = path
    for name, module in before.items():
        sys.modules.pop(name, None)
        if module is not None:
            sys.modules[name] = module


def problem(modules: dict[str, ModuleType], name: str):
    return next(p for p in modules["families"].problems() if p.name == name).make()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lattices 1", "lattices 2", "matrices 1"])
def test_squares_by_which_modes_are_paired_are_those_of_the_residuals(modules: dict[str, ModuleType], name: str):
    p = problem(modules, name)
    at = p.start(np.zeros(len(p.parameters.free)))
    (state,) = at.states
    (case,), modes = p.cases, state.solution
    shapes = np.asarray(case.sensors @ modes.shapes[:, : modes.wanted])
    pairing = modules["objective"].LeastPairing(case, modes.eigenvalues[: modes.wanted], shapes, tuple(p.residuals))
    assert {tests for tests, _ in pairing.groups()} == {tests for tests, _ in state.groups}
    np.testing.assert_allclose(pairing.best[0], at.residuals @ at.residuals, rtol=1e-9)
    assert len(at.residuals) == p.size


def test_derivatives_are_those_of_the_residuals(modules: dict[str, ModuleType]):
    p = problem(modules, "frames 1")
    k = len(p.parameters.free)
    x = np.zeros(k)
    jacobian = p.start(x).jacobian
    for i in (0, k - 1):
        step = 1e-5 * np.eye(k)[i]
        slope = (p.at(x + step, False).residuals - p.at(x - step, False).residuals) / 2e-5
        np.testing.assert_allclose(slope, jacobian[:, i], atol=1e-5 * np.abs(jacobian[:, i]).max())


def test_a_jacobian_at_the_point_last_solved_is_no_solution(modules: dict[str, ModuleType]):
    p = problem(modules, "lattices 1").counted()
    functions = modules["objective"].Residuals(p, p.size)
    x = np.zeros(len(p.parameters.free))
    functions.values(x)
    functions.jacobian(x)
    assert len(p.trace.objectives) == 1
    functions.values(x + 1e-3)
    assert len(p.trace.objectives) == 2


def test_close_test_modes_are_one_group(modules: dict[str, ModuleType]):
    assert modules["objective"].close_modes(np.array([10.0, 20.0, 10.5, 30.0])) == [(0, 2), (1,), (3,)]


def test_solutions_count_to_the_first_point_that_is_close(modules: dict[str, ModuleType]):
    run = {"falls": [[1, 5.0], [4, 2.0 * (1.0 + 5e-7)], [6, 2.0]]}
    assert modules["page"].solutions_to(run, 2.0) == 4
    assert modules["page"].solutions_to(run, 1.0) == np.inf


def test_profiles_are_ratios_to_the_quickest(modules: dict[str, ModuleType]):
    found = modules["page"].profile({"a": np.array([2.0, np.inf, np.inf]), "b": np.array([4.0, 3.0, np.inf])})
    np.testing.assert_array_equal(found["a"], [1.0, np.inf])
    np.testing.assert_array_equal(found["b"], [2.0, 1.0])


def test_problems_are_many_and_have_names_of_their_own(modules: dict[str, ModuleType]):
    names = [p.name for p in modules["families"].problems()]
    assert len(set(names)) == len(names) >= 40


@pytest.mark.long
def test_a_start_is_measured_and_makes_a_page(modules: dict[str, ModuleType]):
    row = modules["run"].measured("lattices 1", 0)
    text = modules["page"].write_page([modules["page"].Measured((row,))], None)
    assert row["solvers"]["femtune"]["status"] == "CONVERGED_AT_BOUNDS"
    assert max(row["restarted"].values()) < 1e-6
    assert "| (iv) runs that end by the limit" in text


@pytest.mark.parametrize(("name", "most"), [("frames 1", 40), ("matrices 5", 40)])
@pytest.mark.slow
def test_springs_over_nine_decades_take_few_solutions(modules: dict[str, ModuleType], name: str, most: int):
    """With damping that changes by factors of ten these took 83 and 146 solutions."""
    p = problem(modules, name)
    end = modules["solvers"].femtune(p, np.zeros(len(p.parameters.free)))
    assert end.status == "CONVERGED_AT_BOUNDS"
    assert len(end.trace) <= most
