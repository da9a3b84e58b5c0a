"""What is said where there is no posterior distribution, or where it is limited."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.residuals import ResidualBlock
from femtune.sampling import ChainRules, Known, Likelihood, NormalBox, Sampler, SamplingRules, Scaled, noise_groups
from femtune.status import Status
from femtune.steps.posterior.facts import limits_of
from femtune.steps.posterior.problem import solving_of
from femtune.steps.posterior.record import OtherRegion, PosteriorFrequency, PosteriorNoise, PosteriorResults
from femtune.steps.posterior.run import check_posterior, posterior_at
from femtune.study.progress import silent


@pytest.mark.parametrize("problem", ["stages", "external", "specimens"])
def test_studies_that_have_no_likelihood_of_one_model(problem: str) -> None:
    file = SimpleNamespace(
        where=lambda *keys: None, stage=("all",) if problem == "stages" else (),
        specimens={"a": 1} if problem == "specimens" else {},
    )  # fmt: skip
    study: Any = SimpleNamespace(file=file, source=SimpleNamespace(needs_runs=problem == "external"))
    with pytest.raises(FemtuneError) as caught:
        check_posterior(study)
    check_shown(f"posterior.{problem}", caught.value)


def test_an_update_without_an_optimum() -> None:
    study: Any = SimpleNamespace(file=SimpleNamespace(posterior=object(), where=lambda *keys: None))
    update: Any = SimpleNamespace(result=SimpleNamespace(status=Status.MAX_ITERATIONS))
    with pytest.raises(FemtuneError) as caught:
        posterior_at(study, update, Path(), {}, silent)
    check_shown("posterior.not-converged", caught.value)


def test_residuals_without_a_distribution() -> None:
    block = ResidualBlock("MAC", "", "1", np.zeros(1), np.zeros((1, 1)), 0.1, not_normal="its errors are squares")
    found: Any = SimpleNamespace(after=SimpleNamespace(weighted=(block,)))
    problem: Any = None
    with pytest.raises(FemtuneError) as caught:
        solving_of(problem, found, False)
    check_shown("posterior.no-likelihood", caught.value)


def test_a_model_that_cannot_be_solved_at_the_samples() -> None:
    def model(points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
        return [None] * len(points)

    groups = noise_groups(np.array(["a"] * 2), np.zeros(2, bool), {}, "stated", {}, 3.0)
    known, scaled = Known(np.zeros(2), np.zeros(2), 9.0 * np.eye(2)), Scaled.identity(2)
    rules = SamplingRules(chain=ChainRules(16, (5, 5), 20, 20, 10))
    likelihood = Likelihood(groups, (), np.zeros((2, 0)))
    with pytest.raises(FemtuneError) as caught:
        Sampler(likelihood, NormalBox(-np.ones(2), np.ones(2)), known, scaled, model, rules).run()
    check_shown("posterior.not-sampled", caught.value)


def test_what_limits_samples_is_told() -> None:
    noise = PosteriorNoise(residuals="mass", count=1.0, factor=1.0, interval_95=None)
    missed = PosteriorFrequency(
        configuration="free", mode=9, value_hz=41.0, median_hz=41.0, interval_95=(40.6, 41.4), test_mode="3",
        measured_hz=42.3, measured_inside=False,
    )  # fmt: skip
    region = OtherRegion(values=(1.25, 0.8), log_likelihood_difference=-0.1, starts=2)
    fine: dict[str, Any] = {
        "noise": "by-kind", "others": (), "free": ("left", "right"), "paired_anew_percent": 0.0, "r_hat": 1.004,
        "surrogate_error": 0.2, "effective": 900.0, "draws": 1000, "failed": 0, "gradient_solutions": 60,
        "plain_solutions": 1200,
        "full_model_error": None, "left_out": (), "noise_levels": (),
        "changes_not_settled": "", "frequencies": (), "unused_chance": None, "predictions": 200,
        "predictions_failed": 0,
    }  # fmt: skip
    assert not list(limits_of(PosteriorResults.model_construct(**fine)))
    limits = {
        "other-region": {"others": (region,)}, "paired-anew": {"paired_anew_percent": 12.0},
        "slow-chains": {"r_hat": 1.042}, "few-effective": {"effective": 180.0}, "rough": {"surrogate_error": 2.3},
        "failed": {"failed": 40},
        "reduced-model": {"full_model_error": 0.9}, "left-out": {"left_out": ("MAC: its errors are squares",)},
        "prediction-missed": {"frequencies": (missed, missed), "unused_chance": 0.005},
        "predictions-failed": {"predictions_failed": 12},
        "noise-as-stated": {"noise_levels": (noise,)},
        "changes-not-settled": {
            "changes_not_settled": "the most probable changes did not converge within 8 linearisations"
        },
    }  # fmt: skip
    for problem, change in limits.items():
        (told,) = limits_of(PosteriorResults.model_construct(**{**fine, **change}))
        check_shown(f"posterior.{problem}", f"[{told.code}] {told.sentence}")
