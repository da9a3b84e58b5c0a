"""Named reductions: what theory says is exact, and listings of commercial Nastran."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, ModelPoint, configure, parametric_model
from femtune.model.eigen import pairs
from femtune.model.reduce import (
    Component,
    couple,
    craig_bampton,
    deck_masters,
    dynamic,
    guyan,
    irs,
    serep,
)
from femtune.model.reduce.condensation import Partition, fixed_interface_modes_up_to, slaves_factor
from femtune.parameters import ParameterSet

Pair = tuple[np.ndarray, np.ndarray]


def chain(n: int = 12, loose: bool = False) -> Pair:
    """Masses on a line with springs, the first one held by a spring unless loose."""
    random = np.random.default_rng(0)
    springs, masses = random.uniform(1.0, 3.0, n), random.uniform(0.5, 2.0, n)
    k = np.diag(springs + np.append(springs[1:], 0.0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    if loose:
        k[0, 0] -= springs[0]
    m = np.diag(masses) + 0.1 * (np.eye(n, k=1) + np.eye(n, k=-1))
    return k, m


@pytest.fixture(scope="module")
def pair() -> Pair:
    return chain()


MASTERS = [2, 5, 11]


@pytest.mark.parametrize("convert", [np.asarray, sp.csr_array])
def test_guyan_is_exact_for_static_loads_on_the_masters(pair: Pair, convert: object) -> None:
    k, m = pair
    found = guyan(convert(k), convert(m), MASTERS)  # type: ignore[operator]
    load = np.array([1.0, -2.0, 0.5])
    whole = np.zeros(len(k))
    whole[MASTERS] = load
    np.testing.assert_allclose(found.transformation @ la.solve(found.stiffness, load), la.solve(k, whole), rtol=1e-12)


def test_dynamic_reduction_is_exact_at_its_frequency(pair: Pair) -> None:
    k, m = pair
    freq = 0.11
    square = (2 * np.pi * freq) ** 2
    found = dynamic(k, m, MASTERS, freq)
    load = np.zeros(len(k))
    load[MASTERS] = [1.0, 3.0, -1.0]
    q = la.solve(found.stiffness - square * found.mass, load[MASTERS])
    np.testing.assert_allclose(found.transformation @ q, la.solve(k - square * m, load), rtol=1e-11)
    assert not np.allclose(guyan(k, m, MASTERS).mass, found.mass)


def test_serep_keeps_its_modes_exactly(pair: Pair) -> None:
    k, m = pair
    values, shapes = la.eigh(k, m)
    for kept in ([0, 1, 2], [0, 2, 7]):
        found = serep(k, m, MASTERS, shapes[:, kept])
        again, vectors = la.eigh(found.stiffness, found.mass)
        np.testing.assert_allclose(again, values[kept], rtol=1e-10)
        turned = found.transformation @ vectors
        np.testing.assert_allclose(np.abs(turned.T @ m @ shapes[:, kept]), np.eye(3), atol=1e-9)


def test_irs_lies_between_guyan_and_the_truth_and_iterates_to_it(pair: Pair) -> None:
    k, m = pair
    truth = la.eigvalsh(k, m)[:3]
    error = [
        np.abs(la.eigvalsh(r.stiffness, r.mass)[:3] / truth - 1.0)
        for r in (guyan(k, m, MASTERS), irs(k, m, MASTERS), irs(k, m, MASTERS, 60))
    ]
    assert error[0][0] > 1e-4
    assert (error[1][:2] < 0.5 * error[0][:2]).all()
    assert error[2].max() < 1e-8


def test_irs_transformation_is_the_published_formula(pair: Pair) -> None:
    k, m = pair
    a, o = np.array(MASTERS), np.setdiff1d(np.arange(len(k)), MASTERS)
    ts = np.eye(len(k))[:, a]
    ts[o] = -la.solve(k[np.ix_(o, o)], k[np.ix_(o, a)])
    flexibility = np.zeros_like(k)
    flexibility[np.ix_(o, o)] = la.inv(k[np.ix_(o, o)])
    expected = ts + flexibility @ m @ ts @ la.solve(ts.T @ m @ ts, ts.T @ k @ ts)
    np.testing.assert_allclose(irs(k, m, MASTERS).transformation, expected, rtol=1e-11, atol=1e-12)


def test_craig_bampton_with_all_modes_is_exact_and_without_any_is_guyan(pair: Pair) -> None:
    k, m = pair
    whole = craig_bampton(k, m, MASTERS, 99)
    assert whole.transformation.shape == (12, 12)
    np.testing.assert_allclose(la.eigvalsh(whole.stiffness, whole.mass), la.eigvalsh(k, m), rtol=1e-10)
    some = craig_bampton(k, m, MASTERS, 2)
    np.testing.assert_allclose(some.stiffness[:3, 3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(some.mass[3:, 3:], np.eye(2), atol=1e-12)
    np.testing.assert_allclose(craig_bampton(k, m, MASTERS, 0).mass, guyan(k, m, MASTERS).mass, rtol=1e-12)


@pytest.mark.parametrize("modes", [3, 5, 8, 9])
@pytest.mark.parametrize("dense_up_to", [0, 400])
def test_fixed_interface_modes_are_those_of_scipy(
    pair: Pair, modes: int, dense_up_to: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By every way of the eigen-solver, and all modes up to a frequency."""
    monkeypatch.setattr(pairs, "DENSE_UP_TO", dense_up_to)
    k, m = pair
    slaves = np.setdiff1d(np.arange(12), MASTERS)
    values = la.eigvalsh(k[np.ix_(slaves, slaves)], m[np.ix_(slaves, slaves)])
    found = craig_bampton(k, m, MASTERS, modes)
    np.testing.assert_allclose(np.diag(found.stiffness)[3:], values[:modes], rtol=1e-9)
    parts = Partition.of(k, m, MASTERS)
    between = 0.5 * (np.sqrt(values[modes - 1]) + np.sqrt([*values, 1.1 * values[-1]][modes])) / (2.0 * np.pi)
    assert fixed_interface_modes_up_to(parts, slaves_factor(parts), between).shape == (9, modes)


