"""The whole correlation: orthogonality, COMAC, noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from femtune.correlation import NotTested, ReducedMass, correlate, reduce_mass
from femtune.correlation.noise import noise_share, orthogonality_noise
from femtune.dofs import Dof, DofSet
from femtune.modal import ModeSet, mac


def chain(n: int = 12, *, free: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Unit masses on a line of springs, fixed at both ends or free."""
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    if free:
        K[0, 0] = K[-1, -1] = 1.0
    return 1e4 * K, np.eye(n)


def model_modes(K: np.ndarray, M: np.ndarray, C: np.ndarray, m: int = 5) -> ModeSet:
    lam, phi = eigh(K, M)
    dofs = DofSet(Dof(i + 1, "X") for i in range(len(C)))
    freq = np.sqrt(np.maximum(lam[:m], 0.0)) / (2 * np.pi)
    return ModeSet(freq, C @ phi[:, :m], dofs, normalisation="mass")


def _case(noise: float = 0.0, **changes: object) -> tuple[ModeSet, ModeSet, ReducedMass]:
    K, M = chain()
    C = np.eye(12)
    model = model_modes(K, M, C)
    rng = np.random.default_rng(0)
    shapes = 2.5 * model.shapes[:, :4] + noise * rng.normal(size=(12, 4))
    test = ModeSet(model.freq_hz[:4] / 1.02, shapes, model.dofs, **changes)  # type: ignore[arg-type]
    mass = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), C, model)
    assert isinstance(mass, ReducedMass)
    return test, model, mass


def test_a_model_against_itself() -> None:
    test, model, mass = _case()
    found = correlate(test, model, mass=mass)
    assert found.macs == pytest.approx(np.ones(4))
    assert found.paired_mac == pytest.approx(np.eye(4), abs=1e-9)
    assert found.mac == pytest.approx(np.eye(4, 5), abs=1e-9)
    assert found.auto_mac_test == pytest.approx(np.eye(4), abs=1e-9)
    assert found.auto_mac_model == pytest.approx(np.eye(5), abs=1e-9)
    assert found.frequency_errors == pytest.approx(np.full(4, 0.02))
    assert found.comac == pytest.approx(np.ones(12))
    assert found.cross_orthogonality == pytest.approx(np.eye(4), abs=1e-9)
    assert found.self_orthogonality == pytest.approx(np.eye(4), abs=1e-9)
    assert isinstance(found.noise, NotTested)
    assert not found.notices


def test_no_pairs_is_a_clear_result() -> None:
    test, model, mass = _case()
    found = correlate(ModeSet(test.freq_hz * 100, test.shapes, test.dofs), model, mass=mass)
    assert found.paired_mac.shape == (0, 0)
    assert np.isnan(found.comac).all()
    assert str(found.cross_orthogonality) == "not tested: no modes are paired"


def test_rotated_vectors_enter_orthogonality_and_comac() -> None:
    rng = np.random.default_rng(1)
    phi = np.linalg.qr(rng.normal(size=(9, 3)))[0]
    dofs = DofSet(Dof(i + 1, "Z") for i in range(9))
    model = ModeSet(np.array([5.0, 9.0, 9.0]), phi, dofs)
    turned = np.column_stack([phi[:, 0], phi[:, 1] + phi[:, 2], phi[:, 1] - phi[:, 2]])
    mass = ReducedMass(np.eye(9), np.eye(9), np.zeros(3), model.labels, tuple(range(9)))
    found = correlate(ModeSet(np.array([5.0, 9.0, 9.02]), turned, dofs), model, mass=mass)
    assert found.cross_orthogonality == pytest.approx(np.eye(3), abs=1e-9)
    assert found.paired_mac == pytest.approx(np.eye(3), abs=1e-9)
    assert found.mac[1, 1:] == pytest.approx([0.5, 0.5])
    assert found.comac == pytest.approx(np.ones(9))
    assert found.clusters[0].rotation.angle_deg == pytest.approx(45.0)


def test_an_inverted_sensor_is_named() -> None:
    test, model, _ = _case()
    shapes = test.shapes.copy()
    shapes[4] *= -1
    notices = correlate(ModeSet(test.freq_hz, shapes, test.dofs), model).notices
    assert [n.code for n in notices] == ["correlate.sensor-inverted"]
    # the sensor carries so much of mode 3 that its MAC falls below the gate: three pairs are left
    assert "3 pairs: 5X+;" in notices[0].what


def test_a_sensor_on_a_rigid_body_does_not_hinder_orthogonality() -> None:
    K, M = chain()
    C = np.vstack([np.eye(12), np.eye(12)[1]])
    model = model_modes(K, M, C, 3)
    rng = np.random.default_rng(4)
    test = ModeSet(model.freq_hz, model.shapes + 0.01 * rng.normal(size=(13, 3)), model.dofs)
    mass = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), C, model)
    assert isinstance(mass, ReducedMass)
    found = correlate(test, model, mass=mass)
    assert len(found.orthogonality_dropped) == 1
    assert found.orthogonality_dropped[0] in ("2X+", "13X+")
    kept = [i for i in range(13) if f"{i + 1}X+" not in found.orthogonality_dropped]
    part = model_modes(K, M, C[kept], 3)
    alone = correlate(
        ModeSet(test.freq_hz, test.shapes[kept], part.dofs),
        part,
        mass=reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), C[kept], part),
    )
    assert alone.orthogonality_dropped == ()
    assert found.cross_orthogonality == pytest.approx(alone.cross_orthogonality)
    assert found.self_orthogonality == pytest.approx(alone.self_orthogonality)
    assert np.diag(found.cross_orthogonality).min() > 0.9


