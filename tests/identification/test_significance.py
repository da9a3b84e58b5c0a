"""Poles that follow the noise are no modes, those that stand out of it are: without noise, and in proportion."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.identification import Limits, choose, join_tables, n4sid_poles, normal_equations, plscf_poles, subspace
from femtune.identification.pole_table import PoleTable, table_of
from femtune.identification.significance import stands_out, without_poles_of_noise
from femtune.modal import FrfSet, pole_of
from femtune.testing import example_deck


def _in_proportion(frfs: FrfSet, level: float, seed: int = 0) -> FrfSet:
    """Errors of the magnitudes, in proportion to them."""
    error = np.random.default_rng(seed).standard_normal(frfs.values.shape)
    return dataclasses.replace(frfs, values=frfs.values * (1.0 + level * error))


@pytest.mark.parametrize("level", [1e-14, 1e-9, 1e-5, 1e-2])
@pytest.mark.parametrize("lines", [40, 800])
def test_modes_stand_out_and_poles_beside_them_do_not(three_modes: Any, level: float, lines: int) -> None:
    """Whatever the noise: the pole that is not there lies in the flank of a mode, and has any bandwidth."""
    frfs = _in_proportion(three_modes.frfs(np.linspace(5.0, 30.0, lines)), level)
    modes = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
    for i in range(3):
        assert stands_out(frfs, modes[i], np.delete(modes, i))
    for beside in pole_of(np.array([9.8, 10.3, 20.5, 26.0]), np.array([0.002, 0.01, 0.03, 0.01])):
        assert not stands_out(frfs, complex(beside), modes)


def test_a_weak_mode_stands_out_as_far_as_the_noise_allows(three_modes: Any) -> None:
    """A thousandth of its neighbours, at one reference."""
    weak = dataclasses.replace(three_modes, shapes=three_modes.shapes * [1.0, 1.0, 0.03])
    modes = pole_of(weak.freq_hz, weak.damping_ratio)
    lines = np.linspace(5.0, 30.0, 800)
    found = [stands_out(_in_proportion(weak.frfs(lines), level), modes[2], modes[:2]) for level in (1e-8, 1e-3, 1.0)]
    assert found == [True, True, False]


def test_what_cannot_be_told_stands_out(three_modes: Any) -> None:
    """Fewer lines than unknowns, functions of nothing, and two poles of one place."""
    frfs = _in_proportion(three_modes.frfs(np.linspace(5.0, 30.0, 200)), 0.01)
    modes = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
    few = dataclasses.replace(frfs, freq_hz=frfs.freq_hz[:5], values=frfs.values[:, :, :5])
    assert stands_out(few, modes[0], modes[1:])
    assert stands_out(dataclasses.replace(frfs, values=0.0 * frfs.values), modes[0], modes[1:])
    assert stands_out(frfs, modes[0] * 1.0001, modes)


def _clusters(close: tuple[float, float], mixed_share: int) -> PoleTable:
    """Ten orders of a method that has two close modes with their own shapes, and of another that has a mixture."""
    poles = pole_of(np.array(close), np.array([0.01, 0.01]))
    both = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    mixture, orders = both @ [[0.7], [0.7]], list(range(2, 22, 2))
    dofs = ft.DofSet.parse(["1Z+", "2Z+", "3Z+"])
    count = [int(i < mixed_share) for i in range(len(orders))]
    between = [poles.mean(keepdims=True)[:c] for c in count]
    apart = table_of([poles] * 10, [both] * 10, orders, "N4SID", dofs)
    return join_tables([apart, table_of(between, [mixture[:, :c] for c in count], orders, "pLSCF", dofs)])


@pytest.mark.parametrize("second", [20.0, 20.1])
def test_two_close_modes_come_before_a_mixture_of_both(second: float) -> None:
    """Repeated modes, and modes half a per cent apart: one method tells them apart, the other does not."""
    found = choose(_clusters((20.0, second), 10))
    assert [c.share["N4SID"] > 0.5 for c in found if c.chosen] == [True, True]
    assert [c.reason[:15] for c in found if not c.chosen] == ["same mode as at"]


def test_clusters_that_no_method_has_side_by_side_are_one_mode() -> None:
    """One method's shape is off; both have one pole there."""
    table = _clusters((20.0, 24.0), 0)
    pole, shape = table.poles[[0]], table.shapes[:, [1]]
    other = table_of([pole * 1.0002] * 10, [shape] * 10, range(2, 22, 2), "pLSCF", table.dofs)
    found = choose(join_tables([table, other]))
    assert [round(c.freq_hz) for c in found if c.chosen] == [20, 24]
    assert [c.reason for c in found if not c.chosen] == ["same mode as at 20 Hz"]


def _cantilever(folder: Path) -> FrfSet:
    path = folder / "frf.uff"
    places = [f"{n}{d}+" for n in (2, 3, 4, 5) for d in "YZ"]
    lines = {"from_hz": 5.0, "to_hz": 400.0, "step_hz": 0.5, "ratio": 0.01}
    deck = example_deck(folder)
    ft.respond(deck, inputs=["5Y+", "5Z+"], outputs=places, uff=path, units="m-kg-s", **lines)
    frfs = ft.read_test(path).frfs
    assert frfs is not None
    return frfs


@pytest.mark.slow
def test_noise_in_proportion_has_no_modes(tmp_path: Path) -> None:
    """From rounding to half a per cent; by how often poles come back alone some of them were modes."""
    clean, before = _cantilever(tmp_path), []
    for level, seed in ((0.0, 0), (1e-12, 1), (1e-10, 1), (1e-6, 1), (1e-6, 2), (5e-3, 1), (5e-3, 4)):
        frfs = _in_proportion(clean, level, seed)
        by_subspace = n4sid_poles(subspace(frfs, 60), range(2, 61, 2))
        table = join_tables([by_subspace, plscf_poles(normal_equations(frfs, 30), range(2, 31))])
        candidates = choose(table, Limits(band_hz=(5.0, 400.0)))
        before.append(sum(c.chosen for c in candidates))
        after = [c.freq_hz for c in without_poles_of_noise(candidates, table, frfs, 0.15) if c.chosen]
        np.testing.assert_allclose(after, [28.268, 44.695, 201.105, 317.974], rtol=2e-4)
    assert max(before) > 4
