"""Bootstrap of FRFs: what is drawn, the runs against an independent optimiser, spreads against formulas."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import norm, t
from tests.messages.shown import check_shown
from tests.residuals.damped import TRUTH, chain, measured, ports_of

from femtune.errors import FemtuneError
from femtune.executor import Processes, Serial
from femtune.identification.kinds import Drawing
from femtune.model import solve_modes
from femtune.residuals import FrfScatter, ModelWay, ResidualBlock, UpdateProblem, case_without_modes, frf_residual
from femtune.residuals.weights import LineSamples
from femtune.uncertainty import (
    Bootstrap,
    BootstrapResult,
    BootstrapRules,
    BootstrapRun,
    bootstrap_of,
    bootstrap_result,
)
from femtune.uncertainty.bootstrap import drawn_groups, noise_of
from femtune.updating import UpdateResult, update

FLOOR = 0.01


@lru_cache
def calibrated(form: str = "log-complex", seed: int = 1, inflated: float = 1.0) -> tuple[UpdateProblem, UpdateResult]:
    """The damped chain, updated by its noisy FRFs."""
    model = chain()
    way = ModelWay("complex-modes", (5, None))
    test = measured(model, ports_of(model), noise=FLOOR * inflated, seed=seed)
    start = solve_modes(model.at(TRUTH), 5)
    residual, _ = frf_residual(start, test, form=form, scatter=FrfScatter(0.0, FLOOR), way=way)  # type: ignore[arg-type]
    problem = UpdateProblem((case_without_modes(model, (residual,)),), model.model.parameters)
    return problem, update(problem, start=problem.start(TRUTH))


def work(method: Drawing = "lines", form: str = "log-complex", **rules: object) -> Bootstrap:
    problem, found = calibrated(form)
    return bootstrap_of(problem, found.after, found.side, found.active, BootstrapRules(method, **rules))  # type: ignore[arg-type]


def block(freq_hz: list[float], configuration: str = "a", log_sd: float | None = None) -> ResidualBlock:
    n = len(freq_hz)
    lines = np.tile(freq_hz, 2)
    samples = LineSamples(lines, np.tile(np.arange(n), 2), None if log_sd is None else np.full(2 * n, log_sd))
    return ResidualBlock("frf", configuration, "x", np.zeros(2 * n), np.zeros((2 * n, 1)), 1.0, samples=samples)


def test_lines_are_drawn_with_all_their_functions_and_each_configuration_by_itself() -> None:
    blocks = [block([1.0, 2.0, 3.0]), block([2.0, 3.0, 4.0]), block([1.0, 2.0, 3.0], "b")]
    drawn = drawn_groups(blocks, "lines")
    assert drawn.group.tolist() == [0, 1, 2, 0, 1, 2, 1, 2, 3, 1, 2, 3, 4, 5, 6, 4, 5, 6]
    counts = drawn.counts(np.random.default_rng(0))
    assert counts[:4].sum() == 4
    assert counts[4:].sum() == 3


def test_entries_are_drawn_with_real_and_imaginary_part() -> None:
    drawn = drawn_groups([block([1.0, 2.0, 3.0]), block([1.0, 2.0, 3.0])], "entries")
    assert drawn.group.tolist() == [0, 1, 2, 0, 1, 2, 3, 4, 5, 3, 4, 5]


def test_noise_of_logarithms_is_that_of_the_functions() -> None:
    """ln of 1 + σn by its distribution: |1 + σn|²/σ² is noncentral χ² with two degrees of freedom."""
    sd = 0.3
    found = noise_of(block([1.0] * 40_000, log_sd=sd), np.random.default_rng(3), 1.0)
    real, imaginary = found[:40_000] * sd, found[40_000:] * sd
    ratio = np.exp(-real - 1j * imaginary)
    n = (ratio - 1.0) / sd
    # means of 40,000 normal values of variance 1: 4 σ
    assert abs(n.mean()) < 4.0 * np.sqrt(2.0 / 40_000)
    assert np.var(n.real) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 40_000))
    assert np.var(n.imag) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 40_000))


@pytest.mark.parametrize(
    ("method", "form"), [("lines", "log-complex"), ("entries", "log-magnitude"), ("noise", "linear")]
)
@pytest.mark.quick(0, gate=1)
def test_a_run_is_the_optimum_of_its_data(method: Drawing, form: str) -> None:
    """Against a trust-region optimiser with its own differences, on the same draw."""
    bootstrap = work(method, form)
    start = bootstrap.at
    for number in range(2):
        root, added = bootstrap.drawn_data(number)

        def residuals(x: np.ndarray, root: np.ndarray = root, added: np.ndarray = added) -> np.ndarray:
            return np.asarray(root * (bootstrap.problem.follow(x, start, False).residuals + added))

        exact = least_squares(residuals, start.x, "3-point", x_scale=bootstrap.sd, xtol=1e-12, ftol=1e-12, gtol=1e-12).x
        shared, own = bootstrap(number), bootstrap.check(number)
        assert shared.converged
        assert own.converged
        # derivatives at the optimum lead to a point nearby, where residuals are large; a tenth of σ is what is promised
        assert np.abs((shared.x - exact) / bootstrap.sd).max() < 0.1
        assert np.abs((own.x - exact) / bootstrap.sd).max() < 2e-3
        assert np.abs((exact - start.x) / bootstrap.sd).max() > 0.1


@pytest.mark.slow
def test_serial_and_processes_agree_to_the_last_bit() -> None:
    bootstrap = work()
    one, other = (e.run(bootstrap, range(24)) for e in (Serial(), Processes(2)))
    assert [r.x.tobytes() for r in one] == [r.x.tobytes() for r in other]
    assert [r.steps for r in one] == [r.steps for r in other]


@pytest.mark.slow
def test_a_pickle_of_the_work_has_no_solutions() -> None:
    bootstrap = work()
    first = bootstrap(3)
    again = pickle.loads(pickle.dumps(bootstrap))
    assert again(3).x.tobytes() == first.x.tobytes()
    assert again.at.states[0].solved is None


def found(bootstrap: Bootstrap, runs: int) -> BootstrapResult:
    return bootstrap_result(bootstrap, [bootstrap(i) for i in range(runs)], [bootstrap.check(i) for i in range(3)])


@pytest.mark.long
def test_spread_of_noise_is_that_of_the_fisher_information() -> None:
    """Independent formulas: (JᵀJ)⁻¹, and its parts by numpy on the Jacobian of the update."""
    bootstrap = work("noise")
    result = found(bootstrap, 400)
    J = calibrated()[1].after.jacobian
    exact = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    np.testing.assert_allclose([p.fisher_sd for p in result.found], exact, rtol=1e-6)
    # χ² of 400 runs: the standard deviation is known to 3.5 %, four of them
    np.testing.assert_allclose([p.sd for p in result.found], exact, rtol=0.15)
    assert result.difference is not None
    assert result.difference < 0.02
    assert all(abs(p.bias) < 0.25 for p in result.found)


@pytest.mark.long
@pytest.mark.parametrize("method", ["lines", "entries"])
def test_spread_of_lines_is_that_of_the_first_steps(method: Drawing) -> None:
    """The linearised covariance by an independent sum over the drawn groups; residuals three times the stated ones."""
    problem, best = calibrated(inflated=3.0)
    bootstrap = bootstrap_of(problem, best.after, best.side, best.active, BootstrapRules(method))
    J, r = best.after.jacobian, best.after.residuals
    H = np.linalg.inv(J.T @ J)
    groups: dict[object, np.ndarray] = {}
    rows = iter(zip(J, r))
    for number, b in enumerate(best.after.blocks):
        assert b.samples is not None
        for hz, entry in zip(b.samples.freq_hz, b.samples.entry):
            j, value = next(rows)
            key = hz if method == "lines" else (number, int(entry))
            groups[key] = groups.get(key, 0.0) + j * value
    exact = np.sqrt(np.diag(H @ sum(np.outer(g, g) for g in groups.values()) @ H))
    result = found(bootstrap, 300)
    np.testing.assert_allclose([p.linear_sd for p in result.found], exact, rtol=1e-3)
    np.testing.assert_allclose([p.sd for p in result.found], exact, rtol=0.3)
    # the noise is three times the stated one, which the Fisher information does not know and the lines do
    assert any("3" in s and "Fisher" in s for s in result.sentences)


@pytest.mark.slow
def test_statistics_of_given_runs() -> None:
    bootstrap = work()
    rng = np.random.default_rng(5)
    x = bootstrap.at.x + bootstrap.sd * rng.standard_normal((4000, 4))
    runs = [*(BootstrapRun(row, True, 2, 1) for row in x), BootstrapRun(x[0], False, 20, 20)]
    result = bootstrap_result(bootstrap, runs, [])
    names = [p.name for p in result.parameters.free]
    values = result.parameters.denormalise(x)
    assert len(result.samples) == 4000
    for i, p in enumerate(result.found):
        assert p.name == names[i]
        assert p.mean == pytest.approx(values[:, i].mean())
        assert p.sd == pytest.approx(values[:, i].std(ddof=1))
        # of P, not of its change
        assert p.cov == pytest.approx(values[:, i].std(ddof=1) / values[:, i].mean())
        lines = len(np.unique(np.concatenate([b.samples.freq_hz for b in bootstrap.at.blocks if b.samples])))
        wide = np.sqrt(lines / (lines - 4)) * t.ppf(0.975, lines - 4)
        low, high = np.quantile(values[:, i], [norm.cdf(-wide), norm.cdf(wide)])
        assert (p.lower, p.upper) == pytest.approx((low, high))
    np.testing.assert_allclose(result.correlation, np.corrcoef(x.T), atol=1e-12)
    assert "1 of 4001 runs did not converge and are left out." in result.sentences


@pytest.mark.slow
def test_bias_and_bounds_are_told() -> None:
    bootstrap = work()
    rng = np.random.default_rng(5)
    x = bootstrap.at.x + bootstrap.sd * (rng.standard_normal((200, 4)) + np.eye(4)[0])
    lower = bootstrap.problem.parameters.bounds[0]
    x[:20, 3] = lower[3]
    result = bootstrap_result(bootstrap, [BootstrapRun(row, True, 2, 1) for row in x], [])
    assert result.found[0].bias == pytest.approx(1.0, abs=0.3)
    assert result.found[3].at_bound == pytest.approx(0.1)
    text = " ".join(result.sentences)
    assert "differs from the result by more than half a standard deviation (k +" in text
    assert "Some runs end at a bound of g" in text


@pytest.mark.slow
def test_an_exact_fit_has_no_scatter() -> None:
    problem, best = calibrated()
    exact = replace(best.after, blocks=tuple(replace(b, values=0.0 * b.values) for b in best.after.blocks))
    bootstrap = bootstrap_of(problem, exact, best.side, best.active, BootstrapRules(runs=10))
    result = bootstrap_result(bootstrap, [BootstrapRun(exact.x, True, 1, 0)] * 10, [])
    assert result.sentences[0].startswith("The runs have no scatter")


@pytest.mark.slow
def test_a_fixed_parameter_rests() -> None:
    problem, best = calibrated()
    bootstrap = bootstrap_of(problem, best.after, best.side, best.active[:2], BootstrapRules())
    run = bootstrap(0)
    assert run.converged
    assert run.x[2:].tolist() == best.x[2:].tolist()
    assert bootstrap.sd[2:].tolist() == [0.0, 0.0]


def test_other_residuals_have_no_lines() -> None:
    mass = ResidualBlock("mass", "a", "total", np.zeros(1), np.zeros((1, 1)), 1.0)
    with pytest.raises(FemtuneError) as error:
        drawn_groups([block([1.0, 2.0, 3.0]), mass], "lines")
    check_shown("bootstrap.no-lines", error.value)


def test_too_few_lines() -> None:
    with pytest.raises(FemtuneError) as error:
        drawn_groups([block([1.0, 2.0])], "lines")
    check_shown("bootstrap.few-lines", error.value)


def test_undetermined_parameters() -> None:
    problem, best = calibrated()
    blocks = tuple(replace(b, jacobian=b.jacobian * [1.0, 1.0, 0.0, 0.0]) for b in best.after.blocks)
    with pytest.raises(FemtuneError) as error:
        bootstrap_of(problem, replace(best.after, blocks=blocks), best.side, best.active, BootstrapRules())
    check_shown("bootstrap.undetermined", error.value)


def test_no_run_converged() -> None:
    bootstrap = work()
    with pytest.raises(FemtuneError) as error:
        bootstrap_result(bootstrap, [BootstrapRun(bootstrap.at.x, False, 20, 20)] * 10, [])
    check_shown("bootstrap.no-runs", error.value)


def test_a_run_that_cannot_be_solved_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    bootstrap = work()

    def refuse(*_: object, **__: object) -> None:
        raise FemtuneError("study.no-test", purpose="this")

    monkeypatch.setattr(UpdateProblem, "follow", refuse)
    run = bootstrap(0)
    assert not run.converged
    assert run.problem
