"""Ports: where a structure is driven and where its motion is seen, as combinations of DOFs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import ErrorCollector, FemtuneError
from femtune.model.configured import ConfiguredModel


@dataclass(frozen=True)
class Signal:
    """A linear combination of DOFs: a mean of sensors, a pair of forces, a load case.

    Parameters
    ----------
    label : the DOF that it stands for in results
    weights : factor of each DOF; signs of the DOFs count
    name : what it is, in words
    """

    label: Dof
    weights: Mapping[Dof, float]
    name: str = ""


@dataclass(frozen=True, eq=False)
class Ports:
    """Inputs and outputs on the free DOFs of a configuration.

    Parameters
    ----------
    inputs : B (n_free, n_in), csc: column j is the force on the free DOFs for a unit of input j
    outputs : C (n_out, n_free), csr: row i is what output i sees of the free DOFs
    input_labels, output_labels : the DOFs that they are, or stand for
    input_names, output_names : their names, which are the labels for single DOFs
    """

    inputs: sp.csc_array
    outputs: sp.csr_array
    input_labels: DofSet
    output_labels: DofSet
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]


def make_ports(
    configured: ConfiguredModel, inputs: Iterable[Signal | Dof | str], outputs: Iterable[Signal | Dof | str]
) -> Ports:
    """Ports at DOFs ("101Z+", in the displacement frame of the node) and at combinations of them.

    Raises
    ------
    FemtuneError : ``response.no-ports``, ``response.held-port``, ``response.weight``, ``dof.syntax``,
        ``dof.duplicate``, ``model.unknown-node``, ``model.component``; several are shown together
    """
    driven, seen = _signals(inputs, "inputs"), _signals(outputs, "outputs")
    errors = ErrorCollector()
    forces = _rows(configured, driven, "input", errors)
    motions = _rows(configured, seen, "output", errors)
    errors.raise_if_any()
    return matrix_ports(
        configured, forces, motions, DofSet(s.label for s in driven), DofSet(s.label for s in seen),
        tuple(_name(s) for s in driven), tuple(_name(s) for s in seen),
    )  # fmt: skip


def matrix_ports(
    configured: ConfiguredModel,
    inputs: sp.sparray,
    outputs: sp.sparray,
    input_labels: DofSet,
    output_labels: DofSet,
    input_names: tuple[str, ...] = (),
    output_names: tuple[str, ...] = (),
) -> Ports:
    """Ports from combinations of g-set DOFs: rows (n_in, n_g) of forces and rows (n_out, n_g) of motions.

    A sensor map's matrix is such a set of rows.

    Raises
    ------
    FemtuneError : ``response.no-ports``, ``response.held-port``
    """
    T = configured.transformation
    B, C = sp.csc_array(sp.csr_array(inputs @ T).T), sp.csr_array(outputs @ T)
    names_in = input_names or tuple(input_labels.labels())
    names_out = output_names or tuple(output_labels.labels())
    for what, names, matrix in (("input", names_in, B.T), ("output", names_out, C)):
        _check(configured, what, names, sp.csr_array(matrix))
    return Ports(B, C, input_labels, output_labels, names_in, names_out)


def _signals(given: Iterable[Signal | Dof | str], what: str) -> list[Signal]:
    signals = []
    for one in given:
        dof = parse_dof(one) if isinstance(one, str) else one
        signals.append(dof if isinstance(dof, Signal) else Signal(dof, {dof: 1.0}))
    if not signals:
        raise FemtuneError("response.no-ports", ports=what)
    return signals


def _name(signal: Signal) -> str:
    return signal.name or str(signal.label)


def _rows(configured: ConfiguredModel, signals: list[Signal], what: str, errors: ErrorCollector) -> sp.csr_array:
    """(signals, n_g) combinations."""
    nodes = configured.model.structure.nodes
    out = sp.lil_array((len(signals), nodes.n_dofs))
    for i, signal in enumerate(signals):
        for dof, weight in signal.weights.items():
            with errors.catch():
                _check_weight(signal, what, weight)
                out[i, nodes.dof(dof.node, dof.component)] += dof.sign * weight
    return sp.csr_array(out)


def _check_weight(signal: Signal, what: str, weight: float) -> None:
    if not np.isfinite(weight):
        raise FemtuneError("response.weight", port=what, name=_name(signal), weight=weight)


def _check(configured: ConfiguredModel, what: str, names: tuple[str, ...], rows: sp.csr_array) -> None:
    if not names:
        raise FemtuneError("response.no-ports", ports=f"{what}s")
    size: NDArray = np.asarray(np.abs(rows).sum(axis=1))
    held = [name for name, some in zip(names, size) if some == 0.0]
    if held:
        raise FemtuneError(
            "response.held-port",
            values={f"constrained {what}s": ", ".join(held[:6]) + (" …" if len(held) > 6 else "")},
            configuration=configured.configuration.name,
            port=what,
            name=held[0],
        )
