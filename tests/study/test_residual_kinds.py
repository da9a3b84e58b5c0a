"""[[residual]] tables through whole runs: every kind finds the true beam, with its record and its row in the report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.deck_models import model_of

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.deviations import deviations_text
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.modal import ModeSet
from femtune.model.response import make_ports, static_response
from femtune.steps.run.result import RunResult
from femtune.testdata import ModalTest

from .cantilever import CANTILEVER, EI, Bench, modes_of_deck

LOAD = "forces = { '5Y+' = 100.0, '5Z+' = 30.0 }"
SEEN = ("2Y+", "3Y+", "5Y+")


def displacements(deck: Path, labels: tuple[str, ...] = SEEN) -> NDArray:
    """Of the true beam under the load, past everything that a study does."""
    model = model_of(deck)
    found = static_response(model.at(np.zeros(0)), make_ports(model, ["5Y+", "5Z+"], labels)).values
    return np.asarray(found @ [100.0, 30.0])


def measured_table(deck: Path) -> str:
    values = ", ".join(f"'{label}' = {value:.12g}" for label, value in zip(SEEN, displacements(deck)))
    return f"displacements = {{ {values} }}"


GAUGES = "".join(
    f'[[sensor]]\nname = "{50 + i}X+"\nterms = [{{ node = {i + 1}, component = "RZ", factor = 4.0 }}, '
    f'{{ node = {i}, component = "RZ", factor = -4.0 }}]\n'
    for i in (2, 3, 4)
)
OF_MODES = {
    "frequency": 'kind = "frequency"\nform = "eigenvalue"\nsd = 0.01',
    "frequency by covariance": 'kind = "frequency"\ncovariance = '
    + str([[0.02 * (1 + (i == j)) for j in range(4)] for i in range(4)]),
    "shape": 'kind = "shape"\nscaling = "scale-factor"\nsd = 0.01\nsensors = ["2Y+", "3Y+", "5Y+"]\nmodes = ["1", "3"]',
    "mass-normalised shape": 'kind = "shape"\nscaling = "mass"\nsd = 0.01\nmass_scaled = true',
    "flexibility": 'kind = "flexibility"\nsd = 0.01\npart = "diagonal"\nmass_scaled = true',
    "dynamic": 'kind = "dynamic"\nsd = 100.0',
    "MAC": 'kind = "mac"\nsd = 0.01\nform = "difference"',
}


def run(bench: Bench, tail: str, test: str | None = "beam.uff") -> RunResult:
    return ft.run(bench.study(EI + tail, test=test))


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_MODES)
def test_kinds_of_modes(name: str, beam: Bench):
    # shapes know the ratio of the two stiffnesses only
    more = "" if name != "MAC" and "shape" not in name else '[[residual]]\nkind = "frequency"\nsd = 0.01\n'
    update = run(beam, f"[[residual]]\n{OF_MODES[name]}\n{more}").results.update
    assert update is not None
    assert update.ok
    assert [p.value for p in update.parameters] == pytest.approx([1.3, 0.85], rel=2e-3)
    kind = name.split(" ", maxsplit=1)[0] if "shape" not in name else "shape"
    (record,) = [k for k in update.residual_counts if k.kind == kind]
    assert record.rms_after is not None
    assert record.rms_before is not None
    assert record.rms_after < 0.02 * record.rms_before


PLAIN = "MAT1    1       2.1+11          0.3     7850."
DAMPED = f"{PLAIN:<64}0.01"
LOSS = """
[[parameter]]
name = "eta"
fields = ["MAT1 1 GE"]
lower = 0.2
upper = 5.0
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "tail"), [("complex-eigenvalue", ""), ("damping", ""), ("complex-eigenvalue", "[reduction]\n")]
)
def test_kinds_of_poles(kind: str, tail: str, bench: Bench):
    """A loss factor η of the whole beam: λ = iω√(1 + iη) for every mode; the deck has η = 0.01, the beam 0.03."""
    bench.write("beam.bdf", CANTILEVER.replace(PLAIN, DAMPED))
    test = bench.measure(bench.truth())
    assert test.modes is not None
    poles = 2j * np.pi * test.modes.freq_hz * np.sqrt(1.0 + 0.03j)
    freq, ratio = np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles)
    bench.uff(replace(test, modes=replace(test.modes, freq_hz=freq, damping_ratio=ratio)))
    more = "" if kind == "complex-eigenvalue" else '[[residual]]\nkind = "frequency"\nsd = 0.001\n'
    found = run(bench, f'{LOSS}[[residual]]\nkind = "{kind}"\nsd = 0.01\n{more}{tail}')
    update = found.results.update
    assert update is not None
    assert update.ok
    values = {p.name: p.value for p in update.parameters}
    # a frequency residual compares |λ| with ω: η adds (1 + η²)^¼ to the measured one
    assert values == pytest.approx({"root": 1.3, "tip": 0.85, "eta": 3.0}, rel=1e-5 if not more else 1e-3)
    label = {"complex-eigenvalue": "complex eigenvalue", "damping": "damping ratio"}[kind]
    (record,) = [k for k in update.residual_counts if k.kind == label]
    assert record.count == (8 if not more else 4)
    assert [p.label for p in update.poles] == list(test.modes.labels)
    for p, hz, zeta in zip(update.poles, freq, ratio):
        assert (p.measured_hz, p.measured_ratio) == pytest.approx((hz, zeta), rel=1e-5)
        assert p.after_hz == pytest.approx(hz, rel=1e-3)
        assert p.after_ratio == pytest.approx(zeta, rel=1e-3)
        # the deck has a third of the loss factor
        assert p.before_ratio == pytest.approx(zeta / 3.0, rel=1e-3)
    assert found.report is not None
    html = found.report.read_text(encoding="utf-8")
    assert label in html
    assert "Poles of test and damped model" in html
    assert found.results.validation is not None
    told = [s for s in found.results.validation.not_tested if "damping" in s or "forced response" in s]
    assert told == ["forced response: no measured FRFs were compared with those of the model"]


