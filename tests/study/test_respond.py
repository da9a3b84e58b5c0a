"""Responses through the whole chain, from decks and studies to records: closed forms, measured functions, journal."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.deck_models import model_of
from tests.reporting.packed import unpacked

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff, write_uff_frfs
from femtune.modal import FrfSet, as_kind
from femtune.model import constant_damping, solve_modes
from femtune.model.response import ACCURACY, frf, make_ports
from femtune.steps.report.view import view_of
from femtune.steps.report_source import ReportSource
from femtune.steps.respond.record import ResponseResults
from femtune.testdata import ModalTest
from femtune.units import SI

from .cantilever import CANTILEVER, EI, Bench

OSCILLATOR = """SOL 111
CEND
BEGIN BULK
SPOINT  1
CELAS2  1       1000.   1       0                       .05
CMASS2  2       2.5     1       0
CDAMP2  3       4.      1       0
ENDDATA
"""
WAYS = ("real modes", "complex modes", "direct")


def _respond(path: Path, **options: Any) -> tuple[ResponseResults, NDArray[np.float64], NDArray[np.complex128]]:
    """The only record of a deck or study, its lines and values."""
    found = ft.respond(path, **options)
    return found[0], found.frfs.freq_hz, found.frfs.values


@pytest.mark.quick(0)
@pytest.mark.parametrize("method", WAYS)
@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
def test_one_mass(bench: Bench, method: str, kind: str) -> None:
    deck = bench.write("one.bdf", OSCILLATOR)
    found, lines, values = _respond(
        deck, inputs=("1S+",), from_hz=0.5, to_hz=10.0, step_hz=0.1, method=method, kind=kind
    )
    s = 2j * np.pi * lines
    exact = s ** ("receptance", "mobility", "accelerance").index(kind) / (1000.0 * (1 + 0.05j) + 4 * s + 2.5 * s**2)
    assert len(lines) == 96
    np.testing.assert_allclose(values[0, 0], exact, rtol=1e-10)
    assert found.frfs is not None
    assert found.frfs.damping == "loss factors of the deck, dashpots of the deck"
    assert found.frfs.unit == ""
    if method != "complex modes":
        assert not found.poles
        assert found.poles_reason
        return
    (pole,) = found.poles
    root = np.roots([2.5, 4.0, 1000.0 * (1 + 0.05j)])
    upper = root[root.imag > 0][0]
    assert pole.freq_hz == pytest.approx(abs(upper) / (2 * np.pi), rel=1e-10)
    assert pole.damping_ratio == pytest.approx(-upper.real / abs(upper), rel=1e-9)
    assert pole.real_freq_hz == pytest.approx(np.sqrt(400.0) / (2 * np.pi), rel=1e-10)


@pytest.mark.slow
def test_ratios_in_place_of_what_the_deck_damps(bench: Bench) -> None:
    deck = bench.write("one.bdf", OSCILLATOR)
    asked = {"inputs": ("1S+",), "from_hz": 1.0, "to_hz": 6.0, "lines": 30, "damping": "modal", "kind": "receptance"}
    omega = np.sqrt(400.0)
    for method in WAYS:
        found, lines, values = _respond(deck, ratio=0.02, method=method, **asked)
        s = 2j * np.pi * lines
        np.testing.assert_allclose(values[0, 0], 1 / (1000.0 + 2.5 * 0.04 * omega * s + 2.5 * s**2), rtol=1e-10)
        assert not found.alerts
        assert not found.poles
        assert found.poles_reason == "with modal damping, they are identical to the real modes"
    found, lines, values = _respond(deck, **asked)
    np.testing.assert_allclose(values[0, 0], 1 / (1000.0 - 2.5 * (2 * np.pi * lines) ** 2), rtol=1e-9)
    assert [a.code for a in found.alerts] == ["response.undamped"]
    assert not found.poles
    both, _, _ = _respond(deck, **{**asked, "damping": "deck", "ratios": (0.02,)})
    assert both.frfs is not None
    assert both.frfs.damping.endswith("dashpots of the deck, modal damping ratio 0.02")


_PAIR = "SOL 103\nCEND\nBEGIN BULK\nGRID,2,,0.,0.,0.,,23456\nGRID,3,,1.,0.,0.,,23456\nCELAS2,1,800.,2,1\n"
_PAIR += "CELAS2,2,500.,2,1,3,1\nCMASS2,3,2.,2,1\nCMASS2,4,3.,3,1\n"


@pytest.mark.quick(0)
@pytest.mark.parametrize(("dashpots", "coupled"), [((8.0, 5.0), False), ((8.0, 0.0), True), ((8.0, 4.9), True)])
def test_complex_modes_where_damping_couples_the_real_ones(
    bench: Bench, dashpots: tuple[float, float], coupled: bool
) -> None:
    """C = K/100, or not: the real modes are 5.4 and 1.4 Hz; the direct way lists no complex modes."""
    cards = f"CDAMP2,5,{dashpots[0]},2,1\nCDAMP2,6,{dashpots[1]},2,1,3,1\nENDDATA\n"
    deck = bench.write("pair.bdf", _PAIR + cards)
    asked: dict[str, Any] = {"inputs": ("2X+",), "from_hz": 1.0, "to_hz": 9.0, "lines": 9}
    found, _, _ = _respond(deck, **asked)
    assert len(found.poles) == (2 if coupled else 0)
    assert ("proportional" in found.poles_reason) is not coupled
    assert not _respond(deck, method="direct", **asked)[0].poles
    assert len(_respond(deck, method="complex modes", **asked)[0].poles) == 2


def test_shapes_of_complex_modes_travel_on_the_page(bench: Bench) -> None:
    """(λ²M + λC + K)φ = 0 of what the page holds: 16 bits of each part."""
    deck = bench.write("pair.bdf", _PAIR + "CDAMP2,5,8.0,2,1\nENDDATA\n")
    made = ft.respond(deck, inputs=("2X+",), from_hz=1.0, to_hz=9.0, lines=9)
    (scene,) = view_of(ReportSource(made.results, made.arrays)).scenes
    stage = scene.stages[-1]
    assert stage.motion_imaginary is not None
    shapes = (unpacked(stage.motion) + 1j * unpacked(stage.motion_imaginary))[:, 0]
    K, C, M = np.array([[1300.0, -500.0], [-500.0, 500.0]]), np.diag([8.0, 0.0]), np.diag([2.0, 3.0])
    for pole, shape in zip(made.results.responses[0].poles, shapes.T):
        at = 2 * np.pi * pole.freq_hz * (-pole.damping_ratio + 1j * np.sqrt(1 - pole.damping_ratio**2))
        assert np.linalg.norm((at**2 * M + at * C + K) @ shape) < 1e-4 * np.linalg.norm(K @ shape)
        # the real part is as large as it can be
        assert abs(np.imag(np.sum(shape**2))) < 1e-4 * np.sum(np.abs(shape) ** 2)
        assert np.abs(shape.imag).max() > 1e-3 * np.abs(shape).max()


class _Told:
    def __init__(self) -> None:
        self.steps: list[tuple[str, int, int | None]] = []

    def step(self, text: str, done: int, total: int | None) -> None:
        self.steps.append((text, done, total))


def test_the_direct_way_tells_its_lines(bench: Bench) -> None:
    told = _Told()
    asked = {"inputs": ("1S+",), "from_hz": 1.0, "to_hz": 9.0, "lines": 3, "method": "direct"}
    ft.respond(bench.write("one.bdf", OSCILLATOR), progress=told, **asked)
    lines = [(done, total) for text, done, total in told.steps if text.endswith("before: frequency lines, directly")]
    assert lines == [(1, 3), (2, 3), (3, 3)]


def test_a_free_beam_beside_its_closed_form(bench: Bench) -> None:
    """Driving-point receptance of the end of a free-free Euler beam with a loss factor.

    Bishop and Johnson: (cos λl sinh λl − sin λl cosh λl)/(EI λ³ (cos λl cosh λl − 1)), λ⁴ = ω² ρA/EI.
    """
    n, length = 24, 1.2
    cards = ["PBAR,1,1,1.-3,2.-7,5.-7,4.-7", "MAT1,1,2.1+11,,.3,7850.,,,0.02", "SPC1,1,1246,1,THRU,25", "ENDDATA"]
    grids = [f"GRID,{i + 1},,{length * i / n:.9f},0.,0." for i in range(n + 1)]
    bars = [f"CBAR,{i + 1},1,{i + 1},{i + 2},0.,1.,0." for i in range(n)]
    text = ["SOL 111", "CEND", "SPC = 1", "BEGIN BULK", "PARAM,COUPMASS,1", *grids, *bars, *cards]
    deck = bench.write("free.bdf", "\n".join(text) + "\n")
    found, lines, values = _respond(
        deck, inputs=("1Z+",), outputs=("25Z+", "1Z+"), from_hz=20.0, to_hz=400.0, step_hz=10.0, kind="receptance",
        method="complex modes",
    )  # fmt: skip
    ei = 2.1e11 * (1 + 0.02j) * 5e-7
    wave = ((2 * np.pi * lines) ** 2 * 7.85 / ei) ** 0.25
    x = wave * length
    below = ei * wave**3 * (np.cos(x) * np.cosh(x) - 1)
    same = -(np.cos(x) * np.sinh(x) - np.sin(x) * np.cosh(x)) / below
    far = (np.sin(x) - np.sinh(x)) / below
    for computed, exact in ((values[1, 0], same), (values[0, 0], far)):
        np.testing.assert_allclose(computed, exact, atol=2e-3 * np.abs(exact).max())
    assert found.frfs is not None
    assert [p.driving_point for p in found.frfs.pairs] == [False, True]
    assert [p.kind for p in found.poles[:2]] == ["rigid", "rigid"]


def _functions(deck: Path, outputs: list[str], inputs: list[str], lines: NDArray) -> FrfSet:
    """What a test of a deck with 1 % damping measures."""
    configured = model_of(deck)
    modes = solve_modes(configured.at(np.zeros(0)), 20)
    ports = make_ports(configured, inputs, outputs)
    return frf(modes, ports, lines, "accelerance", "real-modes", damping=constant_damping(0.01))


def _with_functions(bench: Bench, frfs: FrfSet) -> ModalTest:
    """A file with the modes of the true beam and these functions."""
    test = bench.measure(bench.truth())
    assert test.modes is not None
    damped = replace(test.modes, damping_ratio=np.full(len(test.modes), 0.01))
    test = replace(test, modes=damped, frfs=frfs)
    modes = bench.uff(test).read_text()
    functions = write_uff_frfs(bench.folder / "frfs-only.uff", test).read_text()
    (bench.folder / "beam.uff").write_text(modes + functions[functions.index("    -1\n    58\n") :])
    return test


RESPONSE = '\n[response]\nratio = 0.01\n[[load]]\nname = "tip"\nforces = { "5Z-" = 100.0 }\noutputs = ["5Z+", "3Y+"]\n'


@pytest.fixture
def measured(bench: Bench) -> tuple[Bench, FrfSet]:
    """The cantilever with modes and functions of its true form; 1 is held, and 4RY is no DOF of the modes."""
    frfs = _functions(bench.truth(), ["5Z+", "3Y-", "4RY+"], ["5Z+", "4Y+"], np.arange(0.0, 300.0, 2.0))
    _with_functions(bench, frfs)
    return bench, frfs


@pytest.mark.slow
def test_functions_of_the_test_are_beside_the_model(measured: tuple[Bench, FrfSet]) -> None:
    bench, frfs = measured
    result = ft.respond(bench.study(EI + RESPONSE), kind="mobility")
    (found,), arrays = result, result.arrays
    record = found.frfs
    assert record is not None
    assert (record.outputs, record.inputs) == (("5Z+", "3Y-", "4RY+"), ("5Z+", "4Y+"))
    assert record.unit == "m/s/N"
    assert [a.code for a in found.alerts] == ["response.zero-line"]
    np.testing.assert_array_equal(arrays[record.freq_key], frfs.freq_hz[1:])
    assert record.test_values_key is not None
    test = arrays[record.test_values_key]
    assert np.isnan(test[:, :, 0]).all()
    wanted = as_kind(frfs, "mobility").values[:, :, 1:]
    np.testing.assert_allclose(test[:, :, 1:], wanted, atol=1e-9 * np.abs(wanted).max())


def test_grid_points_find_the_sensors_on_them_with_their_sign(measured: tuple[Bench, FrfSet]) -> None:
    bench, frfs = measured
    options = {"outputs": ("2Z+", "3Y+"), "inputs": ("4Y-",), "from_hz": 10.0, "to_hz": 100.0, "step_hz": 2.0}
    result = ft.respond(bench.study(EI + RESPONSE), **options)
    (found,), arrays = result, result.arrays
    assert found.frfs is not None
    assert found.frfs.test_values_key is not None
    test = arrays[found.frfs.test_values_key]
    assert np.isnan(test[0]).all()
    np.testing.assert_allclose(test[1, 0], frfs.values[1, 1], atol=1e-9 * np.abs(frfs.values[1, 1]).max())


@pytest.mark.slow
def test_the_fdac_of_a_stiffer_deck_shows_its_frequency_shift(bench: Bench) -> None:
    """E of the true beam is 0.81 times that of the deck: the model's frequencies are 1/0.9 of the test's."""
    softer = bench.truth((("2.1+11 ", "1.701+11"),))
    lines = np.arange(4.0, 500.0, 1.0)
    frfs = _functions(softer, ["5Z+", "3Z+", "4Z+", "2Z+"], ["5Z+"], lines)
    bench.uff(replace(bench.measure(softer), frfs=frfs))
    write_uff_frfs(bench.folder / "beam.uff", replace(bench.measure(softer), frfs=frfs))
    study = bench.study("[response]\nratio = 0.01\nfrom_hz = 4.0\nto_hz = 550.0\nstep_hz = 1.0\n")
    result = ft.respond(study, report=bench.folder / "page.html")
    record = result[0].frfs
    assert record is not None
    (found,) = record.fdac
    assert (found.axis, found.dof, found.functions) == ("input", "5Z+", 4)
    assert found.shift_percent == pytest.approx(100.0 * (1.0 / 0.9 - 1.0), abs=0.1)
    assert found.mean_shifted is not None
    assert found.mean is not None
    assert found.mean_shifted > 0.98
    assert found.mean < 0.98
    values = result.arrays[found.values_key]
    assert values.shape == (len(result.arrays[found.test_freq_key]), len(result.arrays[found.model_freq_key]))
    assert max(values.shape) <= 400
    page = (bench.folder / "page.html").read_text()
    assert "Frequency domain assurance criterion" in page
    assert "FDAC, input 5Z+" in page


@pytest.mark.slow
def test_a_run_ends_on_the_measured_functions(measured: tuple[Bench, FrfSet]) -> None:
    bench, frfs = measured
    study = bench.study(EI + RESPONSE)
    run = ft.run(study)
    before, after = run.results.responses
    assert (before.stage, after.stage) == ("before", "after as written")
    assert before.frfs is not None
    assert after.frfs is not None
    pair = {(p.output, p.input): k for k, p in enumerate(after.frfs.pairs)}["3Y-", "4Y+"]
    first, last = before.frfs.pairs[pair].frac, after.frfs.pairs[pair].frac
    assert first is not None
    assert last is not None
    assert first < 0.9
    assert last > 0.999
    values = run.arrays[after.frfs.values_key]
    assert np.abs(values - frfs.values[:, :, 1:]).max() < 1e-3 * np.abs(frfs.values).max()
    # the identified modes of the test with the residues of its functions, around these modes
    assert after.frfs.identified_freq_key is not None
    lines, identified = (run.arrays[str(k)] for k in (after.frfs.identified_freq_key, after.frfs.identified_values_key))
    at = np.isin(frfs.freq_hz, lines)
    assert at.sum() == len(lines) > 50
    assert np.abs(identified - frfs.values[:, :, at]).max() < 0.02 * np.abs(frfs.values).max()
    (shown,) = view_of(ReportSource(run.results, run.arrays)).functions
    assert [c.look for c in shown.curves] == ["test", "identified", "before", "after"]
    written = read_uff(bench.folder / "run" / "frfs.uff", units=SI).test.frfs
    assert written is not None
    np.testing.assert_allclose(written.values, values, atol=1e-11 * np.abs(values).max())
    lines = (bench.folder / "run" / "frfs.uff").read_text().splitlines()
    about = lines[lines.index("    58") + 1 :][:5]
    assert about[2:4] == ["after as written", tomllib.loads(study.read_text())["study"]["title"]]
    assert about[4].startswith("configuration ")
    assert "Responses" in (bench.folder / "run" / "report.html").read_text()
    again = ft.run(study)
    assert again.results.journal is not None
    assert again.results.journal.solved == 0
    counts = {k.kind: k.recalled for k in again.results.journal.kinds}
    assert (counts["frf"], counts["static"], counts.get("poles")) == (2, 2, None)
    np.testing.assert_array_equal(again.arrays[after.frfs.values_key], values)
    other = study.read_text().replace("ratio = 0.01", "ratio = 0.02")
    study.write_text(other)
    changed = ft.respond(study)
    assert changed.records != (before,)
    assert tuple(map(str, changed.remarks)) == ("2 of 3 solutions from the journal of an earlier run",)


def test_a_tip_load(bench: Bench) -> None:
    """FL³/3EI with the stiffness of both halves alike, minus the deck's sign conventions."""
    (found,) = ft.respond(bench.study(RESPONSE.replace("[response]\nratio = 0.01\n", ""), test=None))
    assert found.frfs is None
    (load,) = found.loads
    moved = {d.output: d.value for d in load.displacements}
    assert moved["5Z+"] == pytest.approx(-100.0 / (3 * 2.1e11 * 5e-7), rel=1e-9)
    assert abs(moved["3Y+"]) < 1e-15
    assert load.forces == ("5Z- 100",)


