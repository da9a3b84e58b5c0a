"""[[frequency_table]] through whole runs: a beam on rubber, whose modulus and loss factor depend on frequency."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.deck_models import model_of
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.model import (
    ConfiguredModel,
    frequency_table,
    modes_at_own_frequency,
)
from femtune.model.response import complex_modes_at_own_frequency, frf, make_ports
from femtune.steps.run.result import RunResult

from .cantilever import CANTILEVER, LABELS, Bench, bounded

RUBBER = "CELAS2  21      2.0+4   3       2                       0.15\n"
DECK = CANTILEVER.replace("CONM2 ", f"{RUBBER}CONM2 ")
TRUE_RUBBER = "CELAS2  21      2.6+4   3       2                       0.12\n"
TABLES = """
[[frequency_table]]
fields = ["CELAS2 21 K"]
freq_hz = [0.0, 50.0, 200.0, 1000.0]
factor = [0.8, 1.0, 1.6, 2.2]

[[frequency_table]]
fields = ["CELAS2 21 GE"]
freq_hz = [0.0, 100.0, 1000.0]
factor = [0.5, 1.0, 1.8]
"""
PARAMETERS = f"\n{bounded('stiffness', 'CELAS2 21 K')}\n{bounded('loss', 'CELAS2 21 GE')}"


def true_model(bench: Bench) -> ConfiguredModel:
    path = bench.write("truth/true.bdf", DECK.replace(RUBBER, TRUE_RUBBER))
    tables = (
        frequency_table([FieldRef("CELAS2", 21, "K")], [0.0, 50.0, 200.0, 1000.0], [0.8, 1.0, 1.6, 2.2]),
        frequency_table([FieldRef("CELAS2", 21, "GE")], [0.0, 100.0, 1000.0], [0.5, 1.0, 1.8]),
    )
    return model_of(path, tables=tables)


@pytest.fixture
def rubber(bench: Bench) -> Bench:
    bench.write("beam.bdf", DECK)
    return bench


def measured_modes(bench: Bench) -> Path:
    """Frequencies and damping ratios of the true poles, shapes of the real modes."""
    model = true_model(bench)
    point = model.at(np.zeros(0))
    real, poles = modes_at_own_frequency(point, 4), complex_modes_at_own_frequency(point, 4)
    test = bench.measure(bench.folder / "truth" / "true.bdf")
    assert test.modes is not None
    structure = model.model.structure
    rows = [structure.nodes.dof(d.node, d.component) for d in test.modes.dofs]
    shapes = model.transformation.tocsr()[rows] @ np.stack([m.shape for m in real], axis=1)
    values = np.array([m.eigenvalue for m in poles])
    modes = replace(
        test.modes, freq_hz=np.abs(values) / (2 * np.pi), shapes=shapes, damping_ratio=-values.real / np.abs(values)
    )
    return bench.uff(replace(test, modes=modes))


def measured_frfs(bench: Bench) -> Path:
    """FRFs of the true beam, in its bending plane with the rubber."""
    model = true_model(bench)
    outputs = [label for label in LABELS if "Y" in label]
    ports = make_ports(model, ["3Y+", "5Y+"], outputs)
    found = frf(model.at(np.zeros(0)), ports, np.arange(5.0, 300.0, 5.0), "accelerance", "direct")
    return bench.functions(found)


def told_of_first_table(found: RunResult) -> str:
    first = next(a for a in found.results.alerts if a.code == "table.acts")
    return f"[{first.code}] {first.sentence}"


@pytest.mark.slow
def test_poles_find_modulus_and_loss_factor(rubber: Bench):
    measured_modes(rubber)
    tail = f'{PARAMETERS}{TABLES}[[residual]]\nkind = "complex-eigenvalue"\nsd = 0.001\nmodes = ["1", "3"]\n'
    found = ft.run(rubber.study(tail))
    update = found.results.update
    assert update is not None
    assert update.ok
    values = {p.name: p.value for p in update.parameters}
    assert values == pytest.approx({"stiffness": 1.3, "loss": 0.8}, rel=5e-4)
    assert [a.sentence for a in found.results.alerts if a.level == "problem"] == []
    check_shown("table.acts", told_of_first_table(found))
    told = [a.sentence for a in found.results.alerts if a.code == "table.acts"]
    assert told[0].startswith("CELAS2 21 K ")
    assert "factor 0.8 to 2.2 between 0 and 1000 Hz" in told[0]
    assert found.report is not None
    html = found.report.read_text(encoding="utf-8")
    assert "CELAS2 21 GE" in html


@pytest.mark.long
def test_direct_frfs_find_modulus_and_loss_factor(rubber: Bench):
    """The updated deck, read back, gives the measured FRFs with the same tables; [response] compares them."""
    measured_frfs(rubber)
    tail = '[[residual]]\nkind = "frf"\nmethod = "direct"\nsd = 0.01\n[response]\nmethod = "direct"\n'
    found = ft.run(rubber.study(f"{PARAMETERS}{TABLES}{tail}", test="frfs.uff"))
    update = found.results.update
    assert update is not None
    assert update.ok
    values = {p.name: p.value for p in update.parameters}
    assert values == pytest.approx({"stiffness": 1.3, "loss": 0.8}, rel=1e-4)
    assert [a.sentence for a in found.results.alerts if a.level == "problem"] == []
    last = found.results.responses[-1]
    assert last.configuration == "baseline"


@pytest.mark.slow
def test_modes_of_a_study_are_those_of_their_own_frequency(rubber: Bench):
    rubber.write("beam.bdf", DECK.replace(RUBBER, TRUE_RUBBER))
    found = ft.modes(rubber.study(f"{PARAMETERS}{TABLES}", test=None))
    expected = [m.freq_hz for m in modes_at_own_frequency(true_model(rubber).at(np.zeros(0)), 6)]
    assert list(found.freq_hz) == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
def test_a_modulus_of_the_whole_beam(bench: Bench):
    """All stiffness follows E, and G with it: f = f₀√t(f) with the frequencies f₀ of the deck."""
    deck = bench.folder / "beam.bdf"
    lines, factor = [0.0, 100.0, 1000.0, 5000.0], [0.7, 1.0, 1.4, 2.0]
    table = f'[[frequency_table]]\nfields = ["MAT1 1 E"]\nfreq_hz = {lines}\nfactor = {factor}\n'
    found = ft.modes(bench.study(table, test=None)).freq_hz
    expected = [
        brentq(lambda f, plain=plain: f - plain * np.sqrt(np.interp(f, lines, factor)), 0.0, 1e5, xtol=1e-12)
        for plain in bench.modes(deck)
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.slow
def test_a_table_holds_for_all_regions_of_a_field(bench: Bench):
    region = bounded("a", "PBAR 1 I1", 'elements = "1"\n')
    table = '[[frequency_table]]\nfields = ["PBAR 1 I1"]\nfreq_hz = [0.0, 100.0]\nfactor = [1.0, 2.0]\n'
    found = [ft.modes(bench.study(text, test=None)).freq_hz for text in (table, region + table)]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-10)
    assert found[0][2] > 1.05 * bench.modes(bench.folder / "beam.bdf")[2]


BAD = {
    "an unknown field": (TABLES.replace("21 K", "22 K"), "table.fields", "CELAS2 22 K"),
    "lists of two lengths": (TABLES.replace("[0.8, 1.0, 1.6, 2.2]", "[0.8, 1.0]"), "table.values", "4 frequencies"),
    "descending frequencies": (TABLES.replace("[0.0, 100.0,", "[200.0, 100.0,"), "table.values", "ascending"),
    "mass": (TABLES.replace("CELAS2 21 GE", "CONM2 9 M"), "table.fields", "changes the mass"),
    "a factor of zero": (TABLES.replace("[0.5,", "[0.0,"), "study", "greater than 0"),
    "a reduction": (f"{TABLES}[reduction]\n", "study.frequency-table", "reduction"),
    "FRFs of modes": (
        f'{TABLES}[response]\ninputs = ["5Y+"]\nfrom_hz = 1.0\nto_hz = 100.0\nlines = 10\n',
        "table.direct",
        "direct",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name: str, rubber: Bench):
    tail, code, word = BAD[name]
    with pytest.raises(FemtuneError) as caught:
        ft.respond(rubber.study(f"{PARAMETERS}{tail}", test=None))
    assert code in str(caught.value)
    assert word in str(caught.value)


@pytest.mark.parametrize("method", ["dynamic", "mdre", "serep"])
@pytest.mark.slow
def test_shapes_are_expanded_with_the_stiffness_of_their_frequency(rubber: Bench, method: str):
    """The modes of the model with the tables, measured at three grid points, are expanded to the fourth."""
    rubber.write("beam.bdf", DECK.replace(RUBBER, TRUE_RUBBER))
    model = true_model(rubber)
    real = modes_at_own_frequency(model.at(np.zeros(0)), 4)
    labels = [f"{n}{d}+" for n in (2, 4, 5) for d in ("Y", "Z")]
    test = rubber.measure(rubber.folder / "beam.bdf", *labels)
    assert test.modes is not None
    structure = model.model.structure
    rows = [structure.nodes.dof(d.node, d.component) for d in test.modes.dofs]
    whole = model.transformation.tocsr() @ np.stack([m.shape for m in real], axis=1)
    modes = replace(test.modes, freq_hz=np.array([m.freq_hz for m in real]), shapes=whole[rows])
    rubber.uff(replace(test, modes=modes))
    expand = f'[correlate]\nexpand = "{method}"\nexpand_noise = 1e-6\n'
    tail = f"{PARAMETERS}{TABLES}[residuals]\nfrequency_sd = 0.01\n{expand}"
    found = ft.run(rubber.study(tail))
    record = found.results.correlations[0].expansion
    assert record is not None
    at_third = found.arrays[record.shapes_key][2, 1:3]
    wanted = whole[[structure.nodes.dof(3, c) for c in (2, 3)]]
    np.testing.assert_allclose(at_third, wanted, atol=1e-4 * np.abs(whole).max())


@pytest.mark.slow
def test_no_sturm_count_is_said_to_be_hidden(rubber: Bench):
    found = ft.modes(rubber.study(f"{PARAMETERS}{TABLES}", test=None))[0]
    assert found.sturm_sentence == "not tested: the stiffness depends on frequency"
