"""FRF residuals by superposition: enough modes by default, a stated error, and a warning that names what is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.steps.run.result import RunResult

from ..messages.shown import check_shown
from .cantilever import Bench
from .fine_cantilever import HIGHEST, TRUTH, measure


def run_with(bench: Bench, residual: str, modes: str = "") -> RunResult:
    path = bench.study(f'{bench.parameters}\n[[residual]]\nkind = "frf"\n{residual}\n', test="frfs.uff")
    text = path.read_text().replace("[modes]\ncount = 6\n", modes)
    return ft.run(bench.write("study.toml", text))


@pytest.fixture(scope="module")
def with_frfs(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = Bench(tmp_path_factory.mktemp("frfs"))
    measure(made, np.arange(10.0, HIGHEST + 5.0, 10.0))
    return made


def within_a_tenth_of_sigma(run: RunResult) -> None:
    update = run.results.update
    assert update is not None
    for p, truth in zip(update.parameters, TRUTH):
        assert p.sd is not None
        assert abs(p.value - truth) < 0.1 * p.sd


def alerts(run: RunResult, code: str) -> list[str]:
    return [a.sentence for a in run.results.alerts if a.code == code]


@pytest.mark.slow
@pytest.mark.parametrize("modes", ["", "[modes]\ncount = 4\n"])
def test_a_study_that_states_the_band_only_ends_at_the_truth(with_frfs: Bench, modes: str) -> None:
    run = run_with(with_frfs, f"to_hz = {HIGHEST}", modes)
    within_a_tenth_of_sigma(run)
    assert run.results.update is not None
    before, after = run.results.update.frf_truncation
    assert (before.stage, after.stage) == ("before", "after")
    for found in (before, after):
        assert found.small
        assert found.largest_sd is not None
        assert found.largest_sd < 0.02
        assert found.highest_line_hz == HIGHEST
        assert HIGHEST in found.lines_hz
        assert len(found.lines_hz) >= 4
        assert found.modes_to_hz is not None
        assert found.modes_to_hz > 1.5 * HIGHEST
    assert not alerts(run, "residual.frf-truncated")
    told = alerts(run, "residual.frf-more-modes")
    assert len(told) == bool(modes)
    if modes:
        assert "count = 4 of [modes]" in told[0]
        assert f"{TIMES_HIGHEST_LINE:g} times" in told[0]
        check_shown("residual.frf-more-modes", f"[residual.frf-more-modes] {told[0]}")
    assert run.report is not None
    assert "superposition of modes beside direct solutions" in Path(run.report).read_text(encoding="utf-8")


@pytest.mark.slow
def test_precise_measurements_take_more_modes(with_frfs: Bench) -> None:
    """Modes up to twice the highest line would leave 0.2 σ: further ones are taken until the error is small."""
    run = run_with(with_frfs, f"to_hz = {HIGHEST}\nsd = 0.0005", "[modes]\ncount = 4\n")
    within_a_tenth_of_sigma(run)
    assert run.results.update is not None
    for found in run.results.update.frf_truncation:
        assert found.small
        assert found.modes_to_hz is not None
        assert found.modes_to_hz > TIMES_HIGHEST_LINE * HIGHEST
    (told,) = alerts(run, "residual.frf-more-modes")
    assert "4 times" in told


@pytest.mark.slow
def test_too_few_modes_are_named_in_a_warning(with_frfs: Bench) -> None:
    run = run_with(with_frfs, f"to_hz = {HIGHEST}\ncount = 2\nresidual_vectors = false")
    told = alerts(run, "residual.frf-truncated")
    assert told
    assert '"count = 2"' in told[0]
    assert "missing: modes 3 to" in told[0]
    assert "1200 Hz" in told[0]
    check_shown("residual.frf-truncated", f"[residual.frf-truncated] {told[0]}")


@pytest.mark.slow
def test_the_direct_method_has_no_truncation(with_frfs: Bench) -> None:
    run = run_with(with_frfs, 'to_hz = 60.0\nmethod = "direct"')
    within_a_tenth_of_sigma(run)
    assert run.results.update is not None
    found = run.results.update.frf_truncation[-1]
    assert found.small
    assert found.largest_sd is None
    assert "without truncation" in found.sentence
