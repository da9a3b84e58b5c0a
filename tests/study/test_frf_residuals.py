"""[[residual]] tables of measured FRFs through whole runs: stiffness, loss factors, dashpots and modal damping."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.uff import write_uff_frfs
from femtune.model import constant_damping
from femtune.residuals import FrfResidual
from femtune.residuals.frf.model_way import settled
from femtune.steps.report.build import build_report
from femtune.steps.report.view import view_of
from femtune.steps.report_source import ReportSource
from femtune.study.study import load_study

from .cantilever import CANTILEVER, Bench
from .damped_cantilever import DAMPED, LABELS, PARAMETERS, TRULY, TRUTH, functions, study_of


@pytest.fixture
def true_deck(bench: Bench) -> Path:
    return bench.truth(TRULY, DAMPED)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["log-complex", "log-magnitude", "linear"])
def test_stiffness_loss_factor_and_dashpot_are_found(bench: Bench, true_deck: Path, form: str) -> None:
    bench.functions(functions(true_deck))
    more = "to_hz = 60.0\n" if form == "linear" else ""
    text = f'kind = "frf"\nform = "{form}"\ncount = 20\n{more}'
    start = PARAMETERS
    if form == "linear":
        # peaks of the linear form attract from a bandwidth or two away only
        start = start.replace('fields = ["PBAR 1 I1"]\n', 'fields = ["PBAR 1 I1"]\nnominal = 1.29\n').replace(
            'fields = ["PBAR 2 I1"]\n', 'fields = ["PBAR 2 I1"]\nnominal = 0.853\n'
        )
    run = ft.run(study_of(bench, text, start))
    update = run.results.update
    assert update is not None
    assert update.ok
    assert [p.value for p in update.parameters] == pytest.approx(TRUTH, rel=2e-3)
    (record,) = update.residual_counts
    assert record.kind == "frf"
    assert record.rms_after is not None
    assert record.rms_before is not None
    assert record.rms_after < 0.01 * record.rms_before


@pytest.mark.slow
def test_noise_and_honest_standard_deviations(bench: Bench, true_deck: Path) -> None:
    bench.functions(functions(true_deck, 0.005))
    update = ft.run(study_of(bench, 'kind = "frf"\nfloor = 0.005\ncount = 20')).results.update
    assert update is not None
    for parameter, truth in zip(update.parameters, TRUTH):
        assert parameter.sd is not None
        assert abs(parameter.value - truth) < 4.0 * parameter.sd
        assert parameter.sd < 0.1 * truth
    (record,) = update.residual_counts
    assert record.rms_after == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_damping_in_the_resonance_regions_with_modes_and_functions_of_one_file(bench: Bench, true_deck: Path) -> None:
    """Stiffness stays wrong; the model's functions are stretched onto the test's peaks, so that damping comes right."""
    modes = bench.measure(true_deck, *LABELS, count=4)
    assert modes.modes is not None
    modes = replace(modes, modes=replace(modes.modes, damping_ratio=np.full(4, 0.02)))
    both = replace(modes, frfs=functions(true_deck))
    bench.uff(modes, "both.uff")
    frfs_file = bench.folder / "only.uff"
    write_uff_frfs(frfs_file, both)
    functions_only = [part for part in frfs_file.read_text().split("    -1\n") if part.split("\n")[0].strip() == "58"]
    text = "".join(f"    -1\n{part}    -1\n" for part in functions_only)
    bench.write("both.uff", (bench.folder / "both.uff").read_text() + text)
    residual = 'kind = "frf"\naround = "resonances"\naligned = true\nregion_ratio = 0.02\ncount = 20'
    only_damping = PARAMETERS[PARAMETERS.index('[[parameter]]\nname = "loss"') :]
    run = ft.run(study_of(bench, residual, only_damping, "both.uff"))
    update = run.results.update
    assert update is not None
    assert update.parameters[0].value == pytest.approx(0.03, rel=0.1)
    # the identified test stays in the picture while the update moves
    (compared,) = update.frfs
    assert compared.identified_values_key is not None
    history = view_of(ReportSource(run.results, run.arrays)).history
    assert history is not None
    (moving,) = history.functions
    assert (moving.test_look, [c.look for c in moving.beside]) == ("test", ["identified"])


@pytest.mark.slow
def test_modal_damping_is_found_and_told_where_the_deck_has_no_card_for_it(bench: Bench) -> None:
    bench.functions(functions(bench.truth((), CANTILEVER), damping=constant_damping(0.02)))
    bench.write("beam.bdf", CANTILEVER)
    zeta = 'name = "zeta"\nfields = ["MODAL ZETA"]\nlower = 0.001\nupper = 0.2\nabsolute = true\nnominal = 0.005\n'
    run = ft.run(bench.study(f'[[parameter]]\n{zeta}[[residual]]\nkind = "frf"\ncount = 20\n', test="frfs.uff"))
    assert run.results.update is not None
    assert run.results.update.parameters[0].value == pytest.approx(0.02, rel=1e-4)
    assert run.results.write_back is not None
    assert any("zeta: the damping ratio 0.02" in s for s in run.results.write_back.without_field)


@pytest.mark.slow
def test_antiresonances_update_stiffness(bench: Bench, true_deck: Path) -> None:
    seen = ("2Y+", "3Y+", "4Y+", "5Y+")
    bench.functions(functions(true_deck, 0.0, ("3Y+", "5Y+"), seen))
    stiffness = PARAMETERS[: PARAMETERS.index('[[parameter]]\nname = "loss"')]
    update = ft.run(study_of(bench, 'kind = "antiresonance"\ncount = 20', stiffness)).results.update
    assert update is not None
    assert update.ok
    assert [p.value for p in update.parameters] == pytest.approx(TRUTH[:2], rel=0.02)
    assert update.residual_counts[0].kind == "antiresonance"


@pytest.mark.slow
def test_a_channel_that_does_not_couple_is_named_in_the_alerts(bench: Bench, true_deck: Path) -> None:
    bench.functions(functions(true_deck, 1e-4, ("5Y+",)))
    run = ft.run(study_of(bench, 'kind = "frf"\ncount = 20'))
    (alert,) = [a for a in run.results.alerts if a.code == "residual.silent-frf"]
    assert alert.sentence.endswith(": 5Z+ / 5Y+")


REFUSED = {
    "no functions": ('kind = "frf"', "residual.no-frfs"),
    "unknown output": ('kind = "frf"\noutputs = ["4Y+"]', "dof.missing"),
    "no line": ('kind = "frf"\nfrom_hz = 900.0', "residual.no-frf-lines"),
    "falling band": ('kind = "frf"\nfrom_hz = 9.0\nto_hz = 5.0', "study.response-lines"),
    "no modes": ('kind = "frf"\naround = "resonances"', "study.no-test"),
    "no scatter": ('kind = "frf"\nsd = 0.0', "residual.zero-variance"),
    "no coherence": ('kind = "frf"\naverages = 20', "residual.no-coherence"),
    "keys of regions": ('kind = "frf"\nbandwidths = 2.0', "study.residual-lines"),
    "two ratios": ('kind = "frf"\nratio = 0.01\nratios = [0.01]', "study.response-ratios"),
    "two numbers of modes": ('kind = "antiresonance"\ncount = 3\nmax_hz = 90.0', "study.modes"),
    "no antiresonance": ('kind = "antiresonance"\nfrom_hz = 230.0', "residual.no-antiresonances"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_compared_is_refused_in_a_sentence(name: str, bench: Bench, true_deck: Path) -> None:
    text, code = REFUSED[name]
    bench.functions(functions(true_deck))
    if name == "no functions":
        bench.uff(bench.measure(true_deck), "frfs.uff")
    with pytest.raises(FemtuneError) as error:
        load_study(study_of(bench, text)).problem().start(np.zeros(4))
    assert error.value.code == code
    assert error.value.hint


@pytest.mark.slow
def test_what_is_seen_only_at_the_start_points_to_its_own_table(bench: Bench, true_deck: Path) -> None:
    bench.functions(functions(true_deck))
    path = study_of(bench, 'kind = "frf"\nto_hz = 50.0\n\n[[residual]]\nkind = "frf"\nfrom_hz = 900.0')
    with pytest.raises(FemtuneError, match="no frequency line from 900 Hz on") as error:
        load_study(path).problem().start(np.zeros(4))
    tables = [i for i, line in enumerate(path.read_text().splitlines(), start=1) if line == "[[residual]]"]
    assert error.value.where is not None
    assert error.value.where.line == tables[-1]


@pytest.mark.slow
def test_functions_on_reduced_models(bench: Bench, true_deck: Path) -> None:
    """The same end as with the full model, the comparison of both in the results and in the report."""
    bench.functions(functions(true_deck, 0.002))
    ends = []
    for table in ("", "\n[reduction]\n"):
        run = ft.run(study_of(bench, f'kind = "frf"\nfloor = 0.002\n{table}'))
        assert run.results.update is not None
        ends.append((run, run.results.update))
    (_, full), (run, reduced) = ends
    assert full.reduction is None
    assert reduced.reduction is not None
    assert reduced.reduction.certified
    (model,) = reduced.reduction.models
    assert model.frf_residuals == 1
    assert reduced.reduction.frfs is not None
    assert reduced.reduction.frfs.shift <= reduced.reduction.frfs.tolerance == pytest.approx(0.01)
    for a, b in zip(full.parameters, reduced.parameters):
        assert a.sd is not None
        assert abs(a.value - b.value) < 0.01 * a.sd
    text = str(build_report(run.results, run.arrays))
    assert "0.01 standard deviations of the parameters (FRFs)" in text


@pytest.mark.slow
def test_poor_channels_and_turned_sensors_weigh_less(bench: Bench, true_deck: Path) -> None:
    """σ of the logarithm: that of the output; with a turned sensor more where the other axis moves more."""
    bench.functions(functions(true_deck))
    weights = 'sd = 0.02\noutput_sd = { "3Y+" = 0.3 }\nangle_sd_deg = { 5 = 2.0 }'
    study = load_study(study_of(bench, f'kind = "frf"\ncount = 20\n{weights}'))
    study.problem().start(np.zeros(4))
    assert study.cases[0].compared is not None
    residual = settled(study.cases[0].compared.residuals[0])
    assert isinstance(residual, FrfResidual)
    H, column = np.abs(residual.measured.values), 0
    y, z = H[1, column], H[2, column]
    turned = [np.sqrt(0.02**2 + 0.5 * (np.deg2rad(2.0) * ratio) ** 2) for ratio in (z / y, y / z)]
    expected = [np.full(len(y), 0.3), *turned]
    for row, sd in enumerate(expected):
        known = np.isfinite(residual.sd[row, column])
        assert residual.sd[row, column][known] == pytest.approx(sd[known], rel=1e-9)
    wrong = study_of(bench, 'kind = "frf"\ncount = 20\noutput_sd = { "4Y+" = 0.3 }')
    with pytest.raises(FemtuneError) as caught:
        load_study(wrong)
    assert caught.value.code == "dof.missing"
