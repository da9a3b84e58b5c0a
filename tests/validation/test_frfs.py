"""Criteria on FRFs, by hand and on oscillators with known resonances."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.modal import fdac
from femtune.validation.criteria import FDAC, FRAC, MAX_LEVEL, MEAN_LEVEL, RESONANCE, Criterion, Outcome
from femtune.validation.frfs import PredictedFrfs, assess_frfs

LINES = np.arange(5.0, 100.0, 0.5)
LIMITS = {FRAC: (0.9, False), FDAC: (0.9, False), MEAN_LEVEL: (1.0, True), MAX_LEVEL: (3.0, True),
          RESONANCE: (0.02, True)}  # fmt: skip
CRITERIA = [Criterion("own", quantity, *limit) for quantity, limit in LIMITS.items()]


def oscillators(*freq_hz: float, ratio: float = 0.01) -> np.ndarray:
    """(3, 1, k) receptances: three sensors that see each mode in another way."""
    shapes = np.array([[1.0, 0.8, -0.5], [0.3, -1.0, 0.7], [0.6, 0.2, 1.0]])[: len(freq_hz)]
    w, w0 = 2.0 * np.pi * LINES, 2.0 * np.pi * np.array(freq_hz)
    gain = 1.0 / (w0[:, None] ** 2 - w**2 + 2j * ratio * w0[:, None] * w)
    return np.asarray(np.einsum("mo,m,mk->ok", shapes, shapes[:, 0], gain)[:, None, :])


def predicted(model: np.ndarray, test: np.ndarray) -> PredictedFrfs:
    return PredictedFrfs([f"{i + 1}X+" for i in range(len(model))], ["1X+"], LINES, model, test)


def outcomes(found: PredictedFrfs) -> dict[str, tuple[float | None, Outcome]]:
    return {v.criterion.quantity: (v.measured, v.outcome) for v in assess_frfs(found, CRITERIA)}


def test_a_factor_changes_levels_only() -> None:
    test = oscillators(20.0, 45.0, 70.0)
    found = outcomes(predicted(2.0 * test, test))
    assert found[FRAC] == (pytest.approx(1.0), Outcome.PASS)
    assert found[FDAC] == (pytest.approx(1.0), Outcome.PASS)
    assert found[RESONANCE] == (pytest.approx(0.0, abs=1e-12), Outcome.PASS)
    assert found[MEAN_LEVEL] == (pytest.approx(20.0 * np.log10(2.0)), Outcome.FAIL)
    assert found[MAX_LEVEL] == (pytest.approx(20.0 * np.log10(2.0)), Outcome.FAIL)


def test_resonances_between_the_lines_and_their_errors() -> None:
    test, model = oscillators(20.2, 45.0, 70.0), oscillators(20.2, 46.8, 70.0)
    found = predicted(model, test)
    assert [r.test_hz for r in found.resonances] == pytest.approx([20.2, 45.0, 70.0], rel=2e-3)
    value, outcome = outcomes(found)[RESONANCE]
    assert value == pytest.approx(0.04, rel=0.05)
    assert outcome is Outcome.FAIL


def test_a_resonance_that_the_model_lacks_fails() -> None:
    (verdict,) = assess_frfs(predicted(oscillators(20.0), oscillators(20.0, 60.0)), [CRITERIA[-1]])
    assert verdict.outcome is Outcome.FAIL
    assert verdict.measured == np.inf
    assert "no peak within 20 % of 59.9" in verdict.remark


def test_fdac_by_hand() -> None:
    """Deflections (1, 1, 0) and (1, 0, 0) at every line: |1|²/(2·1) = 1/2."""
    ones, zeros = np.ones(len(LINES), complex), np.full(len(LINES), 1e-9, complex)
    model, test = (np.array(rows)[:, None, :] for rows in ([ones, ones, zeros], [1j * ones, zeros, zeros]))
    ((label, value),) = predicted(model, test).fdac()
    assert (label, value) == ("1X+", pytest.approx(0.5))


def test_fdac_is_the_diagonal_of_the_matrix() -> None:
    test, model = oscillators(20.0, 45.0, 70.0), oscillators(21.0, 44.0, 71.0)
    ((_, value),) = predicted(model, test).fdac()
    assert value == pytest.approx(np.mean(np.diag(fdac(test[:, 0], model[:, 0]))))


def test_what_the_data_do_not_have_is_not_tested() -> None:
    test = oscillators(20.0, 45.0)
    test[2] = np.nan
    found = outcomes(predicted(test, test))
    assert found[FDAC] == (None, Outcome.NOT_TESTED)
    assert found[FRAC][1] is Outcome.PASS
    none = outcomes(predicted(test, np.full_like(test, np.nan)))
    assert {outcome for _, outcome in none.values()} == {Outcome.NOT_TESTED}
    flat = outcomes(predicted(np.ones_like(test), np.ones_like(test)))
    assert flat[RESONANCE] == (None, Outcome.NOT_TESTED)


def test_functions_that_are_rounding_in_the_model_are_not_judged() -> None:
    test = oscillators(20.0, 45.0, 70.0)
    model = test.copy()
    model[1] *= 1e-14
    found = predicted(model, test)
    assert [m.output for m in found.matches] == ["1X+", "3X+"]
