"""FRF residual: forms by hand, Jacobians by every way, weights, and what is left out."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import as_kind
from femtune.modal.kinds import FrfKind
from femtune.model import solve_modes
from femtune.model.damping import constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import METHODS, frf
from femtune.residuals import (
    Band,
    FrfForm,
    FrfResidual,
    FrfScatter,
    ModelWay,
    Resonance,
    Resonances,
    UpdateProblem,
    case_without_modes,
    frf_residual,
)
from femtune.residuals.frf.residual import frf_comparison
from femtune.residuals.kinds import FRF_FORMS
from femtune.testing import check_residual
from femtune.updating import SensitivityMethod, update
from structures.springs import factor_model, spring_structure

from .damped import LINES, TRUTH, chain, circular, measured, noisy, ports_of, with_gap

AT = np.array([0.03, 0.05, -0.1, 0.2])
# of LINES, where the dynamic stiffness is factorised anew at every one
FEW = Band(most=30)
every_form = pytest.mark.parametrize("form", FRF_FORMS)


@lru_cache
def residual_of(form: FrfForm, method: FrfMethod = "real-modes", kind: FrfKind = "accelerance") -> FrfResidual:
    model = chain()
    ports = ports_of(model)
    start = solve_modes(model.at(np.zeros(4)), 5)
    way = ModelWay(method, (5, None))
    band = FEW if method == "direct" else Band()
    found, notices = frf_residual(start, measured(model, ports, kind), band, form=form, way=way)
    assert not notices
    return found


def values_at(residual: FrfResidual, x: np.ndarray) -> np.ndarray:
    return np.concatenate([b.values for b in residual.compare(solve_modes(chain().at(x), 5), False)])


def test_forms_by_hand():
    model, slope, test = np.array([2.0j]), np.array([[1.0, 1.0j]]), np.array([1.0 + 0.0j])
    values, jacobian = frf_comparison("linear").compare(model, slope, test)
    np.testing.assert_allclose(values, [-1.0, 2.0])
    np.testing.assert_allclose(jacobian, [[1.0, 0.0], [0.0, 1.0]])
    values, jacobian = frf_comparison("log-complex").compare(model, slope, test)
    np.testing.assert_allclose(values, [np.log(2.0), np.pi / 2])
    np.testing.assert_allclose(jacobian, [[0.0, 0.5], [-0.5, 0.0]])
    values, jacobian = frf_comparison("log-magnitude").compare(model, slope, test)
    np.testing.assert_allclose(values, [np.log(2.0)])
    np.testing.assert_allclose(jacobian, [[0.0, 0.5]])


def test_the_phase_does_not_jump_where_both_pass_pi():
    model, test = np.array([np.exp(1j * 3.1)]), np.array([np.exp(-1j * 3.1)])
    values, _ = frf_comparison("log-complex").compare(model, np.zeros((1, 0)), test)
    assert values[1] == pytest.approx(6.2 - 2 * np.pi)


@pytest.mark.slow
@every_form
@pytest.mark.parametrize("method", METHODS)
def test_jacobian_by_every_way(form: FrfForm, method: FrfMethod):
    residual = residual_of(form, method)
    jacobian = np.concatenate([b.jacobian for b in residual.compare(solve_modes(chain().at(AT), 5))])
    h = 1e-5
    for i, e in enumerate(np.eye(4)):
        found = (values_at(residual, AT + h * e) - values_at(residual, AT - h * e)) / (2 * h)
        assert np.abs(found - jacobian[:, i]).max() <= 1e-6 * np.abs(jacobian).max()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
def test_logarithms_by_complex_difference(kind: FrfKind):
    """(f(p + ih) − f(p − ih))/2ih of ln H, by real and imaginary part."""
    model, h = chain(), 1e-5
    lines = LINES[FEW.regions(LINES)[0].at]
    residual = residual_of("log-complex", "direct", kind)
    blocks = residual.compare(model.at(AT))
    for i, e in enumerate(np.eye(4)):
        ends = [frf(model.at(AT + s * 1j * h * e), ports_of(model), lines, kind, "direct").values for s in (1, -1)]
        exact = (np.log(ends[0] / ends[1]) / (2j * h)).reshape(6, -1)
        for block, slope in zip(blocks, exact):
            found = block.jacobian[: len(lines), i] + 1j * block.jacobian[len(lines) :, i]
            np.testing.assert_allclose(found * 0.05, slope, atol=1e-8 * np.abs(slope).max())


@pytest.mark.quick(0)
@every_form
def test_zero_at_the_truth_and_only_there(form: FrfForm):
    residual = residual_of(form)
    assert np.abs(values_at(residual, TRUTH)).max() < 1e-8
    assert np.linalg.norm(values_at(residual, AT)) > 10.0


@pytest.mark.quick(0)
@every_form
def test_values_with_and_without_derivatives_are_the_same_numbers(form: FrfForm):
    """Few modes: residual vectors make up for the others, and both must have the same ones."""
    model = chain()
    residual = residual_of(form)
    few = solve_modes(model.at(AT), 3)
    for plain, full in zip(residual.compare(few, False), residual.compare(few, True)):
        np.testing.assert_array_equal(plain.values, full.values)
        assert plain.jacobian.shape == (len(plain.values), 0)


@pytest.mark.slow
@every_form
def test_functions_of_the_model_follow_from_the_blocks(form: FrfForm):
    """The inverse of a form, beside the functions that the residual was made of."""
    residual, model = residual_of(form), solve_modes(chain().at(AT), 5)
    found = residual.values_of(residual.compare(model, False))
    exact = residual.functions(model)[0]
    compared = np.isfinite(found)
    assert compared.sum() > 100
    np.testing.assert_allclose(
        found[compared], (np.abs(exact) if form == "log-magnitude" else exact)[compared], rtol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("form", ["linear", "log-complex"])
def test_weighted_residuals_of_a_noisy_test_have_unit_variance_and_no_mean(form: FrfForm):
    """Noise of a floor: weights must not follow the noise of what they weigh."""
    model = chain()
    exact, floor = measured(model, ports_of(model)), 0.01
    start, truth = solve_modes(model.at(np.zeros(4)), 5), solve_modes(model.at(TRUTH), 5)
    found = []
    for seed in range(20):
        residual, _ = frf_residual(start, noisy(exact, floor, seed), form=form, scatter=FrfScatter(0.0, floor))
        for b in residual.compare(truth, False):
            half = len(b.values) // 2
            found.append(np.column_stack([b.values[:half], b.values[half:]]))
    pairs = np.concatenate(found)
    assert len(pairs) > 10000
    assert np.abs(pairs.mean(axis=0)).max() < 4.0 / np.sqrt(len(pairs))
    np.testing.assert_allclose(pairs.std(axis=0), 1.0, atol=0.06)


@pytest.mark.quick(0)
@every_form
@pytest.mark.parametrize("seed", range(3))
def test_parameters_are_recovered(form: FrfForm, seed: int):
    residual = residual_of(form)
    start = np.random.default_rng(seed).uniform(-0.05, 0.05, 4)
    if form == "linear":
        start = TRUTH + start

    def jacobian(x: np.ndarray) -> np.ndarray:
        return np.concatenate([b.jacobian for b in residual.compare(solve_modes(chain().at(x), 5))])

    found = least_squares(lambda x: values_at(residual, x), start, jacobian, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(found.x, TRUTH, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["log-complex", "log-magnitude"])
def test_an_update_of_a_case_without_modes_finds_the_parameters(form: FrfForm):
    case = case_without_modes(chain(), (residual_of(form),), count=5)
    problem = UpdateProblem((case,), case.configured.model.parameters)
    check_residual(problem, AT, 1e-5)
    found = update(problem, SensitivityMethod())
    np.testing.assert_allclose(found.x, TRUTH, atol=1e-6)


@pytest.mark.slow
def test_motions_that_do_not_couple_are_left_out_with_a_sentence():
    model = chain()
    ports = ports_of(model, ("1X+", "2Y+"))
    test = measured(model, ports)
    noisy = replace(test, values=test.values + 1e-3 * circular(test.values.shape, 3))
    start = solve_modes(model.at(np.zeros(4)), 5)
    for form in FRF_FORMS:
        residual, notices = frf_residual(start, noisy, form=form)  # type: ignore[arg-type]
        assert [b.mode for b in residual.compare(start)] == ["1X+ / 1X+", "1X+ / 3X+"]
        (notice,) = notices
        assert notice.code == "residual.silent-frf"
        assert "2 of 4 FRFs " in notice.what
        assert "2Y+ / 1X+, 2Y+ / 3X+" in notice.what


@pytest.mark.parametrize("unit", [1e-10, 1.0, 1e10])
def test_motions_that_do_not_couple_are_the_same_in_every_unit_of_force(unit: float):
    model = factor_model(
        spring_structure([(-1, 0, 900.0 * unit), (0, 1, 700.0 * unit), (-1, 2, 500.0 * unit)], [unit] * 3), {"a": [1]}
    )
    start = solve_modes(model.at(np.zeros(1)), 3)
    test = frf(start, ports_of(model, ("1X+", "2X+", "3X+")), LINES, "accelerance")
    some = np.abs(test.values).max() * circular(test.values.shape, 3)
    residual, _ = frf_residual(start, replace(test, values=test.values + some))
    assert [b.mode for b in residual.compare(start)] == ["1X+ / 1X+", "2X+ / 1X+", "3X+ / 3X+"]


@pytest.mark.slow
def test_nothing_left_is_an_error_that_says_why():
    model = chain()
    ports = ports_of(model, ("2Y+",))
    test = measured(model, ports)
    start = solve_modes(model.at(np.zeros(4)), 5)
    with pytest.raises(FemtuneError, match="2 of 2 FRFs are zero") as error:
        frf_residual(start, replace(test, values=test.values + circular(test.values.shape, 3)))
    assert error.value.code == "residual.no-frf-channels"


@pytest.mark.slow
def test_what_was_not_measured_is_not_compared():
    model = chain()
    ports = ports_of(model)
    start = solve_modes(model.at(np.zeros(4)), 5)
    residual, _ = frf_residual(start, with_gap(measured(model, ports), 1, 1))
    assert [b.mode for b in residual.compare(start)] == [
        "1X+ / 1X+", "1X+ / 3X+", "2X- / 1X+", "4X+ / 1X+", "4X+ / 3X+",
    ]  # fmt: skip
    empty = replace(measured(model, ports), values=np.full((3, 2, len(LINES)), np.nan + 0j))
    with pytest.raises(FemtuneError, match="none has a nonzero value at the chosen frequency lines"):
        frf_residual(start, empty)


@pytest.mark.slow
def test_antiresonances_below_the_noise_are_left_out_of_logarithms_only():
    model = chain()
    ports = ports_of(model)
    start = solve_modes(model.at(np.zeros(4)), 5)
    test, scatter = measured(model, ports, noise=0.02), FrfScatter(0.0, 0.02)
    residual, (notice,) = frf_residual(start, test, scatter=scatter)
    assert notice.code == "residual.frf-below-noise"
    count = sum(len(b.values) for b in residual.compare(start)) // 2
    assert f"{test.values.size - count} of {test.values.size} FRF values" in notice.what
    assert 0.3 * test.values.size < count < test.values.size
    _, notices = frf_residual(start, test, form="linear", scatter=scatter)
    assert not notices


def test_nodes_that_the_model_lacks_are_refused():
    model = chain()
    start = solve_modes(model.at(np.zeros(4)), 5)
    test = measured(model, ports_of(model))
    with pytest.raises(FemtuneError) as error:
        frf_residual(start, replace(test, responses=DofSet.parse(["1X+", "2X-", "44X+"])))
    assert error.value.code == "model.unknown-node"


@pytest.mark.slow
def test_a_test_of_another_kind_is_compared_in_its_own():
    model = chain()
    ports = ports_of(model)
    test = measured(model, ports, "receptance")
    truth = solve_modes(model.at(TRUTH), 5)
    for kind in ("receptance", "mobility", "accelerance"):
        residual, _ = frf_residual(truth, as_kind(test, kind))
        assert max(np.abs(b.values).max() for b in residual.compare(truth)) < 1e-8


@pytest.mark.slow
def test_modal_damping_counts():
    model = chain()
    ports, damping = ports_of(model), constant_damping(0.02)
    truth = solve_modes(model.at(TRUTH), 5)
    test = frf(truth, ports, LINES, "accelerance", "direct", damping=damping)
    for method in METHODS:
        residual, _ = frf_residual(truth, test, way=ModelWay(method, None, damping))
        assert max(np.abs(b.values).max() for b in residual.compare(truth)) < 1e-6


class TestResonanceRegions:
    """Blocks by resonance, at lines that are stretched where the model's peaks are elsewhere."""

    @pytest.mark.slow
    def test_blocks_are_those_of_the_modes(self):
        model = chain()
        ports = ports_of(model)
        start = solve_modes(model.at(np.zeros(4)), 5)
        modes = tuple(Resonance(str(i + 1), f, 0.03) for i, f in enumerate(start.freq_hz[:2]))
        residual, _ = frf_residual(start, measured(model, ports), Resonances(modes))
        assert [b.mode for b in residual.compare(start)] == ["1", "2"]

    @pytest.mark.slow
    def test_stretched_lines_make_up_for_a_stiffness_that_is_wrong_everywhere(self):
        """All stiffness too high by r² and dashpots by r: the same functions at lines r times as high."""
        model, r = chain(), 1.02
        ports = ports_of(model)
        point = model.at(np.zeros(4))
        test = frf(point, ports, LINES, "receptance", "direct")
        # Z(rω) of K r², C r is r² Z(ω): taken at ω r the model answers 1/r² as much
        scaled = replace(test, freq_hz=test.freq_hz / r, values=test.values * r**2)
        start = solve_modes(point, 5)
        modes = [Resonance(str(i), f / r, 0.02, f) for i, f in enumerate(start.freq_hz[:3])]
        residual, _ = frf_residual(start, scaled, Resonances(modes))
        assert max(np.abs(b.values).max() for b in residual.compare(start)) < 1e-9
        for kind in ("mobility", "accelerance"):
            residual, _ = frf_residual(start, as_kind(scaled, kind), Resonances(modes))
            assert max(np.abs(b.values).max() for b in residual.compare(start)) < 1e-9

    def test_band_and_thinning(self):
        lines = np.arange(0.0, 10.0, 0.1)
        assert Band(2.0, 3.0).regions(lines)[0].at.tolist() == list(range(20, 31))
        assert len(Band(most=7).regions(lines)[0].at) == 7
        assert 0 not in Band().regions(lines)[0].at
