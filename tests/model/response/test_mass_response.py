"""Mass properties as responses, against the checks of the kernel and complex steps."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem import FieldRef
from femtune.fem.checks import mass_properties
from femtune.model import (
    AddedMass,
    Assignment,
    Configuration,
    ConfiguredModel,
    configure,
    grid_matrix,
    parametric_model,
)
from femtune.model.response import mass_response
from femtune.parameters import Parameter, ParameterSet
from structures.frames import bars, make_structure, masses

from .models import SECTION

FIELDS = {
    "area": FieldRef("CBAR", 1, "A"),
    "density": FieldRef("CBAR", 2, "rho"),
    "block": FieldRef("CONM2", 1001, "M"),
}
CONFIGURATION = Configuration(elements_off=frozenset({3}), masses=(AddedMass(2, 0.7, (0.1, 0.0, 0.2)),))


def _model(consistent: bool) -> ConfiguredModel:
    xyz = [[0, 0, 0], [0, 0, 1], [1, 0, 1.1], [1.2, 0.1, 0]]
    parts = [
        bars([[0, 1], [1, 2], [2, 3]], SECTION, orientation=(0.3, 1.0, 0.2)),
        masses([3], {"M": 0.4, "I11": 1e-3, "I22": 2e-3, "I33": 1e-3}, (0.02, 0.0, 0.05)),
    ]
    kinds = dict.fromkeys((1, 2, 3), "CBAR") | {1001: "CONM2"}
    structure = make_structure(xyz, parts, permanent=np.r_[0:6], consistent_mass=consistent, element_kinds=kinds)
    names = ParameterSet(tuple(Parameter(name) for name in FIELDS))
    model = parametric_model(structure, names, [Assignment(name, ref) for name, ref in FIELDS.items()])
    return configure(model, CONFIGURATION)


@pytest.mark.parametrize("consistent", [True, False])
def test_values_are_those_of_the_grid_matrix(consistent: bool) -> None:
    """Elements that are off are left out; added masses and the mass at supports count."""
    model, about = _model(consistent), np.array([0.1, 0.2, -0.3])
    found = mass_response(model.at(np.zeros(3)), about).properties
    exact = mass_properties(model.model.structure.nodes, grid_matrix(model.model, CONFIGURATION, "mass"), about)
    for name in ("mass", "centre", "inertia", "central_inertia", "directional_mass"):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("consistent", [True, False])
def test_gradients_by_differences(consistent: bool) -> None:
    model, about, x, h = _model(consistent), (0.1, 0.2, -0.3), np.array([0.1, -0.2, 0.3]), 1e-3
    found = mass_response(model.at(x), about)
    for i in range(3):
        a, b, c, d = (mass_response(model.at(x + s * h * np.eye(3)[i]), about).properties for s in (1, -1, 2, -2))
        for name in ("mass", "centre", "inertia"):
            ends = [np.asarray(getattr(one, name)) for one in (a, b, c, d)]
            exact = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * h)
            np.testing.assert_allclose(getattr(found, name)[..., i], exact, rtol=1e-9, atol=1e-11)


def test_mass_of_a_bar_in_closed_form() -> None:
    """Doubling the area of bar 1 adds ρAL at its middle."""
    found = mass_response(_model(False).at(np.zeros(3)))
    assert found.mass[0] == pytest.approx(SECTION["rho"] * SECTION["A"], rel=1e-12)
    centre, mass = found.properties.centre, found.properties.mass
    np.testing.assert_allclose(
        found.centre[:, 0], found.mass[0] * (np.array([0.0, 0.0, 0.5]) - centre) / mass, atol=1e-14
    )
    assert found.parameters == tuple(FIELDS)
