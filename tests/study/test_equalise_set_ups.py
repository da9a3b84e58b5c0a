"""[equalise] with what is known of the set-up: exponential window, suspension, rigid-body motion, a fixed order."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.deck_models import model_of

import femtune as ft
from femtune.errors import FemtuneError, Notice
from femtune.model import damping_by_mode, solve_modes
from femtune.model.response import frf, make_ports
from femtune.residuals import state_at
from femtune.study.study import load_study

from ..messages.shown import check_shown
from .cantilever import CANTILEVER, EI, TRUE, Bench, bounded

ZETA = (0.004, 0.03, 0.02, 0.008, 0.012, 0.02, *([0.01] * 14))
LINES = np.arange(5.0, 240.0, 0.25)
TRUTH = {"root": 1.3, "tip": 0.85}
TAU = 0.4
"""Of the window: 1.2 times the damping of the first mode is added to the first, 5 % of it to the second."""
FREE = CANTILEVER.replace("SPC = 1\n", "").replace("SPC1    1       123456  1\n", "")
SUSPENDED = FREE.replace("ENDDATA", "CELAS2  71      4000.   1       2\nCELAS2  72      4000.   5       2\nENDDATA")
"""On springs: it moves at about 4 and 7 Hz as a rigid body, and bends first at 189 Hz."""
OUTPUTS = ["2Y+", "3Y+", "4Y+", "5Y+"]


def measure(
    bench: Bench, noise: float = 0.002, tau: float | None = None, deck: str = CANTILEVER, kind: str = "accelerance",
    lines: NDArray = LINES, changes: tuple[tuple[str, str], ...] = TRUE,
) -> None:  # fmt: skip
    """FRFs of the true beam in a record with an exponential window, with noise of each value and of a floor.

    That a window moves iω to iω + 1/τ is shown with a record in tests/model/response/test_decay.py.
    """
    model = model_of(bench.truth(changes, deck))
    ports = make_ports(model, ["5Y+"], OUTPUTS)
    modes, decay = solve_modes(model.at(np.zeros(0)), 20), 1.0 / tau if tau else 0.0
    exact = frf(modes, ports, lines, kind, damping=damping_by_mode(ZETA), decay=decay)  # type: ignore[arg-type]
    chance = np.random.default_rng(4).standard_normal((2, *exact.values.shape))
    size = noise * (np.abs(exact.values) + 0.1 * np.abs(exact.values).max(axis=2, keepdims=True))
    bench.functions(replace(exact, values=exact.values + size * (chance[0] + 1j * chance[1])))


def study(
    bench: Bench, keys: str = "", more: str = "", *, deck: str = CANTILEVER, test: str = "frfs.uff", residual: str = ""
) -> Path:
    bench.write("beam.bdf", deck)
    table = f"[equalise]\ndamping = 0.02\nlargest_order = 16\n{keys}\n" if keys is not None else ""
    return bench.study(f'{EI}\n[[residual]]\nkind = "frf"\n{residual}\n{table}{more}', test=test)


def described(bench: Bench, tau: float) -> None:
    bench.write("test.toml", f'[identify]\nfrfs = "frfs.uff"\nexponential_s = {tau}\n')


def error(p: Any) -> float:
    """Of an updated parameter, in its standard deviations."""
    assert p.sd is not None
    return float(abs(p.value - TRUTH[p.name]) / p.sd)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "accelerance"])
def test_parameters_and_damping_are_those_of_the_structure_only_if_the_window_is_known(bench: Bench, kind: str) -> None:
    measure(bench, tau=TAU, kind=kind)
    for key in (f"exponential_s = {TAU}", ""):
        results = ft.update(study(bench, key)).results
        assert results.update is not None
        assert results.update.ok
        assert results.update.raw is not None
        errors = [error(p) for p in results.update.parameters]
        (mapped,) = results.mapped_damping
        first, third = (m.measured_percent for m in mapped.modes if m.mac is not None)
        codes = {a.code for a in results.alerts}
        if key:
            assert max(errors) < 3.5
            assert (first, third) == pytest.approx((0.4, 2.0), rel=0.02)
            assert "update.raw-misfit" not in codes
        else:
            assert max(errors) > 4.0
            # 1/(2πfτ) is added
            assert (first, third) == pytest.approx((0.4 + 1.263, 2.0 + 0.196), rel=0.02)
        assert ("residual.frf-window" in codes) is bool(key)


@pytest.mark.slow
@pytest.mark.parametrize("reduction", ["", "[reduction]\n"])
def test_exact_functions_with_a_window_give_exact_parameters(bench: Bench, reduction: str) -> None:
    measure(bench, 0.0, TAU)
    update = ft.update(study(bench, f"exponential_s = {TAU}", reduction)).results.update
    assert update is not None
    assert (update.reduction is not None) is bool(reduction)
    for p in update.parameters:
        assert p.value == pytest.approx(TRUTH[p.name], rel=1e-5)


@pytest.mark.slow
def test_functions_that_are_held_out_are_compared_with_the_window(bench: Bench) -> None:
    measure(bench, 0.0, TAU)
    results = ft.run(study(bench, f"exponential_s = {TAU}", '[[hold_out]]\noutputs = ["3Y+"]\n')).results
    assert results.validation is not None
    (held,) = results.validation.frfs
    assert held.output == "3Y+"
    assert held.frac > 1.0 - 1e-6
    assert held.max_db < 0.01


@pytest.mark.slow
def test_the_worst_fit_is_judged_with_the_window(bench: Bench) -> None:
    measure(bench, tau=TAU)
    (exact,) = [study(bench, f"exponential_s = {TAU}", '[[hold_out]]\nworst = 1\nby = "fit"\n')]
    (notice,) = [n for n in load_study(exact).notices if n.code == "study.worst-held"]
    # all functions have the same noise, of 0.2 % and more where they are small
    assert notice.facts["first"] < 0.01


@pytest.mark.slow
def test_a_described_test_has_its_window_and_a_contradiction_is_refused(bench: Bench) -> None:
    measure(bench, tau=TAU)
    described(bench, TAU)
    for path in (study(bench, test="test.toml"), study(bench, f"exponential_s = {TAU}", test="test.toml")):
        (case,) = load_study(path).cases
        assert case.test is not None
        assert case.test.exponential_s == TAU
    with pytest.raises(FemtuneError) as caught:
        load_study(study(bench, "exponential_s = 0.5", test="test.toml"))
    assert "residual.window-differs" in str(caught.value)
    facts = {"configuration": "baseline", "stated": 0.5, "of_test": 0.4}
    check_shown("residual.window-differs", FemtuneError("residual.window-differs", **facts))


@pytest.mark.slow
def test_functions_of_a_described_test_are_compared_with_its_window_without_equal_damping_too(bench: Bench) -> None:
    measure(bench, 0.0, TAU)
    described(bench, TAU)
    bench.write("beam.bdf", CANTILEVER)
    table = f'[[residual]]\nkind = "frf"\ncount = 20\nratios = {list(ZETA)}\n'
    for test, exactly in (("test.toml", True), ("frfs.uff", False)):
        update = ft.update(bench.study(f"{EI}\n{table}", test=test)).results.update
        assert update is not None
        largest = max(abs(p.value / TRUTH[p.name] - 1.0) for p in update.parameters)
        assert (largest < 1e-6) is exactly


def test_aligned_lines_have_no_window(bench: Bench) -> None:
    measure(bench, tau=TAU)
    described(bench, TAU)
    bench.uff(bench.measure(bench.truth(), *OUTPUTS))
    path = study(bench, f"exponential_s = {TAU}", residual='around = "resonances"\naligned = true')
    path.write_text(path.read_text("utf-8").replace('"frfs.uff"', '["frfs.uff", "beam.uff"]'), "utf-8")
    with pytest.raises(FemtuneError) as caught:
        load_study(path)
    assert "residual.window-aligned" in str(caught.value)
    check_shown("residual.window-aligned", FemtuneError("residual.window-aligned", configuration="baseline"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "accelerance"])
def test_rigid_body_motion_of_a_model_with_another_mass(bench: Bench, kind: str) -> None:
    """The end mass is 30 % larger than in the deck: what is left of the motion is fitted."""
    heavier = ("CONM2   9       5               2.0", "CONM2   9       5               2.6")
    measure(bench, deck=FREE, kind=kind, lines=np.arange(30.0, 700.0, 0.5), changes=(*TRUE, heavier))
    path = study(bench, "rigid_body = true", bounded("mass", "CONM2 9 M"), deck=FREE)
    update = ft.update(path).results.update
    assert update is not None
    assert update.ok
    assert update.raw is not None
    truth = {**TRUTH, "mass": 1.3}
    for p in update.parameters:
        assert p.sd is not None
        assert abs(p.value - truth[p.name]) < 3.5 * p.sd
    assert {v.parameter: v.equalised for v in update.raw.values} == pytest.approx(truth, rel=1e-3)


@pytest.mark.slow
def test_a_structure_that_is_held_has_no_rigid_body_motion(bench: Bench) -> None:
    measure(bench)
    held = study(bench, "rigid_body = true")
    with pytest.raises(FemtuneError) as caught:
        ft.update(held)
    assert "residual.rigid-body" in str(caught.value)
    check_shown("residual.rigid-body", FemtuneError("residual.rigid-body", configuration="baseline"))
    told = FemtuneError("residual.rigid-body/channels", configuration="baseline", names="12X+, 12Y+")
    check_shown("residual.rigid-body, channels", told)


@pytest.mark.slow
def test_lines_below_the_suspension_are_not_compared(bench: Bench) -> None:
    measure(bench)
    found = load_study(study(bench, "suspension_hz = 50.0"))
    (case,) = found.cases
    assert case.compared is not None
    (residual,) = case.compared.residuals
    residual.blocks(state_at(case.compared, np.zeros(2)), False)
    settled = residual.settled
    assert settled.measured.freq_hz[0] > 50.0
    # the mode at 31 Hz is fitted, and none of the structure
    np.testing.assert_allclose(settled.identified.modes.freq_hz, [203.4], rtol=1e-3)
    fit = settled.identified.fit
    assert np.abs(np.abs(fit.poles[~fit.outside]) / (2.0 * np.pi) - 31.5).min() < 0.1


@pytest.mark.slow
def test_a_free_model_of_a_structure_on_soft_springs(bench: Bench) -> None:
    measure(bench, deck=SUSPENDED, lines=np.arange(3.0, 700.0, 0.5))
    sd = []
    for key in ("suspension_hz = 15.0", ""):
        results = ft.update(study(bench, key, deck=FREE)).results
        assert results.update is not None
        # the springs raise the first bending mode, by a part of (4 Hz/189 Hz)²
        assert {p.name: p.value for p in results.update.parameters} == pytest.approx(TRUTH, rel=1e-3)
        sd.append([p.sd for p in results.update.parameters])
        # motions on the springs are no modes of the test that the model lacks
        assert ("update.mode-not-in-model" in {a.code for a in results.alerts}) is not bool(key)
    # functions near these motions differ from those of the model, and all errors grow with them
    assert np.all(np.array(sd[1]) > 4.0 * np.array(sd[0]))


@pytest.mark.slow
def test_a_fixed_order(bench: Bench) -> None:
    measure(bench)
    results = ft.update(study(bench, "order = 4")).results
    assert results.update is not None
    assert results.update.ok
    assert max(error(p) for p in results.update.parameters) < 3.5


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ("suspension_hz = 300.0\nband_hz = [5.0, 240.0]", "study.value"),
        ("order = 7", "multiple of 2"),
        ("exponential_s = 0.0", "exponential_s"),
        ("order = 300", "order"),
    ],
)
def test_values_that_cannot_be(bench: Bench, keys: str, says: str) -> None:
    measure(bench)
    with pytest.raises(FemtuneError) as caught:
        load_study(study(bench, keys))
    assert says in str(caught.value)


def test_what_is_said_of_set_ups(bench: Bench) -> None:
    check_shown(
        "residual.frf-window", Notice("residual.frf-window", level="info", configuration="baseline", seconds=0.4)
    )
    measure(bench)
    with pytest.raises(FemtuneError) as caught:
        load_study(study(bench, "suspension_hz = 300.0\nband_hz = [5.0, 240.0]"))
    check_shown("study.value, suspension", FemtuneError("study.value/suspension"))
    assert "suspension_hz" in str(caught.value)


def two_tests(bench: Bench, noise: float = 0.002) -> Path:
    """Accelerances from 20 Hz in one file, and those of a second test from 3 to 40 Hz in another."""
    measure(bench, noise, lines=np.arange(3.0, 40.0, 0.2))
    (bench.folder / "frfs.uff").rename(bench.folder / "low.uff")
    measure(bench, noise, lines=np.arange(20.0, 240.0, 0.25))
    path = study(bench, residual="from_hz = 20.0")
    path.write_text(path.read_text("utf-8").replace('"frfs.uff"', '["frfs.uff", "low.uff"]'), "utf-8")
    return path


def test_low_frequencies_of_a_second_test(bench: Bench) -> None:
    found = load_study(two_tests(bench))
    (case,) = found.cases
    assert case.test is not None
    assert case.test.frfs is not None
    complete = np.isfinite(case.test.frfs.values).all(axis=(0, 1))
    expected = np.concatenate([np.arange(3.0, 20.0 - 1e-9, 0.2), np.arange(20.0, 240.0, 0.25)])
    np.testing.assert_allclose(case.test.frfs.freq_hz[complete], expected, rtol=1e-9)
    (notice,) = [n for n in found.notices if n.code == "test.joined-frfs"]
    assert "185 lines from 3 to 39.8 Hz" in notice.what
    sets = "880 lines from 20 to 239.75 Hz, 185 lines from 3 to 39.8 Hz"
    check_shown("test.joined-frfs", Notice("test.joined-frfs", level="info", sets=sets, lines=965))


@pytest.mark.slow
def test_parameters_of_two_tests(bench: Bench) -> None:
    results = ft.update(two_tests(bench)).results
    assert results.update is not None
    assert results.update.ok
    assert results.update.raw is not None
    assert max(error(p) for p in results.update.parameters) < 3.5
