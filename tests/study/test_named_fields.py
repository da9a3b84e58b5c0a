"""Parameters that only a study makes: factors of matrices, offsets of bars, generic elements; derived quantities."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.model import Configuration, solve_modes
from femtune.study.study import load_study

from .cantilever import CANTILEVER, Bench

OFFSET = CANTILEVER.replace(
    "CBAR    3       2       3       4       0.0     1.0     0.0\n",
    "CBAR    3       2       3       4       0.0     1.0     0.0\n"
    "                        0.0     0.02    0.0     0.0     0.02    0.0\n",
)


def _parameter(name: str, fields: str, rest: str = "lower = 0.5\nupper = 2.0\n") -> str:
    return f'[[parameter]]\nname = "{name}"\nfields = {fields}\n{rest}\n'


def _updated(bench: Bench, tail: str, truth: tuple[tuple[str, str], ...], text: str):
    bench.write("beam.bdf", text)
    bench.uff(bench.measure(bench.truth(truth, text)))
    return ft.run(bench.study(tail))


@pytest.mark.slow
def test_the_factor_of_a_region_is_found_without_a_deck(bench: Bench) -> None:
    tip = "PBAR    2       1       "
    truth = ((tip + "1.0-3   2.0-7   5.0-7   4.0-7 ", tip + "7.0-4   1.4-7   3.5-7   2.8-7 "),)
    tail = _parameter("soft", '["STIFFNESS"]', 'elements = "3 THRU 4"\nlower = 0.3\nupper = 2.0\n')
    tail += _parameter("light", '["MASS"]', "region = { properties = [2] }\nlower = 0.3\nupper = 2.0\n")
    run = _updated(bench, tail + "[write]\ndeck = false\n", truth, CANTILEVER)
    assert run.results.update is not None
    found = {p.name: p.value for p in run.results.update.parameters}
    assert found["soft"] == pytest.approx(0.7, abs=1e-5)
    assert found["light"] == pytest.approx(0.7, abs=1e-5)
    assert run.results.write_back is None
    assert "write.no-deck" in {a.code for a in run.results.alerts}


@pytest.mark.slow
def test_an_offset_is_found_and_written_to_its_fields(bench: Bench) -> None:
    truth = (("0.0     0.02    0.0     0.0     0.02    0.0", "0.0     0.03    0.0     0.0     0.03    0.0"),)
    tail = _parameter("a", '["CBAR 3 W2A", "CBAR 3 W2B"]') + '[[derived]]\nname = "twice"\nexpression = "0.04*a"\n'
    run = _updated(bench, tail + 'unit = "m"\n', truth, OFFSET)
    update = run.results.update
    assert update is not None
    assert update.parameters[0].value == pytest.approx(1.5, abs=1e-5)
    (derived,) = update.derived
    assert (derived.name, derived.unit, derived.nominal) == ("twice", "m", pytest.approx(0.04))
    assert derived.value == pytest.approx(0.06, abs=1e-6)
    assert derived.sd == pytest.approx(0.04 * update.parameters[0].sd)
    assert [w.field for w in update.parameters[0].written] == ["CBAR 3 W2A", "CBAR 3 W2B"]
    again = load_study(bench.write("again.toml", '[study]\ntitle="a"\ndeck="run/updated.bdf"\nunits="m-kg-s"\n'))
    batch = next(b for b in again.built.structure.batches if b.kind == "bar")
    np.testing.assert_allclose(batch.facts["offset_a"][2], [0.0, 0.03, 0.0], atol=1e-6)
    stored = json.loads((run.folder / "results.json").read_text())
    assert stored["update"]["derived"][0]["expression"] == "0.04*a"


def test_offsets_of_a_region_by_the_name_of_the_card(bench: Bench) -> None:
    bench.write("beam.bdf", OFFSET)
    study = load_study(
        bench.study(_parameter("a", '["CBAR W2A", "CBAR W2B"]', 'elements = "3"\nlower=0.5\nupper=2.0'), test=None)
    )
    assert [str(a.ref) for a in study.model.assignments] == ["CBAR 3 W2A", "CBAR 3 W2B"]


GENERIC = '[[generic]]\nname = "JOINT"\nelements = "1 THRU 2"\ncomponents = "26"\n'


@pytest.mark.slow
def test_an_eigenvalue_of_a_group_is_found(bench: Bench) -> None:
    """A test made with κ 1 at 1.4: the study finds it; no card could hold it."""
    tail = GENERIC + _parameter("k", '["GENERIC JOINT K1"]')
    bench.write("beam.bdf", CANTILEVER)
    study = load_study(bench.study(tail, test=None))
    (notice,) = [n for n in study.built.notices if n.code == "generic.eigenvalues"]
    assert "4 rigid-body modes" not in notice.what
    assert "2 rigid-body modes, K1 = " in notice.what
    case = study.cases[0]
    solution = solve_modes(case.configured.at(np.array([0.4])), 6)
    wanted = solution.freq_hz
    test = bench.measure(bench.folder / "beam.bdf")
    modes = test.modes
    assert modes is not None
    shapes = case.configured.transformation @ solution.shapes[:, :6]
    rows = [study.model.structure.nodes.dof(d.node, d.component) for d in modes.dofs]
    bench.uff(replace(test, modes=replace(modes, freq_hz=wanted[:4], shapes=shapes[rows][:, :4])))
    with pytest.raises(FemtuneError) as caught:
        ft.run(bench.study(tail))
    assert caught.value.code == "write.no-card"
    run = ft.run(bench.study(tail + "[write]\ndeck = false\n"))
    assert run.results.update is not None
    assert run.results.update.parameters[0].value == pytest.approx(1.4, abs=1e-5)
    assert run.results.write_back is None


def _code(bench: Bench, tail: str) -> str:
    with pytest.raises(FemtuneError) as caught:
        load_study(bench.study(tail, test=None))
    errors = getattr(caught.value, "errors", [caught.value])
    assert all(str(e.where) for e in errors), errors
    return " ".join(dict.fromkeys(e.code for e in errors))


@pytest.mark.quick(11)
@pytest.mark.parametrize(
    ("tail", "code"),
    [
        (_parameter("a", '["CBAR 1 W2A"]'), "parameter.touches-nothing"),
        (_parameter("a", '["CBAR W2A"]'), "parameter.touches-nothing"),
        (_parameter("a", '["CBAR 99 W2A"]'), "study.unknown-field"),
        (_parameter("a", '["CBAR 3 W4A"]'), "study.unknown-field"),
        (_parameter("a", '["CROD 3 W1A"]'), "study.unknown-field"),
        (_parameter("a", '["CONM2 9 W1A"]'), "study.unknown-field"),
        (_parameter("a", '["CBAR 3 W1A"]'), "parameter.zero-nominal"),
        (_parameter("f", '["STIFFNESS"]', "lower = 0.0\nupper = 2.0\n"), "parameter.not-positive"),
        (_parameter("f", '["VISCOUS"]'), "parameter.without-effect"),
        (_parameter("f", '["STIFFNES"]'), "study.field"),
        (
            _parameter("f", '["STIFFNESS"]', 'elements = "1,2"\nlower=0.5\nupper=2.0\n')
            + _parameter("g", '["STIFFNESS"]', 'elements = "2,3"\nlower=0.5\nupper=2.0\n'),
            "parameter.field-twice",
        ),
        (GENERIC, "generic.unused"),
        (_parameter("k", '["GENERIC JOIN K1"]') + GENERIC, "generic.unknown generic.unused"),
        (_parameter("k", '["GENERIC JOINT K0"]') + GENERIC, "generic.rigid-body"),
        (_parameter("k", '["GENERIC JOINT K99"]') + GENERIC, "generic.name"),
        (_parameter("k", '["GENERIC JOINT E"]') + GENERIC, "study.field"),
        (_parameter("k", '["GENERIC JOINT K1"]') + GENERIC.replace("1 THRU 2", "77"), "generic.elements"),
        (
            _parameter("k", '["GENERIC JOINT K1", "GENERIC TOO K1"]')
            + GENERIC
            + GENERIC.replace("JOINT", "TOO").replace("1 THRU 2", "2,3"),
            "generic.overlap",
        ),
        (
            _parameter("k", '["GENERIC JOINT K1"]') + GENERIC + _parameter("e", '["PBAR 1 I1"]'),
            "generic.moved-elsewhere",
        ),
        (_parameter("k", '["GENERIC JOINT K1"]', "lower=-1.0\nupper=2.0\n") + GENERIC, "parameter.not-positive"),
        (_parameter("s", '["GENERIC JOINT S1-2"]') + GENERIC, "parameter.zero-nominal"),
        ('[[derived]]\nname = "d"\nexpression = "root"\n', "tie.unknown"),
        (_parameter("a", '["PBAR 1 I1"]') + '[[derived]]\nname = "a"\nexpression = "a"\n', "parameter.duplicate"),
        (_parameter("a", '["PBAR 1 I1"]') + '[[derived]]\nname = "if"\nexpression = "a"\n', "parameter.name"),
        (_parameter("a", '["PBAR 1 I1"]') + '[[derived]]\nname = "d"\nexpression = "log(a-2)"\n', "tie.value"),
        (_parameter("a", '["PBAR 1 I1"]') + '[[derived]]\nname = "d"\nexpression = "a("\n', "tie.syntax"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_place(bench: Bench, tail: str, code: str) -> None:
    bench.write("beam.bdf", OFFSET)
    assert _code(bench, tail) == code


@pytest.mark.slow
def test_a_derived_quantity_without_a_value_at_the_end_loses_nothing(bench: Bench) -> None:
    truth = (("PBAR    1       1       1.0-3   2.0-7 ", "PBAR    1       1       1.0-3   3.0-7 "),)
    tail = _parameter("root", '["PBAR 1 I1"]') + '[[derived]]\nname = "d"\nexpression = "sqrt(1.2-root)"\n'
    run = _updated(bench, tail, truth, CANTILEVER)
    assert run.results.update is not None
    (derived,) = run.results.update.derived
    assert (derived.value, derived.sd) == (None, None)
    assert "not finite" in derived.sd_reason


PLATE = CANTILEVER.replace(
    "PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7           $ root",
    "PBARL   1       1               BAR\n        0.02    0.05",
)


IN_PLANE = """[[configuration]]
name = "in its plane"
test = "beam.uff"
supports_added = ["1 THRU 5:345"]
"""


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    ("first", "second", "redundant"),
    [
        ('["MAT1 1 E"]', '["STIFFNESS"]', True),
        ('["MAT1 1 E"]', '["PBAR 1 I1", "PBAR 2 I1"]', True),
        ('["MAT1 1 RHO"]', '["MASS"]', False),
        ('["PBARL 1 DIM1"]', '["PBARL 1 DIM2"]', False),
    ],
)
def test_what_the_guide_calls_redundant(bench: Bench, first: str, second: str, redundant: bool) -> None:
    """E and I enter the bending in a plane as a product; RHO leaves out the lumped mass, which MASS does not."""
    bench.write("beam.bdf", PLATE if "PBARL" in first else CANTILEVER)
    held = Configuration(supports_added=tuple((n, "345") for n in range(1, 6)))
    bench.uff(bench.measure(bench.folder / "beam.bdf", *(f"{n}Y+" for n in range(2, 6)), configuration=held, count=3))
    found = ft.select(bench.study(IN_PLANE + _parameter("p", first) + _parameter("q", second), test=None)).record
    assert (found.singular_values[1] < 1e-9 * found.singular_values[0]) == redundant
    assert bool(found.undetermined) >= redundant