@pytest.mark.slow
@pytest.mark.parametrize("weights", ['sd = "test"', 'covariance = "test"'])
def test_poles_weighted_by_the_file_of_the_identification(weights: str, bench: Bench):
    """A mode whose damping ratio is wrong by a tenth, with a standard deviation to match, does not matter."""
    bench.write("beam.bdf", CANTILEVER.replace(PLAIN, DAMPED))
    test = bench.measure(bench.truth())
    assert test.modes is not None
    poles = 2j * np.pi * test.modes.freq_hz * np.sqrt(1.0 + 0.03j)
    freq, ratio = np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles)
    sd = np.array([1e-6, 1e-6, 1e-6, 0.1]) * ratio
    freq_sd = 1e-6 * freq
    spread = np.concatenate([freq_sd, sd])
    covariance = (0.9 * np.eye(8) + 0.1) * np.outer(spread, spread)
    measured = replace(test.modes, freq_hz=freq, damping_ratio=ratio * [1.0, 1.0, 1.0, 1.1])
    bench.uff(replace(test, modes=measured))
    text = deviations_text(replace(measured, freq_sd_hz=freq_sd, damping_sd=sd, covariance=covariance))
    assert text is not None
    bench.write("deviations.json", text)
    tail = f'{LOSS}[test]\nfile = "beam.uff"\ndeviations = "deviations.json"\n'
    update = run(bench, f'{tail}[[residual]]\nkind = "complex-eigenvalue"\n{weights}\n', test=None).results.update
    assert update is not None
    assert update.ok
    assert {p.name: p.value for p in update.parameters} == pytest.approx(
        {"root": 1.3, "tip": 0.85, "eta": 3.0}, rel=1e-4
    )


@pytest.mark.slow
def test_a_study_without_any_mode(bench: Bench):
    """Static displacements, forces and a weighed mass: nothing is paired, and the run ends with its deck and report."""
    truth = bench.truth()
    tail = (
        f'[[residual]]\nkind = "static-displacement"\nname = "bench"\n{LOAD}\n{measured_table(truth)}\nsd = 0.01\n'
        '[[residual]]\nkind = "mass"\nmass = 9.9\nsd = 0.02\n'
        '[[residual]]\nkind = "centre-of-gravity"\nx = 0.6\nsd = 0.01\n'
        '[[residual]]\nkind = "inertia"\nizz = 4.7\nsd = 0.1\n'
    )
    found = run(bench, tail, None)
    update = found.results.update
    assert update is not None
    assert update.ok
    assert [p.value for p in update.parameters] == pytest.approx([1.3, 0.85], rel=1e-6)
    kinds = {k.kind: k.count for k in update.residual_counts}
    assert kinds == {"static displacement": 3, "mass": 1, "centre of gravity": 1, "inertia": 1}
    # 7.85 kg of beam and 2 kg at its end: centre at (7.85/2 + 2)/9.85 m
    by_kind = {k.kind: k for k in update.residual_counts}
    assert by_kind["mass"].rms_after == pytest.approx((9.9 - 9.85) / 9.9 / 0.02, rel=1e-6)
    assert by_kind["centre of gravity"].rms_after == pytest.approx(abs(5.925 / 9.85 - 0.6) / 0.01, rel=1e-6)
    assert (found.folder / "updated" / "beam.bdf").is_file() or list(found.folder.rglob("*.bdf"))
    assert found.report is not None
    html = found.report.read_text(encoding="utf-8")
    assert "Residuals by kind" in html
    assert "no modes; static displacement, mass, centre of gravity and inertia" in html
    assert "All residuals" in html
    (pull,) = [c for c in update.comparisons if c.kind == "static displacement"]
    # three displacements beside the largest: the stiffer root is 1.3, the softer tip 0.85 times the deck's
    start = displacements(bench.folder / "beam.bdf")
    true = displacements(truth)
    rms = 100.0 * np.sqrt(np.mean((start - true) ** 2)) / np.abs(true).max()
    assert pull.error_before_percent == pytest.approx(rms, rel=1e-6)
    assert (pull.configuration, pull.label, pull.count) == ("baseline", "bench", 3)
    assert "weighted mean error" in html
    assert "Traceback" not in html


