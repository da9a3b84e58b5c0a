"""Factors of the element matrices of a region."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import Structure
from femtune.fem.assemble import assemble
from femtune.fem.factors import with_factors
from femtune.fem.fields import factor_ref
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.parameters import Parameter, ParameterSet
from structures.frames import bars, make_structure, scalars

SECTION = {"E": 2.1e11, "G": 8.1e10, "A": 2e-4, "I1": 1.5e-8, "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0, "GE": 0.02}
XYZ = [[0.0, 0.0, 0.0], [1.3, 0.2, -0.1], [2.0, 1.0, 0.4]]


def _structure() -> Structure:
    return make_structure(
        XYZ, [bars([[0, 1], [1, 2]], SECTION), scalars("dashpot", [[0, 7], [3, -1]], "B", [2.0, 3.0])]
    )


def _model(words: list[str], elements: frozenset[int] | None):
    parameters = ParameterSet(tuple(Parameter(w.lower(), 1.0, 0.2, 3.0) for w in words))
    chosen = [Assignment(w.lower(), factor_ref(w), elements=elements) for w in words]
    return parametric_model(with_factors(_structure(), words), parameters, chosen)


def test_the_deck_stays_as_it_is():
    plain, factored = _structure(), with_factors(_structure(), ["STIFFNESS", "MASS", "VISCOUS"])
    for kind in ("stiffness", "mass", "viscous", "hysteretic"):
        np.testing.assert_array_equal(assemble(factored, kind).toarray(), assemble(plain, kind).toarray())


@pytest.mark.parametrize("elements", [None, frozenset([1]), frozenset([1, 2])])
def test_matrices_are_linear_in_the_factors_of_the_region(elements: frozenset[int] | None):
    words = ["STIFFNESS", "MASS", "VISCOUS"]
    held = Configuration(supports_added=((1, "123456"),))
    model = _model(words[:2], elements)
    at, start = (configure(model, held).at(np.array(x)) for x in ([0.5, -0.25], [0.0, 0.0]))
    for kind, p, change in (("stiffness", 0, 0.5), ("mass", 1, -0.25), ("hysteretic", 0, 0.5)):
        slope = getattr(start, f"{kind}_derivatives")[p].toarray()
        assert np.abs(slope).max() > 0
        moved = getattr(start, kind).toarray() + change * slope
        np.testing.assert_allclose(getattr(at, kind).toarray(), moved, atol=1e-13 * np.abs(moved).max())
        if elements != frozenset([1]):
            np.testing.assert_allclose(slope, getattr(start, kind).toarray(), atol=1e-13 * np.abs(slope).max())


def test_stiffness_and_mass_by_one_factor_leave_the_frequencies():
    model = _model(["STIFFNESS", "MASS"], None)
    held = configure(model, Configuration(supports_added=((1, "123456"),)))
    one, two = (solve_modes(held.at(np.array(x)), 3).freq_hz for x in ([0.0, 0.0], [0.6, 0.6]))
    np.testing.assert_allclose(one, two, rtol=1e-9)


def test_a_factor_without_matrices_in_its_region_is_refused():
    with pytest.raises(FemtuneError) as caught:
        _model(["VISCOUS"], frozenset([1]))
    assert caught.value.code == "parameter.without-effect"


def test_regions_that_overlap_are_refused():
    parameters = ParameterSet(tuple(Parameter(n, 1.0, 0.2, 3.0) for n in "ab"))
    both = [Assignment(n, factor_ref("STIFFNESS"), elements=frozenset(e)) for n, e in (("a", [1, 2]), ("b", [2]))]
    with pytest.raises(FemtuneError) as caught:
        parametric_model(with_factors(_structure(), ["STIFFNESS"]), parameters, both)
    assert caught.value.code == "parameter.field-twice"
