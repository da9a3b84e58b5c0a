"""Block Lanczos: against dense solutions, on hard spectra, from good and bad starts, and the count behind it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.fem import Structure
from femtune.fem.fields import FieldRef
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    ModelPoint,
    configure,
    parametric_model,
    solve_modes,
)
from femtune.model.eigen import krylov as iteration
from femtune.model.eigen import pairs as eigenpairs
from femtune.model.eigen import solution as eigen_module
from femtune.model.eigen.accuracy import energy_residuals
from femtune.model.eigen.krylov import Krylov, KrylovPairs, begin, beside, iterate
from femtune.model.eigen.mass_space import MassSpace
from femtune.model.eigen.pairs import EigenSearch, iterative, largest
from femtune.model.eigen.pencil import Inverse, Pencil, indefinite_mass
from femtune.model.linear import sparse_products
from femtune.model.linear.dense_products import symmetric_eigen
from femtune.model.linear.sparse_products import product
from femtune.model.linear.symmetric import symmetric
from femtune.model.solvers import factorise
from femtune.parameters import Parameter, ParameterSet
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure
from structures.springs import spring_structure

STEEL = Isotropic(2.1e11, 0.3, 7850.0)


def point_of(structure: Structure) -> ModelPoint:
    return configure(parametric_model(structure, ParameterSet(()), ()), Configuration("test")).at(np.zeros(0))


def pencil_of(point: ModelPoint) -> Pencil:
    return Pencil(point.symmetric_stiffness, point.symmetric_mass)


def springs(links: list[tuple[int, int, float]], weights: list[float]) -> Pencil:
    return pencil_of(point_of(spring_structure(links, weights)))


def plate(cells: int = 9, t: float = 2e-3, sides: tuple[float, float] = (0.6, 0.6), **settings) -> Structure:
    """A free plate of shells, square unless told otherwise."""
    mesh = shell_mesh(rectangle(*sides), cells, cells)
    return shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, t))], **settings)


def dense_values(pencil: Pencil, shift: float) -> np.ndarray:
    """All finite eigenvalues, ascending, by LAPACK on the inverse: M may be singular."""
    theta = la.eigh(pencil.M.full().toarray(), pencil.shifted(shift).full().toarray(), eigvals_only=True)
    return np.sort(shift + 1.0 / theta[theta > 1e-13 * theta.max()])


def check(pencil: Pencil, values: np.ndarray, shapes: np.ndarray, shift: float, wanted: int) -> None:
    """Orthonormal to 1e-10, with residuals below 1e-8."""
    gram = shapes.T @ (pencil.M.full() @ shapes)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-10)
    K, M = pencil.K.full(), pencil.M.full()
    residual = K @ shapes - (M @ shapes) * values
    energy = np.einsum("ij,ij->j", residual, sp.linalg.spsolve(sp.csc_array(K - shift * M), residual))
    assert (np.sqrt(np.abs(energy) / (values - shift))[:wanted] < 1e-8).all()


@pytest.mark.quick(0)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("count", [4, 30, 90])
def test_a_free_square_plate_against_dense(consistent: bool, count: int):
    """Six rigid-body modes, repeated modes, DOFs without mass where it is lumped."""
    pencil = pencil_of(point_of(plate(consistent_mass=consistent)))
    values, shapes = iterative(EigenSearch(Inverse(pencil, -1e4)), count + 6, count)
    check(pencil, values, shapes, -1e4, count)
    expected = dense_values(pencil, -1e4)[:count]
    np.testing.assert_allclose(values[:count], expected, rtol=1e-8, atol=1e-6 * expected[min(6, count - 1)] + 1e-5)


def test_more_than_half_of_all_modes():
    """The whole spectrum of 60 masses, by the iteration although nobody would choose it here."""
    pencil = springs([(i - 1, i, 10.0 + i) for i in range(60)], [1.0 + 0.1 * (i % 7) for i in range(60)])
    for count in (31, 58, 60):
        values, shapes = iterative(EigenSearch(Inverse(pencil, -0.1)), count, count)
        np.testing.assert_allclose(np.sort(values), dense_values(pencil, -0.1)[:count], rtol=1e-9)
        check(pencil, values, shapes, -0.1, count)


@pytest.mark.quick(1)
@pytest.mark.parametrize("copies", [8, 9, 30])
def test_a_cluster_wider_than_the_block(copies: int):
    """Equal plates side by side have every mode `copies` times; the count makes the solution whole."""
    links = [(i - 1 if i % 20 else -1, i, 40.0) for i in range(20 * copies)]
    point = point_of(spring_structure([*links, (-1, 20 * copies, 1.0)], [1.0] * (20 * copies + 1)))
    single = 160.0 * np.sin(np.pi * (2 * np.arange(1, 21) - 1) / 82) ** 2
    expected = np.sort([1.0, *np.repeat(single, copies)])
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(eigenpairs, "DENSE_UP_TO", 0)
        solution = solve_modes(point, copies + 1)
    assert solution.sturm_count == (expected < solution.sturm_shift).sum()
    np.testing.assert_allclose(solution.eigenvalues[: solution.wanted], expected[: solution.wanted], rtol=1e-8)
    assert solution.wanted == copies + 1


def test_twelve_decades():
    """A chain of springs from 1e12 to 1, softer towards its end, against its flexibility in closed form."""
    stiffness = np.repeat(10.0 ** np.arange(12, -1, -1), 30)
    n = len(stiffness)
    weights = np.random.default_rng(4).uniform(0.5, 2.0, n)
    pencil = springs([(i - 1, i, k) for i, k in enumerate(stiffness)], list(weights))
    values, shapes = iterative(EigenSearch(Inverse(pencil, -1e-3)), 26, 20)
    check(pencil, values, shapes, -1e-3, 20)
    # the flexibility of a chain is known without an inverse: that of the springs up to the nearer of two masses
    up_to = np.cumsum(1.0 / stiffness)
    root = np.sqrt(weights)
    theta = la.eigvalsh(root[:, None] * np.minimum(up_to[:, None], up_to) * root)[::-1]
    np.testing.assert_allclose(values[:20], 1.0 / theta[:20], rtol=1e-8)


def test_fewer_modes_than_rows_with_mass():
    """Rank is revealed: mass of rank 5 in 300 DOFs."""
    n, rng = 300, np.random.default_rng(5)
    K = sp.diags_array([2.0 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
    L = sp.random_array((n, 5), density=0.2, rng=rng)
    pencil = Pencil(*_common(K, L @ L.T))
    values, _ = iterative(EigenSearch(Inverse(pencil, 0.0)), 12, 12)
    theta = la.eigvalsh(L.T @ sp.linalg.spsolve(sp.csc_array(K), L.toarray()))
    np.testing.assert_allclose(values, np.sort(1.0 / theta), rtol=1e-9)


def _common(K: sp.sparray, M: sp.sparray):
    """Both matrices on one pattern."""
    both = sp.csr_array(abs(sp.csr_array(K)) + abs(sp.csr_array(M)))
    both.data[:] = 0.0
    ones = sp.csr_array((np.full(both.nnz, 1e-300), both.indices, both.indptr), shape=both.shape)
    return symmetric(sp.csr_array(K) + ones), symmetric(sp.csr_array(M) + ones)


def operator_of(pencil: Pencil, shift: float) -> Krylov:
    inverse = Inverse(pencil, shift)
    return Krylov(inverse.solve, pencil.mass, pencil.heavy.size)


@pytest.mark.slow
def test_exact_near_and_useless_starts():
    pencil = pencil_of(point_of(plate(8, sides=(0.6, 0.5))))
    operator = operator_of(pencil, -1e4)
    first = iterate(operator, begin(operator, 26), 26, 20)
    near = first.shapes + 1e-4 * np.random.default_rng(1).standard_normal(first.shapes.shape)
    starts = {
        "exact": first.shapes,
        "near": near,
        "one": first.shapes[:, :1],
        "zero": 0.0 * near,
        "nan": near * np.nan,
        "noise": np.random.default_rng(2).standard_normal(near.shape),
    }
    solves = {}
    for name, start in starts.items():
        found = iterate(operator, begin(operator, 26, start), 26, 20)
        np.testing.assert_allclose(found.theta[:20], first.theta[:20], rtol=1e-9, err_msg=name)
        solves[name] = found.solves
    assert solves["exact"] < 0.8 * first.solves
    assert max(solves.values()) <= first.solves + 40


def test_modes_beside_those_that_are_known():
    pencil = pencil_of(point_of(plate(8, sides=(0.6, 0.5))))
    operator = operator_of(pencil, -1e4)
    whole = iterate(operator, begin(operator, 20), 20, 20)
    known = np.delete(np.arange(12), [3, 8])
    found = iterate(operator, beside(operator, 20, whole.theta[known], whole.shapes[:, known]), 20, 20)
    np.testing.assert_allclose(found.theta, whole.theta, rtol=1e-9)


def test_restarts_change_nothing(monkeypatch: pytest.MonkeyPatch):
    pencil = pencil_of(point_of(plate(8, sides=(0.6, 0.5))))
    operator = operator_of(pencil, -1e4)
    free = iterate(operator, begin(operator, 30), 30, 30)
    monkeypatch.setattr(iteration, "most_columns", lambda operator, count, block: count + 4 * block)
    tight = iterate(operator, begin(operator, 30), 30, 30)
    assert tight.columns < free.columns
    assert tight.solves > free.solves
    np.testing.assert_allclose(tight.theta, free.theta, rtol=1e-10)
    gram = tight.shapes.T @ (operator.mass @ tight.shapes)
    np.testing.assert_allclose(gram, np.eye(30), atol=1e-11)


def thickness_model() -> ConfiguredModel:
    """A free plate of two thicknesses, 900 DOFs."""
    mesh = shell_mesh(rectangle(0.7, 0.5), 14, 9)
    halves = [ShellPart(mesh.cells[:63], Section(STEEL, 2e-3)), ShellPart(mesh.cells[63:], Section(STEEL, 3e-3))]
    names = ParameterSet((Parameter("a"), Parameter("b")))
    fields = [Assignment(p, FieldRef("PSHELL", i, "T")) for i, p in enumerate(("a", "b"), 1)]
    model = parametric_model(shell_structure(mesh.xyz, halves, consistent_mass=True), names, fields)
    return configure(model, Configuration("test"))


@pytest.mark.slow
def test_the_modes_of_another_point_shorten_the_way(monkeypatch: pytest.MonkeyPatch):
    """The same modes from the old ones, by one factorisation above them, which counts them too."""
    model, made = thickness_model(), []
    right = Pencil.factorise
    old = solve_modes(model.at(np.zeros(2)), 20)
    monkeypatch.setattr(Pencil, "factorise", lambda self, shift: made.append(shift) or right(self, shift))
    new = solve_modes(model.at(np.array([0.1, -0.1])), 20, start=old)
    assert made == [new.sturm_shift]
    assert new.shift == old.shift
    assert new.sturm_count == len(new.eigenvalues) >= new.wanted == 20
    check(pencil_of(new.point), new.eigenvalues, new.shapes, new.shift, 20)
    fresh = solve_modes(new.point, 20)
    np.testing.assert_allclose(new.eigenvalues[6:20], fresh.eigenvalues[6:20], rtol=1e-9)
    assert abs(new.eigenvalues[6] / old.eigenvalues[6] - 1.0) > 1e-3


@pytest.mark.quick(0)
@pytest.mark.parametrize("damage", ["nan", "rotated", "few"])
def test_bad_starts_lead_to_the_same_modes(damage: str):
    point = thickness_model().at(np.zeros(2))
    good = solve_modes(point, 20)
    shapes = {"nan": good.shapes * np.nan, "rotated": good.shapes[::-1].copy(), "few": good.shapes[:, :1]}[damage]
    again = solve_modes(point, 20, start=replace(good, shapes=shapes))
    np.testing.assert_allclose(again.eigenvalues[6:20], good.eigenvalues[6:20], rtol=1e-9)


@pytest.mark.slow
def test_large_models_keep_one_factor_at_a_time(monkeypatch: pytest.MonkeyPatch):
    """That of the count; whoever wants the other one gets it made again."""
    if "PARDISO" not in factorise.available_solvers():
        pytest.skip("the Math Kernel Library is not installed (extra 'fast')")
    monkeypatch.setattr(factorise, "PARDISO_FROM", 0)
    point = thickness_model().at(np.zeros(2))
    both = solve_modes(point, 20)
    assert both.known_factor is not None
    assert both.sturm_factor is None
    monkeypatch.setattr(eigen_module, "ONE_FACTOR_FROM", 0)
    one = solve_modes(point, 20)
    assert one.known_factor is None
    assert one.sturm_factor is not None
    np.testing.assert_array_equal(one.eigenvalues, both.eigenvalues)
    b = np.ones(point.configured.n_free)
    x = one.sturm_factor.solve(b)
    np.testing.assert_allclose(one.point.stiffness @ x - one.sturm_shift * (one.point.mass @ x), b, atol=1e-6)
    x = one.factor.solve(b)
    assert one.sturm_factor is None
    np.testing.assert_allclose(one.point.stiffness @ x - one.shift * (one.point.mass @ x), b, atol=1e-6)
    np.testing.assert_allclose(one.factor.solve(b), both.factor.solve(b))
    again = solve_modes(point, 20)
    again.forget_factors()
    assert again.sturm_factor is None


def test_modes_that_are_nearly_orthonormal_become_so():
    """Off by 1e-4, one step of Newton leaves the square of it, and unit modal masses leave rounding on the diagonal."""
    rng = np.random.default_rng(5)
    mass = np.diag(rng.uniform(0.5, 2.0, 40))
    shapes = la.qr(rng.standard_normal((40, 3)), mode="economic")[0] / np.sqrt(np.diag(mass))[:, None]
    vectors = np.asfortranarray(shapes * [1.0001, 0.9999, 1.0] + 1e-4 * shapes[:, [1, 2, 0]])
    basis = SimpleNamespace(vectors=vectors, B=np.zeros((0, 3)), mass=mass, least=0.0, solves=3)
    theta = np.array([3.0, 2.0, 1.0])
    found = iteration.finished_pairs(basis, theta, np.eye(3), np.zeros(3), 3).shapes  # type: ignore[arg-type]
    gram = found.T @ mass @ found
    np.testing.assert_allclose(np.diag(gram), 1.0, rtol=1e-14)
    np.testing.assert_allclose(gram, np.eye(3), atol=1e-7)


@pytest.mark.slow
def test_a_count_at_the_limit_spares_a_factorisation(monkeypatch: pytest.MonkeyPatch):
    point, made = thickness_model().at(np.zeros(2)), []
    found = solve_modes(point, 12)
    between = float(np.sqrt(found.eigenvalues[10:12].mean()) / (2.0 * np.pi))
    right = Pencil.factorise
    monkeypatch.setattr(Pencil, "factorise", lambda self, shift: made.append(shift) or right(self, shift))
    limited = solve_modes(point, max_hz=between)
    assert limited.wanted == limited.sturm_count == 11
    assert sum(s > 0 for s in made) == 1


def test_bounds_of_residuals_are_bounds():
    """One bad mode among thirty good ones shows in the bound of its group, and then in its own residual."""
    pencil = pencil_of(point_of(plate(9, consistent_mass=True)))
    inverse = Inverse(pencil, -1e4)
    values, shapes = iterative(EigenSearch(inverse), 36, 30)
    good = energy_residuals(inverse, values, shapes, 30)
    assert (good[:30] <= 1e-8).all()
    assert len(set(good[:30])) == 1
    spoilt = shapes.copy()
    spoilt[:, 17] += 1e-6 * shapes[:, 20]
    errors = energy_residuals(inverse, values, spoilt, 30)
    # (λ20 − λ17)²/((λ20 − σ)(λ17 − σ)) of the energy that was mixed in
    size = abs(values[20] - values[17]) / np.sqrt((values[20] + 1e4) * (values[17] + 1e4))
    assert errors[17] == pytest.approx(1e-6 * size, rel=1e-2)
    assert (np.delete(errors[:30], 17) < 1e-8).all()
    # forces, each measured by its stiffness, of the elastic modes
    elastic, inertial = pencil.stiffness @ shapes, (pencil.mass @ shapes) * values
    scale = 1.0 / np.sqrt(pencil.K.diagonal())[:, None]
    size = np.linalg.norm(scale * elastic, axis=0) + np.linalg.norm(scale * inertial, axis=0)
    assert (np.linalg.norm(scale * (elastic - inertial), axis=0)[6:30] < 1e-6 * size[6:30]).all()


def test_negative_masses_are_seen():
    for entries, bad in (([1.0, 1.0, 0.5], False), ([1.0, 1.0, 1.2], True), ([1.0, -0.1, 0.0], True)):
        a, b, c = entries
        assert indefinite_mass(symmetric(sp.csr_array([[a, c], [c, b]]))) == bad
    links = [(-1, 0, 1e3), (0, 1, 1e3)]
    with pytest.raises(FemtuneError) as caught:
        solve_modes(point_of(spring_structure(links, [1.0, -0.2])), 1)
    assert caught.value.code == "eigen.negative"


@pytest.mark.parametrize("entries_from", [0, 10**9])
@pytest.mark.parametrize("more", [0, 30, 2000])
def test_products(entries_from: int, more: int, monkeypatch: pytest.MonkeyPatch):
    """With `more` entries than the diagonal: none, few, many."""
    monkeypatch.setattr(sparse_products, "LIBRARY_FROM", entries_from)
    rng = np.random.default_rng(0)
    B = sp.random_array((200, 200), density=more / 200**2, rng=rng)
    A = sp.csr_array(sp.diags_array(rng.standard_normal(200)) + B + B.T)
    for block in (0, 4):
        times = product(symmetric(A), block)
        for shape in ((200,), (200, 1), (200, 7), (200, 0)):
            x = rng.standard_normal(shape)
            np.testing.assert_allclose(times @ x, A @ x, atol=1e-13)
            np.testing.assert_allclose(times @ np.asfortranarray(x), A @ x, atol=1e-13)


def test_the_last_solve_makes_pairs_better() -> None:
    """Of a plate whose rotations have no mass: shapes on all DOFs, nearer to those of a dense solution."""
    pencil = pencil_of(point_of(plate(7)))
    K, M, shift = pencil.K.full().toarray(), pencil.M.full().toarray(), -1e4
    A = K - shift * M
    exact, vectors = la.eigh(M, A)
    space = MassSpace(pencil, lambda b: np.asfortranarray(la.solve(A, b)))
    assert space.is_part
    assert space.operator.mass.shape[0] == pencil.heavy.size < pencil.n
    theta, shapes = exact[:-13:-1], vectors[:, :-13:-1] / np.sqrt(exact[:-13:-1])
    noise = np.random.default_rng(2).standard_normal(shapes.shape)
    rough = shapes + 1e-5 * noise * np.linalg.norm(shapes, axis=0) / np.linalg.norm(noise, axis=0)
    start = np.asfortranarray(rough[pencil.heavy])
    start /= np.sqrt(np.einsum("ij,ij->j", start, space.pencil.heavy_mass @ start))
    found = space.finished(KrylovPairs(theta, start, np.zeros(12), 0.0, 0, 12))
    np.testing.assert_allclose(found.theta, theta, rtol=1e-8)
    np.testing.assert_allclose(found.shapes.T @ M @ found.shapes, np.eye(12), atol=1e-10)
    residual = found.shapes / found.theta - la.solve(A, M @ found.shapes) / found.theta**2
    before = rough / theta - la.solve(A, M @ rough) / theta**2
    sizes = [np.sqrt(np.einsum("ij,ij->j", r, A @ r)).max() for r in (residual, before)]
    assert sizes[0] < 0.1 * sizes[1]


def test_where_all_dofs_have_mass_there_is_no_last_solve() -> None:
    pencil = springs([(i, i + 1, 1e3) for i in range(-1, 9)], [1.0] * 10)
    space = MassSpace(pencil, lambda b: b)
    pairs = KrylovPairs(np.ones(1), np.ones((10, 1)), np.zeros(1), 0.0, 0, 1)
    assert not space.is_part
    assert space.finished(pairs) is pairs
    assert space.operator.mass is pencil.mass


@pytest.mark.parametrize("rows", [5, 80])
def test_eigenvalues_of_small_matrices(rows: int) -> None:
    A = np.random.default_rng(3).standard_normal((rows, rows))
    A = A + A.T
    values, vectors = symmetric_eigen(A)
    np.testing.assert_allclose(values, la.eigvalsh(A), atol=1e-12 * rows)
    np.testing.assert_allclose(vectors * values @ vectors.T, A, atol=1e-12 * rows)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(rows), atol=1e-13 * rows)


@pytest.mark.parametrize("seed", [0, 120, 200, 284, 325, 838])
def test_eigenvalues_that_are_equal_but_for_rounding(seed: int) -> None:
    """Six rigid-body modes, and a cluster far above: of some such matrices LAPACK's xSYEVR finds no vectors."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(20, 60))
    equal = int(rng.integers(2, n - 8))
    count = int(rng.integers(10, n))
    exact = 1.0 / (
        1e5 + np.concatenate([np.zeros(6), 10.0 ** rng.uniform(5.0, 7.0, n - equal - 6), np.full(equal, 4e7)])
    )
    others = la.qr(rng.standard_normal((n - equal, n - equal)))[0]
    turn = la.block_diag(others, np.eye(equal) + 1e-9 * rng.standard_normal((equal, equal)))
    matrix = turn * exact @ turn.T
    theta, vectors = largest(0.5 * (matrix + matrix.T), count)
    np.testing.assert_allclose(theta, np.sort(exact)[-count:], rtol=1e-7)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(count), atol=1e-12)
    np.testing.assert_allclose(matrix @ vectors, vectors * theta, atol=1e-12 * theta[-1])