@pytest.mark.slow
def test_a_model_without_mass(bench: Bench):
    """It has no modes, and a static test needs none."""
    text = CANTILEVER.replace("7850.", "").replace("CONM2   9       5               2.0\n", "")
    assert "CONM2" not in text
    bench.write("beam.bdf", text)
    truth = bench.truth(text=text)
    table = f'[[residual]]\nkind = "static-displacement"\nname = "b"\n{LOAD}\n{measured_table(truth)}\nsd = 0.01\n'
    found = run(bench, table, None).results
    assert found.update is not None
    assert [p.value for p in found.update.parameters] == pytest.approx([1.3, 0.85], rel=1e-6)
    assert found.modes == ()


@pytest.mark.slow
def test_forces_that_measured_displacements_need(bench: Bench):
    truth = bench.truth()
    table = f'[[residual]]\nkind = "static-force"\nname = "bench"\n{LOAD}\n{measured_table(truth)}\nsd = 1.0\n'
    update = run(bench, table, None).results.update
    assert update is not None
    assert [p.value for p in update.parameters] == pytest.approx([1.3, 0.85], rel=1e-6)


@pytest.mark.slow
def test_strain_shapes(bench: Bench):
    """Gauges that see the curvature of three spans beside the displacement sensors of the same modes."""
    labels = ("2Y+", "3Y+", "4Y+", "5Y+", "2Z+", "3Z+", "4Z+", "5Z+")
    truth = bench.truth()
    test = bench.measure(truth, *labels)
    bench.uff(with_gauges(truth, test))
    tail = f'{GAUGES}[[residual]]\nkind = "strain"\nsensors = ["52X+", "53X+", "54X+"]\nmodes = ["1", "3"]\nsd = 0.01\n'
    tail += '[[residual]]\nkind = "frequency"\nsd = 0.01\n'
    update = run(bench, tail).results.update
    assert update is not None
    assert [p.value for p in update.parameters] == pytest.approx([1.3, 0.85], rel=1e-3)
    assert {k.kind: k.count for k in update.residual_counts} == {"strain": 6, "frequency": 4}


def with_gauges(truth: Path, test: ModalTest) -> ModalTest:
    """The test with the strains of three gauges among its shapes."""
    structure = build_structure(read_deck(truth)).structure
    freq, shapes = modes_of_deck(truth, 4)
    at = [structure.nodes.dof(i, 6) for i in (2, 3, 4, 5)]
    strains = 4.0 * np.diff(shapes[at], axis=0)
    modes = test.modes
    assert modes is not None
    dofs = DofSet.parse([*map(str, modes.dofs), "52X+", "53X+", "54X+"])
    both = ModeSet(freq[:4], np.vstack([modes.shapes, strains[:, :4]]), dofs, normalisation="mass")
    return replace(test, modes=both)


@pytest.mark.slow
def test_modes_that_nothing_compares_are_named(beam: Bench):
    found = run(beam, '[[residual]]\nkind = "mass"\nmass = 9.85\nsd = 0.01\n' + FREQUENCIES_BY_RULE)
    assert not [a for a in found.results.alerts if a.code == "residual.modes-unused"]
    table = f'[[residual]]\nkind = "static-force"\nname = "b"\n{LOAD}\n{measured_table(beam.truth())}\nsd = 1.0\n'
    silent = run(beam, table)
    (told,) = [a.sentence for a in silent.results.alerts if a.code == "residual.modes-unused"]
    assert told.startswith("baseline: ")
    # they are still compared with the updated model
    last = next(c for c in silent.results.correlations if c.stage == "after")
    assert max(abs(p.freq_error_percent) for p in last.pairs) < 1e-3


