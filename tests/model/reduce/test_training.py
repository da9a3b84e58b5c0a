"""Training on a box: errors fall, the estimate bounds them, what is certified is right, and nothing is lost."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.files.reduced_basis import load_basis, save_basis
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.reduce import (
    ErrorEstimator,
    Trained,
    Trainer,
    TrainingRules,
    TrainingStatus,
    certified_error,
    reduce_model,
    reduced_modes,
)
from femtune.model.reduce.reduced_model import leading
from femtune.model.reduce.training import TRIED, candidates
from femtune.parameters import Parameter, ParameterSet
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure

RULES = TrainingRules(count=16, tolerance=2e-4, full_solutions=12, inner=12, corners=4)


@pytest.fixture(scope="module")
def plate() -> ConfiguredModel:
    mesh = shell_mesh(rectangle(1.0, 0.7), 8, 6, distort=0.1)
    thirds = np.array_split(mesh.cells, 3)
    parts = [
        ShellPart(cells, Section(Isotropic(2.1e11, 0.3, 7850.0), 0.01 + 0.002 * i)) for i, cells in enumerate(thirds)
    ]
    structure = shell_structure(mesh.xyz, parts, consistent_mass=True)
    names = ("t1", "t2", "t3")
    parameters = ParameterSet(tuple(Parameter(n, lower=0.7, upper=1.3) for n in names))
    model = parametric_model(
        structure, parameters, [Assignment(n, FieldRef("PSHELL", i + 1, "T")) for i, n in enumerate(names)]
    )
    return configure(model, Configuration())


@pytest.fixture(scope="module")
def told() -> list[Trained]:
    return []


@pytest.fixture(scope="module")
def trainer(plate: ConfiguredModel, told: list[Trained]) -> Trainer:
    return Trainer(plate, RULES, report=told.append)


@pytest.fixture(scope="module")
def trained(trainer: Trainer) -> Trained:
    return trainer.train(trainer.start())


def _points(plate: ConfiguredModel, count: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(*plate.model.parameters.bounds, (count, 3))


@pytest.mark.slow
def test_training_reaches_the_tolerance_everywhere(plate: ConfiguredModel, trained: Trained) -> None:
    assert trained.status is TrainingStatus.CONVERGED
    assert len(trained.certified) < RULES.full_solutions
    for x in _points(plate, 6):
        error = certified_error(trained.model, x, solve_modes(plate.at(x), 16).eigenvalues[:16])
        assert error.max() < 1e-3


@pytest.mark.slow
def test_ranked_candidates_need_no_estimates(plate: ConfiguredModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tolerance holds at random points; what is stated is the larger of the true errors at the last two points."""
    asked: list[int] = []
    estimate = ErrorEstimator.at
    monkeypatch.setattr(ErrorEstimator, "at", lambda *given: asked.append(1) or estimate(*given))
    ranked = Trainer(plate, replace(RULES, ranked=True))
    found = ranked.train(ranked.start())
    assert found.status is TrainingStatus.CONVERGED
    assert len(found.certified) < RULES.full_solutions
    assert not asked
    assert found.worst_estimate == max(c.error for c in found.certified[-2:]) <= RULES.tolerance
    for x in _points(plate, 6):
        error = certified_error(found.model, x, solve_modes(plate.at(x), 16).eigenvalues[:16])
        assert error.max() < 1e-3


@pytest.mark.slow
def test_ranked_candidates_are_solved_once_each(plate: ConfiguredModel) -> None:
    """All candidates are used up before the limit of solutions is."""
    few = Trainer(plate, replace(RULES, ranked=True, inner=2, corners=0, tolerance=1e-12))
    found = few.train(few.start())
    points = [tuple(c.x) for c in found.certified]
    assert len(set(points)) == len(points) == 3


