"""[posterior] through whole runs: results, page, interrupted runs."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.posterior.run import POSTERIOR_FILE

from .cantilever import EI, TRUE, Bench

TABLE = '\n[residuals]\nfrequency_sd = 0.01\n[posterior]\nnoise = "stated"\ndraws = 120\nstarts = 2\nseed = 4\n'


@pytest.mark.slow
def test_a_run_with_a_posterior(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text)
    bench.uff(bench.measure(bench.truth(TRUE)))
    study = bench.study(f"{EI}{TABLE}")
    run = ft.run(study)
    found = run.results.posterior
    assert found is not None
    samples, weights = run.arrays[found.samples_key], run.arrays[found.weights_key]
    assert samples.shape == (found.draws, 2)
    assert weights.sum() == pytest.approx(1.0)
    assert found.effective > 60
    # errors of one percent and no misfit: the truth is inside, and the linear interval does
    for p, truth in zip(found.parameters, (1.3, 0.85)):
        assert p.interval_95[0] < truth < p.interval_95[1]
        assert p.mean == pytest.approx(float(weights @ samples[:, found.free.index(p.parameter)]))
    assert [row.parameter for row in run.posterior] == ["root", "tip"]
    assert not found.others
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "Posterior distribution" in page
    assert "Distribution of the parameters: filled the samples" in page
    # an interrupted run solves what is missing, with the same result
    file = run.folder / POSTERIOR_FILE
    lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(b"".join(lines[: len(lines) // 2]))
    again = ft.posterior(study)
    other = again.results.posterior
    assert other is not None
    assert 0 < other.recalled < found.draws
    apart = {"seconds", "recalled"}
    assert other.model_dump(exclude=apart) == found.model_dump(exclude=apart)
    for key in (found.samples_key, found.weights_key, found.sizes_key):
        np.testing.assert_array_equal(again.arrays[key], run.arrays[key])


def test_samples_for_arviz_have_the_weights_of_the_run(bench: Bench) -> None:
    with warnings.catch_warnings():
        # ArviZ announces its next version
        warnings.simplefilter("ignore")
        pytest.importorskip("arviz")
    bench.uff(bench.measure(bench.truth(TRUE)))
    found = ft.posterior(bench.study(f'{EI}{TABLE}discrepancy = "none"\n'))
    record = found.results.posterior
    assert record is not None
    data = ft.to_inference_data(found)
    for name, column in zip(record.free, found.arrays[record.samples_key].T):
        drawn = data.posterior[name].to_numpy().ravel()
        assert len(drawn) == record.draws
        mean = float(found.arrays[record.weights_key] @ column)
        # each sample as often as its weight asks for, within one
        assert abs(drawn.mean() - mean) < 0.1 * column.std()
        every, place = np.unique(column, return_inverse=True)
        wanted = np.bincount(place, found.arrays[record.weights_key]) * record.draws
        counts = (drawn[:, None] == every).sum(axis=0)
        assert (np.abs(counts - wanted) < np.bincount(place)).all()
    assert data.attrs["log_evidence"] == record.log_evidence


def test_a_run_without_samples_has_none_for_arviz(bench: Bench) -> None:
    bench.uff(bench.measure(bench.truth(TRUE)))
    found = ft.run(bench.study(f"{EI}\n[residuals]\nfrequency_sd = 0.01\n"))
    with pytest.raises(FemtuneError) as caught:
        ft.to_inference_data(found)
    check_shown("posterior.none", caught.value)


@pytest.mark.slow
def test_transitional_chains_in_a_run(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text)
    bench.uff(bench.measure(bench.truth(TRUE)))
    study = bench.study(f'{EI}{TABLE}sampling = "tmcmc"\ndiscrepancy = "none"\n'.replace("draws = 120", "draws = 800"))
    run = ft.run(study)
    found = run.results.posterior
    assert found is not None
    assert (found.drawn_from, found.degree, found.r_hat, found.surrogate_error) == ("tmcmc", 0, None, None)
    assert found.stages > 2
    assert f"after {found.stages} stages of TMCMC" in found.sentences[-1]
    for p, truth in zip(found.parameters, (1.3, 0.85)):
        assert p.interval_95[0] < truth < p.interval_95[1]
        assert p.sd == pytest.approx(p.linear_sd, rel=0.5)
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "stages of transitional Markov chain Monte Carlo" in page
    # what was solved is not solved again
    file = run.folder / POSTERIOR_FILE
    lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(b"".join(lines[: len(lines) // 2]))
    other = ft.posterior(study).results.posterior
    assert other is not None
    assert other.recalled > 0.4 * found.plain_solutions
    apart = {"seconds", "recalled"}
    assert other.model_dump(exclude=apart) == found.model_dump(exclude=apart)
