"""Does the chi-square test reject a right model in 5 % of all tests, for every kind of residual and scaling?"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import pytest
from scipy.stats import binom

from femtune.files.study_file.residual import TABLES
from femtune.kinds import loaded
from structures.chi_square import LEVEL, Trial, rejections, trials

DRAWS, _ONCE_IN_A_THOUSAND = 2000, 5e-4
_SCALES = ("unit-norm", "scale-factor", "largest-entry", "mass")
_DOFS = ("5 of 5 DOFs measured", "3 of 5 DOFs measured")
_OF_POLES = [
    f"{sd}{modes}"
    for sd in ("sd", "sd of the test", "covariance of the test")
    for modes in ("", ", repeated modes")
]  # fmt: skip
TESTED = {
    "frequency": ["frequency", "eigenvalue", "covariance"],
    "shape": [scale + weight for scale in _SCALES for weight in ("", ", deviations of the sensors", ", covariance")]
    + ["unit-norm, repeated modes", "mass, repeated modes"],
    "strain": _SCALES,
    "dynamic": _DOFS,
    "static displacement": _DOFS,
    "static force": _DOFS,
    "mass": ["measured twice"],
    "centre of gravity": ["measured twice"],
    "inertia": ["measured twice"],
    "frf": ["linear", "log-magnitude", "log-complex"],
    "antiresonance": [""],
    "complex eigenvalue": _OF_POLES,
    "damping ratio": _OF_POLES,
}
NOT_TESTED = {"MAC": ["root", "ratio", "difference"], "flexibility": ["matrix", "diagonal"]}


def _names(forms: dict[str, Sequence[str]]) -> list[object]:
    """The names alone: the trials solve models, which is not to be done where these tests are only collected."""
    return [pytest.param((kind, form), id=f"{kind} {form}") for kind, of_kind in forms.items() for form in of_kind]


@lru_cache(maxsize=1)
def _trials() -> dict[tuple[str, str], tuple[int, Trial]]:
    return {(trial.kind, trial.form): (seed, trial) for seed, trial in enumerate(trials())}


@pytest.mark.parametrize("name", _names(TESTED))
@pytest.mark.quick(2, rest="long")
@pytest.mark.slow
def test_a_right_model_is_rejected_as_often_as_the_level_says(name: tuple[str, str]) -> None:
    seed, trial = _trials()[name]
    found = rejections(trial, DRAWS, seed)
    lower, upper = (binom.ppf(p, DRAWS, LEVEL) for p in (_ONCE_IN_A_THOUSAND, 1.0 - _ONCE_IN_A_THOUSAND))
    assert lower <= found.rate * DRAWS <= upper


@pytest.mark.parametrize("name", _names(NOT_TESTED))
@pytest.mark.slow
def test_kinds_that_are_not_tested_could_not_be(name: tuple[str, str]) -> None:
    seed, trial = _trials()[name]
    found = rejections(trial, DRAWS, seed)
    assert found.rate > 2.0 * LEVEL
    assert found.why_not


@pytest.mark.slow
def test_every_kind_of_a_study_is_tried() -> None:
    made = _trials()
    assert {kind for kind, _ in made} == {loaded(table.made_by).label for table in TABLES.values()}
    tested = {name for name, (_, t) in made.items() if not any(b.not_normal for b in t.exact)}
    assert tested == {(kind, form) for kind, forms in TESTED.items() for form in forms}
    assert made.keys() - tested == {(kind, form) for kind, forms in NOT_TESTED.items() for form in forms}


@pytest.mark.slow
def test_degrees_of_freedom_by_hand() -> None:
    """Four shapes at five sensors, three parameters; 15 equation errors, of which 3 modes at 3 or 5 sensors count."""
    freedom = {(t.kind, t.form): sum(len(b.values) - b.lost for b in t.exact) - 3 for _, t in _trials().values()}
    assert freedom["shape", "unit-norm"] == freedom["shape", "scale-factor"] == 4 * 5 - 4 - 3
    assert freedom["shape", "largest-entry"] == 4 * 4 - 3
    assert freedom["shape", "mass"] == 4 * 5 - 3
    assert freedom["strain", "unit-norm"] == 4 * 5 - 4 - 3
    assert freedom["dynamic", "3 of 5 DOFs measured"] == 3 * 3 - 3
    assert freedom["dynamic", "5 of 5 DOFs measured"] == 3 * 5 - 3
    # six shapes at six sensors in a ring, two of the pairs repeated
    assert freedom["shape", "unit-norm, repeated modes"] == 6 * 6 - 6 - 2 - 3
