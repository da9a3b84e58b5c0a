"""Modes that few orders show are chosen by what they explain; noise and systematic errors are not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femtune.identification import InputKnown, Limits, Rule, choose, chosen_poles, identify_frfs
from femtune.identification.information import with_needed_modes
from femtune.identification.modal_fit import fit_modes
from femtune.identification.plscf import normal_equations, plscf_poles
from femtune.modal import FrfSet

from .conftest import Known

LINES = np.linspace(5.0, 30.0, 400)


def chosen_with(frfs: FrfSet) -> tuple[list[float], list[float]]:
    """Frequencies that are chosen before and after, where the rule wants what only the strongest clusters have."""
    table = plscf_poles(normal_equations(frfs, 20), range(2, 21))
    candidates = choose(table, Limits(band_hz=(5.0, 30.0)))
    strongest = max(candidates, key=lambda c: max(c.share.values()))
    few = tuple(
        c if c is strongest else replace(c, chosen=False, reason="stable in few of the orders") for c in candidates
    )
    fit = fit_modes(frfs, chosen_poles(few, table).poles)

    def refit(inside: np.ndarray, outside: np.ndarray, below: float) -> Any:
        return fit_modes(frfs, inside, neighbours=outside, below=below)

    fit, kept = with_needed_modes(fit, few, table, refit)
    assert int(fit.reported.sum()) == sum(c.chosen for c in kept)
    return [c.freq_hz for c in few if c.chosen], [c.freq_hz for c in kept if c.chosen]


def test_modes_that_the_rule_leaves_out_are_taken_if_the_data_need_them(three_modes: Any) -> None:
    before, after = chosen_with(three_modes.frfs(LINES, noise=0.01, seed=1))
    assert len(before) == 1
    assert after == pytest.approx(three_modes.freq_hz, rel=2e-3)


def test_nothing_is_taken_where_the_errors_are_no_noise_with_it_either(three_modes: Any) -> None:
    frfs = three_modes.frfs(LINES, noise=0.0005, seed=1)
    # as of a structure whose frequencies change with its motion: peaks that no mode has
    bent = np.exp(0.4j * np.sin(40.0 * np.abs(frfs.values) / np.abs(frfs.values).max()))
    before, after = chosen_with(replace(frfs, values=frfs.values * bent))
    assert after == before


@pytest.mark.slow
def test_noise_gives_no_modes(three_modes: Any) -> None:
    for seed in range(5):
        frfs = three_modes.frfs(LINES, noise=0.02, seed=seed)
        found = identify_frfs(frfs, InputKnown(largest_order=40, rule=Rule(alone=0.7)))
        assert len(found.modes) == 3


def test_functions_that_were_measured_one_after_the_other_have_no_further_modes() -> None:
    """Frequencies that fall by parts of a bandwidth between the hits of a roving hammer: each mode is still one."""
    shapes = np.cos(np.outer(np.arange(9), [0.35, 0.75])) / 2.0
    structure = Known(np.array([10.0, 11.5]), np.array([1.5e-4, 1.2e-4]), shapes)
    lines = np.linspace(9.5, 12.0, 1250)
    exact = structure.frfs(lines, noise=0.0, seed=0)
    values = exact.values.copy()
    for i, shift in enumerate(np.linspace(0.0, 1e-4, 9)):
        values[i] = structure.frfs(lines * (1.0 + shift), noise=0.01, seed=i).values[i]
    identified = identify_frfs(replace(exact, values=values), InputKnown(rule=Rule(alone=0.7)))
    assert identified.modes.freq_hz == pytest.approx(structure.freq_hz, rel=2e-4)
