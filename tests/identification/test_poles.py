"""Poles by N4SID and pLSCF: exact without noise whatever the lines, together after choice with noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification import (
    Limits,
    Rule,
    change_choice,
    choose,
    chosen_poles,
    in_band,
    join_tables,
    n4sid_poles,
    normal_equations,
    plscf_poles,
    stable,
    subspace,
    subspace_poles,
)
from femtune.identification.pole_table import PoleTable
from femtune.modal import FrfSet, freq_and_damping, mac, pole_of

_EVEN = np.linspace(5.0, 62.0, 1200)
_UNEVEN = np.sort(np.random.default_rng(3).uniform(5.0, 62.0, 900))


def _table(frfs: FrfSet, order: int = 50) -> PoleTable:
    by_subspace = n4sid_poles(subspace(frfs, order), range(2, order + 1, 2))
    return join_tables([by_subspace, plscf_poles(normal_equations(frfs, order // 2), range(2, order // 2 + 1))])


@pytest.mark.slow
@pytest.mark.parametrize("lines", [_EVEN, _UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
def test_n4sid_is_exact_without_noise(eight_modes: Any, lines: np.ndarray, kind: str) -> None:
    poles, shapes = subspace_poles(subspace(eight_modes.frfs(lines, kind=kind), 16), 16)
    up = np.flatnonzero(poles.imag > 0)
    up = up[np.argsort(np.abs(poles[up]))]
    np.testing.assert_allclose(poles[up], pole_of(eight_modes.freq_hz, eight_modes.damping_ratio), rtol=1e-7)
    np.testing.assert_allclose(np.diag(mac(shapes[:, up], eight_modes.shapes)), 1.0, atol=1e-6)


@pytest.mark.parametrize("lines", [_EVEN, _UNEVEN], ids=["even", "uneven"])
def test_plscf_comes_near_without_noise(eight_modes: Any, lines: np.ndarray) -> None:
    """Not exact at any order: what lies outside the band is no polynomial in z."""
    found = plscf_poles(normal_equations(eight_modes.frfs(lines), 25), [25])
    for pole, shape in zip(pole_of(eight_modes.freq_hz, eight_modes.damping_ratio), eight_modes.shapes.T):
        near = np.argmin(np.abs(found.poles - pole))
        assert abs(found.poles[near] - pole) < 1e-5 * abs(pole)
        assert mac(found.shapes[:, [near]], shape[:, None])[0, 0] > 0.9999


@pytest.mark.slow
def test_all_modes_are_chosen_and_no_other(eight_modes: Any) -> None:
    table = _table(eight_modes.frfs(_EVEN, noise=0.01))
    found = chosen_poles(choose(table), table)
    np.testing.assert_allclose(found.freq_hz, eight_modes.freq_hz, rtol=2e-3)
    np.testing.assert_allclose(np.diag(mac(found.shapes, eight_modes.shapes)), 1.0, atol=0.03)


def test_noise_alone_has_no_modes() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((6, 1, 800)) + 1j * rng.standard_normal((6, 1, 800))
    known = FrfSet(_EVEN[:800], noise, *_dofs(6), "accelerance")
    assert not any(c.chosen for c in choose(_table(known, 60)))


def _dofs(n: int) -> tuple[DofSet, DofSet]:
    dofs = DofSet.parse(f"{i + 1}Z+" for i in range(n))
    return dofs, dofs.select([0])


@pytest.mark.slow
def test_the_choice_can_be_changed(eight_modes: Any) -> None:
    table = _table(eight_modes.frfs(_EVEN, noise=0.01))
    changed = change_choice(choose(table), drop=[13.0, 58.0])
    np.testing.assert_allclose(chosen_poles(changed, table).freq_hz, np.delete(eight_modes.freq_hz, [1, 7]), rtol=2e-3)
    assert next(c for c in changed if abs(c.freq_hz - 13.0) < 0.1).reason == "dropped by the user"
    back = change_choice(changed, take=[13.0])
    assert sum(c.chosen for c in back) == 7
    with pytest.raises(FemtuneError) as caught:
        change_choice(changed, take=[5000.0])
    assert caught.value.code == "identify.no-candidate"


def test_a_rule_can_leave_complex_shapes_out(three_modes: Any) -> None:
    """A mode whose entries turn by 60 degrees is left out, and told with its collinearity."""
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 600))
    turned = FrfSet(
        frfs.freq_hz,
        frfs.values * np.exp(1j * np.array([0.0, 1.0, 2.0]))[:, None, None],
        frfs.responses,
        frfs.references,
        frfs.kind,
    )
    found = choose(_table(turned, 24), Limits(), Rule(collinearity=0.9))
    assert not any(c.chosen for c in found)
    assert any("complex" in c.reason for c in found)


def test_poles_that_wander_are_not_stable(three_modes: Any) -> None:
    poles = pole_of(np.array([10.0, 10.05, 11.0]), np.array([0.01, 0.0104, 0.01]))
    dofs = three_modes.dofs
    table = PoleTable(poles, np.ones((3, 3), complex), np.array([2, 4, 6]), ("N4SID",) * 3, dofs)
    assert stable(table, Limits()).tolist() == [False, True, False]


@pytest.mark.parametrize(("second", "expected"), [(1.0, True), (-1.0, False)])
def test_shapes_at_two_responses_tell_poles_apart(three_modes: Any, second: float, expected: bool) -> None:
    poles = pole_of(np.array([10.0, 10.0]), np.array([0.01, 0.01]))
    shapes = np.array([[1.0, 1.0], [1.0, second]], complex)
    table = PoleTable(poles, shapes, np.array([2, 4]), ("N4SID",) * 2, three_modes.dofs.select([0, 1]))
    assert stable(table, Limits()).tolist() == [False, expected]


@pytest.mark.parametrize("method", [lambda f: subspace(f, 60), lambda f: normal_equations(f, 30)])
def test_too_few_lines_for_the_order(three_modes: Any, method: Callable[[FrfSet], object]) -> None:
    with pytest.raises(FemtuneError) as caught:
        method(three_modes.frfs(np.linspace(5.0, 30.0, 20)))
    assert caught.value.code == "identify.few-lines"


def test_one_channel_only(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 600))
    one = FrfSet(frfs.freq_hz, frfs.values[:1], frfs.responses.select([0]), frfs.references, frfs.kind)
    poles = subspace_poles(subspace(one, 6), 6)[0]
    freq = freq_and_damping(poles[poles.imag > 0])[0]
    np.testing.assert_allclose(np.sort(freq), three_modes.freq_hz, rtol=1e-6)
    table = _table(one, 20)
    np.testing.assert_allclose(chosen_poles(choose(table), table).freq_hz, three_modes.freq_hz, rtol=1e-3)


def test_lines_that_a_channel_lacks_are_left_out(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(0.0, 30.0, 601))
    values = frfs.values.copy()
    values[1, 0, 100:130] = np.nan
    gaps = FrfSet(frfs.freq_hz, values, frfs.responses, frfs.references, frfs.kind)
    poles = subspace_poles(subspace(gaps, 6), 6)[0]
    np.testing.assert_allclose(np.sort(freq_and_damping(poles)[0])[::2], three_modes.freq_hz, rtol=1e-6)
    values[1] = np.nan
    with pytest.raises(FemtuneError) as caught:
        subspace(FrfSet(frfs.freq_hz, values, frfs.responses, frfs.references, frfs.kind), 6)
    assert caught.value.code == "identify.missing-pair"
    assert caught.value.values == {"pairs": "2Z+/1Z+"}


def test_a_band_without_lines(three_modes: Any) -> None:
    frfs = three_modes.frfs(np.linspace(5.0, 30.0, 26))
    assert in_band(frfs, 10.0, 12.0).freq_hz.tolist() == [10.0, 11.0, 12.0]
    with pytest.raises(FemtuneError) as caught:
        in_band(frfs, 40.0, 50.0)
    assert caught.value.code == "identify.band"


def test_tables_of_other_dofs_are_not_joined(three_modes: Any, eight_modes: Any) -> None:
    tables = [_table(known.frfs(_EVEN), 10) for known in (three_modes, eight_modes)]
    with pytest.raises(FemtuneError) as caught:
        join_tables(tables)
    assert caught.value.code == "poles.shape"