FREQUENCIES_BY_RULE = "[residuals]\nfrequency_sd = 0.01\n"

BAD = {
    "modes without a test": ('kind = "shape"\nsd = 0.1', None, "study.no-test", "has no test with modes"),
    "shapes of unknown scale": (
        'kind = "flexibility"\nsd = 0.1', "unscaled.uff", "residual.not-mass-scaled", "requires mass-normalised"),
    "an unknown mode": ('kind = "mac"\nsd = 0.1\nmodes = ["9"]', "beam.uff", "study.unknown-mode", "has no mode '9'"),
    "an unknown sensor": (
        'kind = "shape"\nsd = 0.1\nsensors = ["77Z+"]', "beam.uff", "dof.missing", "have no DOF 77Z+"),
    "a covariance of another size": (
        'kind = "frequency"\ncovariance = [[1.0]]', "beam.uff", "residual.weights", "for 1 values, but 4"),
    "an indefinite covariance": (
        'kind = "shape"\nsensors = ["2Y+", "3Y+"]\ncovariance = [[1.0, 2.0], [2.0, 1.0]]',
        "beam.uff", "residual.covariance", "smallest eigenvalue"),
    "a variance of zero": (
        'kind = "shape"\nsensors = ["2Y+", "3Y+"]\ncovariance = [[1.0, 0.0], [0.0, 0.0]]',
        "beam.uff", "residual.zero-variance", "variance of value 2"),
    "no scatter in the test": (
        'kind = "frequency"\nsd = "test"', "beam.uff", "residual.no-scatter", "does not give standard dev"),
    "no covariance in the test": (
        'kind = "frequency"\ncovariance = "test"', "beam.uff", "residual.no-scatter", "does not give standard dev"),
    "no damping ratios in the test": (
        'kind = "damping"\nsd = 0.1', "beam.uff", "residual.no-damping", "have no damping ratios"),
    "no scatter of damping ratios": (
        'kind = "damping"\nsd = "test"', "damped.uff", "residual.no-scatter", "frequencies and damping ratios"),
    "no covariance of poles": (
        'kind = "complex-eigenvalue"\ncovariance = "test"', "damped.uff", "residual.no-scatter", "and damping ratios"),
    "a covariance of frequencies alone": (
        'kind = "complex-eigenvalue"\ncovariance = [[1.0]]', "damped.uff", "residual.weights", "for 1 values, but 8"),
    "both weights of a pole": (
        'kind = "damping"\nsd = 0.1\ncovariance = [[1.0]]', "damped.uff", "residual.weights", "sd"),
    "a load on a support": (
        "kind = 'static-force'\nname = 'p'\nforces = { '1Y+' = 1.0 }\ndisplacements = { '5Y+' = 1.0 }\nsd = 1.0",
        None, "response.held-port", "is constrained"),
    "a load on nothing": (
        "kind = 'static-force'\nname = 'p'\nforces = { '99Y+' = 1.0 }\ndisplacements = { '5Y+' = 1.0 }\nsd = 1.0",
        None, "model.unknown-node", "99"),
    "forces of zero": (
        "kind = 'static-force'\nname = 'p'\nforces = { '5Y+' = 0.0 }\ndisplacements = { '5Y+' = 1.0 }\nsd = 1.0",
        None, "response.zero-load", "are zero"),
    "displacements of zero": (
        "kind = 'static-force'\nname = 'p'\nforces = { '5Y+' = 1.0 }\ndisplacements = { '5Y+' = 0.0 }\nsd = 1.0",
        None, "residual.static-data", "all of them are zero"),
    "no coordinate": ('kind = "centre-of-gravity"\nsd = 0.1', None, "residual.mass-data", "at least one"),
    "no moment": ('kind = "inertia"\nsd = 0.1', None, "residual.mass-data", "one measured entry"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
@pytest.mark.quick(2)
def test_bad_input_is_a_sentence_at_its_place(name: str, beam: Bench):
    table, test, code, words = BAD[name]
    modes = beam.measure(beam.truth())
    assert modes.modes is not None
    beam.uff(replace(modes, modes=replace(modes.modes, normalisation="unknown")), "unscaled.uff")
    beam.uff(replace(modes, modes=replace(modes.modes, damping_ratio=np.full(4, 0.01))), "damped.uff")
    with pytest.raises(FemtuneError) as error:
        run(beam, f"[[residual]]\n{table}\n", test)
    assert error.value.code == code
    assert words in error.value.what
    assert error.value.hint
    assert error.value.where is not None
    assert error.value.where.record.startswith("residual[1]")
    assert not (beam.folder / "run" / "results.json").exists()