def test_the_leading_part_of_a_reduced_model_is_that_of_fewer_vectors(plate: ConfiguredModel, trained: Trained) -> None:
    x, order = np.array([0.1, -0.2, 0.15]), 20
    small = reduce_model(plate, trained.basis[:, :order], None, trained.model.shift)
    there = leading(trained.model, order).at(x)
    assert there.model.order == order
    np.testing.assert_allclose(there.stiffness, small.at(x).stiffness, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(there.mass, small.at(x).mass, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_the_estimate_is_never_below_a_tenth_of_the_error_nor_far_above_it(
    plate: ConfiguredModel, trainer: Trainer, told: list[Trained], trained: Trained
) -> None:
    ratios = []
    for stage in (told[0], told[2]):
        for x in _points(plate, 4):
            error = certified_error(stage.model, x, solve_modes(plate.at(x), 16).eigenvalues[:16]).max()
            ratios.append(stage.estimator.at(stage.model, stage.basis, x).worst / error)
    assert min(ratios) > 0.1
    assert max(ratios) < 10.0 * np.median(ratios)


def test_a_certified_point_is_exact_to_what_the_basis_neglects(plate: ConfiguredModel, trained: Trained) -> None:
    assert len(trained.certified) > 2
    for point in trained.certified:
        assert certified_error(trained.model, point.x, point.eigenvalues).max() < 1e-4
    orders = [c.order for c in trained.certified]
    assert orders == sorted(orders)
    assert orders[-1] == trained.model.order == trained.basis.shape[1]


def test_rigid_body_modes_stay_in_the_basis(plate: ConfiguredModel, trained: Trained) -> None:
    values = reduced_modes(trained.model.at(np.full(3, 0.2)), 16).eigenvalues
    assert np.abs(values[:6]).max() < 1e-6 * values[6]


@pytest.mark.slow
def test_a_budget_ends_the_training_with_the_best_so_far(trainer: Trainer, plate: ConfiguredModel) -> None:
    short = replace(trainer, rules=replace(RULES, full_solutions=2))
    found = short.train(short.start())
    assert found.status is TrainingStatus.SOLUTIONS
    assert len(found.certified) == 2
    small = replace(trainer, rules=replace(RULES, order=30))
    assert small.train(small.start()).status is TrainingStatus.ORDER


def test_static_shapes_of_inputs_are_exact(plate: ConfiguredModel, trainer: Trainer) -> None:
    load = np.zeros((plate.n_free, 1))
    load[100] = 1.0
    found = trainer.start(load)
    point = plate.at(np.zeros(3))
    A = point.symmetric_stiffness.plus(-found.model.shift, point.symmetric_mass)
    exact = found.estimator.factor.solve(load)
    small = found.basis @ np.linalg.solve(found.basis.T @ (A @ found.basis), found.basis.T @ load)
    np.testing.assert_allclose(small, exact, atol=1e-9 * np.abs(exact).max())


@pytest.mark.slow
def test_training_goes_on_from_a_file(
    plate: ConfiguredModel, trainer: Trainer, told: list[Trained], tmp_path: Path
) -> None:
    first = trainer.start()
    save_basis(first, tmp_path / "basis.npz")
    again = trainer.resume(load_basis(tmp_path / "basis.npz", plate))
    x = np.full(3, 0.1)
    found = [reduced_modes(t.model.at(x), 16).eigenvalues for t in (first, again)]
    np.testing.assert_allclose(found[0][6:16], found[1][6:16], rtol=1e-9)
    assert trainer.certify(again, x).model.order == trainer.certify(first, x).model.order


def test_files_that_lie_are_refused(plate: ConfiguredModel, trainer: Trainer, tmp_path: Path) -> None:
    path = tmp_path / "basis.npz"
    save_basis(trainer.start(), path)
    other = configure(plate.model, Configuration(supports_added=((1, "123"),)))
    with pytest.raises(FemtuneError, match="belongs to another model"):
        load_basis(path, other)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FemtuneError, match="cannot be used"):
        load_basis(path, plate)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("basis.npy", bytes(1000))
    with pytest.raises(FemtuneError, match="compressed"):
        load_basis(path, plate)


def test_candidates_fill_the_box_and_are_the_same_every_time() -> None:
    lower, upper = np.array([-0.25, -0.5]), np.array([0.25, 1.0])
    points = candidates(lower, upper, 32, 6)
    np.testing.assert_array_equal(points, candidates(lower, upper, 32, 6))
    assert points.shape == (38, 2)
    assert ((points >= lower) & (points <= upper)).all()
    quarters = (points[:32] > 0.5 * (lower + upper)) @ [1, 2]
    assert np.bincount(quarters).min() >= 6
    assert np.isin(points[32:, 0], [-0.25, 0.25]).all()


@pytest.mark.slow
def test_few_candidates_are_tried_before_the_worst_of_them_is_solved(
    trainer: Trainer, plate: ConfiguredModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []
    many = replace(trainer, rules=replace(RULES, full_solutions=3, inner=20), report=lambda t: tried.append(0))
    estimate = ErrorEstimator.at
    monkeypatch.setattr(ErrorEstimator, "at", lambda *given: tried.append(1) or estimate(*given))
    found = many.train(many.start())
    solutions = [i for i, one in enumerate(tried) if not one]
    assert [sum(tried[a:b]) for a, b in pairwise(solutions)] == [TRIED, TRIED]
    # where the solutions are used up all are tried, so that the worst of the box is known
    assert sum(tried[solutions[-1] :]) > TRIED
    assert np.isfinite(found.worst_estimate)
    assert len(found.certified) == 3
    for point in found.certified[1:]:
        assert point.estimate > point.error
