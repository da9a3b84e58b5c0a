"""Studies of stages: two spans and the spring between them, with masses, stiffnesses and dampings that are known."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from femtune import steps
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, read_deck
from femtune.files.study_file import study_from_text
from femtune.files.uff import write_uff_frfs, write_uff_modes
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.model.response import frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.reporting import build_report, html_text
from femtune.results.step_results import RunResult
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from structures.exhaust import functions_of, reference

_NODES = range(1, 9)
TRUTH = {"E": ("MAT1 1 E", 2.1e11, 1.9e11), "mass": ("CONM2 90 M", 1.0, 1.2), "eta": ("MAT1 1 GE", 0.02, 0.01),
         "k": ("PBUSH 9 K3", 3.0e5, 2.0e5), "b": ("PBUSH 9 B3", 40.0, 60.0)}  # fmt: skip


def _deck() -> str:
    """Two cantilevers that bend in the plane, tip to tip, and a bush between the tips."""
    lines = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "MAT1,1,2.1+11,,.3,7850.,,,.02",
             "PBAR,1,1,1.-3,2.-7,2.-7,4.-7", "PBUSH,9,K,1.+8,1.+8,3.+5,1.+8,1.+8,1.+8", ",,B,0.,0.,40.",
             "CBUSH,9,9,4,5,,,,0", "CONM2,90,3,,1.0"]  # fmt: skip
    for i in _NODES:
        x = 0.4 * (i - 1) if i <= 4 else 1.2 + 0.4 * (i - 5)
        lines.append(f"GRID,{i},,{x:.2f},0.,0.")
        held = "123456" if i in (1, 8) else "1246"
        lines.append(f"SPC1,1,{held},{i}")
        if i not in (4, 8):
            lines.append(f"CBAR,{i},1,{i},{i + 1},0.,0.,1.")
    return "\n".join([*lines, "ENDDATA", ""])


def _test(deck: Path, name: str, off: Sequence[int], nodes: Sequence[int], count: int) -> None:
    """The true structure's modes and accelerances of a state, without noise."""
    structure = build_structure(read_deck(deck)).structure
    parameters = ParameterSet(tuple(Parameter(n, t, 0.5 * t, 2.0 * t) for n, (_, _, t) in TRUTH.items()))
    model = parametric_model(
        structure, parameters, [Assignment(n, reference(f), False) for n, (f, _, _) in TRUTH.items()]
    )
    configured = configure(model, Configuration(name, elements_off=frozenset(off)))
    solution = solve_modes(configured.at(np.zeros(len(TRUTH))), count)
    dofs = [Dof(n, "Z") for n in nodes]
    ports = make_ports(configured, dofs[-1:], dofs)
    phi, omega = solution.shapes[:, :count], 2.0 * np.pi * solution.freq_hz[:count]
    point = solution.point
    loss = np.einsum("ij,ij->j", phi, point.hysteretic @ phi) + omega * np.einsum("ij,ij->j", phi, point.viscous @ phi)
    modes = ModeSet(
        solution.freq_hz[:count], np.asarray(ports.outputs @ phi), DofSet(dofs), damping_ratio=0.5 * loss / omega**2
    )
    lines = np.linspace(1.0, 1.2 * solution.freq_hz[count - 1], 1500)
    frame = WireFrame(np.array(nodes), np.array([structure.nodes.xyz[n - 1] for n in nodes]))
    test = ModalTest(name, SI, frame, modes=modes, frfs=frf(solution, ports, lines))
    path = deck.with_name(f"{name}.uff")
    write_uff_modes(path, test)
    write_uff_frfs(deck.with_name("frfs.uff"), test)
    path.write_text(path.read_text() + functions_of(deck.with_name("frfs.uff").read_text()))


_STUDY = """
[study]
title = "Two spans"
deck = "spans.bdf"
units = "m-kg-s"
journal = false

[modes]
count = 4

[[configuration]]
name = "left"
test = "left.uff"
elements_off = [5, 6, 7, 9]

[[configuration]]
name = "whole"
test = "whole.uff"

[residuals]
frequency_sd = 1e-4
shape_sd = 1e-3

[sensors]
by_id = true

[[residual]]
kind = "mass"
configuration = "left"
mass = {mass}
sd = 1e-3
"""
_PARAMETER = """
[[parameter]]
name = "{name}"
fields = ["{field}"]
absolute = true
lower = {lower!r}
upper = {upper!r}
"""
_STAGES = """
[[stage]]
name = "left, mass"
configurations = ["left"]
parameters = ["mass"]
residuals = ["mass"]

[[stage]]
name = "left, stiffness"
configurations = ["left"]
parameters = ["E"]
residuals = ["frequency", "shape"]

[[stage]]
name = "left, damping"
configurations = ["left"]
parameters = ["eta"]
residuals = ["resonances"]
seeds = [{ eta = 0.004 }, { eta = 0.06 }]

[[stage]]
name = "joint, stiffness"
configurations = ["whole"]
parameters = ["k"]
residuals = ["frequency", "shape"]

[[stage]]
name = "joint, damping"
configurations = ["whole"]
parameters = ["b"]
residuals = ["resonances"]
"""


