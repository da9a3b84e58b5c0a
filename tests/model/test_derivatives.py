"""Derivatives at sensors by the dual way, whole fields by streaming, each beside the exact way of small models."""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.fem import FieldRef
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.field_refs import resolve
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    SubspaceDerivative,
    configure,
    derivatives_by_parameter,
    eigenvalue_derivatives,
    parametric_model,
    sensor_derivatives,
    solve_modes,
    subspace_derivative,
)
from femtune.model.derivatives import (
    chosen as mode_derivatives,
)
from femtune.model.derivatives import (
    modes as derivatives,
)
from femtune.model.derivatives import (
    sensors as dual_basis,
)
from femtune.model.derivatives import (
    sensors as dual_derivatives,
)
from femtune.model.derivatives import (
    streamed as streamed_derivatives,
)
from femtune.model.derivatives.modes import Complement, complement, deflated_factor, exact_derivative
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_directional, check_taylor_slope
from structures.shells import Isotropic, Section, ShellPart, dofs_of, rectangle, shell_mesh, shell_structure
from structures.springs import factor_model, sensor_rows, spring_structure
from structures.subframe import subframe, write_subframe

PARAMETERS = (
    "PSHELL 1 T", "PSHELL 3 T", "PSHELL 6 T", "MAT1 1 E", "MAT1 4 E", "MAT1 2 RHO", "PBAR 20 A",
)  # fmt: skip
WANTED = 16


def gradient(d: SubspaceDerivative) -> np.ndarray:
    """(rows, c, k) the derivative without rotation inside the subspace."""
    return d.outside - 0.5 * np.einsum("ri,kij->rjk", d.shapes, d.mass)


def true_error(found: SubspaceDerivative, exact: SubspaceDerivative) -> float:
    """Largest error of a mode over the largest entry of its derivative."""
    g, e = gradient(found), gradient(exact)
    return float((np.abs(g - e).max(axis=(0, 2)) / np.abs(e).max(axis=(0, 2))).max())


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> tuple[EigenSolution, sp.csr_array]:
    """A free subframe (shells, rubber solids, bars, RBE2, point masses) and sixty rows at its accelerometers."""
    made = subframe(5_000)
    built = build_structure(read_deck(write_subframe(made, tmp_path_factory.mktemp("deck") / "subframe.bdf")))
    refs = [FieldRef(card, int(number), name) for card, number, name in map(str.split, PARAMETERS)]
    for ref in refs:
        resolve(built, ref)
    names = [f"p{i}" for i in range(len(refs))]
    model = parametric_model(
        built.structure, ParameterSet(tuple(map(Parameter, names))), [Assignment(n, r) for n, r in zip(names, refs)]
    )
    configured = configure(model, Configuration())
    solution = solve_modes(configured.at(np.linspace(-0.1, 0.1, len(refs))), WANTED)
    # a rotation each too: where mass is lumped on translations, it is a sensor without mass
    dofs = [6 * built.structure.nodes.position(n) + d for n in made.sensors[:15] for d in (0, 1, 2, 4)]
    return solution, sp.csr_array(sp.csr_array(configured.transformation)[dofs])


CLUSTERS = [list(range(6)), [6], [8, 9], [12], [WANTED - 1]]


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-2, pytest.param(1e-4, marks=pytest.mark.long), 1e-7])
def test_the_dual_way_keeps_its_tolerance_and_tells_its_error(
    frame: tuple[EigenSolution, sp.csr_array], tolerance: float
) -> None:
    solution, rows = frame
    found = sensor_derivatives(solution, rows, tolerance)
    assert found.error.max() <= tolerance
    for cluster in CLUSTERS:
        some = found.subspace(cluster)
        error = true_error(some, exact_derivative(solution, cluster, rows))
        assert error <= tolerance
        assert some.error is not None
        assert some.error >= 0.1 * error


@pytest.mark.slow
def test_sensors_are_solved_for_a_few_times_whatever_the_number_of_parameters(
    frame: tuple[EigenSolution, sp.csr_array],
) -> None:
    solution, rows = frame
    solves = [sensor_derivatives(solution, rows, tolerance).solves for tolerance in (1e-2, 1e-4, 1e-7)]
    assert solves[0] < solves[1] < solves[2]
    assert solves[1] <= 5 * rows.shape[0]


