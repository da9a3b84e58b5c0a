"""Studies of stages: two spans and the spring between them, with masses, stiffnesses and dampings that are known."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, read_deck
from femtune.files.study_file import study_from_text
from femtune.reporting.html import html_text
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult
from structures.exhaust import reference

from .two_spans import TRUTH, write_spans


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_spans(tmp_path_factory.mktemp("spans"))


@pytest.fixture(scope="module")
def run(folder: Path) -> RunResult:
    return ft.update(folder / "study.toml")


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
    facts = {p.name: p for p in ft.update(folder / "later.toml", output=folder / "later").results.parameters}
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
        ft.update(folder / "bad.toml", output=folder / "bad")
    assert caught.value.code == "study.stage"
    assert "its test lacks FRFs" in str(caught.value)


@pytest.mark.slow
def test_a_stage_without_anything_to_compare_is_refused_at_its_line(folder: Path):
    text = (folder / "study.toml").read_text().replace('residuals = ["mass"]', 'residuals = ["shape"]', 1)
    (folder / "silent.toml").write_text(text.replace("shape_sd = 1e-3", ""))
    with pytest.raises(FemtuneError, match="stage left, mass: none of its configurations has data") as caught:
        ft.update(folder / "silent.toml", output=folder / "silent")
    assert caught.value.code == "study.stage"
    assert caught.value.where is not None
    assert caught.value.where.line == text.splitlines().index('residuals = ["shape"]') + 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('parameters = ["E"]', 'parameters = ["F"]', "'F' is not a free parameter"),
        ('configurations = ["whole"]', 'configurations = ["hole"]', "did you mean 'whole'?"),
        ('residuals = ["mass"]', 'residuals = ["inertia"]', "'inertia'"),
        ("{ eta = 0.004 }", "{ eta = 4.0 }", "the seed value of eta lies outside the bounds"),
        ("{ eta = 0.004 }", "{ E = 2e11 }", "the seed names 'E', but this stage does not move"),
        ("{ eta = 0.004 }", "{ eta = nan }", "is not a finite number"),
        ('name = "left, mass"', 'name = "left, stiffness"', "entry on line"),
        ("[sensors]", '[update]\nregularisation = "prior"\n\n[sensors]', "cannot be used with stages"),
        (
            "[sensors]",
            "[update]\nstarts = 5\n\n[sensors]",
            "'starts' in [update]",
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
        ft.update(folder / "wrong.toml", output=folder / "wrong")
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
    found = ft.update(folder / "lacking.toml", output=folder / "lacking").results
    alerts = {a.code: a for a in found.alerts}
    assert "joint, stiffness: its shape residuals are" in alerts["update.stage-misfit"].sentence
    assert "left, damping " in alerts["update.stage-unfinished"].sentence
    assert "minimum" in alerts["update.starts-differ"].sentence
    assert not found.update.ok
    # parameters that no stage moved keep their values and have no σ
    values = {p.name: p for p in found.update.parameters}
    assert values["mass"].sd is None
    assert values["mass"].sd_reason == "not updated in any stage, σ not given"