def test_gaps_make_orthogonality_untestable() -> None:
    test, model, mass = _case()
    shapes = test.shapes.copy()
    shapes[0, 0] = np.nan
    found = correlate(ModeSet(test.freq_hz, shapes, test.dofs), model, mass=mass)
    assert "not measured" in str(found.cross_orthogonality)
    assert found.macs == pytest.approx(np.ones(4))


def test_an_inaccurate_reduction_is_no_judge() -> None:
    K, M = chain()
    C = np.eye(12)[[3, 8]]
    model = model_modes(K, M, C, m=2)
    mass = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), C, model)
    assert isinstance(mass, ReducedMass)
    found = correlate(model, model, mass=mass)
    assert isinstance(found.cross_orthogonality, NotTested)
    assert "frequency error of the reduced model" in found.cross_orthogonality.reason


def test_a_mode_that_the_reduction_loses_is_named_without_a_number() -> None:
    test, model, mass = _case()
    assert isinstance(mass, ReducedMass)
    errors = mass.frequency_error.copy()
    errors[1] = np.nan
    found = correlate(test, model, mass=replace(mass, frequency_error=errors)).cross_orthogonality
    assert isinstance(found, NotTested)
    assert "nan" not in found.reason
    assert "frequency error of the reduced model" not in found.reason
    assert f"the reduced model has no mode with the shape of mode {mass.labels[1]}" in found.reason
    errors[2] = 0.12
    both = str(correlate(test, model, mass=replace(mass, frequency_error=errors)).cross_orthogonality)
    assert f"mode {mass.labels[2]} (+12.0 %), and the reduced model has no mode" in both


def test_invisible_model_modes_are_undefined_not_an_error() -> None:
    test, model, _ = _case()
    shapes = model.shapes.copy()
    shapes[:, 4] = 0.0
    found = correlate(test, ModeSet(model.freq_hz, shapes, model.dofs))
    assert np.isnan(found.mac[:, 4]).all()
    assert found.pairing.unpaired_model == (4,)


@pytest.mark.slow
def test_noise_predicts_the_mean_loss() -> None:
    rng = np.random.default_rng(2)
    shape = rng.normal(size=15)
    sd = 0.1 * np.abs(rng.normal(size=15))
    losses = [1 - mac(shape[:, None], (shape + sd * rng.normal(size=15))[:, None])[0, 0] for _ in range(4000)]
    share = noise_share(1 - float(np.mean(losses)), shape, sd)
    assert share.expected == pytest.approx(np.mean(losses), rel=0.03)
    assert share.explains
    # the limit is the mean plus two standard deviations: few of the losses lie beyond
    assert 0.01 < np.mean(np.array(losses) > share.limit) < 0.08


def test_a_real_difference_is_not_noise() -> None:
    test, model, _ = _case(shapes_sd=np.full((12, 4), 0.01))
    wrong = ModeSet(model.freq_hz, model.shapes + 0.2 * model.shapes[:, [1, 2, 3, 4, 0]], model.dofs)
    found = correlate(test, wrong)
    assert isinstance(found.noise, tuple)
    assert not any(share.explains for share in found.noise)
    same = correlate(test, model)
    assert isinstance(same.noise, tuple)
    assert all(share.explains for share in same.noise)


def test_an_invisible_mode_fixed_by_hand_has_no_mac() -> None:
    test, model, mass = _case()
    shapes = model.shapes.copy()
    shapes[:, 4] = 1e-15 * shapes[:, 0]
    found = correlate(test, ModeSet(model.freq_hz, shapes, model.dofs), mass=mass, fixed=((0, 4),))
    assert np.isnan(found.pairing.pairs[0].mac)
    assert np.isnan(found.paired_mac[0, 0])
    assert found.comac == pytest.approx(np.ones(12))
    assert "are zero at the sensors" in str(found.cross_orthogonality)


def test_what_scatter_gives_off_the_diagonals_of_orthogonality() -> None:
    test, model, mass = _case()
    rng = np.random.default_rng(5)
    sd = 0.05 * rng.uniform(0.5, 2.0, size=test.shapes.shape)
    draws = []
    for _ in range(4000):
        psi = test.shapes + sd * rng.normal(size=sd.shape)
        unit = psi / np.sqrt(np.einsum("ni,nm,mi->i", psi, mass.mass, psi))
        draws.append((unit.T @ mass.mass @ model.shapes[:, :4], unit.T @ mass.mass @ unit))
    cross, own = orthogonality_noise(test.shapes, model.shapes[:, :4], sd, mass.mass)
    off = ~np.eye(4, dtype=bool)
    for predicted, drawn in ((cross, [d[0] for d in draws]), (own, [d[1] for d in draws])):
        # 4000 draws tell a standard deviation within 1.1 %
        assert predicted[off] == pytest.approx(np.std(drawn, axis=0)[off], rel=0.06)
    losses = 1.0 - np.abs([np.diag(d[0]) for d in draws])
    assert np.diag(cross) == pytest.approx(losses.mean(axis=0), rel=0.06)
    spread = correlate(replace(test, shapes_sd=sd), model, mass=mass)
    assert spread.orthogonality_sd == pytest.approx(cross, rel=1e-6)
    assert isinstance(correlate(test, model, mass=mass).orthogonality_sd, NotTested)
