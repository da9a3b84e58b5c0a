"""Likeness, information, order and energies in the record, on the terminal and in the report."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import femtune as ft
from femtune.model import eigenvalue_derivatives
from femtune.steps.report.build import build_report
from femtune.steps.select.page import selection_document
from femtune.steps.select.record.selection import SelectionMeasures
from femtune.steps.subject import subject_of
from femtune.study.progress import silent
from femtune.study.solved import solved_cases
from femtune.study.study import load_study

from .cantilever import EI, Bench, bounded

TWICE = f"\n{bounded('all', 'MAT1 1 E')}\n{bounded('root', 'PBAR 1 I1')}"


def _measures(study) -> SelectionMeasures:
    found = ft.select(study).record.measures
    assert found is not None
    return found


def test_every_parameter_has_its_order_and_information(beam: Bench):
    found = _measures(beam.study(EI))
    assert {p.parameter for p in found.information} == {"root", "tip"}
    assert {s.parameter for s in found.subset} == {"root", "tip"}
    assert sorted(p.d_rank for p in found.information) == [1, 2]
    assert all(p.sd_together >= p.sd_alone > 0.0 for p in found.information)
    assert found.subset[-1].left_percent <= found.subset[0].left_percent <= 100.0
    assert found.energies == ()


def test_the_parameters_that_are_wrong_explain_the_residual(beam: Bench):
    """Root 1.3, tip 0.85; the mass at the tip is right."""
    mass = bounded("mass", "CONM2 9 M")
    found = _measures(beam.study(EI + mass))
    assert "root" in [s.parameter for s in found.subset if s.chosen][:1]


@pytest.mark.slow
def test_a_parameter_is_tested_by_the_independent_residuals_of_shapes(bench: Bench):
    """Each shape of unit norm has one independent value less than entries."""
    bench.uff(bench.measure(bench.truth(), "3Y+", "5Y+", "3Z+"))
    one = EI.split("[[parameter]]")[1]
    study = load_study(bench.study(f"[[parameter]]{one}[residuals]\nfrequency_sd = 0.01\nshape_sd = 0.05\n"), silent)
    problem = study.problem()
    at = problem.start(np.zeros(1))
    r, column = at.residuals, at.jacobian[:, 0]
    shapes = len({b.mode for b in at.blocks if b.kind == "shape"})
    gain = (column @ r) ** 2 / (column @ column)
    freedom = len(r) - shapes - 1
    p = stats.f.sf(gain * freedom / (r @ r - gain), 1, freedom)
    (step,) = _measures(study.file.path).subset
    assert step.p_value == pytest.approx(p, rel=1e-6)
    assert stats.f.sf(gain * (len(r) - 1) / (r @ r - gain), 1, len(r) - 1) < 0.9 * p


@pytest.mark.slow
def test_relative_weights_mean_the_same_in_any_unit(bench: Bench):
    """With estimated variance only ratios of the standard deviations count: 1 and 5 say what 0.01 and 0.05 say."""
    bench.uff(bench.measure(bench.truth()))

    def ratios(frequency: float, shape: float, scatter: str) -> list[float]:
        stated = f'frequency_sd = {frequency}\nshape_sd = {shape}\nscatter = "{scatter}"\n'
        found = ft.select(bench.study(f"{EI}[residuals]\n{stated}")).record
        return [p.sd_ratio or 0.0 for p in found.parameters]

    assert ratios(1.0, 5.0, "estimated") == pytest.approx(ratios(0.01, 0.05, "estimated"), rel=1e-6)
    assert max(ratios(1.0, 5.0, "estimated")) < 0.2
    assert min(ratios(1.0, 5.0, "stated")) > 0.9


def test_parameters_that_do_the_same_are_told(beam: Bench):
    """Frequencies of one plane: E and both I1 together do the same."""
    out = ", ".join(f'{{ mode = "{m}", reason = "other plane" }}' for m in (2, 4))
    both = TWICE.replace("PBAR 1 I1", 'PBAR 1 I1", "PBAR 2 I1')
    found = _measures(beam.study(f"leave_out = [{out}]\n{both}"))
    assert found.collinearity_index is None or found.collinearity_index > 100.0
    assert {found.pairs[0].first, found.pairs[0].second} == {"all", "root"}
    assert any("have nearly the same effect" in s for s in found.sentences)


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    ("groups", "names"),
    [
        ("parameters", {"root", "tip"}),
        ("properties", {"property 1", "property 2", "element 9"}),
        ("elements", {f"element {i}" for i in (1, 2, 3, 4, 9)}),
    ],
)
def test_energies_by_group_sum_to_all(beam: Bench, groups: str, names: set[str]):
    found = _measures(beam.study(f'{EI}[select]\nenergies = "{groups}"\n'))
    assert found.energy_groups == groups
    assert [e.test_label for e in found.energies] == ["1", "2", "3", "4"]
    for mode in found.energies:
        assert {g.group for g in mode.groups} == names
        assert sum(g.strain_percent or 0.0 for g in mode.groups) == pytest.approx(100.0)
        assert all(g.residual_percent is None for g in mode.groups)
    if groups != "parameters":
        assert sum(g.kinetic_percent for g in found.energies[0].groups) == pytest.approx(100.0)


def test_shares_of_a_stiffness_are_the_logarithmic_derivatives(beam: Bench):
    """Of I1, in modes that bend about it alone."""
    study = beam.study(f'{EI}[select]\nenergies = "parameters"\n')
    found = _measures(study)
    loaded = load_study(study)
    (_, solution) = next(iter(solved_cases(loaded, silent)))
    slopes = eigenvalue_derivatives(solution)[0] / solution.eigenvalues[0]
    shares = {g.group: g.strain_percent for g in found.energies[0].groups}
    np.testing.assert_allclose([shares["root"], shares["tip"]], 100.0 * slopes, rtol=1e-6)


@pytest.mark.slow
def test_what_contradicts_the_test_gathers_where_the_deck_is_wrong(bench: Bench):
    """Only the root differs, and all points are measured."""
    change = ("PBAR    1       1       1.0-3   2.0-7 ", "PBAR    1       1       1.0-3   3.0-7 ")
    bench.uff(bench.measure(bench.truth((change,))))
    found = _measures(bench.study(f'{EI}[select]\nenergies = "properties"\nlocalise = true\nnoise = 0.001\n'))
    of_plane = [e for e in found.energies if e.test_label in ("1", "3")]
    for mode in of_plane:
        assert mode.groups[0].group == "property 1"
        assert mode.groups[0].residual_percent > 80.0
        assert mode.contradiction_percent > 1.0


@pytest.mark.slow
def test_report_and_terminal_show_the_measures(beam: Bench):
    study = beam.study(f'{EI}[select]\nenergies = "properties"\nlocalise = true\n')
    run = ft.update(study)
    section = next(s for s in build_report(run.results, run.arrays).sections if s.id == "identifiability")
    titles = [getattr(b, "title", "") for b in section.blocks]
    assert "Choice of parameters" in titles
    assert sum(t.startswith("Energies:") for t in titles) == 4
    document = selection_document(subject_of(study), ft.select(study).record)
    shown = next(s for s in document.short if s.id == "choice")
    assert any(getattr(b, "title", "") == "Choice of parameters" for b in shown.blocks)