def test_components_with_all_modes_joined_are_the_whole() -> None:
    k, m = chain(9)
    cut = 5
    left, right = slice(0, cut + 1), slice(cut, 9)
    # the right part is loose: what the left one has at the cut belongs to it
    k2, m2 = k[right, right].copy(), m[right, right].copy()
    k1, m1 = k[left, left].copy(), m[left, left].copy()
    k2[0, 0], m2[0, 0] = -k[cut, cut + 1], 0.4 * m[cut, cut]
    k1[cut, cut] -= k2[0, 0]
    m1[cut, cut] -= m2[0, 0]
    parts = [Component(craig_bampton(k1, m1, [cut], 99), ["cut"]), Component(craig_bampton(k2, m2, [0], 99), ["cut"])]
    joined = couple(parts)
    values, q = la.eigh(joined.stiffness, joined.mass)
    truth, shapes = la.eigh(k, m)
    np.testing.assert_allclose(values, truth, rtol=1e-10)
    both = np.vstack([joined.shapes(parts[0], 0, q[:, :2]), joined.shapes(parts[1], 1, q[:, :2])[1:]])
    np.testing.assert_allclose(np.abs(shapes[:, :2].T @ m @ both), np.eye(2), atol=1e-9)


def test_reductions_refuse_what_they_cannot_do() -> None:
    k, m = chain(loose=True)
    with pytest.raises(FemtuneError, match="not a set"):
        guyan(k, m, [1, 1])
    with pytest.raises(FemtuneError, match="not a set"):
        guyan(k, m, [12])
    two = la.block_diag(k, k)
    with pytest.raises(FemtuneError, match="slave DOFs"):
        guyan(two, la.block_diag(m, m), [0])
    shapes = la.eigh(k, m)[1]
    with pytest.raises(FemtuneError, match="cannot be distinguished"):
        serep(k, m, MASTERS, shapes[:, :4])
    with pytest.raises(FemtuneError, match="names are given"):
        couple([Component(guyan(k, m, MASTERS), ["one"])])


def _cantilever(shared_data: Path, name: str) -> ModelPoint:
    path = shared_data / "nastran_decks/cantilever_bar_reduction/no_super" / name
    structure = build_structure(read_deck(path)).structure
    return configure(parametric_model(structure, ParameterSet(()), []), Configuration()).at(np.zeros(0))


def _hz(k: np.ndarray, m: np.ndarray) -> np.ndarray:
    return np.sqrt(la.eigvalsh(k, m)) / (2 * np.pi)


def test_guyan_of_the_listed_cantilever(shared_data: Path) -> None:
    point = _cantilever(shared_data, "guyanReduction.dat")
    masters = deck_masters(point.configured)
    assert [str(point.configured.free_dof(int(i))) for i in masters] == ["6Y+", "6RZ+"]
    found = guyan(point.stiffness, point.mass, masters)
    np.testing.assert_allclose(_hz(found.stiffness, found.mass), [359.0738, 2934.100], rtol=3e-7)


def test_component_modes_of_the_listed_dynamic_reduction(shared_data: Path) -> None:
    """ASET with three modal points (QSET): the listing is Craig-Bampton with three fixed-interface modes."""
    point = _cantilever(shared_data, "guyanReduction.dat")
    found = craig_bampton(point.stiffness, point.mass, deck_masters(point.configured), 3)
    np.testing.assert_allclose(np.diag(found.stiffness)[2:], [7.518384e7, 2.711212e9, 3.150545e9], rtol=3e-7)
    listed = [349.7303, 2168.717, 6015.472, 11974.12, 29336.18]
    np.testing.assert_allclose(_hz(found.stiffness, found.mass), listed, rtol=3e-7)


LISTED_COMPONENTS = {
    0: [359.0738, 2934.100],
    1: [349.7555, 2182.490, 6733.634, 18222.00],
    2: [349.7299, 2168.126, 6011.365, 11851.45, 21809.58, 48160.41],
    3: [349.7289, 2167.436, 6008.068, 11670.88, 19073.61, 28653.90, 43490.38, 104304.1],
}


@pytest.mark.slow
@pytest.mark.parametrize("modes", [0, 1, 2, 3])
def test_superelements_of_the_listed_cantilever(shared_data: Path, tmp_path: Path, modes: int) -> None:
    folder = shared_data / "nastran_decks/cantilever_bar_reduction"
    parts = []
    for name, case in (("cantileverBar1.dat", ""), ("cantileverBar2.dat", "SPC = 1\n")):
        deck = tmp_path / name
        deck.write_text(f"SOL 103\nCEND\n{case}BEGIN BULK\n{(folder / name).read_text()}\nENDDATA\n")
        structure = build_structure(read_deck(deck)).structure
        point = configure(parametric_model(structure, ParameterSet(()), []), Configuration()).at(np.zeros(0))
        joint = [i for i in range(point.configured.n_free) if point.configured.free_dof(i).node == 6]
        names = [str(point.configured.free_dof(i)) for i in joint]
        parts.append(Component(craig_bampton(point.stiffness, point.mass, joint, modes), names))
    joined = couple(parts)
    assert joined.names == ("6Y+", "6RZ+")
    np.testing.assert_allclose(_hz(joined.stiffness, joined.mass), LISTED_COMPONENTS[modes], rtol=4e-7)