def test_a_combination_is_a_sensor(bench: Bench) -> None:
    """The mean of two points by a pair of forces: a quarter of the sum of four functions."""
    terms = ", ".join(f'{{ node = {node}, component = "Z", factor = 0.5 }}' for node in (3, 5))
    mean = f'[[sensor]]\nname = "901Z+"\nterms = [{terms}]\n'
    lines = {"from_hz": 10.0, "to_hz": 90.0, "lines": 9, "method": "direct"}
    study = bench.study(mean + "\n[response]\nratio = 0.01\n", test=None)
    _, _, four = _respond(study, inputs=("3Z+", "5Z+"), outputs=("3Z+", "5Z+"), **lines)
    found, _, one = _respond(study, inputs=("901Z+",), outputs=("901Z-",), **lines)
    np.testing.assert_allclose(one[0, 0], -four.sum(axis=(0, 1)) / 4, rtol=1e-9)
    assert found.frfs is not None
    assert found.frfs.pairs[0].driving_point


def test_a_universal_file_of_each_configuration(bench: Bench) -> None:
    states = '[[configuration]]\nname = "a"\n[[configuration]]\nname = "b"\nmasses = [{ node = 5, mass = 1.0 }]\n'
    asked = '[response]\ninputs = ["5Z+"]\nfrom_hz = 1.0\nto_hz = 50.0\nstep_hz = 1.0\nratio = 0.02\n'
    study = bench.study(states + asked, test=None)
    found = ft.respond(study, uff=bench.folder / "out.uff")
    assert [r.configuration for r in found] == ["a", "b"]
    sets = [read_uff(bench.folder / f"out_{i}.uff", units=SI).test.frfs for i in (1, 2)]
    assert all(s is not None and s.responses == DofSet.parse(["5Z+"]) for s in sets)
    assert sets[0] is not None
    assert sets[1] is not None
    assert not np.allclose(sets[0].values, sets[1].values)


