"""The residuals in parts: chances are right where the model is right, and the part that is wrong is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import binom, chi2, kstest

from femtune.judge.parts import ResidualPart, holm, only_prior_contradicts, parts
from femtune.judge.whitened import Whitened, whitened
from femtune.updating import Prior, SensitivityMethod, update
from structures.coverage import spring_chain

LEVEL = 0.05


def _record(prior: bool = False) -> Whitened:
    """Rows of a real update: 5 frequencies, 5 shapes at 6 sensors, and 4 parameters."""
    method = SensitivityMethod(regularisation=Prior()) if prior else SensitivityMethod()
    found = whitened(update(spring_chain().problem(0), method))
    assert found is not None
    return found


def _noise(record: Whitened, rng: np.random.Generator) -> Whitened:
    """Other noise, of unit variance but for what is lost, and other values of the parameters."""
    e = rng.standard_normal(len(record.r))
    return replace(record, r=e - record.lost @ (record.lost.T @ e) + record.range @ rng.normal(size=4) * 50.0)


def _least(found: tuple[ResidualPart, ...]) -> float:
    return min(p.p_family_wise for p in found)


def test_the_numbers_of_all_rows_are_those_of_the_textbook() -> None:
    record = _noise(_record(), np.random.default_rng(0))
    whole = parts(record)[0]
    P = np.eye(35) - record.basis @ record.basis.T
    q = record.r @ P @ record.r
    assert (whole.family, whole.kind, whole.values) == ("kinds", "", 35)
    assert (whole.chi_square, whole.degrees) == (pytest.approx(q), pytest.approx(26.0))
    assert (whole.p_large, whole.p_small) == (pytest.approx(chi2.sf(q, 26)), pytest.approx(chi2.cdf(q, 26)))


def test_every_family_is_there() -> None:
    found = parts(_record(prior=True))
    count = {f: sum(p.family == f for p in found) for f in dict.fromkeys(p.family for p in found)}
    # all and two kinds; five modes by frequency and by shape; six sensors; four priors
    assert count == {"kinds": 3, "modes": 10, "sensors": 6, "priors": 4}


@pytest.mark.slow
@pytest.mark.parametrize("draws", [150, pytest.param(4000, marks=pytest.mark.long)])
def test_chances_are_uniform_and_their_family_is_at_its_level(draws: int) -> None:
    """By draws of noise: Kolmogorov-Smirnov of each kind of part at one in a thousand; the family at 5 %."""
    rng, base = np.random.default_rng(7), _record(prior=True)
    found = [parts(_noise(base, rng)) for _ in range(draws)]
    for i, part in enumerate(found[0]):
        chances = [p[i].p_large for p in found]
        assert kstest(chances, "uniform").pvalue > 1e-3 / len(found[0]), part
        assert kstest([p[i].p_small for p in found], "uniform").pvalue > 1e-3 / len(found[0]), part
    false = sum(_least(p) < LEVEL for p in found)
    assert false <= binom.ppf(0.999, draws, LEVEL)


def _gain(record: Whitened) -> np.ndarray:
    return np.where(np.array(record.sensors) == record.sensors[1 + 3], 4.0, 0.0)


def _one_frequency(record: Whitened) -> np.ndarray:
    return np.where((np.array(record.kinds) == "frequency") & (np.array(record.modes) == "4"), 9.0, 0.0)


def _one_shape(record: Whitened) -> np.ndarray:
    shift = 3.0 * (-1.0) ** np.arange(len(record.r))
    return np.where((np.array(record.kinds) == "shape") & (np.array(record.modes) == "2"), shift, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "family", "name"),
    [(_gain, "sensors", ""), (_one_frequency, "modes", "frequency 4"), (_one_shape, "modes", "shape 2")],
)
def test_what_is_wrong_is_named(fault: Callable[[Whitened], np.ndarray], family: str, name: str) -> None:
    record = _noise(_record(), np.random.default_rng(3))
    record = replace(record, r=record.r + fault(record))
    fine = [p for p in parts(record) if p.family != "kinds"]
    worst = min(fine, key=lambda p: p.p_family_wise)
    assert worst.family == family
    assert worst.p_family_wise < 0.01
    assert worst.sensor == record.sensors[4] if family == "sensors" else f"{worst.kind} {worst.mode}" == name


def test_a_tight_prior_that_the_data_contradict_is_named() -> None:
    """One value with a prior 30 σ away: the data alone fit perfectly, and so does the prior."""
    n = 4
    J = np.vstack([0.05 * np.ones((n, 1)), np.ones((1, 1))])
    r = np.concatenate([np.full(n, 10.0), [0.0]])
    labels = (("frequency",) * n + ("prior",), ("test",) * n + ("",), ("1", "2", "3", "4", "E"), ("",) * (n + 1))
    record = Whitened(
        r, J, ("E",), np.zeros((n + 1, 0)), *labels, ("data",) * n + ("prior",), np.ones(n + 1), np.zeros((n + 1, 0)),
        frozenset({"frequency"}),
    )  # fmt: skip
    found = parts(record)
    worst = min((p for p in found if p.family != "kinds"), key=lambda p: p.p_family_wise)
    assert (worst.family, worst.mode) == ("priors", "E")
    assert only_prior_contradicts(record, 0.01)
    assert not only_prior_contradicts(replace(record, r=record.r + 20.0 * (-1.0) ** np.arange(n + 1)), 0.01)
    # the conflict is that of the mean of the data and the prior, in one direction
    assert np.sqrt(worst.chi_square / worst.degrees) == pytest.approx(10.0 / np.sqrt(0.05**2 + 1 / n), rel=1e-6)
    assert next(p.degrees for p in found if p.family == "kinds") == pytest.approx(4.0)


def test_what_bounds_and_side_constraints_keep() -> None:
    """A residual of 5 along a parameter at its bound, or held by a constraint that is no information."""
    J, r = np.eye(6)[:, :1], np.array([5.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    none, labels = np.zeros((6, 0)), (("frequency",) * 6, *[("",) * 6] * 3)
    at_bound = Whitened(r, none, (), J, *labels, ("data",) * 6, np.ones(6), none)
    assert [(p.family, p.chi_square, p.degrees) for p in parts(at_bound)][-1] == ("bounds", 25.0, 1)
    assert parts(at_bound)[-1].p_large == pytest.approx(chi2.sf(25.0, 1))
    # the other parts do not have it
    assert parts(at_bound)[0].chi_square == pytest.approx(5.0)
    held = Whitened(r, J, ("k",), none, *labels, ("data",) * 6, np.ones(6), none)
    assert [p.family for p in parts(held)] == ["kinds"]
    assert [(p.family, p.chi_square) for p in parts(held, side_constraint=True)][-1] == ("side constraint", 25.0)


@pytest.mark.slow
def test_true_values_within_bounds_are_rarely_contradicted() -> None:
    """Least squares within bounds of a true value on the bounds: the part of the bounds is at its level of 5 %.

    Three standard deviations of 5 % in 500 draws are 2.9 %.
    """
    rng, J = np.random.default_rng(6), np.random.default_rng(7).standard_normal((12, 3))
    labels, false = (("frequency",) * 12, *[("",) * 12] * 3), 0
    for _ in range(500):
        e = rng.standard_normal(12)
        x = lsq_linear(J, -e, (np.zeros(3), np.full(3, np.inf))).x
        at = x < 1e-9
        record = Whitened(
            e + J @ x, J[:, ~at], ("",) * int((~at).sum()), J[:, at], *labels, ("data",) * 12, np.ones(12), J[:, :0]
        )
        false += any(p.p_large < LEVEL for p in parts(record) if p.family == "bounds")
    assert false / 500 < LEVEL + 0.029


def test_holm_is_that_of_the_paper() -> None:
    """Steps of Holm by hand: 4·0.005, 3·0.011, 2·0.02, 1·0.04, never falling."""
    assert holm([0.04, 0.005, 0.02, 0.011]) == pytest.approx([0.04, 0.02, 0.04, 0.033])
