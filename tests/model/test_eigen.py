"""Eigen-solution: closed forms, rigid-body and repeated modes, mechanisms, counts, wide stiffness ratios."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.fem import Structure
from femtune.model import Configuration, EigenSolution, ModelPoint, configure, parametric_model, solve_modes
from femtune.model.eigen import krylov, sturm
from femtune.model.eigen import pairs as eigenpairs
from femtune.model.eigen import solution as eigen_module
from femtune.model.eigen.pencil import Pencil
from femtune.model.eigen.shift import near_shift
from femtune.model.solvers import factorise
from femtune.parameters import ParameterSet
from structures.frames import bars, bushes, make_structure, masses, scalars
from structures.springs import spring_structure

STEEL = {"E": 2.1e11, "G": 8.1e10, "A": 2e-4, "I1": 1.5e-8, "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0}


def point_of(structure: Structure) -> ModelPoint:
    return configure(parametric_model(structure, ParameterSet(()), ()), Configuration("test")).at(np.zeros(0))


def springs(links: list[tuple[int, int, float]], weights: list[float]) -> ModelPoint:
    return point_of(spring_structure(links, weights))


def eigenvalues(point: ModelPoint, count: int | None = None) -> np.ndarray:
    solution = solve_modes(point, count)
    check_modes(solution)
    return solution.eigenvalues[: solution.wanted]


def check_modes(solution: EigenSolution) -> None:
    """Mass-normalised, and counted."""
    M = solution.point.mass
    gram = solution.shapes.T @ (M @ solution.shapes)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-8)
    assert solution.sturm_count == (solution.eigenvalues < solution.sturm_shift).sum()


def chain(n: int) -> ModelPoint:
    return springs([(i - 1, i, 1.0) for i in range(n)], [1.0] * n)


def chain_values(n: int) -> np.ndarray:
    return 4.0 * np.sin(np.pi * (2 * np.arange(1, n + 1) - 1) / (4 * n + 2)) ** 2


@pytest.mark.slow
@pytest.mark.parametrize(("n", "count"), [(1, 1), (1, 10), (2, 1), (5, 50), (30, 4), (500, 12)])
def test_chains(n: int, count: int):
    """A single DOF, more modes than there are, and the iterative path."""
    np.testing.assert_allclose(eigenvalues(chain(n), count), chain_values(n)[:count], rtol=1e-9)


def test_all_modes_up_to_a_frequency():
    hz = np.sqrt(chain_values(30)) / (2 * np.pi)
    for m in (1, 7, 30):
        assert solve_modes(chain(30), max_hz=hz[m - 1] * 1.0001).wanted == m
    # at least one, even where the limit lies below
    assert solve_modes(chain(30), max_hz=0.5 * hz[0]).wanted == 1
    # a limit that is an eigenvalue makes K − λM singular
    assert solve_modes(springs([(-1, 0, 4.0 * np.pi**2)], [1.0]), max_hz=1.0).wanted == 1


def free_beam(elements: int) -> Structure:
    xyz = np.column_stack([np.linspace(0, 2.0, elements + 1), np.zeros((elements + 1, 2))])
    part = bars(np.column_stack([np.arange(elements), np.arange(1, elements + 1)]), STEEL, orientation=(0.0, 0.0, 1.0))
    # bars have no inertia about their own axis: a free one would spin without energy
    polar = masses(range(elements + 1), {"M": 0.0, "I11": 1e-7})
    return make_structure(xyz, [part, polar], consistent_mass=True)


@pytest.mark.parametrize("elements", [8, 120])
def test_free_beam_has_six_zeros_and_the_listed_frequencies(elements: int):
    values = eigenvalues(point_of(free_beam(elements)), 10)
    assert (np.abs(values[:6]) < 1e-6 * values[6]).all()
    mass = STEEL["rho"] * STEEL["A"]
    theory = [22.3733**2 * STEEL["E"] * i / (mass * 2.0**4) for i in (STEEL["I2"], STEEL["I1"])]
    np.testing.assert_allclose(values[6:8], theory, rtol=2e-3 if elements == 8 else 1e-4)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_a_count_among_the_rigid_body_modes(count: int):
    """Zeros are one repeated mode, which is kept whole; rounding between them is no gap."""
    solution = solve_modes(point_of(free_beam(8)), count)
    check_modes(solution)
    assert solution.wanted == 6


def ring(n: int) -> ModelPoint:
    return springs([(i, (i + 1) % n, 40.0) for i in range(n)] + [(-1, i, 10.0) for i in range(n)], [1.0] * n)


@pytest.mark.quick(1)
@pytest.mark.parametrize("n", [6, 450])
def test_repeated_modes_at_the_end_are_kept_whole(n: int):
    theory = np.sort(10.0 + 80.0 * (1.0 - np.cos(2 * np.pi * np.arange(n) / n)))
    for count in (2, 3, 4):
        found = eigenvalues(ring(n), count)
        assert len(found) == {2: 3, 3: 3, 4: 5}[count]
        np.testing.assert_allclose(found, theory[: len(found)], rtol=1e-8)


@pytest.mark.quick(1)
@pytest.mark.parametrize("n", [40, 500])
def test_dozens_of_equal_oscillators(n: int):
    """Forty equal modes above one lower: more than the first extra modes hold."""
    links = [(-1, i, 5.0 if i else 1.0) for i in range(41)] + [(-1, i, 50.0 + i) for i in range(41, n)]
    found = eigenvalues(springs(links, [1.0] * max(n, 41)), 2)
    np.testing.assert_allclose(found, [1.0] + [5.0] * 40, rtol=1e-9)


@pytest.mark.parametrize("n", [40, 500])
def test_singular_mass(n: int):
    """Mass on every tenth DOF only: as many modes as masses, the others condensed."""
    weights = [1.0 if i % 10 == 9 else 0.0 for i in range(n)]
    found = eigenvalues(springs([(i - 1, i, 10.0) for i in range(n)], weights), 1000)
    # ten springs of 10 in line are one of 1
    np.testing.assert_allclose(found, chain_values(n // 10), rtol=1e-7)


@pytest.mark.parametrize("elements", [8, 120])
def test_masses_with_offsets_have_fewer_modes_than_rows(elements: int):
    """An offset mass without inertia fills six rows and gives three modes."""
    xyz = np.column_stack([np.linspace(0, 2.0, elements + 1), np.zeros((elements + 1, 2))])
    part = bars(np.column_stack([np.arange(elements), np.arange(1, elements + 1)]), {**STEEL, "rho": 0.0},
                orientation=(0.0, 0.0, 1.0))  # fmt: skip
    tip = masses([elements], {"M": 3.0}, (0.1, 0.2, 0.3))
    found = eigenvalues(point_of(make_structure(xyz, [part, tip], permanent=np.arange(6))), 10)
    assert len(found) == 3


def test_wide_stiffness_ratios():
    """Penalties of 1e12 beside springs of 1e4: the soft modes keep their digits, the stiff one is right too."""
    point = springs([(-1, 0, 1e4), (0, 1, 1e12), (1, 2, 1e4), (-1, 2, 2e4)], [1.0, 1.0, 1.0])
    found = eigenvalues(point, 3)
    # the two joined masses move as one
    soft = 1e4 * np.linalg.eigvals(np.array([[2.0 / 2, -1.0 / 2], [-1.0, 3.0]]))
    np.testing.assert_allclose(found[:2], np.sort(soft), rtol=1e-7)
    assert found[2] == pytest.approx(2e12, rel=1e-7)


@pytest.mark.parametrize("n", [7, 450])
def test_stiff_parts_on_a_soft_ground(n: int):
    """Neither a mechanism nor negative: rounding of 1e12 is."""
    point = springs([(-1, 0, 1e6), *((i, i + 1, 1e12) for i in range(n - 1))], [1.0] * n)
    found = eigenvalues(point, 1)
    assert found[0] == pytest.approx(1e6 / n, rel=1e-3 if n < 10 else 0.1)


def test_a_soft_support_is_legitimate():
    values = eigenvalues(springs([(-1, 0, 1e-6), (0, 1, 1e3)], [1.0, 1.0]), 2)
    np.testing.assert_allclose(values, [5e-7, 2e3], rtol=1e-6)


def mechanism(n: int) -> ModelPoint:
    """A chain of bars whose last two masses hang on a part that is joined to nothing, without mass."""
    links = [(i - 1, i, 1e3) for i in range(n)] + [(n, n + 1, 1e3), (n + 1, n + 2, 1e3)]
    return springs(links, [1.0] * n + [0.0] * 3)


@pytest.mark.quick(1)
@pytest.mark.parametrize("n", [5, 450, 3200])
def test_a_massless_mechanism_names_its_dofs(n: int):
    with pytest.raises(FemtuneError) as caught:
        solve_modes(mechanism(n), 3)
    assert caught.value.code == "eigen.mechanism"
    assert caught.value.values["DOFs that move"] == f"{n + 1}X, {n + 2}X, {n + 3}X"


def test_a_loose_part_with_mass_is_a_rigid_body_mode():
    links = [(i - 1, i, 1e3) for i in range(5)] + [(5, 6, 1e3)]
    values = eigenvalues(springs(links, [1.0] * 7), 3)
    assert abs(values[0]) < 1e-9 * values[1]


def test_nothing_free_and_no_mass():
    held = make_structure([[0.0, 0.0, 0.0]], [scalars("spring", [[0, -1]], "K", 1.0)], permanent=np.arange(6))
    with pytest.raises(FemtuneError) as caught:
        solve_modes(point_of(held))
    assert caught.value.code == "eigen.no-dofs"
    with pytest.raises(FemtuneError) as caught:
        solve_modes(springs([(-1, 0, 1.0)], [0.0]))
    assert caught.value.code == "eigen.no-mass"


@pytest.mark.slow
@pytest.mark.parametrize("k", [-1.0, -1e-3, -50.0])
@pytest.mark.parametrize("n", [4, 450])
def test_negative_stiffness_is_refused(k: float, n: int):
    with pytest.raises(FemtuneError) as caught:
        solve_modes(springs([(-1, 0, k), *((i, i + 1, 10.0) for i in range(n - 1))], [1.0] * n), 2)
    assert caught.value.code == "eigen.negative"


def scaled_chain(n: int, k: float, m: float) -> ModelPoint:
    return springs([(i - 1, i, k) for i in range(n)], [m] * n)


@pytest.mark.slow
@pytest.mark.parametrize(("k", "m"), [(1.0, 1e200), (1e200, 1.0), (1e-60, 1e60)])
@pytest.mark.parametrize("n", [4, 450])
def test_sizes_whose_products_overflow_are_refused(n: int, k: float, m: float):
    with pytest.raises(FemtuneError, match="overflow") as caught:
        solve_modes(scaled_chain(n, k, m), 2)
    assert caught.value.code == "eigen.inaccurate"
    assert caught.value.values["largest mass"] == f"{m:g}"


@pytest.mark.quick(3)
@pytest.mark.parametrize(("k", "m"), [(1.0, 1e70), (1e70, 1.0), (1e-35, 1e35), (1e80, 1e80), (1e-80, 1e-80)])
@pytest.mark.parametrize("n", [4, 450])
def test_any_other_unit_serves(n: int, k: float, m: float):
    solution = solve_modes(scaled_chain(n, k, m), 2)
    np.testing.assert_allclose(solution.eigenvalues[:2], k / m * chain_values(n)[:2], rtol=1e-8)


def skip_one(original):
    """An iterative solver that loses the second mode."""

    def spoilt(search, count, wanted, known=None):
        values, shapes = original(search, count + 1, wanted + 1, None)
        keep = np.argsort(values)
        keep = np.delete(keep, 1)
        return values[keep], shapes[:, keep]

    return spoilt


@pytest.mark.slow
def test_a_missed_mode_is_caught(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(eigenpairs, "iterative", skip_one(eigenpairs.iterative))
    monkeypatch.setattr(eigen_module, "MOST_EXTRA", 50)
    with pytest.raises(FemtuneError) as caught:
        solve_modes(chain(500), 5)
    assert caught.value.code == "eigen.missed-modes"


def test_a_mode_missed_once_is_found_beside_the_others(monkeypatch: pytest.MonkeyPatch):
    given: list[int] = []
    right, wrong = eigenpairs.iterative, skip_one(eigenpairs.iterative)

    def once(search, count, wanted, known=None):
        given.append(0 if known is None else len(known[0]))
        return (wrong if len(given) == 1 else right)(search, count, wanted, known)

    monkeypatch.setattr(eigenpairs, "iterative", once)
    np.testing.assert_allclose(eigenvalues(chain(500), 5), chain_values(500)[:5], rtol=1e-8)
    assert given == [0, 11]


def test_inaccurate_modes_are_refused(monkeypatch: pytest.MonkeyPatch):
    right = eigenpairs.iterative

    def rough(*given):
        values, shapes = right(*given)
        return values, shapes + 1e-3 * np.random.default_rng(0).standard_normal(shapes.shape)

    monkeypatch.setattr(eigenpairs, "iterative", rough)
    with pytest.raises(FemtuneError) as caught:
        solve_modes(chain(500), 5)
    assert caught.value.code == "eigen.inaccurate"


def test_an_iteration_that_does_not_converge(monkeypatch: pytest.MonkeyPatch):
    """A basis with room for little more than the modes, and no patience."""
    monkeypatch.setattr(krylov, "most_columns", lambda operator, count, block: count + 2 * block)
    monkeypatch.setattr(krylov, "MOST_RESTARTS", 1)
    with pytest.raises(FemtuneError) as caught:
        solve_modes(chain(500), 10)
    assert caught.value.code == "eigen.no-convergence"


def test_hidden_inertia(monkeypatch: pytest.MonkeyPatch):
    """Without a count the modes come with a notice, but not "all up to" a frequency."""
    monkeypatch.setattr(eigen_module, "count_below", lambda pencil, value: sturm.Count(value, None))
    solution = solve_modes(chain(30), 4)
    assert [n.code for n in solution.notices] == ["eigen.not-counted"]
    assert solution.sturm_count == -1
    with pytest.raises(FemtuneError) as caught:
        solve_modes(chain(30), max_hz=1.0)
    assert caught.value.code == "eigen.uncounted"


def space_frame(bays: int, storeys: int) -> Structure:
    """A clamped frame of 6·(bays + 1)²·storeys free DOFs, its columns of uneven stiffness."""
    n = bays + 1
    at = {(i, j, k): n * n * k + n * i + j for k in range(storeys + 1) for i in range(n) for j in range(n)}
    xyz = np.array([[3.0 * i, 4.0 * j, 3.2 * k] for (i, j, k) in at])
    columns = [(at[i, j, k], at[i, j, k + 1]) for i, j, k in at if k < storeys]
    along = [(at[i, j, k], at[i + 1, j, k]) for i, j, k in at if k and i < bays]
    across = [(at[i, j, k], at[i, j + 1, k]) for i, j, k in at if k and j < bays]
    stiff = {**STEEL, "A": 5e-3, "I1": 3e-5, "I2": np.linspace(1e-5, 2e-5, len(columns)), "J": 1e-6}
    parts = [
        bars(columns, stiff, orientation=(1.0, 0.3, 0.0)),
        bars(along + across, {**stiff, "I2": 1.2e-5}, orientation=(0.0, 0.0, 1.0)),
        bushes([[at[0, 0, storeys], -1]], {f"K{i}": 1e4 for i in range(1, 4)}),
    ]
    return make_structure(xyz, parts, permanent=np.arange(6 * n * n), consistent_mass=True)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["SuperLU", "PARDISO"])
def test_iterative_against_dense_on_a_frame(solver: str, monkeypatch: pytest.MonkeyPatch):
    if solver not in factorise.available_solvers():
        pytest.skip("the Math Kernel Library is not installed (extra 'fast')")
    monkeypatch.setattr(factorise, "PARDISO_FROM", 0 if solver == "PARDISO" else 10**9)
    point = point_of(space_frame(5, 7))
    assert point.configured.n_free == 1512
    iterative = solve_modes(point, 20)
    assert iterative.factor.name == solver
    check_modes(iterative)
    K, M = point.stiffness.toarray(), point.mass.toarray()
    dense = la.eigh(K, M, eigvals_only=True, subset_by_index=[0, 19])
    np.testing.assert_allclose(iterative.eigenvalues[:20], dense, rtol=1e-8)


def test_an_unknown_solver_is_refused():
    with pytest.raises(FemtuneError) as caught:
        factorise.factorise(chain(3).stiffness, "HAL")
    assert caught.value.code == "solver.unavailable"


@pytest.mark.parametrize("solver", factorise.available_solvers())
def test_factors_and_inertia(solver: str):
    """Solutions and negative pivots of indefinite matrices of very different scales, twice on one pattern."""
    point, rng = chain(60), np.random.default_rng(3)
    scale = 10.0 ** rng.uniform(-5, 5, 60)
    for cut in (0.5, 1.9, 3.3):
        matrix = (point.stiffness - cut * point.mass).toarray() * scale[:, None] * scale
        factor = factorise.factorise(sp.csr_array(matrix), solver)
        assert factor.negative_pivots == (chain_values(60) < cut).sum()
        for b in (rng.standard_normal(60), rng.standard_normal((60, 3))):
            x = factor.solve(b)
            row = scale if b.ndim == 1 else scale[:, None]
            np.testing.assert_allclose((matrix @ x) / row, b / row, atol=1e-6 * np.abs(b / row).max())


def test_complex_matrices_go_to_the_solver_that_keeps_its_ordering():
    if "PARDISO" not in factorise.available_solvers():
        pytest.skip("the Math Kernel Library is not installed (extra 'fast')")
    matrix = point_of(space_frame(5, 7)).stiffness
    b = np.arange(1.0, matrix.shape[0] + 1.0)
    factor = factorise.factorise(matrix * (1 + 0.02j))
    assert factor.name == "PARDISO"
    assert factorise.factorise(matrix).name == "SuperLU"
    np.testing.assert_allclose(matrix @ factor.solve(b) * (1 + 0.02j), b, rtol=1e-6, atol=1e-5)


def test_a_start_whose_rigid_body_modes_are_lifted_by_rounding_keeps_the_shift_away_from_zero():
    point = springs([(i - 1, i, 1e9) for i in range(1, 6)], [1.0] * 6)
    pencil = Pencil(point.symmetric_stiffness, point.symmetric_mass)
    search = near_shift(point, pencil, np.array([1e-4, 1.0]), -100.0, np.eye(pencil.n)[:, :2])
    assert -100.0 <= search.shift < -0.1
