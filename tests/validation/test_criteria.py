"""Criteria: profiles of standards and own ones, verdicts on a whole correlation or on some of its test modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from femtune.correlation import ReducedMass, correlate, reduce_mass
from femtune.dofs import Dof, DofSet
from femtune.modal import ModeSet
from femtune.steps.correlate.facts import correlation_results
from femtune.steps.validate.facts import prediction
from femtune.validation import FrequencyMiss, Outcome, assess, profile


def _case(noise: float = 0.0) -> tuple[ModeSet, ModeSet, ReducedMass]:
    """Twelve unit masses on a line of springs; the test is 2 % low."""
    K = 1e4 * (2.0 * np.eye(12) - np.eye(12, k=1) - np.eye(12, k=-1))
    values, phi = eigh(K)
    dofs = DofSet(Dof(i + 1, "X") for i in range(12))
    model = ModeSet(np.sqrt(values[:5]) / (2 * np.pi), phi[:, :5], dofs, normalisation="mass")
    shapes = 2.5 * model.shapes[:, :4] + noise * np.random.default_rng(0).normal(size=(12, 4))
    test = ModeSet(model.freq_hz[:4] / 1.02, shapes, dofs)
    mass = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(np.eye(12)), np.eye(12), model)
    assert isinstance(mass, ReducedMass)
    return test, model, mass


def test_verdicts_stand_beside_their_limits() -> None:
    test, model, mass = _case()
    verdicts = {(v.criterion.standard, v.criterion.quantity): v for v in assess(correlate(test, model, mass=mass))}
    assert {v.outcome for v in verdicts.values()} == {Outcome.PASS}
    nasa = verdicts["NASA-STD-5002", "frequency error"]
    assert (nasa.criterion.limit, nasa.measured) == (0.05, pytest.approx(0.02))


def test_verdicts_of_a_worse_model() -> None:
    test, model, _ = _case(noise=0.35)
    slow = ModeSet(test.freq_hz * 0.982, test.shapes, test.dofs)
    found = correlate(slow, model)
    verdicts = {(v.criterion.standard, v.criterion.quantity): v for v in assess(found)}
    outcome = {key: v.outcome.value for key, v in verdicts.items()}
    # 1.02/0.982 is 3.9 %: between the limits of 3 % and 5 %
    assert outcome["NASA-STD-5002", "frequency error"] == "pass"
    assert outcome["MIL-STD-1540C", "frequency error"] == "fail"
    assert outcome["NASA-STD-5002", "cross-orthogonality, diagonal"] == "not tested"
    assert found.macs.min() < 0.9
    assert outcome["ECSS-E-ST-32-11C", "MAC"] == "fail"
    assert verdicts["ECSS-E-ST-32-11C", "MAC"].measured == pytest.approx(found.macs.min())


def test_a_mode_without_partner_fails_and_one_left_out_does_not() -> None:
    test, model, _ = _case()
    lonely = ModeSet(np.append(test.freq_hz[:3], 1e4), test.shapes, test.dofs)
    frequency = assess(correlate(lonely, model))[0]
    assert frequency.outcome is Outcome.FAIL
    assert frequency.remark.endswith("test modes without a partner: 4")
    assert assess(correlate(lonely, model, left_out={3: "local"}))[0].outcome is Outcome.PASS


def test_without_pairs_nothing_is_tested() -> None:
    test, model, mass = _case()
    found = correlate(ModeSet(test.freq_hz * 100, test.shapes, test.dofs), model, mass=mass)
    assert {v.outcome for v in assess(found)} == {Outcome.NOT_TESTED}


def test_a_mode_that_the_sensors_do_not_see_fails() -> None:
    test, model, _ = _case()
    shapes = model.shapes.copy()
    shapes[:, 4] = 1e-15 * shapes[:, 0]
    found = correlate(test, ModeSet(model.freq_hz, shapes, model.dofs), fixed=((0, 4),))
    assert next(v for v in assess(found) if v.criterion.quantity == "MAC").outcome is Outcome.FAIL


def _one_dof() -> tuple[ModeSet, ModeSet, ReducedMass]:
    """The lowest mode of a mass and a small one on it, measured at the first mass only; the test shape is arbitrary."""
    K, M = np.array([[1.1e4, -1e3], [-1e3, 1e3]]), np.diag([1.0, 1e-3])
    values, phi = eigh(K, M)
    dofs = DofSet([Dof(1, "X")])
    model = ModeSet(np.sqrt(values) / (2 * np.pi), phi[:1], dofs, normalisation="mass")
    test = ModeSet(model.freq_hz[:1] / 1.02, np.array([[-7.0]]), dofs)
    mass = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), np.eye(2)[:1], model)
    assert isinstance(mass, ReducedMass)
    return test, model, mass


def test_what_one_measured_dof_fulfils_by_itself_is_not_tested() -> None:
    test, model, mass = _one_dof()
    found = correlate(test, model, mass=mass)
    # these numbers are 1 for any test and any model
    assert found.macs == pytest.approx([1.0])
    assert found.cross_orthogonality == pytest.approx(np.ones((1, 1)))
    assert np.isnan(found.comac).all()
    verdicts = {(v.criterion.standard, v.criterion.quantity): v for v in assess(found)}
    tested = [key for key, v in verdicts.items() if v.outcome is not Outcome.NOT_TESTED]
    assert {quantity for _, quantity in tested} == {"frequency error"}
    reasons = {quantity: v.remark for (_, quantity), v in verdicts.items()}
    assert reasons["MAC"] == "with one measured DOF all shapes are proportional, so that the MAC is 1 for any model"
    for quantity in ("cross-orthogonality, diagonal", "cross-orthogonality, off the diagonal"):
        assert reasons[quantity].startswith("with one measured DOF all shapes are proportional")


def test_records_of_one_measured_dof_have_no_mac() -> None:
    test, model, _ = _one_dof()
    found = correlate(test, model)
    record = correlation_results("c", "before", found, "c", {}, [])
    assert [pair.mac for pair in record.pairs] == [None]
    assert record.comac == ()
    assert prediction("c", found, 0, "").mac is None
    # one DOF says nothing of which mode a mode without a partner resembles
    lonely = correlate(ModeSet(test.freq_hz * 3.0, test.shapes, test.dofs), model)
    assert prediction("c", lonely, 0, "").model_number is None
    plain, other, _ = _case()
    twelve = correlation_results("c", "before", correlate(plain, other), "c", {}, [])
    assert [pair.mac for pair in twelve.pairs] == pytest.approx(np.ones(4))


def test_one_entry_of_a_test_shape_has_no_mac_and_the_others_have() -> None:
    test, model, _ = _case(noise=0.1)
    shapes = test.shapes.copy()
    shapes[1:, 0] = np.nan
    found = correlate(ModeSet(test.freq_hz, shapes, test.dofs), model, fixed=((0, 0), (1, 1), (2, 2), (3, 3)))
    assert found.macs[0] == pytest.approx(1.0)
    (verdict,) = assess(found, profile("own", {"MAC": 0.5}).criteria)
    assert verdict.measured == pytest.approx(found.macs[1:].min())
    assert verdict.remark.endswith("; not tested for test modes with one measured DOF: 1")
    (alone,) = assess(found, profile("own", {"MAC": 0.5}).criteria, tests=[0])
    assert alone.outcome is Outcome.NOT_TESTED


def test_comac_needs_two_pairs_at_a_sensor() -> None:
    test, model, mass = _case()
    one = ModeSet(test.freq_hz[:1], test.shapes[:, :1], test.dofs)
    found = correlate(one, model, mass=mass)
    assert np.isnan(found.comac).all()
    # one mode has no off-diagonal terms, while its MAC at twelve DOFs says something
    outcome = {v.criterion.quantity: v.outcome.value for v in assess(found)}
    assert outcome["self-orthogonality of the test, off the diagonal"] == "not tested"
    assert outcome["cross-orthogonality, off the diagonal"] == "not tested"
    assert (outcome["MAC"], outcome["cross-orthogonality, diagonal"]) == ("pass", "pass")
    shapes = test.shapes[:, :2].copy()
    shapes[3, 0] = np.nan
    two = correlate(ModeSet(test.freq_hz[:2], shapes, test.dofs), model)
    assert np.flatnonzero(np.isnan(two.comac)).tolist() == [3]


def test_only_the_chosen_test_modes_count() -> None:
    test, model, mass = _case()
    off = ModeSet(test.freq_hz * np.array([1.0, 1.0, 1.0, 1.12]), test.shapes, test.dofs)
    found = correlate(off, model, mass=mass)
    limits = profile("NASA").criteria
    assert assess(found, limits)[0].outcome is Outcome.FAIL
    assert assess(found, limits, tests=[0, 2])[0].measured == pytest.approx(0.02)
    only = assess(found, limits, tests=[3])
    assert only[0].measured == pytest.approx(1.0 - 1.02 / 1.12)
    # the row of the chosen mode beside the columns of all pairs
    assert only[2].measured == pytest.approx(0.0, abs=1e-9)


def test_numbers_of_the_standards() -> None:
    """METHODS: NASA 5 %, 0.9 and 0.1; MIL 3 % and 0.95; ECSS 5 % and MAC 0.9; self-orthogonality 0.1."""
    limits = {word: [c.limit for c in profile(word).criteria] for word in ("NASA", "MIL", "ECSS")}
    assert limits == {"NASA": [0.05, 0.9, 0.1, 0.1], "MIL": [0.03, 0.95, 0.1], "ECSS": [0.05, 0.9, 0.1]}


def test_own_limits_take_the_place_of_a_profiles() -> None:
    tailored = profile("ECSS", {"frequency error": 0.02})
    assert tailored.name == "ECSS-E-ST-32-11C, tailored"
    assert {c.quantity: (c.standard, c.limit) for c in tailored.criteria}["frequency error"] == ("own criterion", 0.02)
    assert len(tailored.criteria) == 3
    own = profile("own", {"MAC": 0.8})
    assert [(c.quantity, c.limit, c.at_most) for c in own.criteria] == [("MAC", 0.8, False)]


def test_a_miss_is_told_with_what_noise_explains() -> None:
    test, model, _ = _case()
    slow = ModeSet(test.freq_hz / 1.04, test.shapes, test.dofs)
    found = correlate(slow, model)
    misses = [(i, FrequencyMiss(float(e), 0.02, 0.03)) for i, e in enumerate(found.frequency_errors)]
    worst = assess(found, profile("NASA").criteria, misses=misses)[0]
    assert worst.outcome is Outcome.FAIL
    assert "could explain the error of 6.1 % (1.7 σ)" in worst.sentence
    assert worst.sentence.startswith("fail: frequency error 6.08 %, at most 5 % required by NASA-STD-5002; test mode")
    good = assess(found, [replace(c, limit=0.1) for c in profile("NASA").criteria[:1]], misses=misses)[0]
    assert (good.outcome, good.noise) == (Outcome.PASS, "")


def test_a_verdict_that_was_not_reached_says_why() -> None:
    test, model, _ = _case()
    verdict = assess(correlate(test, model), profile("NASA").criteria)[1]
    assert verdict.measured is None
    assert verdict.required == 0.9
    assert verdict.sentence == (
        "not tested: cross-orthogonality, diagonal, at least 0.9 required by NASA-STD-5002: "
        "no mass matrix reduced to the sensors was given"
    )
