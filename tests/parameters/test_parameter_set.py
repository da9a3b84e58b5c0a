"""Parameters: bounds, priors, ties, and the normalised vector that solvers move."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femtune.errors import FemtuneError, FemtuneErrors, Where
from femtune.parameters import Parameter, ParameterSet, parse_expression, tied


def _code(make: Any) -> str:
    with pytest.raises(FemtuneError) as caught:
        make()
    return caught.value.code


@pytest.mark.parametrize("name", ["1st", "a b", "", "a-b", "if", "lambda", "a.b"])
def test_a_name_must_be_usable_in_a_tie(name: str) -> None:
    assert _code(lambda: Parameter(name)) == "parameter.name"


@pytest.mark.parametrize(
    ("facts", "says"),
    [
        ({"lower": 2.0, "upper": 0.5}, "above the upper"),
        ({"lower": 1.0, "upper": 1.0}, "equals the upper"),
        ({"nominal": 3.0}, "outside the bounds"),
        ({"upper": np.inf}, "finite"),
        ({"nominal": np.nan}, "finite"),
    ],
)
def test_impossible_bounds(facts: dict[str, float], says: str) -> None:
    with pytest.raises(FemtuneError, match=says) as caught:
        Parameter("E", where=Where("study.toml", 12), **facts)  # type: ignore[arg-type]
    assert caught.value.code == "parameter.bounds"
    assert set(caught.value.values) == {"nominal", "lower", "upper"}


@pytest.mark.parametrize("facts", [{"prior_sd": 0.0}, {"prior_sd": -1.0}, {"prior_sd": np.nan}, {"prior_mean": np.inf}])
def test_impossible_priors(facts: dict[str, float]) -> None:
    assert _code(lambda: Parameter("E", **facts)) == "parameter.prior"  # type: ignore[arg-type]


def test_the_prior_is_that_of_a_uniform_distribution_where_none_is_given() -> None:
    p = Parameter("E", nominal=200.0, lower=100.0, upper=400.0)
    draws = np.linspace(100.0, 400.0, 200_001)
    assert p.mean == 200.0
    assert p.sd == pytest.approx(draws.std(), rel=1e-4)


def test_repeated_names_are_an_error() -> None:
    assert _code(lambda: ParameterSet((Parameter("a"), Parameter("a")))) == "parameter.duplicate"


def test_an_unknown_name_in_a_tie_gets_a_suggestion() -> None:
    with pytest.raises(FemtuneError, match="did you mean 'Icx1'") as caught:
        ParameterSet((Parameter("Icx1"), tied("Icx2", "2*Icx11")))
    assert caught.value.code == "tie.unknown"


def test_no_parameter_is_suggested_as_its_own_tie() -> None:
    with pytest.raises(FemtuneError) as caught:
        ParameterSet((Parameter("stiffness"), tied("joint1", "joint")))
    assert "joint1'?" not in caught.value.hint


@pytest.mark.parametrize("ties", [[("a", "a")], [("a", "b"), ("b", "a")], [("a", "b"), ("b", "c + 1"), ("c", "a*x")]])
def test_ties_that_go_round_are_an_error(ties: list[tuple[str, str]]) -> None:
    parameters = (Parameter("x"), *(tied(name, text) for name, text in ties))
    assert _code(lambda: ParameterSet(parameters)) == "tie.circle"


def test_a_tie_without_a_value_is_found_at_set_up() -> None:
    assert _code(lambda: ParameterSet((Parameter("a"), tied("b", "9**9**9**9*a")))) == "tie.value"
    assert _code(lambda: ParameterSet((Parameter("a"), tied("b", "1/(a - 1)")))) == "tie.value"


def test_problems_of_names_and_ties_are_shown_together() -> None:
    with pytest.raises(FemtuneErrors) as caught:
        ParameterSet((Parameter("a"), Parameter("a"), tied("b", "zzz")))
    assert {e.code for e in caught.value.errors} == {"parameter.duplicate", "tie.unknown"}


def _chain() -> ParameterSet:
    """Ties stand before what they use, and use each other."""
    return ParameterSet(
        (
            tied("c", "b*E"),
            tied("b", "sqrt(E)/t"),
            Parameter("E", 210.0, 100.0, 300.0),
            Parameter("t", 2.0, 1.0, 4.0),
            tied("fixed", "7"),
        )
    )


def test_ties_follow_what_they_use_whatever_the_order() -> None:
    values = _chain().values(np.array([0.1, -0.25]))
    e, t = 231.0, 1.5
    assert list(values) == ["c", "b", "E", "t", "fixed"]
    assert [values[n] for n in values] == pytest.approx([np.sqrt(e) / t * e, np.sqrt(e) / t, e, t, 7.0], rel=1e-14)


@given(x=st.lists(st.floats(-0.4, 0.4), min_size=2, max_size=2).map(np.array))
@settings(max_examples=40)
def test_derivatives_of_tied_parameters_are_those_of_complex_step(x: np.ndarray) -> None:
    parameters, h = _chain(), 1e-30
    exact = parameters.jets(x)["c"]
    steps = [parameters.jets(x + 1j * h * np.eye(2)[k])["c"] for k in range(2)]
    np.testing.assert_allclose(exact.grad, [s.value.imag / h for s in steps], rtol=1e-9)
    np.testing.assert_allclose(exact.hess, [s.grad.imag / h for s in steps], rtol=1e-9)


_BOUNDED = st.tuples(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.floats(1e-3, 1e6)).map(
    lambda t: Parameter("p", t[0], t[0] - t[1], t[0] + t[2])
)


@given(p=_BOUNDED, share=st.floats(0.0, 1.0))
def test_normalising_and_back_gives_the_same_value(p: Parameter, share: float) -> None:
    parameters = ParameterSet((p,))
    value = p.lower + share * (p.upper - p.lower)
    x = parameters.normalise([value])
    assert parameters.denormalise(x)[0] == pytest.approx(value, rel=1e-12, abs=1e-12 * p.scale)
    assert parameters.normalise([p.nominal])[0] == 0.0


def test_normalised_bounds_and_prior() -> None:
    parameters = ParameterSet(
        (
            Parameter("E", 200.0, 100.0, 300.0, prior_sd=20.0),
            Parameter("x", -2.0, -3.0, 0.0),
            Parameter("o", 0.0, -1, 3),
        )
    )
    lower, upper = parameters.bounds
    np.testing.assert_allclose(lower, [-0.5, -0.5, -0.25])
    np.testing.assert_allclose(upper, [0.5, 1.0, 0.75])
    mean, sd = parameters.prior
    np.testing.assert_allclose(mean, 0.0)
    np.testing.assert_allclose(sd[0], 0.1)


def test_a_larger_x_is_a_larger_value_where_the_nominal_value_is_negative() -> None:
    parameters = ParameterSet((Parameter("offset", -2.0, -3.0, -1.0),))
    assert parameters.denormalise(np.array([0.5]))[0] == -1.0


def test_only_free_parameters_have_a_place_in_x() -> None:
    parameters = _chain()
    assert [p.name for p in parameters.free] == ["E", "t"]
    assert parameters.index("t") == 1
    assert len(parameters) == 5
    assert not Parameter("q", tie=parse_expression("1")).free
