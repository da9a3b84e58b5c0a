"""Plans for a calibration with FRFs, beside dense matrices of a chain of masses."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import qmc
from tests.messages.shown import check_shown

import femtune as ft
from femtune import Study
from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.reporting.html import html_text
from femtune.steps.report.build import build_page
from femtune.steps.results import Results
from structures.plan_chain import BOUNDS, MASSES, NAMES, chain_deck, chain_frfs, scatter_of_calibrations

_RATIO, _SD = 0.02, 0.05
_PRIOR = (BOUNDS[1] - BOUNDS[0]) / np.sqrt(12.0)


def _chain(folder: Path, reduction: dict[str, Any] | None = None, **more: Any) -> Study:
    fields = {name: [f"PELAS {g + 1} K"] for g, name in enumerate(NAMES)}
    parameters = [{"name": n, "fields": f, "lower": BOUNDS[0], "upper": BOUNDS[1]} for n, f in fields.items()]
    plan = {
        "modes": "1 THRU 4", "directions": ("X",), "uniaxial_threshold": 0.0, "data": "frfs", "damping_ratio": _RATIO,
        "lines_per_half_band": 1, **more,
    }  # fmt: skip
    extra = {} if reduction is None else {"reduction": reduction}
    return Study(
        model=chain_deck(folder), units="m-kg-s", parameters=parameters, modes={"count": 6}, plan=plan, **extra
    )


def _slopes(lines: Reals, at: Reals | None = None, form: str = "log-complex", floor: float = 0.0) -> Reals:
    """(masses, masses, lines, parts, 3) derivatives of weighted residuals by central differences."""
    x, step = np.ones(3) if at is None else at, 1e-5
    H = chain_frfs(x, lines, _RATIO)
    size = np.abs(H)
    # values are weighted by those of the lines beside them, which keeps noise out of the weight
    beside = np.concatenate([size[..., 1:2], size, size[..., -2:-1]], axis=2)
    weight = np.sqrt(0.5 * (beside[..., :-2] ** 2 + beside[..., 2:] ** 2))
    sd = np.sqrt(_SD**2 + (floor * size.max(axis=2, keepdims=True) / size) ** 2)
    found = []
    for e in step * np.eye(3):
        above, below = chain_frfs(x + e, lines, _RATIO), chain_frfs(x - e, lines, _RATIO)
        off = np.log(above / below) if form.startswith("log") else (above - below) / weight
        off = off / (2.0 * step) / sd * _PRIOR
        found.append(off.real[..., None] if form == "log-magnitude" else np.stack([off.real, off.imag], axis=-1))
    return np.stack(found, axis=-1)


def _information(J: Reals, nodes: Iterable[int], inputs: Iterable[int]) -> Reals:
    own = J[np.ix_(np.array(list(nodes)) - 2, np.array(list(inputs)) - 2)].reshape(-1, 3)
    return own.T @ own


def _score(F: Reals, criterion: str) -> float:
    F = np.eye(3) + F
    return float(np.linalg.slogdet(F)[1] if criterion == "D" else -np.trace(np.linalg.inv(F)))


def _sd(F: Reals) -> Reals:
    return _PRIOR * np.sqrt(np.diag(np.linalg.inv(np.eye(3) + F)))


@pytest.mark.quick(0)
@pytest.mark.parametrize("form", ["log-complex", "log-magnitude", "linear"])
def test_expected_standard_deviations_beside_differences(tmp_path: Path, form: str) -> None:
    found = ft.plan(_chain(tmp_path, uniaxial=5, exciters=1, frf_form=form))
    assert found.calibration_lines is not None
    nodes, inputs = ([s.node for s in some] for some in (found.record.sensors, found.record.exciters))
    F = _information(_slopes(found.calibration_lines, form=form), nodes, inputs)
    assert found.parameters.column("expected_sd") == pytest.approx(_sd(F), rel=2e-3)
    assert found.parameters.column("data_sd") == pytest.approx(_PRIOR * np.sqrt(np.diag(np.linalg.inv(F))), rel=2e-3)
    assert found.record.log_det_parameters == pytest.approx(_score(F, "D"), rel=1e-3)
    assert found.record.frequency_sd is None
    functions = found.record.functions
    assert functions is not None
    assert (functions.form, functions.relative_sd, functions.floor) == (form, _SD, 0.0)
    assert functions.lines == len(found.calibration_lines)
    page = html_text(build_page("plan", found.results, found.arrays))
    assert "5 % of each value" in page
    assert Results.model_validate_json(found.results.model_dump_json()) == found.results


@pytest.mark.slow
def test_lines_for_an_identification_are_written_for_the_test_system(tmp_path: Path) -> None:
    file = tmp_path / "lines.txt"
    asked = {"uniaxial": 5, "exciters": 1, "identification_lines": 30, "frf_floor": 0.001}
    found = ft.plan(_chain(tmp_path, **asked), lines=file)
    of, planned = found.record.pole_lines, found.identification_lines
    assert of is not None
    assert planned is not None
    assert len(planned) == of.lines == 30
    np.testing.assert_allclose(np.loadtxt(file), planned, rtol=1e-8)
    *others, best = of.spacings
    assert best.rms_percent is not None
    assert best.rms_percent <= min(one.rms_percent for one in others if one.rms_percent is not None)
    page = html_text(build_page("plan", found.results, found.arrays))
    assert "30 lines for an identification" in page
    assert "by half bandwidths" in page


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["D", "A"])
def test_sensors_for_a_given_exciter_are_the_best_of_all_sets(tmp_path: Path, criterion: str) -> None:
    asked = {"aim": "parameters", "criterion": criterion, "uniaxial": 4, "exciters_placed": ("9X+",)}
    found = ft.plan(_chain(tmp_path, **asked))
    assert found.calibration_lines is not None
    J = _slopes(found.calibration_lines)
    own = _score(_information(J, [s.node for s in found.record.sensors], [9]), criterion)
    # 1,001 sets of four of the fourteen masses
    every = [_score(_information(J, some, [9]), criterion) for some in combinations(range(2, 16), 4)]
    assert own == pytest.approx(max(every), rel=1e-3 if criterion == "D" else 0.02)
    assert own >= np.quantile(every, 0.99)
    assert all(p.candidates_sd is not None and p.candidates_sd <= p.expected_sd for p in found.record.parameters)


@pytest.mark.slow
def test_sensors_and_exciter_together_beside_all_pairs_of_sets(tmp_path: Path) -> None:
    found = ft.plan(_chain(tmp_path, aim="parameters", modes="1 THRU 3", uniaxial=3, exciters=1))
    assert found.calibration_lines is not None
    J, (exciter,) = _slopes(found.calibration_lines), found.record.exciters
    own = _score(_information(J, [s.node for s in found.record.sensors], [exciter.node]), "D")
    every = [
        _score(_information(J, some, [e]), "D") for e in range(2, 2 + MASSES) for some in combinations(range(2, 16), 3)
    ]
    assert own <= max(every) + 1e-2
    assert own >= np.quantile(every, 0.995)


@pytest.mark.slow
def test_lines_beside_random_and_even_ones(tmp_path: Path) -> None:
    asked = {"uniaxial": 4, "exciters_placed": ("9X+",), "frf_lines": 12}
    found = ft.plan(_chain(tmp_path, **asked))
    assert found.chosen_lines is not None
    assert found.calibration_lines is not None
    assert set(found.chosen_lines) <= set(found.calibration_lines)
    nodes, J = [s.node for s in found.record.sensors], _slopes(found.calibration_lines)

    def score(at: Reals) -> float:
        return _score(_information(J[:, :, at], nodes, [9]), "D")

    own = score(np.searchsorted(found.calibration_lines, found.chosen_lines))
    assert found.record.log_det_parameters == pytest.approx(own, rel=1e-3)
    rng, count = np.random.default_rng(0), len(found.calibration_lines)
    assert own > max(score(rng.choice(count, 12, replace=False)) for _ in range(500))
    assert own > score(np.linspace(0, count - 1, 12).round().astype(int))
    everything = ft.plan(_chain(tmp_path, uniaxial=4, exciters_placed=("9X+",)))
    assert (everything.parameters.column("expected_sd") < found.parameters.column("expected_sd")).all()


@pytest.mark.slow
def test_the_noise_floor_counts(tmp_path: Path) -> None:
    found = ft.plan(_chain(tmp_path, uniaxial=5, exciters=1, frf_sd=_SD, frf_floor=0.001))
    nodes, inputs = ([s.node for s in some] for some in (found.record.sensors, found.record.exciters))
    assert found.calibration_lines is not None
    F = _information(_slopes(found.calibration_lines, floor=0.001), nodes, inputs)
    # well above the floor the weight is that of the value, near it that of the lines beside
    assert found.parameters.column("expected_sd") == pytest.approx(_sd(F), rel=0.03)
    without = ft.plan(_chain(tmp_path, uniaxial=5, exciters=1, frf_sd=_SD))
    assert (found.parameters.column("expected_sd") > without.parameters.column("expected_sd")).all()


@pytest.mark.slow
def test_points_within_the_bounds(tmp_path: Path) -> None:
    asked = {"aim": "parameters", "uniaxial": 5, "exciters": 1, "points": 3, "average": "worst", "seed": 3}
    found = ft.plan(_chain(tmp_path, **asked))
    lower, upper = BOUNDS
    unit = qmc.LatinHypercube(3, rng=np.random.default_rng(3)).random(2)
    nodes, inputs = ([s.node for s in some] for some in (found.record.sensors, found.record.exciters))
    assert found.calibration_lines is not None
    points = [np.ones(3), *(lower + (upper - lower) * u for u in unit)]
    each = [_sd(_information(_slopes(found.calibration_lines, x), nodes, inputs)) for x in points]
    assert found.parameters.column("expected_sd") == pytest.approx(each[0], rel=2e-3)
    assert found.parameters.column("worst_sd") == pytest.approx(np.max(each, axis=0), rel=5e-3)


@pytest.mark.slow
def test_a_reduced_model_gives_the_same_plan(tmp_path: Path) -> None:
    asked = {"aim": "parameters", "uniaxial": 4, "triaxial": 1, "exciters": 1, "points": 2}
    full, reduced = (ft.plan(_chain(tmp_path, r, **asked)) for r in (None, {}))
    assert reduced.record.functions is not None
    assert reduced.record.functions.order is not None
    assert {s.node for s in reduced.record.sensors} == {s.node for s in full.record.sensors}
    for key in ("expected_sd", "worst_sd"):
        assert reduced.parameters.column(key) == pytest.approx(full.parameters.column(key), rel=1e-3)


def test_what_a_plan_for_frfs_needs(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError, match="the plan has no exciter") as caught:
        ft.plan(_chain(tmp_path, uniaxial=4))
    assert caught.value.code == "plan.exciters"
    with pytest.raises(FemtuneError, match="'frf_sd' must be above zero"):
        ft.plan(_chain(tmp_path, uniaxial=4, exciters=1, frf_sd=0.0))


@pytest.mark.long
@pytest.mark.parametrize("floor", [0.0, 0.001])
def test_the_scatter_of_1000_simulated_tests_is_the_expected_one(tmp_path: Path, floor: float) -> None:
    found = ft.plan(_chain(tmp_path, aim="parameters", uniaxial=5, exciters=1, frf_sd=_SD, frf_floor=floor))
    assert found.calibration_lines is not None
    masses, inputs = (np.array([s.node - 1 for s in some]) for some in (found.record.sensors, found.record.exciters))
    factors = scatter_of_calibrations(masses, inputs, found.calibration_lines, _RATIO, _SD, floor, 1000)
    # the standard error of a standard deviation of 1000 values is 2.2 %
    assert factors.std(axis=0) == pytest.approx(found.parameters.column("data_sd"), rel=0.1)


def test_more_lines_than_memory_are_refused(tmp_path: Path) -> None:
    """A damping ratio that is far too small must not fill the memory."""
    with pytest.raises(FemtuneError) as caught:
        ft.plan(_chain(tmp_path, uniaxial=4, exciters=1, damping_ratio=1e-9))
    check_shown("plan.too-many-lines", caught.value)