@pytest.mark.parametrize("method", ["real modes", "complex modes"])
@pytest.mark.slow
def test_the_default_is_as_exact_as_the_direct_way(bench: Bench, method: str) -> None:
    """Simulated FRFs are measured FRFs of an update: a systematic error moves its parameters."""
    asked: dict[str, Any] = {
        "inputs": ("5Z+", "3Z+"), "outputs": ("2Z+", "4Z+", "5Z+"), "from_hz": 5.0, "to_hz": 100.0, "lines": 96,
        "ratio": 0.01,
    }  # fmt: skip
    deck = bench.write("deck.bdf", CANTILEVER)
    _, _, exact = _respond(deck, method="direct", **asked)
    found, _, values = _respond(deck, method=method, **asked)
    size = np.maximum(np.abs(exact), 0.01 * np.abs(exact).max(axis=2, keepdims=True))
    assert (np.abs(values - exact) / size).max() <= ACCURACY
    assert found.frfs is not None
    assert found.frfs.truncation_error is not None
    assert found.frfs.truncation_error <= ACCURACY
    assert not found.alerts


@pytest.mark.quick(1)
@pytest.mark.parametrize(("limit", "said"), [({"modes": 1}, "modes = 1"), ({"max_hz": 30.0}, "max_hz = 30"),
                                              ({"residual_vectors": False}, "residual_vectors = false")])  # fmt: skip