@pytest.mark.slow
def test_small_matrices_and_eigenvalues(frame: tuple[EigenSolution, sp.csr_array]) -> None:
    solution, rows = frame
    slopes = eigenvalue_derivatives(solution)
    for cluster in CLUSTERS[1:]:
        dual, exact = sensor_derivatives(solution, rows).subspace(cluster), exact_derivative(solution, cluster, rows)
        for name in ("stiffness", "mass", "shapes"):
            size = np.abs(getattr(exact, name)).max()
            np.testing.assert_allclose(getattr(dual, name), getattr(exact, name), atol=1e-10 * size)
        if len(cluster) == 1:
            size = np.abs(exact.eigenvalue_gradient).max()
            np.testing.assert_allclose(slopes[cluster[0]], exact.eigenvalue_gradient, atol=1e-9 * size)


@pytest.mark.slow
def test_a_shift_among_the_modes_serves_as_well(
    frame: tuple[EigenSolution, sp.csr_array], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The factors of the Sturm count are indefinite; both ways need them on the complement of the modes only."""
    solution, rows = frame
    exact = {j: exact_derivative(solution, [j], rows) for j in (6, 15)}
    monkeypatch.setattr(derivatives, "STURM_FACTOR_FROM", 0)
    again = replace(solution)
    shift, factor = deflated_factor(again)
    assert shift == solution.sturm_shift > solution.eigenvalues[WANTED - 1]
    assert factor.negative_pivots == solution.sturm_count
    found = sensor_derivatives(again, rows)
    for j, expected in exact.items():
        assert true_error(found.subspace([j]), expected) <= 1e-4
        assert true_error(exact_derivative(again, [j], rows), expected) <= 1e-9


@pytest.mark.slow
def test_a_solution_from_file_gives_the_same_bits(frame: tuple[EigenSolution, sp.csr_array]) -> None:
    solution, rows = frame
    kept = replace(solution, known_factor=None, sturm_factor=None)
    one, two = (sensor_derivatives(s, rows.copy()).subspace([9]) for s in (solution, kept))
    for name in ("eigenvalues", "stiffness", "mass", "outside", "shapes"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


@pytest.mark.slow
def test_whole_fields_one_parameter_at_a_time(frame: tuple[EigenSolution, sp.csr_array]) -> None:
    solution, _ = frame
    clusters = [[6], [8, 9], [15]]
    exact = [exact_derivative(solution, cluster) for cluster in clusters]
    for i, found in enumerate(derivatives_by_parameter(solution, clusters)):
        for one, whole in zip(found, exact, strict=True):
            assert one.outside.shape == (len(solution.shapes), len(one.eigenvalues), 1)
            size = np.abs(gradient(whole)).max()
            np.testing.assert_allclose(gradient(one)[:, :, 0], gradient(whole)[:, :, i], atol=1e-8 * size)
            np.testing.assert_allclose(one.stiffness[0], whole.stiffness[i], atol=1e-9 * np.abs(whole.stiffness).max())
    assert i == len(PARAMETERS) - 1


@pytest.mark.slow
def test_a_stream_computes_only_what_is_taken(
    frame: tuple[EigenSolution, sp.csr_array], monkeypatch: pytest.MonkeyPatch
) -> None:
    solution, rows = frame
    asked: list[int] = []
    product = streamed_derivatives.derivative_product

    def counted(point: Any, kind: Any, parameter: int, vectors: np.ndarray) -> np.ndarray:
        asked.append(parameter)
        return product(point, kind, parameter, vectors)

    monkeypatch.setattr(streamed_derivatives, "derivative_product", counted)
    stream = derivatives_by_parameter(solution, [[6]], rows)
    assert asked == []
    next(stream)
    assert set(asked) == {0}


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Every model counts as large; the sizes of dual spaces that are made."""
    made: list[int] = []
    begin = dual_basis.DualBasis.__init__

    def counted(self: Any, solution: EigenSolution, rows: sp.csr_array, blocks: int) -> None:
        made.append(rows.shape[0])
        begin(self, solution, rows, blocks)

    monkeypatch.setattr(dual_basis.DualBasis, "__init__", counted)
    monkeypatch.setattr(mode_derivatives, "LARGE", 0)
    return made


@pytest.mark.slow
def test_all_clusters_share_one_dual_space(frame: tuple[EigenSolution, sp.csr_array], large: list[int]) -> None:
    solution, rows = replace(frame[0]), frame[1]
    found = [subspace_derivative(solution, cluster, rows) for cluster in CLUSTERS]
    assert large == [60]
    assert all(d.error is not None and 0.0 < d.error <= 1e-4 for d in found)
    subspace_derivative(solution, [6], rows[:30])
    assert large == [60, 30]


@pytest.mark.slow
def test_many_rows_and_modes_at_the_end_are_exact(frame: tuple[EigenSolution, sp.csr_array], large: list[int]) -> None:
    solution, rows = frame
    for members, seen in (([6], None), ([6], sp.eye_array(len(solution.shapes), format="csr")), ([WANTED], rows)):
        found = subspace_derivative(solution, members, seen)
        assert found.error == 0.0
        exact = exact_derivative(solution, members, seen)
        assert true_error(found, exact) <= 1e-7
    assert large == []


@pytest.mark.slow
def test_nothing_is_kept_of_a_solution_that_is_gone(frame: tuple[EigenSolution, sp.csr_array]) -> None:
    solution = replace(frame[0])
    sensor_derivatives(solution, frame[1], 1e-2)
    before = len(dual_derivatives.KEPT_DERIVATIVES)
    del solution
    gc.collect()
    assert len(dual_derivatives.KEPT_DERIVATIVES) == before - 1


def square_plate() -> ConfiguredModel:
    """A clamped square plate by quadrants: double modes that thicknesses of quadrants split."""
    mesh = shell_mesh(rectangle(1.0, 1.0), 10, 10)
    part = (mesh.xyz[mesh.cells].mean(axis=1)[:, :2] > 0.5) @ [1, 2]
    steel = [Section(Isotropic(2.1e11, 0.3, 7850.0), 0.01) for _ in range(4)]
    shells = [ShellPart(mesh.cells[part == k], section) for k, section in enumerate(steel)]
    structure = shell_structure(mesh.xyz, shells, held=dofs_of(mesh.rim, "123456"))
    fields = (("PSHELL", 1, "T"), ("MAT1", 1, "E"), ("PSHELL", 2, "T"))
    names = ParameterSet(tuple(Parameter(f"p{i}") for i in range(3)))
    assignments = [Assignment(f"p{i}", FieldRef(*field)) for i, field in enumerate(fields)]
    return configure(parametric_model(structure, names, assignments), Configuration())


@pytest.fixture(scope="module")
def plate() -> EigenSolution:
    solution = solve_modes(square_plate().at(np.zeros(3)), 6)
    assert abs(solution.eigenvalues[2] / solution.eigenvalues[1] - 1.0) < 1e-9
    return solution


@pytest.mark.parametrize("sensors", [None, 12])
def test_a_stream_of_thicknesses_and_moduli_is_the_whole_field(plate: EigenSolution, sensors: int | None) -> None:
    """Thickness moves stiffness and mass; a double mode is one cluster."""
    rows, clusters = None if sensors is None else some_rows(plate, sensors), [[0], [1, 2], [3]]
    exact = [exact_derivative(plate, cluster, rows) for cluster in clusters]
    for i, found in enumerate(derivatives_by_parameter(plate, clusters, rows)):
        for one, whole in zip(found, exact, strict=True):
            size = np.abs(gradient(whole)).max()
            np.testing.assert_allclose(gradient(one)[:, :, 0], gradient(whole)[:, :, i], atol=1e-8 * size)


def test_residuals_may_rise_on_their_way_down() -> None:
    """A column ends at its aim, or where it is near it and rises for good; single rises are no end."""
    progress = derivatives.SeriesProgress(np.array([1.0]), 1e-13)
    near = derivatives.ENOUGH**2
    for energy, done in ((0.3, False), (1.5, False), (0.5 * near, False), (3.0 * near, False), (1e-26, True)):
        assert progress.is_done(np.array([energy])) == done
    rising = derivatives.SeriesProgress(np.array([1.0]), 1e-13)
    assert [rising.is_done(np.array([e])) for e in (0.5 * near, 49.0 * near, 51.0 * near)] == [False, False, True]


def test_the_error_of_a_small_derivative_is_relative_to_it() -> None:
    """A soft spring beside stiff ones moves the shapes by a ten-thousandth: the error is a part of that."""
    n = 300
    springs = [*((i - 1, i, 1000.0 + 13.0 * (i % 7)) for i in range(n)), (-1, 40, 0.01)]
    model = factor_model(spring_structure(springs, [1.0 + 0.1 * (i % 3) for i in range(n)]), {"soft": [n + 1]})
    solution = solve_modes(model.at(np.zeros(1)), 3)
    rows = sensor_rows(solution.point.configured, [100, 250])
    found = sensor_derivatives(solution, rows, 1e-2)
    for j in range(3):
        true = true_error(found.subspace([j]), exact_derivative(solution, [j], rows))
        assert true <= found.error[j]


def some_rows(solution: EigenSolution, count: int) -> sp.csr_array:
    chosen = np.linspace(3, len(solution.shapes) - 5, count).astype(int)
    return sensor_rows(solution.point.configured, chosen)  # type: ignore[arg-type]


def test_a_double_mode(plate: EigenSolution) -> None:
    rows = some_rows(plate, 12)
    found = sensor_derivatives(plate, rows, 1e-7)
    assert found.error.max() <= 1e-7
    for cluster in ([0], [1, 2], [3], [4, 5]):
        assert true_error(found.subspace(cluster), exact_derivative(plate, cluster, rows)) <= 1e-7


def test_the_subspace_of_a_double_mode_at_sensors_moves_as_foretold(plate: EigenSolution) -> None:
    """ΦΦᵀ between sensors does not depend on the choice of vectors."""
    rows, direction = some_rows(plate, 12), np.array([0.3, -0.5, 0.8])
    d = sensor_derivatives(plate, rows, 1e-7).subspace([1, 2])

    def projector(x: np.ndarray) -> np.ndarray:
        seen = rows @ solve_modes(plate.point.configured.at(x), 6).shapes[:, 1:3]
        return (seen @ seen.T).ravel()

    half = np.einsum("rck,sc->rsk", gradient(d), d.shapes)
    slope = (half + half.transpose(1, 0, 2)).reshape(-1, 3)
    check_directional(projector, slope, np.zeros(3), direction, tolerance=1e-6, step=1e-5)


@pytest.mark.slow
def test_single_modes_at_sensors_have_taylor_slope_two(plate: EigenSolution) -> None:
    rows, at = some_rows(plate, 12), np.array([0.05, -0.03, 0.08])
    model = plate.point.configured
    start = solve_modes(model.at(at), 6)
    d = sensor_derivatives(start, rows, 1e-7).subspace([3])
    reference = start.shapes[:, 3]

    def shape(x: np.ndarray) -> np.ndarray:
        phi = solve_modes(model.at(x), 6).shapes[:, 3]
        return np.asarray(rows @ phi) * np.sign(phi @ reference)

    check_taylor_slope(shape, d.shapes[:, 0], d.shape_gradient, at)


def chain(n: int, parameters: Mapping[str, Sequence[int]]) -> EigenSolution:
    springs = [(i - 1, i, 1000.0 + 13.0 * (i % 7)) for i in range(n)]
    model = factor_model(spring_structure(springs, [1.0 + 0.1 * (i % 3) for i in range(n)]), parameters)
    return solve_modes(model.at(np.zeros(len(parameters))), 3)


def test_a_space_that_holds_everything_is_exact() -> None:
    """Ten of twenty masses are sensors: after two blocks nothing is left."""
    solution = chain(20, {"a": [1, 2], "b": [9], "m": [1004]})
    rows = sensor_rows(solution.point.configured, range(0, 20, 2))
    found = sensor_derivatives(solution, rows, 1e-7)
    for j in range(3):
        assert true_error(found.subspace([j]), exact_derivative(solution, [j], rows)) <= 1e-9


def test_blind_and_repeated_sensors_do_no_harm() -> None:
    solution = chain(60, {"a": [1, 2], "m": [1004]})
    one = sensor_rows(solution.point.configured, [10, 10, 40])
    rows = sp.csr_array(sp.vstack([one, sp.csr_array((1, 60)), one[:1] * 2.0]))
    found = sensor_derivatives(solution, rows).subspace([1])
    assert true_error(found, exact_derivative(solution, [1], rows)) <= 1e-4
    assert not found.outside[3].any()


@pytest.mark.parametrize(("count", "names"), [(0, {"a": [1]}), (3, {})])
def test_no_sensors_or_no_parameters(count: int, names: dict[str, list[int]]) -> None:
    solution = chain(60, names)
    rows = sensor_rows(solution.point.configured, range(count))
    assert sensor_derivatives(solution, rows).subspace([0, 1]).outside.shape == (count, 2, len(names))


def test_where_the_dual_way_does_not_get_there_the_exact_one_does(
    large: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One block of one sensor is a poor space."""
    solution = chain(300, {"a": range(1, 40), "m": [1004]})
    rows = sensor_rows(solution.point.configured, [150])
    monkeypatch.setattr(dual_derivatives, "MOST_BLOCKS", 1)
    assert sensor_derivatives(solution, rows).error.max() > 1e-4
    assert subspace_derivative(solution, [2], rows).error == 0.0


def test_columns_of_the_complement_may_have_eigenvalues_of_their_own() -> None:
    solution = chain(60, {"a": [1]})
    b = np.random.default_rng(2).standard_normal((60, 2))
    both = Complement(solution).solve(solution.eigenvalues[:2], b, np.zeros(2))
    for j in range(2):
        alone = complement(solution, float(solution.eigenvalues[j]), b[:, j : j + 1])
        np.testing.assert_allclose(both[:, j : j + 1], alone, atol=1e-10 * np.abs(alone).max())
