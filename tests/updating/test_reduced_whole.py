"""A model that is smaller than its reduced basis may be."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.dofs import Dof, DofSet
from femtune.fem.fields import FieldRef
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, UpdateProblem
from femtune.updating import ReductionRules, SensitivityMethod, update_reduced
from structures.frames import make_structure, scalars


@pytest.mark.slow
def test_a_basis_of_all_motions_is_exact():
    springs = scalars("spring", [[0, 6], [6, -1]], "K", [400.0, 100.0])
    structure = make_structure(np.zeros((2, 3)), [springs, scalars("scalar-mass", [[0, -1], [6, -1]], "M", [1.0, 2.0])])
    parameters = ParameterSet((Parameter("a", 1.0, 0.5, 2.0), Parameter("b", 1.0, 0.5, 2.0)))
    fields = [Assignment(name, FieldRef("CELAS2", i, "K")) for i, name in ((1, "a"), (2, "b"))]
    configured = configure(
        parametric_model(structure, parameters, fields), Configuration(supports_added=((1, "23456"), (2, "23456")))
    )
    truth = solve_modes(configured.at(np.array([0.2, -0.1])), 2)
    test = ModeSet(truth.freq_hz, truth.shapes[:, :2], DofSet([Dof(1, "X"), Dof(2, "X")]))
    case = ComparedCase(configured, test, sp.csr_array(np.eye(2)), count=2)
    problem = UpdateProblem((case,), parameters, (FrequencyResidual(0.01),))
    found = update_reduced(problem, SensitivityMethod(), ReductionRules())
    assert found.certified
    assert found.result.values == pytest.approx({"a": 1.2, "b": 0.9}, rel=1e-6)