def test_a_limit_of_the_modes_is_told_with_its_error(bench: Bench, limit: dict[str, Any], said: str) -> None:
    asked: dict[str, Any] = {"inputs": ("5Z+",), "from_hz": 5.0, "to_hz": 200.0, "lines": 40, "ratio": 0.01}
    found, _, values = _respond(bench.write("deck.bdf", CANTILEVER), **asked, **limit)
    assert [alert.code for alert in found.alerts] == ["response.truncated"]
    assert said in found.alerts[0].sentence
    _, _, exact = _respond(bench.folder / "deck.bdf", method="direct", **asked)
    size = np.maximum(np.abs(exact), 0.01 * np.abs(exact).max(axis=2, keepdims=True))
    assert found.frfs is not None
    assert found.frfs.truncation_error is not None
    assert 0.0 < found.frfs.truncation_error <= (np.abs(values - exact) / size).max() * 1.001


@pytest.mark.slow
def test_noise_of_a_simulated_test_has_the_stated_deviation(bench: Bench) -> None:
    """Real and imaginary part apart, with a part of the magnitude and of the largest one; 6 × 400 values of each."""
    deck = bench.write("deck.bdf", CANTILEVER)
    asked: dict[str, Any] = {
        "inputs": ("5Z+",), "outputs": ("2Z+", "3Z+", "4Z+", "5Z+", "2RY+", "5RY+"), "from_hz": 5.0, "to_hz": 400.0,
        "lines": 400, "ratio": 0.01, "units": "m-kg-s",
    }  # fmt: skip

    def written(**more: Any) -> NDArray[np.complex128]:
        result = ft.respond(deck, uff=bench.folder / "frfs.uff", **asked, **more)
        frfs = read_uff(bench.folder / "frfs.uff", units=SI).test.frfs
        assert frfs is not None
        assert np.abs(result.frfs.values - exact).max() <= 1e-11 * np.abs(exact).max()
        return frfs.values

    exact = ft.respond(deck, **asked).frfs.values
    np.testing.assert_allclose(written(), exact, atol=1e-11 * np.abs(exact).max())
    found = written(scatter=0.03, floor=0.001, seed=7)
    size = np.abs(exact)
    sd = np.sqrt((0.03 * size) ** 2 + (0.001 * size.max(axis=2, keepdims=True)) ** 2)
    for part in ((found - exact).real / sd, (found - exact).imag / sd):
        # χ² of 2400 values: 2400 ± 5 standard deviations of 69
        assert abs(float((part**2).sum()) - 2400.0) < 5 * 69.3
        assert abs(float(part.sum())) < 5 * 49.0
    np.testing.assert_array_equal(found, written(scatter=0.03, floor=0.001, seed=7))
    assert np.abs(found - written(scatter=0.03, floor=0.001, seed=8)).max() > 0.0


@pytest.mark.parametrize(
    "noise", [{"scatter": -0.1}, {"floor": float("nan")}, {"seed": -1}, {"scatter": 0.1, "uff": None}]
)
def test_noise_that_is_none(bench: Bench, noise: dict[str, Any]) -> None:
    deck = bench.write("deck.bdf", CANTILEVER)
    asked: dict[str, Any] = {"inputs": ("5Z+",), "from_hz": 1.0, "to_hz": 2.0, "lines": 2, "units": "m-kg-s"}
    with pytest.raises(FemtuneError) as caught:
        ft.respond(deck, **{"uff": bench.folder / "frfs.uff", **asked, **noise})
    assert caught.value.code == "response.noise"
