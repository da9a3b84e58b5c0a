"""[posterior] through whole runs: results, page, interrupted runs."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.model import Configuration
from femtune.steps.posterior.run import POSTERIOR_FILE

from .cantilever import EI, TRUE, Bench, bounded, measured

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
    assert "Distribution of the parameters. Filled: the samples" in page
    # the table of the update says where the sampled intervals are
    assert "The study has a sampled distribution of the parameters" in page
    # also beside what changed, on the first page
    changed = page.partition("What changed")[2].partition("Reasons for the verdict")[0]
    assert "The study has a sampled distribution of the parameters" in changed
    assert "times as wide as those of the update" in page
    # an interrupted run solves what is missing, with the same result
    file = run.folder / POSTERIOR_FILE
    lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(b"".join(lines[: len(lines) // 2]))
    signed = run.folder / "posterior.html"
    again = ft.posterior(study, report=signed)
    assert again.report == signed
    text = signed.read_text(encoding="utf-8")
    assert all(words in text for words in ("Basis of the report", "Approval", "Posterior distribution"))
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


LOADED = """
[[configuration]]
name = "bare"
test = "beam.uff"
elements_off = [9]

[[configuration]]
name = "loaded"
{test}

[[configuration]]
name = "held"
supports_added = ["5:123"]
"""
FEW = """
[residuals]
frequency_sd = {sd}
[posterior]
noise = "stated"
draws = 400
starts = 0
discrepancy = "none"
"""


@pytest.mark.slow
def test_what_a_further_test_would_teach_is_what_it_then_teaches(bench: Bench) -> None:
    """A mass on a beam whose root and tip are known: nothing tells the mass but a test with it."""
    bench.write("beam.bdf", bench.text)
    truth = bench.truth(TRUE)
    off = Configuration(elements_off=frozenset({9}))
    bench.uff(measured(truth, count=6, configuration=off))
    bench.uff(measured(truth, count=6), "loaded.uff")
    free = f"{EI}{bounded('mass', 'CONM2 9 M')}"
    tail = free + FEW.format(sd=0.01) + "further_sd = 0.01\n"
    before = ft.posterior(bench.study(LOADED.format(test="") + tail, test=None), output=bench.folder / "a")
    record = before.results.posterior
    assert record is not None
    assert {f.configuration for f in record.further} == {"loaded", "held"}
    assert record.further[0].configuration == "loaded"
    assert any("A test of loaded, 6 frequencies" in s for s in record.sentences)
    after = ft.posterior(
        bench.study(LOADED.format(test='test = "loaded.uff"') + tail, test=None), output=bench.folder / "b"
    )
    then = after.results.posterior
    assert then is not None
    assert [f.configuration for f in then.further] == ["held"]
    sds = {p.parameter: p.sd for p in then.parameters}
    loaded = {p.parameter: p for p in record.further[0].parameters}
    assert loaded["mass"].sd > 0.3
    for name, sd in sds.items():
        # the mass may be anything between its bounds before: what the test then teaches depends on its value
        assert loaded[name].sd_after == pytest.approx(sd, rel=0.35 if name != "mass" else 0.8), name
    assert loaded["mass"].sd_after < 0.3 * loaded["mass"].sd
    # what is known already teaches less
    assert then.further[0].bits < record.further[0].bits
    page = before.folder / "report.html" if before.folder else None
    assert page is None or not page.exists() or "What a further test would teach" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_further_tests_of_large_models_are_left_out_with_a_sentence(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.write("beam.bdf", bench.text)
    bench.uff(measured(bench.truth(TRUE), count=6, configuration=Configuration(elements_off=frozenset({9}))))
    monkeypatch.setattr("femtune.steps.posterior.further.MOST_DOFS", 10)
    record = ft.posterior(bench.study(LOADED.format(test="") + EI + FEW.format(sd=0.01), test=None)).results.posterior
    assert record is not None
    assert record.further == ()
    assert any("What a test of loaded, held would teach was not computed" in s for s in record.sentences)


@pytest.mark.slow
def test_the_information_of_one_frequency_in_closed_form(bench: Bench) -> None:
    """One stiffness of the whole beam: the logarithm of each frequency has half of its relative deviation."""
    bench.write("beam.bdf", bench.text)
    bench.uff(bench.measure(bench.truth(())))
    one = '[[parameter]]\nname = "E"\nfields = ["MAT1 1 E"]\nlower = 0.5\nupper = 2.0\n'
    text = (
        '[[configuration]]\nname = "bare"\ntest = "beam.uff"\n[[configuration]]\nname = "light"\nelements_off = [9]\n'
    )
    tail = text + one + FEW.format(sd=0.04) + "further_sd = 0.02\n"
    record = ft.posterior(bench.study(tail, test=None)).results.posterior
    assert record is not None
    (light,) = record.further
    (modulus,) = light.parameters
    ratio = len(light.modes) * (0.5 * modulus.sd) ** 2 / 0.02**2
    # of 200 samples
    assert light.bits == pytest.approx(0.5 * np.log2(1.0 + ratio), rel=0.15)
    assert modulus.sd_after == pytest.approx(modulus.sd / np.sqrt(1.0 + ratio), rel=0.1)
