"""Where measured FRFs were driven and seen, as rows over the DOFs of all grid points, whatever the configuration."""

from __future__ import annotations

from dataclasses import dataclass

import scipy.sparse as sp

from femtune.dofs import DofSet
from femtune.fem import NodeTable
from femtune.modal import FrfSet
from femtune.model import ConfiguredModel
from femtune.model.response import Ports, matrix_ports


@dataclass(frozen=True, eq=False)
class Places:
    """Rows (outputs, n_g) that see motions, and rows (inputs, n_g) of forces, in the order of the functions."""

    outputs: sp.csr_array
    inputs: sp.csr_array

    def ports(self, configured: ConfiguredModel, measured: FrfSet) -> Ports:
        """On the free DOFs of a configuration (error ``response.held-port``)."""
        return matrix_ports(configured, self.inputs, self.outputs, measured.references, measured.responses)


def places_of(nodes: NodeTable, measured: FrfSet) -> Places:
    """Those of functions whose labels are DOFs of the model; errors ``model.unknown-node``, ``model.component``."""
    return Places(_rows(nodes, measured.responses), _rows(nodes, measured.references))


def _rows(nodes: NodeTable, dofs: DofSet) -> sp.csr_array:
    at = [nodes.dof(d.node, d.component) for d in dofs]
    shape = (len(at), nodes.n_dofs)
    return sp.csr_array(([float(d.sign) for d in dofs], (range(len(at)), at)), shape=shape)
