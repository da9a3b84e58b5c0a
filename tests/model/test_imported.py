"""Models of matrices: sums with factors, polynomials through sets, and the comparison with listed modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse as sp

from femtune.errors import FemtuneError, Where
from femtune.fem import NodeTable
from femtune.fem.elimination import eliminate
from femtune.fem.structure import no_constraints
from femtune.model import Assignment, Configuration, ParametricModel, configure, parametric_model, solve_modes
from femtune.model.configured import node_blocks
from femtune.model.imported.model import ImportedMatrix, field_of_matrix, field_of_variable, imported_structure
from femtune.model.imported.modes import check_modes, compare_modes
from femtune.model.imported.polynomial import MatrixSet, Variable, fit_polynomial
from femtune.parameters import Parameter, ParameterSet

N = 6


def scalars(n: int) -> NodeTable:
    none = np.zeros(0, np.int64)
    return NodeTable(none, np.zeros((0, 3)), np.zeros((0, 3, 3)), np.arange(1, n + 1))


def upper(matrix: np.ndarray) -> sp.csr_array:
    return sp.csr_array(np.triu(matrix))


def chain(stiffness: np.ndarray) -> np.ndarray:
    """Springs in a row, the first to ground."""
    K = np.zeros((N, N))
    for i, k in enumerate(stiffness):
        K[i, i] += k
        if i:
            K[i - 1, i - 1] += k
            K[i - 1, i] = K[i, i - 1] = -k
    return K


STORIES = np.array([5.0, 4.0, 4.0, 3.0, 3.0, 2.0])
M = np.diag([2.0, 2.0, 1.0, 1.0, 1.0, 0.5])


def stiffness_at(t: float, e: float = 1.0) -> np.ndarray:
    """The first three springs as t³, the others as t, all times e."""
    return e * (chain(STORIES * [1, 1, 1, 0, 0, 0]) * t**3 + chain(STORIES * [0, 0, 0, 1, 1, 1]) * t)


def constant(name: str, kind: str, matrix: np.ndarray) -> ImportedMatrix:
    return ImportedMatrix(name, kind, (MatrixSet(upper(matrix)),))  # type: ignore[arg-type]


def model_of(
    matrices: list[ImportedMatrix], variables: list[Variable], *fields: tuple[str, object, bool]
) -> ParametricModel:
    n = matrices[0].sets[0].upper.shape[0]
    found = imported_structure(scalars(n), np.arange(n), matrices, variables)
    assignments = [Assignment(name, ref, relative) for name, ref, relative in fields]  # type: ignore[arg-type]
    parameters = ParameterSet(tuple(Parameter(name, 1.0, 0.5, 2.0) for name, _, _ in fields))
    return parametric_model(found.structure, parameters, assignments)


def test_factors_of_matrices_are_exact_with_their_derivatives() -> None:
    first, second = chain(STORIES * [1, 1, 1, 0, 0, 0]), chain(STORIES * [0, 0, 0, 1, 1, 1])
    matrices = [constant("A", "stiffness", first), constant("B", "stiffness", second), constant("M", "mass", M)]
    model = model_of(matrices, [], ("a", field_of_matrix("A"), True), ("m", field_of_matrix("M"), True))
    point = configure(model, Configuration()).at(np.array([0.1, 0.2]))
    np.testing.assert_allclose(point.stiffness.toarray(), 1.1 * first + second, rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(point.mass.toarray(), 1.2 * M, rtol=1e-15)
    np.testing.assert_allclose(point.stiffness_derivatives[0].toarray(), first, atol=1e-15)
    np.testing.assert_allclose(point.mass_derivatives[1].toarray(), M, atol=1e-15)
    expected = np.sqrt(scipy.linalg.eigvalsh(1.1 * first + second, 1.2 * M)) / (2 * np.pi)
    np.testing.assert_allclose(solve_modes(point, N).freq_hz, expected, rtol=1e-10)


def sets_of(values: list[tuple[float, float]]) -> tuple[MatrixSet, ...]:
    return tuple(MatrixSet(upper(stiffness_at(t, e)), {"T": t, "E": e}) for t, e in values)


def test_cubic_sets_give_the_matrix_at_any_value() -> None:
    sets = tuple(MatrixSet(upper(stiffness_at(t)), {"T": t}) for t in (0.6, 0.8, 1.0, 1.2, 1.4))
    K = ImportedMatrix("K", "stiffness", sets)
    model = model_of([K, constant("M", "mass", M)], [Variable("T", 1.0, 3)], ("t", field_of_variable("T"), False))
    configured = configure(model, Configuration())
    for t in (0.5, 1.1, 1.9):
        K_t = configured.at(np.array([t - 1.0])).stiffness.toarray()
        np.testing.assert_allclose(K_t, stiffness_at(t), rtol=1e-12, atol=1e-12)
    slope = configured.at(np.array([0.1 + 1e-30j])).stiffness.toarray().imag / 1e-30
    exact = 3 * 1.1**2 * chain(STORIES * [1, 1, 1, 0, 0, 0]) + chain(STORIES * [0, 0, 0, 1, 1, 1])
    np.testing.assert_allclose(slope, exact, rtol=1e-11, atol=1e-11)
    found = configured.at(np.array([0.1])).stiffness_derivatives[0].toarray()
    np.testing.assert_allclose(found, exact, rtol=1e-11, atol=1e-11)


def test_stiffness_of_single_points_at_another_value_than_one() -> None:
    """Diagonals of points without coordinates, which say what has no stiffness: t³ and t at t = 0.5."""
    sets = tuple(MatrixSet(upper(stiffness_at(t)), {"T": t}) for t in (0.3, 0.4, 0.5, 0.6, 0.7))
    model = model_of([ImportedMatrix("K", "stiffness", sets), constant("M", "mass", M)], [Variable("T", 0.5, 3)])
    terms = [t for t in model.terms if t.matrix == "stiffness"]
    everything = eliminate(N, no_constraints(), [], str)
    blocks = node_blocks(terms, everything, 0, model.table(np.zeros(0)))
    np.testing.assert_allclose(blocks.toarray(), np.diag(np.diag(stiffness_at(0.5))), rtol=1e-12, atol=1e-12)


def test_products_of_crossed_variables() -> None:
    values = [(t, e) for t in (0.6, 0.9, 1.1, 1.4) for e in (0.8, 1.0)] + [(1.25, 1.1)]
    both = [Variable("T", 1.0, 3, crossed=True), Variable("E", 1.0, 1, crossed=True)]
    found = fit_polynomial("K", sets_of(values), both, 1e-10, Where())
    assert found.deviation < 1e-12
    assert found.checks == 1


def test_products_that_are_left_out_are_seen() -> None:
    values = [(t, 1.0) for t in (0.6, 0.8, 1.0, 1.2)] + [(1.0, 1.1), (1.4, 1.2)]
    plain = [Variable("T", 1.0, 3), Variable("E", 1.0, 1)]
    with pytest.raises(FemtuneError) as error:
        fit_polynomial("K", sets_of(values), plain, 1e-4, Where())
    assert error.value.code == "matrices.not-polynomial"
    assert "crossed = true" in error.value.hint


@pytest.mark.parametrize(
    ("values", "what"),
    [
        ([(0.6, 1.0), (1.0, 1.0), (1.4, 1.0)], "4 coefficients"),
        ([(0.6, 1.0), (0.6, 1.0), (1.0, 1.0), (1.2, 1.0), (1.4, 1.0)], "are at the same point"),
        ([(1.0, 1.0)] * 5, "are at the same point"),
    ],
)
def test_sets_that_do_not_suffice(values: list[tuple[float, float]], what: str) -> None:
    sets = [MatrixSet(s.upper, {"T": s.at["T"]}) for s in sets_of(values)]
    with pytest.raises(FemtuneError, match=what) as error:
        fit_polynomial("K", sets, [Variable("T", 1.0, 3)], 1e-4, Where())
    assert error.value.code == "matrices.sets"


def test_no_set_that_moves_all_variables() -> None:
    values = [(0.6, 1.0), (0.8, 1.0), (1.0, 1.0), (1.2, 1.0), (1.0, 1.1), (1.0, 1.2)]
    with pytest.raises(FemtuneError, match="changes all variables at once"):
        fit_polynomial("K", sets_of(values), [Variable("T", 1.0, 3), Variable("E", 1.0, 1)], 1e-4, Where())


def test_a_degree_too_low_is_refused_with_numbers() -> None:
    sets = [MatrixSet(upper(stiffness_at(t)), {"T": t}) for t in (0.6, 0.8, 1.0, 1.2)]
    with pytest.raises(FemtuneError) as error:
        fit_polynomial("K", sets, [Variable("T", 1.0, 2)], 1e-4, Where())
    assert error.value.code == "matrices.not-polynomial"
    assert float(error.value.values["error over change"]) > 1e-3
    assert "increase the degree by one" in error.value.hint


def test_what_does_not_change_has_no_higher_terms() -> None:
    sets = [MatrixSet(upper(stiffness_at(t) + 0.1 * np.eye(N)), {"T": t}) for t in (0.6, 0.8, 1.0, 1.2, 1.4)]
    terms = dict(fit_polynomial("K", sets, [Variable("T", 1.0, 3)], 1e-6, Where()).terms)
    # the last three springs are linear in T: nothing of theirs in the square and cube
    assert (3, 3) not in zip(*terms[(3,)].nonzero())
    assert terms[(3,)].nnz == terms[(2,)].nnz


@pytest.mark.slow
def test_concrete_frame(shared_data: Path) -> None:
    """12 influence matrices with the published true changes: published frequencies before and after."""
    data = scipy.io.loadmat(shared_data / "concrete_frame_simulated" / "ConcreteBuildingFrame.mat")
    matrices, names = frame_matrices(data)
    fields = [(n.lower(), field_of_matrix(n), True) for n in names]
    model = model_of(matrices, [], *fields)
    configured = configure(model, Configuration())
    truth = np.array([-0.1, 0.2, 0.2, -0.05, 0.2, 0.15, 0.15, 0.10, -0.10, -0.15, 0.20, 0.15])
    before = solve_modes(configured.at(np.zeros(12)), 3).freq_hz
    after = solve_modes(configured.at(truth), 3).freq_hz
    np.testing.assert_allclose(before, [2.28649, 5.98051, 16.22121], rtol=2e-6)
    np.testing.assert_allclose(after, [2.38370, 6.19327, 17.06610], rtol=2e-6)


LISTED = np.sqrt(scipy.linalg.eigvalsh(stiffness_at(1.0), M)) / (2 * np.pi)


def refusal(K: np.ndarray, mass: np.ndarray, listed: np.ndarray) -> dict[str, object]:
    model = model_of([constant("K", "stiffness", K), constant("M", "mass", mass)], [])
    point = configure(model, Configuration()).at(np.zeros(0))
    found = solve_modes(point, len(K)).freq_hz
    with pytest.raises(FemtuneError) as error:
        check_modes(point, found, listed, 1e-4, Where("study.toml"))
    assert error.value.code == "matrices.modes-differ"
    return error.value.values


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1000.0, "factor of 1000"),
        (386.0886, "386.09"),
        (1 / 386.0886, "386.09"),
        (9.80665, "9.807"),
        ((2 * np.pi) ** 2, "rad/s"),
        (1.7, "factor 1.7"),
    ],
)
def test_units_are_the_first_cause_of_a_constant_ratio(factor: float, words: str) -> None:
    values = refusal(factor * stiffness_at(1.0), M, LISTED)
    assert words in str(values["likely cause 1"])


def test_missing_supports_are_the_first_cause_of_rigid_modes() -> None:
    free = stiffness_at(1.0)
    free[0, 0] -= STORIES[0]
    values = refusal(free, M, LISTED[:4])
    assert "1 rigid-body modes more than listed" in str(values["likely cause 1"])


@pytest.mark.parametrize("count", [1, 2])
def test_a_list_that_begins_higher_or_lower_tells_of_supports(count: int) -> None:
    """All modes agree when some of the lowest of one side are left out."""
    values = refusal(stiffness_at(1.0), M, LISTED[count:])
    assert f"{count} of the lowest are left out: {count} modes more than listed" in str(values["likely cause 1"])
    below = [0.2 * LISTED[0], 0.5 * LISTED[0]][:count]
    values = refusal(stiffness_at(1.0), M, np.array([*below, *LISTED[: N - count]]))
    assert f"{count} of the lowest are left out: {count} modes fewer than listed" in str(values["likely cause 1"])


def test_lumped_mass_drifts_with_the_mode_number() -> None:
    K = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    consistent = (4.0 * np.eye(N) + np.eye(N, k=1) + np.eye(N, k=-1)) / 6.0
    listed = np.sqrt(scipy.linalg.eigvalsh(K, consistent)) / (2 * np.pi)
    values = refusal(K, np.eye(N), listed[:5])
    assert "the mass is diagonal (lumped)" in str(values["likely cause 1"])


def test_other_order_of_rows() -> None:
    order = [3, 0, 5, 1, 4, 2]
    odd = np.diag([1.0, 20.0, 1.0, 1.0, 1.0, 0.5])
    listed = np.sqrt(scipy.linalg.eigvalsh(stiffness_at(1.0), odd)) / (2 * np.pi)
    values = refusal(stiffness_at(1.0), odd[np.ix_(order, order)], listed[:4])
    assert any("another order" in str(v) for k, v in values.items() if k.startswith("likely cause"))


def test_a_list_without_rigid_body_modes_is_compared_with_the_elastic_ones() -> None:
    compared = compare_modes(np.array([0.0, 1e-7, 3.0, 5.0]), [3.0, 5.0])
    assert compared.difference == 0.0
    assert compared.rigid_found == 2


def frame_matrices(data: dict[str, np.ndarray]) -> tuple[list[ImportedMatrix], list[str]]:
    names = [f"E_{i}" for i in range(1, 13)]
    parts = {name: data[name] for name in ("Influence_Link", "Influence_Rebar", *names)}
    whole = sum(parts.values())
    assert abs(whole - data["K0"]).max() < 1e-9 * abs(data["K0"]).max()
    matrices = [of_file(name.replace("_", ""), "stiffness", A) for name, A in parts.items()]
    return [*matrices, of_file("M", "mass", data["M0"])], [name.replace("_", "") for name in names]


def of_file(name: str, kind: str, A: sp.csc_matrix) -> ImportedMatrix:
    return ImportedMatrix(name, kind, (MatrixSet(sp.csr_array(sp.triu(0.5 * (A + A.T), format="csr"))),))  # type: ignore[arg-type]


def test_a_factor_that_overflows() -> None:
    matrices = [constant("K", "stiffness", 1e300 * np.eye(2)), constant("M", "mass", np.eye(2))]
    with pytest.raises(FemtuneError, match="an entry of K, multiplied by its factor, is larger than 1e\\+100") as error:
        imported_structure(scalars(2), np.arange(2), matrices)
    assert error.value.code == "matrices.huge"


def refused(code: str, K: np.ndarray, mass: np.ndarray, *variables: Variable) -> str:
    n = len(K)
    with pytest.raises(FemtuneError) as error:
        imported_structure(
            scalars(n), np.arange(n), [constant("K", "stiffness", K), constant("M", "mass", mass)], variables
        )
    assert error.value.code == code
    return str(error.value)


def test_entries_that_are_all_zero_are_no_stiffness() -> None:
    K = sp.csr_array((np.zeros(2), ([0, 1], [0, 1])), shape=(2, 2))
    matrices = [ImportedMatrix("K", "stiffness", (MatrixSet(K),)), constant("M", "mass", np.eye(2))]
    with pytest.raises(
        FemtuneError, match="the model has no stiffness: all entries of its stiffness matrices are zero"
    ):
        imported_structure(scalars(2), np.arange(2), matrices)


def test_stiffness_and_mass_on_other_degrees_of_freedom() -> None:
    text = refused("matrices.disjoint", np.diag([1.0, 0.0, 0.0]), np.diag([0.0, 1.0, 1.0]))
    assert "stiffness at = 1S" in text
    assert "mass at = 2S, 3S" in text
    matrices = [constant("K", "stiffness", np.diag([1.0, 1.0, 0.0])), constant("M", "mass", np.eye(3))]
    (notice,) = imported_structure(scalars(3), np.arange(3), matrices).notices
    assert (notice.code, notice.level) == ("matrices.mass-without-stiffness", "warning")
    assert ": 3S;" in notice.what


def test_rows_whose_columns_were_cut_off() -> None:
    """A lower triangle by columns without its last column."""
    K = chain(STORIES)
    K[N - 1, N - 1] = 0.0
    assert "1 rows of the stiffness matrix have entries but no diagonal entry\n  DOFs = 6S" in refused(
        "matrices.no-diagonal", K, M
    )
    K[N - 2, N - 1] = K[N - 1, N - 2] = 1e-12
    imported_structure(scalars(N), np.arange(N), [constant("K", "stiffness", K), constant("M", "mass", M)])


def test_a_variable_that_nothing_depends_on() -> None:
    text = refused("matrices.unused-variable", chain(STORIES), M, Variable("T", 1.0, 2))
    assert "no matrix depends on the variable T\n  variables of the matrices = none" in text


EIGHT = np.array([3.91207, 7.81415, 11.22331, 15.72319, 19.43277, 23.15573])


def test_digits_of_a_list_are_allowed_for() -> None:
    listed = np.round(EIGHT, 2)
    compared = compare_modes(EIGHT, listed)
    assert compared.difference == pytest.approx(0.00415 / 7.81)
    assert compared.excess == 0.0
    assert compare_modes(EIGHT, [3.92, *listed[1:]]).excess > 1e-4
    # a list of full length has nothing to be excused
    assert compare_modes(EIGHT * (1.0 + 3e-4), EIGHT).excess > 2e-4
    # whole numbers of Hz excuse no more than one per cent
    assert compare_modes(np.array([3.4, 8.0]), [3.0, 8.0]).excess > 0.1


def modes_of(K: np.ndarray) -> np.ndarray:
    return np.sqrt(scipy.linalg.eigvalsh(K, M)) / (2 * np.pi)


def causes(values: dict[str, object]) -> str:
    return " | ".join(str(v) for k, v in values.items() if k.startswith("likely cause"))


def test_a_mode_that_lacks_in_the_list() -> None:
    hz = modes_of(stiffness_at(1.0))
    text = causes(refusal(stiffness_at(1.0), M, np.delete(hz, 1)))
    assert text == f"5 modes agree; mode 2 ({hz[1]:.6g} Hz) of the matrices is not in the list"


def test_one_wrong_number_in_the_list() -> None:
    hz = modes_of(stiffness_at(1.0))
    listed = hz.copy()
    listed[2] *= 1.01
    values = refusal(stiffness_at(1.0), M, listed)
    assert causes(values) == (
        f"5 modes agree; mode 3 ({hz[2]:.6g} Hz) of the matrices is not in the list, "
        f"and mode 3 ({listed[2]:.6g} Hz) of the list is not among those of the matrices"
    )
    assert str(values["difference in %"]).split(", ")[2] == "-0.99"


def inclined_beam(t: float, segments: int = 10, h: float = 20.0) -> np.ndarray:
    """A plane cantilever at 45°: its membrane (t) lies over its bending (t³) in every translation."""
    n = 3 * segments
    K = np.zeros((n + 3, n + 3))
    a, b, c = t / h, t**3 / h**3, np.sqrt(0.5)
    Q = np.kron(np.eye(2), [[c, c, 0.0], [-c, c, 0.0], [0.0, 0.0, 1.0]])
    bend = b * np.array([[12, 6 * h, -12, 6 * h], [0, 4 * h * h, -6 * h, 2 * h * h], [0, 0, 12, -6 * h],
                         [0, 0, 0, 4 * h * h]]) / 12.0  # fmt: skip
    local = np.zeros((6, 6))
    local[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = bend + np.triu(bend, 1).T
    local[np.ix_([0, 3], [0, 3])] = [[a, -a], [-a, a]]
    for i in range(segments):
        K[3 * i : 3 * i + 6, 3 * i : 3 * i + 6] += Q.T @ local @ Q
    return K[3:, 3:]


def test_bending_below_a_membrane_is_checked_by_its_energy() -> None:
    # translations only: rotations are eliminated, as where a stiff drilling motion hides them
    def condensed(t: float) -> MatrixSet:
        K = inclined_beam(t)
        turn = np.arange(2, len(K), 3)
        move = np.setdiff1d(np.arange(len(K)), turn)
        A = K[np.ix_(move, move)] - K[np.ix_(move, turn)] @ np.linalg.solve(
            K[np.ix_(turn, turn)], K[np.ix_(turn, move)]
        )
        return MatrixSet(upper(A), {"T": t})

    with pytest.raises(FemtuneError, match="for their softest motions") as error:
        fit_polynomial("K", [condensed(t) for t in (0.8, 0.9, 1.0, 1.1)], [Variable("T", 1.0, 2)], 1e-4, Where())
    assert error.value.code == "matrices.not-polynomial"
    assert float(error.value.values["error over change, entries"]) < 1e-4
    cubic = [condensed(t) for t in (0.8, 0.9, 1.0, 1.1, 1.2)]
    assert fit_polynomial("K", cubic, [Variable("T", 1.0, 3)], 1e-4, Where()).deviation < 1e-10


def test_translations_without_mass_are_told_and_rotations_are_not() -> None:
    nodes = NodeTable(
        np.array([7, 41]), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros(0, np.int64), has_coordinates=False
    )
    K = 2.0 * np.eye(12)
    for still, expected in (([3, 4, 5, 9, 10, 11], []), ([6, 7, 8], ["41X+, 41Y+, 41Z+"])):
        mass = np.eye(12)
        mass[still, still] = 0.0
        matrices = [constant("K", "stiffness", K), constant("M", "mass", mass)]
        found = imported_structure(nodes, np.arange(12), matrices).notices
        assert [n.code for n in found] == ["matrices.stiffness-without-mass"] * len(expected)
        assert all(names.replace("+", "") in n.what and n.level == "info" for names, n in zip(expected, found))
