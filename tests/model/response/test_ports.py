"""Ports: combinations of DOFs in the displacement frames of the nodes, through the constraints."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.constraints import rigid_element_rows
from femtune.fem.structure import NodeTable
from femtune.model import Configuration, configure, parametric_model
from femtune.model.response import Signal, make_ports, matrix_ports
from femtune.parameters import ParameterSet
from structures.frames import make_structure, masses, scalars

from .models import beam


def test_signs_weights_and_names() -> None:
    at = beam(2)
    mean = Signal(parse_dof("50Y+"), {parse_dof("1Y+"): 0.5, parse_dof("3Y-"): 0.5}, "mean")
    ports = make_ports(at.configured, ["2Y-"], [mean, "1RZ+"])
    free = [str(at.configured.free_dof(i)) for i in range(at.configured.n_free)]
    assert free == ["1Y+", "1RZ+", "2Y+", "2RZ+", "3Y+", "3RZ+"]
    np.testing.assert_array_equal(ports.inputs.toarray()[:, 0], [0, 0, -1, 0, 0, 0])
    np.testing.assert_array_equal(ports.outputs.toarray(), [[0.5, 0, 0, 0, -0.5, 0], [0, 1, 0, 0, 0, 0]])
    assert ports.output_labels == DofSet.parse(["50Y+", "1RZ+"])
    assert (ports.input_names, ports.output_names) == (("2Y-",), ("mean", "1RZ+"))


def test_a_force_on_a_rigid_arm_drives_the_independent_point() -> None:
    """A force along Y at the end of an arm of 2 along X is a force and a moment of 2 about Z."""
    xyz = [[0.0, 0, 0], [2.0, 0, 0]]
    parts = [
        scalars("spring", [[i, -1] for i in range(6)], "K", 1.0),
        masses([0], {"M": 1.0, "I11": 1, "I22": 1, "I33": 1}),
    ]
    nodes = NodeTable(np.array([1, 2]), np.array(xyz), np.tile(np.eye(3), (2, 1, 1)))
    rigid = rigid_element_rows(nodes, 1, [2], range(1, 7), 7)
    model = configure(parametric_model(make_structure(xyz, parts, rigid=rigid), ParameterSet(()), ()), Configuration())
    ports = make_ports(model, ["2Y+"], ["2Y+"])
    np.testing.assert_allclose(ports.inputs.toarray()[:, 0], [0, 1, 0, 0, 0, 2])
    np.testing.assert_allclose(ports.outputs.toarray()[0], [0, 1, 0, 0, 0, 2])


def test_rows_of_the_whole_set_of_dofs() -> None:
    at = beam(2)
    rows = sp.csr_array(([2.0], ([0], [7])), shape=(1, 18))
    ports = matrix_ports(at.configured, rows, rows, DofSet.parse(["2Y+"]), DofSet.parse(["2Y+"]))
    assert ports.outputs.toarray()[0, 2] == 2.0
    assert ports.output_names == ("2Y+",)


def test_all_that_is_wrong_is_said_together() -> None:
    at = beam(2)
    with pytest.raises(FemtuneErrors) as caught:
        make_ports(at.configured, ["77Y+", Signal(parse_dof("1Y+"), {parse_dof("1Y+"): np.nan})], ["88Y+"])
    assert [e.code for e in caught.value.errors] == ["model.unknown-node", "response.weight", "model.unknown-node"]


def test_a_held_dof_cannot_be_driven() -> None:
    with pytest.raises(FemtuneError) as caught:
        make_ports(beam(2, clamped=True).configured, ["3Y+", "1Y+"], ["3Y+"])
    assert caught.value.code == "response.held-port"