def _parameters() -> str:
    entries = (
        _PARAMETER.format(name=n, field=f, lower=0.1 * nominal, upper=10.0 * nominal)
        for n, (f, nominal, _) in TRUTH.items()
    )
    return "".join(entries)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Deck, tests and study."""
    found = tmp_path_factory.mktemp("spans")
    (found / "spans.bdf").write_text(_deck())
    _test(found / "spans.bdf", "left", (5, 6, 7, 9), (2, 3, 4), 3)
    _test(found / "spans.bdf", "whole", (), (2, 3, 4, 5, 6, 7), 4)
    # three bars of 0.4 m and the mass at its true value
    text = _STUDY.format(mass=7850.0 * 1e-3 * 1.2 + 1.2) + _parameters() + _STAGES
    (found / "study.toml").write_text(text)
    return found


@pytest.fixture(scope="module")
def run(folder: Path) -> RunResult:
    return steps.update(folder / "study.toml")


@pytest.mark.slow
def test_every_stage_finds_its_part_of_the_truth(run: RunResult):
    update = run.results.update
    assert update.ok
    assert not [a for a in run.results.alerts if a.code.startswith("update.")]
    found = {p.name: p for p in update.parameters}
    for name, (_, _, truth) in TRUTH.items():
        assert found[name].value == pytest.approx(truth, rel=2e-3), name
        assert abs(found[name].value - truth) < 3.0 * found[name].sd, name
    assert [s.name for s in update.stages] == [
        "left, mass", "left, stiffness", "left, damping", "joint, stiffness", "joint, damping"
    ]  # fmt: skip
    # what a stage does not move stays: the table tells values before and after
    assert [p.name for p in update.stages[1].parameters] == ["E"]
    assert update.stages[1].parameters[0].before == 2.1e11


@pytest.mark.slow
def test_what_rests_widens_what_moves(run: RunResult):
    stages = {s.name: s for s in run.results.update.stages}
    joint, mass = stages["joint, stiffness"].parameters[0], stages["left, mass"].parameters[0]
    assert joint.sd > 1.05 * joint.sd_of_data
    assert mass.sd == pytest.approx(mass.sd_of_data, rel=1e-6)


@pytest.mark.slow
def test_seeds_meet_and_error_sums_fall(run: RunResult):
    damping = run.results.update.stages[2]
    assert [r.start for r in damping.runs] == [(0.02,), (0.004,), (0.06,)]
    assert all(r.agrees for r in damping.runs)
    assert {e.label for e in damping.error_sums} == {"1", "2", "3"}
    assert sum(e.after for e in damping.error_sums) < 0.05 * sum(e.before for e in damping.error_sums)


@pytest.mark.slow
def test_the_deck_holds_all_of_it(run: RunResult, folder: Path):
    again = build_structure(read_deck(run.folder / "updated.bdf")).structure.values
    for field, _, truth in TRUTH.values():
        assert again.values[again.index(reference(field))] == pytest.approx(truth, rel=2e-3)


@pytest.mark.slow
def test_the_catalogue_holds_the_dampings(run: RunResult, folder: Path):
    entries = {e["name"]: e for e in tomllib.loads((run.folder / "damping.toml").read_text())["damping"]}
    assert set(entries) == {"eta", "b"}
    assert entries["eta"]["of"] == "material"
    assert entries["b"]["of"] == "joint"
    assert entries["b"]["source"] == "spans.bdf: whole, stage joint, damping"
    (folder / "known.toml").write_text((run.folder / "damping.toml").read_text())
    text = (folder / "study.toml").read_text().replace('name = "eta"\n', 'name = "eta"\nprior = "known.toml"\n', 1)
    (folder / "later.toml").write_text(text)
    facts = {p.name: p for p in steps.update(folder / "later.toml", output=folder / "later").results.parameters}
    assert facts["eta"].prior_mean == pytest.approx(entries["eta"]["value"])
    assert facts["eta"].prior_sd == pytest.approx(entries["eta"]["sd"])


@pytest.mark.slow
def test_the_report_shows_the_stages(run: RunResult):
    page = html_text(build_report(run.results, run.arrays))
    assert "Stages" in page
    assert "left, damping: several initial points" in page
    assert "3 of 3 runs reached the same optimum" in page


@pytest.mark.slow
def test_a_stage_without_functions_is_refused(folder: Path):
    text = (folder / "study.toml").read_text()
    only_modes = (folder / "whole.uff").read_text().split("    58\n")[0].rsplit("    -1\n", 1)[0]
    (folder / "modes.uff").write_text(only_modes)
    (folder / "bad.toml").write_text(text.replace('"whole.uff"', '"modes.uff"'))
    with pytest.raises(FemtuneError) as caught:
        steps.update(folder / "bad.toml", output=folder / "bad")
    assert caught.value.code == "study.stage"
    assert "its test lacks FRFs" in str(caught.value)


@pytest.mark.slow
def test_a_stage_without_anything_to_compare_is_refused_at_its_line(folder: Path):
    text = (folder / "study.toml").read_text().replace('residuals = ["mass"]', 'residuals = ["shape"]', 1)
    (folder / "silent.toml").write_text(text.replace("shape_sd = 1e-3", ""))
    with pytest.raises(FemtuneError, match="stage left, mass: none of its configurations has data") as caught:
        steps.update(folder / "silent.toml", output=folder / "silent")
    assert caught.value.code == "study.stage"
    assert caught.value.where is not None
    assert caught.value.where.line == text.splitlines().index('residuals = ["shape"]') + 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('parameters = ["E"]', 'parameters = ["F"]', "'F' is not a free parameter"),
        ('configurations = ["whole"]', 'configurations = ["hole"]', "did you mean 'whole'?"),
        ('residuals = ["mass"]', 'residuals = ["inertia"]', "'inertia' is not a kind of residual of this study"),
        ("{ eta = 0.004 }", "{ eta = 4.0 }", "the seed value of eta lies outside the bounds"),
        ("{ eta = 0.004 }", "{ E = 2e11 }", "the seed names 'E', but this stage does not move"),
        ("{ eta = 0.004 }", "{ eta = nan }", "is not a finite number"),
        ('name = "left, mass"', 'name = "left, stiffness"', "is already used by the entry on line"),
        ("[sensors]", '[update]\nregularisation = "prior"\n\n[sensors]', "cannot be used with stages"),
        (
            "[sensors]",
            "[update]\nstarts = 5\n\n[sensors]",
            "'starts' in [update] cannot be used in a study with stages",
        ),
        ('residuals = ["mass"]', "residuals = []", "'residuals' is empty"),
        ('name = "eta"\n', 'name = "eta"\nprior = "none.toml"\n', "the catalogue of damping does not exist"),
        (
            'name = "eta"\n',
            'name = "eta"\nprior = "study.toml"\nsd = 0.1\n',
            "the prior is given both by the catalogue and by 'sd'",
        ),
        ('name = "eta"\n', 'name = "eta"\nprior_name = "clamp"\n', "no catalogue is given"),
    ],
)
def test_what_a_stage_cannot_use_is_refused(folder: Path, old: str, new: str, says: str):
    text = (folder / "study.toml").read_text()
    assert old in text
    with pytest.raises(FemtuneError) as caught:
        study_from_text(text.replace(old, new, 1), folder / "study.toml")
    assert says in str(caught.value)


def test_a_catalogue_is_of_the_field_itself(folder: Path):
    text = (folder / "study.toml").read_text()
    factor = text.replace('fields = ["MAT1 1 GE"]\nabsolute = true', 'prior = "study.toml"\nfields = ["MAT1 1 GE"]')
    with pytest.raises(FemtuneError) as caught:
        study_from_text(factor.replace("lower = 0.002", "lower = 0.5"), folder / "study.toml")
    assert "add absolute = true" in str(caught.value)


def test_a_catalogue_that_is_none_is_refused_at_its_line(folder: Path):
    text = (folder / "study.toml").read_text().replace('name = "eta"\n', 'name = "eta"\nprior = "study.toml"\n', 1)
    (folder / "wrong.toml").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        steps.update(folder / "wrong.toml", output=folder / "wrong")
    assert caught.value.code == "catalogue.file"
    assert "it has 'study'" in str(caught.value)


@pytest.mark.slow
def test_what_the_model_lacks_and_runs_that_differ_are_told(folder: Path):
    """The left part's stiffness is taken as known and is wrong, and one run is stopped on its way."""
    text = (folder / "study.toml").read_text()
    for name, sd in (("E", "1e8"), ("mass", "0.01")):
        text = text.replace(f'name = "{name}"\n', f'name = "{name}"\nsd = {sd}\n')
    head, *stages = text.split("[[stage]]")
    few = stages[2].replace('"resonances"]', '"resonances"]\nmax_iterations = 1')
    (folder / "lacking.toml").write_text("[[stage]]".join([head, few, stages[3]]))
    found = steps.update(folder / "lacking.toml", output=folder / "lacking").results
    alerts = {a.code: a for a in found.alerts}
    assert "joint, stiffness: its shape residuals are" in alerts["update.stage-misfit"].sentence
    assert "left, damping did not reach an optimum: stopped at" in alerts["update.stage-unfinished"].sentence
    assert "starts do not end in the same minimum" in alerts["update.starts-differ"].sentence
    assert not found.update.ok
    # parameters that no stage moved keep their values and have no σ
    values = {p.name: p for p in found.update.parameters}
    assert values["mass"].sd is None
    assert values["mass"].sd_reason == "not updated in any stage, σ not given"
