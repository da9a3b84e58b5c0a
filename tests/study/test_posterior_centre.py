"""Errors of the model are linearised about the changes that the data want, not about none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femtune.arrays import Reals
from femtune.sampling import Known, SamplingRules, Solving, kept_blocks
from femtune.steps.posterior import centre
from femtune.steps.posterior.centre import about_most_probable
from femtune.steps.posterior.model_errors import ModelErrors, UnknownChanges, unknown_changes
from femtune.steps.posterior.problem import likelihood_of, sampler_of, solving_of
from femtune.study.described import source_of
from femtune.study.study import load_study
from femtune.updating import update
from structures.wrong_property import FRAME

TRUTH = {"PBAR 1 I2": 1.1, "PBAR 3 I2": 0.9, "PBAR 4 I2": 1.15}
RULES = SamplingRules(draws=120, seed=3)


class Sampled:
    """A study of the frame up to what is sampled."""

    def __init__(self, folder: Path, truth: dict[str, float]) -> None:
        self.study = load_study(source_of(FRAME.study(folder, truth)))
        problem = self.study.problem()
        self.result = update(problem)
        self.solving = solving_of(problem, self.result)
        changes = unknown_changes(self.study, self.result, self.solving)
        assert isinstance(changes, UnknownChanges)
        self.changes = changes
        self.about_none = self.solving, changes.about(changes.end)
        self.about_wanted = about_most_probable(changes, self.solving, self.result, "stated", RULES)

    def most_likely(self, solving: Solving, errors: ModelErrors) -> tuple[Reals, Reals]:
        """Parameters and changes, with linearised residuals."""
        likelihood = likelihood_of(self.solving, self.result, "stated", errors)

        def model(points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
            return [Known(x, s.residuals, s.jacobian) for x in points for s in [solving((x, derivatives))]]

        sampler = sampler_of(solving, likelihood, RULES, model)
        x, theta, _ = sampler.most_likely()
        return x, likelihood.factors(solving((x, False)).residuals[None], theta[None])[0]

    def missed(self, solving: Solving, errors: ModelErrors, x: Reals, q: Reals) -> float:
        """Length of the difference of residuals to those of the model with the changes, in standard deviations."""
        there = np.concatenate([self.result.x, errors.raw @ q])
        there[solving.moving] = x
        true = np.concatenate([b.values for b in kept_blocks(self.changes.problem.follow(there, self.changes.end))])
        near = solving((x, False)).residuals + errors.B @ q
        return float(np.linalg.norm(near[: len(true)] - true))


@pytest.mark.slow
def test_strong_changes_are_where_the_model_has_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = Sampled(tmp_path, TRUTH | {"PBAR 2 I2": 1.5, "CONM2 912 M": 1.5})
    solving, errors = found.about_wanted
    assert solving.shift is not None
    before = found.missed(*found.about_none, *found.most_likely(*found.about_none))
    x, q = found.most_likely(solving, errors)
    after = found.missed(solving, errors, x, q)
    # before: many standard deviations of the data
    assert after < 0.5
    assert before > 10.0 * after
    # nearby too, with derivatives of the same
    rng = np.random.default_rng(1)
    step = 1e-5 * rng.standard_normal(len(x))
    here, there = solving((x, True)), solving((x + step, False))
    assert here.jacobian is not None
    np.testing.assert_allclose(there.residuals - here.residuals, here.jacobian @ step, rtol=0, atol=1e-6)
    for _ in range(5):
        moved = x + 0.02 * rng.standard_normal(len(x))
        assert found.missed(solving, errors, moved, q * rng.uniform(0.9, 1.1, len(q))) < 1.0
    # a model that is too large is not solved with changes
    monkeypatch.setattr(centre, "MOST_DOFS", 10)
    large, about = about_most_probable(found.changes, found.solving, found.result, "stated", RULES)
    assert large.shift is None
    assert {c.name for c in about.classes} == {c.name for c in errors.classes}


@pytest.mark.slow
def test_a_right_model_is_sampled_as_it_is(tmp_path: Path) -> None:
    found = Sampled(tmp_path, TRUTH)
    solving, errors = found.about_wanted
    assert solving.shift is None
    np.testing.assert_array_equal(errors.B, found.about_none[1].B)
    # changes of the model explain any seven frequencies, but not 112 entries of shapes
    groups = likelihood_of(found.solving, found.result, "by-kind", errors).groups
    assert {g.name: g.estimated for g in groups} == {"frequency": False, "shape": True}
    groups = likelihood_of(found.solving, found.result, "by-kind").groups
    assert {g.name: g.estimated for g in groups} == {"frequency": True, "shape": True}
    # sizes at which floating point does not tell the changes apart are not likely
    likelihood = likelihood_of(found.solving, found.result, "stated", errors)
    far = np.zeros((1, likelihood.size))
    far[:] = 60.0
    assert likelihood.at(solving.of(solving.at, False).residuals[None], far)[0] == -np.inf
    # without anything that could change there is nothing to be about
    nothing = replace(found.changes, changes=())
    solving, errors = about_most_probable(nothing, found.solving, found.result, "stated", RULES)
    assert (solving.shift, errors.classes) == (None, ())
    assert "no change" in errors.reason
