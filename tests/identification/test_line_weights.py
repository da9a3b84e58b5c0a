"""Standard deviations of FRFs decide how much each frequency line counts in the subspace identification (N4SID)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femtune.identification.n4sid import subspace, subspace_poles
from femtune.modal import FrfSet, pole_of

_LINES = np.linspace(6.0, 26.0, 120)


def _poles(frfs: FrfSet, sd: np.ndarray | None) -> np.ndarray:
    poles, _ = subspace_poles(subspace(frfs, 6, block_rows=6, sd=sd), 6)
    return np.sort_complex(poles[poles.imag > 0.0])


def _sd(frfs: FrfSet, of_lines: np.ndarray) -> np.ndarray:
    return np.broadcast_to(of_lines, frfs.values.shape).copy()


def test_lines_of_large_standard_deviation_do_not_count(three_modes: Any) -> None:
    """Five lines are spoilt by a disturbance: with its standard deviation stated, the poles are exact all the same."""
    exact = three_modes.frfs(_LINES, kind="receptance")
    spoilt = np.arange(40, 45)
    values = exact.values.copy()
    values[:, :, spoilt] += np.abs(values).max()
    frfs = replace(exact, values=values)
    told = np.ones(len(_LINES))
    told[spoilt] = 1e9
    truth = np.sort_complex(pole_of(three_modes.freq_hz, three_modes.damping_ratio))
    assert np.abs(_poles(frfs, _sd(frfs, told)) - truth).max() < 1e-4
    assert np.abs(_poles(frfs, None) - truth).max() > 1e-1


def test_a_line_counts_as_two_lines_of_twice_its_variance(three_modes: Any) -> None:
    """Least squares: a line measured twice with σ√2 each, both with the same error, says what one line with σ says."""
    once = three_modes.frfs(_LINES, noise=0.1, seed=1, kind="receptance")
    some = np.arange(30, 60)
    at = np.sort(np.concatenate([np.arange(len(_LINES)), some]))
    copies = at[1:] == at[:-1]
    lines = _LINES[at] * np.where(np.append(False, copies), 1.0 + 1e-12, 1.0)
    twice = FrfSet(lines, once.values[:, :, at], once.responses, once.references, once.kind)
    of_twice = np.ones(len(lines))
    of_twice[np.isin(at, some)] = np.sqrt(2.0)
    expected = _poles(once, _sd(once, np.ones(len(_LINES))))
    assert _poles(twice, _sd(twice, of_twice)) == pytest.approx(expected, rel=1e-6)
    assert np.abs(_poles(twice, None) - expected).max() > 1e-4 * np.abs(expected).max()
