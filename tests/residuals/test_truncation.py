"""Error of superposed FRFs beside the inverse of the dynamic stiffness, and how many modes are used by default."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.model import solve_modes
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.residuals import Band, FrfForm, FrfScatter, ModelWay, case_without_modes, frf_residual, state_at
from femtune.residuals.frf.truncation import SMALL, truncation, truncations

from .damped import chain, measured, ports_of

AT = np.array([0.03, 0.05, -0.1, 0.2])


def _inverse(lines: np.ndarray) -> np.ndarray:
    """(outputs, inputs, k) accelerances, by a dense inverse at each line."""
    model = chain()
    point, ports = model.at(AT), ports_of(model)
    K = point.stiffness.toarray() + 1j * point.hysteretic.toarray()
    out = []
    for w in 2.0 * np.pi * lines:
        Z = K + 1j * w * point.viscous.toarray() - w**2 * point.mass.toarray()
        out.append(-(w**2) * (ports.outputs @ np.linalg.solve(Z, ports.inputs.toarray())))
    return np.moveaxis(np.array(out), 0, -1)


@pytest.mark.slow
@pytest.mark.parametrize(("form", "scatter"), [("linear", FrfScatter(0.0, 0.02)), ("log-complex", FrfScatter(0.05))])
def test_the_error_is_that_beside_the_inverse(form: FrfForm, scatter: FrfScatter) -> None:
    model = chain()
    modes = solve_modes(model.at(AT), 2)
    way = ModelWay("real-modes", (2, None), residual_vectors=False)
    residual, _ = frf_residual(modes, measured(model, ports_of(model)), Band(to_hz=4.0), form, scatter, way)
    state = state_at(case_without_modes(model, (residual,)), AT)
    (found,) = truncations(state)
    at = np.searchsorted(residual.measured.freq_hz, found.lines_hz)
    assert found.lines_hz[-1] == residual.measured.freq_hz[-1]
    exact, values = _inverse(found.lines_hz), residual.functions(modes)[0][:, :, at]
    error = values - exact if form == "linear" else np.log(values / exact)
    expected = np.maximum(np.abs(error.real), np.abs(error.imag)) / residual.sd[:, :, at]
    assert found.largest == pytest.approx(expected.max(), rel=1e-9)
    assert found.mean == pytest.approx(np.sqrt(np.mean(expected**2)), rel=1e-9)
    assert found.relative == pytest.approx(np.abs(values / exact - 1.0).max(), rel=1e-9)
    assert found.small is bool(expected.max() <= SMALL)
    assert not found.small
    assert "mode" in found.lacks


@pytest.mark.slow
def test_without_a_number_the_modes_reach_twice_the_highest_line() -> None:
    model = chain()
    start = solve_modes(model.at(AT), 5)
    top = 0.5 * float(start.freq_hz[2]) * 0.99
    state = state_at(case_without_modes(model, (), count=1), AT)
    test = measured(model, ports_of(model))
    highest_hz = float(test.freq_hz[test.freq_hz <= top].max())
    residual, _ = frf_residual(start, test, Band(to_hz=top), way=ModelWay().settled(state, highest_hz))
    found = truncation(residual, state)
    expected = int((start.freq_hz <= TIMES_HIGHEST_LINE * residual.highest_hz).sum())
    assert found.modes == expected
    assert found.missing == 0
    # what is missing with fewer is counted
    few = replace(residual, way=replace(residual.way, modes=(1, None)))
    assert truncation(few, state).missing == expected - 1
    assert "residual vectors" not in truncation(few, state).lacks
    # and residual vectors that the study leaves out are named
    for way in (residual.way, few.way):
        without = replace(residual, way=replace(way, residual_vectors=False))
        assert truncation(without, state).lacks.endswith("(residual_vectors = false)")


@pytest.mark.slow
def test_the_number_of_modes_stays_that_of_the_start() -> None:
    """A mode that leaves the range up to twice the highest line must not leave the functions: they would jump."""
    model, test = chain(), measured(chain(), ports_of(chain()))
    moved = AT + np.array([0.0, 0.5, 0.0, 0.0])
    start = solve_modes(model.at(AT), 5)
    fourth = [solve_modes(model.at(x), 5).freq_hz[3] for x in (AT, moved)]
    residual, _ = frf_residual(start, test, Band(to_hz=sum(fourth) / (2.0 * TIMES_HIGHEST_LINE)))
    reach = TIMES_HIGHEST_LINE * residual.highest_hz
    assert len({int((solve_modes(model.at(x), 5).freq_hz <= reach).sum()) for x in (AT, moved)}) == 2
    for x in (AT, moved):
        state = state_at(case_without_modes(model, (residual,), count=1), x)
        assert truncation(residual, state).modes == 5
