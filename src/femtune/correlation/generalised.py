"""Sensors that are combinations of model DOFs, such as the in-plane motion of a floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DIRECTIONS, Dof
from femtune.errors import FemtuneError
from femtune.fem.structure import NodeTable, Structure


@dataclass(frozen=True)
class GeneralisedSensor:
    """A measured quantity that is Σ coefficient · displacement.

    Parameters
    ----------
    dof : the test's label of it (positive for a label without sign)
    terms : (node, component 1 to 6, coefficient), components in the node's displacement frame
    """

    dof: Dof
    terms: tuple[tuple[int, int, float], ...]


def rigid_motion_sensor(
    structure: Structure,
    label_node: int,
    nodes: Sequence[int],
    origin: Sequence[float],
    components: str = "126",
) -> tuple[GeneralisedSensor, ...]:
    """Sensors for the rigid-body motion of a group of nodes: least-squares fit u_i = t + θ × (x_i − origin).

    Parameters
    ----------
    structure : the model
    label_node : test node that carries the motion in the test's labels
    nodes : grid points whose translations are used
    origin : (3,) point, in the basic frame, whose motion is meant
    components : which of 1 to 6 (X Y Z RX RY RZ, basic frame) are wanted

    Returns
    -------
    one sensor a component, exact where the nodes move as a rigid body

    Raises
    ------
    FemtuneError : ``sensor.components``, ``model.unknown-node``, ``sensor.rigid-motion`` where the nodes' positions
        do not determine a component
    """
    wanted = _components(components)
    rows, undetermined = _fit(structure.nodes, nodes, np.asarray(origin, float))
    lost = [DIRECTIONS[c] for c in wanted if undetermined[c - 1]]
    if lost:
        raise FemtuneError(
            "sensor.rigid-motion",
            values={"nodes": ", ".join(map(str, nodes)), "origin": ", ".join(f"{x:.6g}" for x in origin)},
            components=", ".join(lost),
            test_node=label_node,
        )
    return tuple(GeneralisedSensor(Dof(label_node, DIRECTIONS[c]), _terms(nodes, rows[c - 1])) for c in wanted)


def _components(text: str) -> tuple[int, ...]:
    if not text or set(text) - set("123456") or len(set(text)) != len(text):
        raise FemtuneError("sensor.components", text=text)
    return tuple(int(c) for c in text)


def _fit(table: NodeTable, nodes: Sequence[int], origin: Reals) -> tuple[Reals, NDArray[np.bool_]]:
    """(6, 3n) rows from translations in displacement frames to the motion, and (6,) True where not determined."""
    at = [table.position(node) for node in nodes]
    if len(set(at)) != len(at):
        raise FemtuneError("sensor.rigid-motion/repeated-node", values={"nodes": ", ".join(map(str, nodes))})
    arms = table.xyz[at] - origin
    length = float(np.max(np.linalg.norm(arms - arms.mean(axis=0), axis=1), initial=0.0)) or 1.0 if at else 1.0
    A = np.vstack([np.zeros((0, 6)), *(rigid_translation(arm / length) for arm in arms)])
    inverse = np.linalg.pinv(A, rcond=1e-8)
    undetermined = np.abs(inverse @ A - np.eye(6)).max(axis=1) > 1e-6
    inverse[3:] /= length
    frames = [table.frames[i] for i in at]
    # translations in the displacement frames: u_basic = frame @ u
    rows = [inverse[:, 3 * k : 3 * k + 3] @ frame for k, frame in enumerate(frames)]
    return np.hstack([np.zeros((6, 0)), *rows]), undetermined


def rigid_translation(arm: Reals) -> Reals:
    """(3, 6) translation at `arm` from the origin for unit translations and rotations of the origin."""
    x, y, z = arm
    return np.array([[1.0, 0, 0, 0, z, -y], [0, 1.0, 0, -z, 0, x], [0, 0, 1.0, y, -x, 0]])


def _terms(nodes: Sequence[int], row: Reals) -> tuple[tuple[int, int, float], ...]:
    row = np.where(np.abs(row) > 1e-13 * np.max(np.abs(row)), row, 0.0)
    return tuple((nodes[i // 3], 1 + i % 3, float(row[i])) for i in np.flatnonzero(row).tolist())
