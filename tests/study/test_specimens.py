"""Nominally identical specimens in one study: joint and separate calibration, common and individual parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.nastran import build_structure, read_deck
from femtune.files.study_file import study_from_text
from femtune.model import solve_modes
from femtune.model.reduce import Trained, reduced_modes
from femtune.reporting.html import html_text
from femtune.residuals import ComparedCase
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult
from femtune.steps.specimens.record import SpecimenResults
from femtune.study.study import read_study
from femtune.testing import check_model
from femtune.updating import ReductionRules, SensitivityMethod, update
from femtune.updating.on_reduced_model import train

from .specimen_data import SD, TIP, TRUTH, study_text, write_frfs, write_tests

TIED = """
[[parameter]]
name = "joint"
fields = ["CONM2 9 M"]
tie = "0.5 + 0.5*root"

[[derived]]
name = "ratio"
expression = "root/tip"
"""


def _run(folder: Path, text: str) -> RunResult:
    (folder / "study.toml").write_text(text)
    return ft.run(folder / "study.toml")


def _found(run: RunResult) -> SpecimenResults:
    assert run.results.specimens is not None
    return run.results.specimens


@pytest.fixture(scope="module")
def beams(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    folder = tmp_path_factory.mktemp("beams")
    write_tests(folder, states=("free", "loaded"))
    return _run(folder, study_text(("free", "loaded")))


@pytest.mark.slow
def test_exact_tests_give_the_exact_parameters_of_each_specimen(tmp_path: Path) -> None:
    write_tests(tmp_path, seed=None)
    run = _run(tmp_path, study_text(more='[[derived]]\nname = "ratio"\nexpression = "root/tip"\n'))
    for name, root in TRUTH.items():
        assert run.values[f"root_{name}"] == pytest.approx(root, rel=1e-5)
    assert run.values["tip"] == pytest.approx(TIP, rel=1e-5)
    assert run.results.update is not None
    ratios = {d.name: d.value for d in run.results.update.derived}
    assert ratios == pytest.approx({f"ratio_{n}": r / TIP for n, r in TRUTH.items()}, rel=1e-5)


@pytest.mark.slow
def test_each_specimen_has_its_own_deck(beams: RunResult) -> None:
    for name in TRUTH:
        values = build_structure(read_deck(beams.folder / name / "updated.bdf")).structure.values
        at = {str(ref): values.values[i] for i, ref in enumerate(values.refs)}
        assert at["PBAR 1 I1"] == pytest.approx(2e-7 * beams.values[f"root_{name}"], rel=1e-4)
        assert at["PBAR 2 I1"] == pytest.approx(2e-7 * beams.values["tip"], rel=1e-4)
    written = [c for c in beams.results.correlations if c.stage == "after as written"]
    after = [c for c in beams.results.correlations if c.stage == "after"]
    for one, other in zip(written, after, strict=True):
        hz = [[p.model_freq_hz for p in c.pairs] for c in (one, other)]
        assert hz[0] == pytest.approx(hz[1], rel=1e-4)


@pytest.mark.slow
def test_the_spread_of_the_parameters_is_found_and_that_of_a_common_one_is_noise(beams: RunResult) -> None:
    root, tip = _found(beams).parameters
    assert (root.name, root.individual, tip.name, tip.individual) == ("root", True, "tip", False)
    assert root.spread is not None
    assert tip.spread is not None
    values = np.array([v.value for v in root.values])
    assert root.spread.sd == pytest.approx(np.std(values, ddof=1))
    assert root.spread.cov_percent == pytest.approx(100.0 * np.std(values, ddof=1) / values.mean())
    assert root.spread.verdict == "real"
    assert tip.spread.verdict == "explained"
    assert tip.spread.mean == pytest.approx(np.mean([v.separate_value for v in tip.values]))
    assert _found(beams).common is not None


@pytest.mark.slow
def test_joint_calibration_uses_all_data_of_the_common_parameter(beams: RunResult) -> None:
    _, tip = _found(beams).parameters
    assert tip.values[0].sd is not None
    separate = np.array([v.separate_sd for v in tip.values], float)
    assert tip.values[0].sd < separate.min()
    for one in _found(beams).separate:
        assert one.ok
    assert sum(s.chi_square for s in _found(beams).separate) < sum(s.chi_square_joint for s in _found(beams).separate)


@pytest.mark.slow
def test_frequencies_of_test_and_model_stand_beside_each_other(beams: RunResult) -> None:
    rows = _found(beams).frequencies
    assert {r.configurations for r in rows} == {("A free", "B free", "C free"), ("A loaded", "B loaded", "C loaded")}
    first = rows[0]
    test = np.array([m.test_hz for m in first.modes], float)
    assert first.test is not None
    assert first.model is not None
    assert first.test.cov_percent == pytest.approx(100.0 * np.std(test, ddof=1) / test.mean())
    sd = SD * test
    mean = np.sum(test / sd**2) / np.sum(1.0 / sd**2)
    assert first.test.chi_square == pytest.approx(np.sum(((test - mean) / sd) ** 2), rel=1e-9)
    assert first.test.verdict == "real"
    # bending in the other plane depends on no individual parameter
    assert rows[1].test is not None
    assert rows[1].test.verdict == "explained"
    assert first.model.cov_percent == pytest.approx(first.test.cov_percent, rel=0.1)


@pytest.mark.slow
def test_report_and_summary_show_the_specimens(beams: RunResult) -> None:
    text = html_text(build_report(beams.results, beams.arrays))
    assert "Parameters of the specimens" in text
    assert "Frequencies of the specimens: A free, B free, C free" in text
    assert "The spread of root is real" in text
    rows = beams.specimens
    assert [row["specimen"] for row in rows] == ["A", "B", "C"] * 2


@pytest.mark.slow
def test_individual_parameters_alone_need_no_separate_calibration(tmp_path: Path) -> None:
    write_tests(tmp_path)
    run = _run(tmp_path, study_text(individual=("root", "tip")))
    assert _found(run).separate == ()
    # the joint problem falls apart: each specimen by itself gives the same
    study = read_study(tmp_path / "study.toml")
    for name in TRUTH:
        own = study.of_specimen(name).problem()
        found = update(own, SensitivityMethod(), active=[f"root_{name}", f"tip_{name}"])
        assert found.values[f"root_{name}"] == pytest.approx(run.values[f"root_{name}"], rel=1e-5)
        assert found.sd[f"root_{name}"] == pytest.approx(run.results.update.parameters[0].sd or 0.0, rel=0.5)  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_parameter_that_is_not_common_is_found_out(tmp_path: Path) -> None:
    write_tests(tmp_path, tip=1.2)
    run = _run(tmp_path, study_text())
    common = _found(run).common
    assert common is not None
    assert common.p_value < 1e-3
    assert "some common parameter differs" in common.sentence
    assert _found(run).parameters[1].spread is not None
    assert _found(run).parameters[1].spread.verdict == "real"  # type: ignore[union-attr]


@pytest.mark.slow
def test_frfs_on_reduced_models_that_are_trained_once(tmp_path: Path) -> None:
    """The specimens share one training; the truth lies within 3.5 of the stated standard deviations."""
    write_frfs(tmp_path)
    frfs = '[[residual]]\nkind = "frf"\nform = "log-complex"\nsd = 0.01\ncount = 12\n[reduction]\n'
    run = _run(tmp_path, study_text(more=frfs).replace(f"[residuals]\nfrequency_sd = {SD}\n", ""))
    found = {p.name: (p.value, p.sd) for p in run.results.update.parameters}  # type: ignore[union-attr]
    for name, true in [*((f"root_{s}", root) for s, root in TRUTH.items()), ("tip", TIP)]:
        value, sd = found[name]
        assert sd is not None
        assert abs(value - true) < 3.5 * sd < 0.01
    assert {s.specimen for s in _found(run).separate} == set(TRUTH)
    assert _found(run).common is not None
    assert _found(run).common.p_value > 1e-3  # type: ignore[union-attr]
    assert _found(run).frequencies[0].test is None
    assert _found(run).frequencies[0].model is not None
    # by the numbers: the training of the first specimen serves the others
    study = read_study(tmp_path / "study.toml")
    problem, solved = study.problem(), list[str]()
    told = _Solutions(solved)
    before = problem.start(np.zeros(4))
    search = train(problem, ReductionRules(), before, told)
    assert len({len(t.certified) for t in search.trained}) == 1
    for case, trained in zip(problem.cases, search.trained):
        x = np.array([0.3, -0.2, 0.1, 0.2])
        full = solve_modes(case.configured.at(x), 4).freq_hz[:4]
        reduced = reduced_modes(trained.model.at(x), 4).freq_hz[:4]
        assert reduced == pytest.approx(full, rel=2e-3)
        own = [case.configured.model.name_of("root") == f"root_{s}" for s in TRUTH]
        assert trained.points[:, :3].any(axis=0).tolist() == own
    assert len(solved) == len(search.trained[0].certified) + 2


@dataclass
class _Solutions:
    """Counts what is told of trainings: every full solution of the first, and that the others took it over."""

    solved: list[str]

    def trained(self, name: str, trained: Trained) -> None:
        self.solved.append(name)

    def estimated(self, name: str, trained: Trained, count: int) -> None: ...

    def searched(self, number: int) -> None: ...


def test_what_is_tied_to_an_individual_parameter_is_individual(tmp_path: Path) -> None:
    write_tests(tmp_path)
    (tmp_path / "study.toml").write_text(study_text(more=TIED))
    study = read_study(tmp_path / "study.toml")
    assert study.parameters.names == (
        "root_A", "root_B", "root_C", "tip", "joint_A", "joint_B", "joint_C",
    )  # fmt: skip
    at = study.parameters.values(study.parameters.normalise([0.8, 1.0, 1.4, 1.0]))
    assert [at[f"joint_{s}"] for s in "ABC"] == pytest.approx([0.9, 1.0, 1.2])


@pytest.mark.slow
def test_derivatives_are_those_of_the_specimen(tmp_path: Path) -> None:
    """By complex step; by the parameters of other specimens they are zero."""
    write_tests(tmp_path)
    (tmp_path / "study.toml").write_text(study_text(more=TIED))
    study = read_study(tmp_path / "study.toml")
    for case in study.cases:
        point = case.configured.at(np.array([0.1, -0.1, 0.2, 0.05]))
        check_model(point, modes=(0, 2))
        acting = [abs(k).max() > 0 for k in point.stiffness_derivatives]
        assert acting == [case.entry.specimen == s for s in "ABC"] + [True]


@pytest.mark.slow
def test_specimens_in_one_state_share_their_matrices(tmp_path: Path) -> None:
    write_tests(tmp_path, states=("free", "loaded"))
    (tmp_path / "study.toml").write_text(study_text(("free", "loaded")))
    study = read_study(tmp_path / "study.toml")
    free = [c for c in study.cases if c.name.endswith("free")]
    assert all(c.configured.projected is free[0].configured.projected for c in free)
    loaded = [c for c in study.cases if c.name.endswith("loaded")]
    assert loaded[0].configured.projected is not free[0].configured.projected


@pytest.mark.long
def test_truth_lies_within_the_stated_deviation_at_the_stated_rate(tmp_path: Path) -> None:
    """60 campaigns on three specimens: squared errors in their covariance are χ² (significance 1e-3)."""
    write_tests(tmp_path, seed=None, states=("free", "loaded"))
    (tmp_path / "study.toml").write_text(study_text(("free", "loaded")))
    study = read_study(tmp_path / "study.toml")
    problem, truth = study.problem(), study.parameters.normalise([*TRUTH.values(), TIP])
    rng, squares, inside = np.random.default_rng(12), [], []
    base = problem.start(truth)
    for _ in range(60):
        cases = tuple(_noisy(case, rng) for case in problem.cases)
        noisy = type(problem)(cases, problem.parameters)
        found = update(noisy, SensitivityMethod(), start=noisy.start(base.x))
        error = found.x - truth
        # by the stated deviations alone, which chance widens now and then
        J = found.after.jacobian
        squares.append(float(error @ (J.T @ J) @ error))
        inside.append(np.abs(error) < 1.96 * np.sqrt(np.diag(np.linalg.inv(J.T @ J))))
    assert stats.kstest(squares, stats.chi2(4).cdf).pvalue > 1e-3
    assert stats.binomtest(int(np.sum(inside)), np.size(inside), 0.95).pvalue > 1e-3


def _noisy(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
    freq = case.test.freq_hz * (1.0 + SD * rng.standard_normal(len(case.test)))
    return replace(case, test=replace(case.test, freq_hz=freq))


# ----------------------------------------------------------------------------------------------------
# Bad input.


@pytest.mark.parametrize(
    ("name", "code", "old", "new"),
    [
        ("missing", "specimen.keys", 'specimen = "B"\n', ""),
        ("none", "specimen.keys", 'specimen = "', 'mode_labels = ["1", "2", "3", "4", "5"]\n#'),
        ("one", "specimen.keys", 'specimen = "', 'specimen = "A" #'),
        ("tied", "specimen.keys", 'fields = ["PBAR 1 I1"]\nlower = 0.5\nupper = 2.0', 'tie = "tip"'),
        ("name-taken", "specimen.keys", 'name = "tip"', 'name = "root_B"'),
        ("other-table", "specimen.keys", "[residuals]", '[quantify]\nrepeats = "repeats.csv"\n[residuals]'),
        ("name", "study.value", 'specimen = "B"', 'specimen = "B 2"'),
        ("unknown", "study.residual-configuration", "[residuals]", '[[residual]]\nkind = "mass"\nmass = 1.0\nsd = 0.1\n'
         'configuration = ["A free", "D free"]\n[residuals]'),
    ],
)  # fmt: skip
def test_keys_that_do_not_fit_are_refused(name: str, code: str, old: str, new: str, tmp_path: Path) -> None:
    for file in ("beam.bdf", "repeats.csv", *(f"{s}_free.uff" for s in TRUTH)):
        (tmp_path / file).touch()
    text = study_text()
    assert old in text
    with pytest.raises(FemtuneError) as caught:
        study_from_text(text.replace(old, new), tmp_path / "study.toml")
    errors = caught.value.errors if isinstance(caught.value, FemtuneErrors) else (caught.value,)
    found = next(error for error in errors if error.code == code)
    check_shown(f"{code}, {name}", str(found).replace(str(tmp_path), "."))


@pytest.mark.slow
@pytest.mark.parametrize("way", ["no test", "for validation"])
def test_a_specimen_without_data_is_left_out_of_mean_and_cov(tmp_path: Path, way: str) -> None:
    write_tests(tmp_path, seed=None)
    line = 'test = "B_free.uff"\n'
    run = _run(tmp_path, study_text().replace(line, "" if way == "no test" else f'{line}use = "validation"\n'))
    found = _found(run)
    assert found.not_calibrated == ("B",)
    root, tip = found.parameters
    known = np.array([TRUTH["A"], TRUTH["C"]])
    assert root.spread is not None
    assert root.spread.mean == pytest.approx(known.mean(), rel=1e-5)
    assert root.spread.cov_percent == pytest.approx(100.0 * known.std(ddof=1) / known.mean(), rel=1e-4)
    assert root.spread.degrees_of_freedom == 1
    assert tip.spread is not None
    assert tip.spread.degrees_of_freedom == 1
    for mode in found.frequencies:
        after = [m.after_hz for m in mode.modes if m.specimen != "B"]
        assert mode.model is not None
        assert mode.model.mean == pytest.approx(np.mean(after), rel=1e-12)  # type: ignore[arg-type]
    page = (run.folder / "report.html").read_text()
    assert "The update uses no test of B: its individual parameters have the initial values" in page
