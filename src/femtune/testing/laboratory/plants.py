"""Plants of models and of matrices."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike, NDArray

from femtune.dofs import DofSet
from femtune.model import EigenSolution
from femtune.model.response import Ports
from femtune.testing.laboratory.plant import Plant

Reals = NDArray[np.float64]


def plant_of_model(modes: EigenSolution, ports: Ports, damping_ratio: ArrayLike) -> Plant:
    """The elastic modes of a model point, its outputs as sensors and its inputs as forces.

    Parameters
    ----------
    modes : all modes that matter in the band and some above it
    damping_ratio : one for all modes, or (m,) one for each elastic mode
    """
    elastic = modes.eigenvalues[: modes.wanted] > 1e-6 * modes.eigenvalues[modes.wanted - 1]
    phi = modes.shapes[:, : modes.wanted][:, elastic]
    omega = np.sqrt(modes.eigenvalues[: modes.wanted][elastic])
    shapes, forcing = np.asarray(ports.outputs @ phi), np.asarray(ports.inputs.T @ phi)
    ratio = np.broadcast_to(np.asarray(damping_ratio, dtype=float), omega.shape).copy()
    direct = np.zeros((len(shapes), len(forcing)))
    return Plant(omega, ratio, shapes, forcing, direct, ports.output_labels, ports.input_labels)


def plant_of_matrices(
    mass: Reals,
    stiffness: Reals,
    damping_ratio: ArrayLike,
    outputs: Reals,
    sensors: DofSet,
    forces: Reals,
    inputs: DofSet,
) -> Plant:
    """All modes of a small supported structure.

    Parameters
    ----------
    mass, stiffness : (n, n), both positive definite
    outputs : (s, n) rows that sample the motion at the sensors
    forces : (r, n) rows of the inputs
    """
    eigenvalues, phi = la.eigh(stiffness, mass)
    ratio = np.broadcast_to(np.asarray(damping_ratio, dtype=float), eigenvalues.shape).copy()
    direct = np.zeros((len(outputs), len(forces)))
    return Plant(np.sqrt(eigenvalues), ratio, outputs @ phi, forces @ phi, direct, sensors, inputs)


def on_shaking_ground(
    mass: Reals,
    stiffness: Reals,
    damping_ratio: ArrayLike,
    outputs: Reals,
    sensors: DofSet,
    carried: Reals,
    inputs: DofSet,
) -> Plant:
    """A structure whose inputs are accelerations of its ground; sensors measure absolute accelerations.

    Parameters
    ----------
    carried : (n, r) rigid motion of the DOFs under a unit motion of the ground in each direction
    """
    eigenvalues, phi = la.eigh(stiffness, mass)
    ratio = np.broadcast_to(np.asarray(damping_ratio, dtype=float), eigenvalues.shape).copy()
    forcing = -(carried.T @ mass @ phi)
    return Plant(np.sqrt(eigenvalues), ratio, outputs @ phi, forcing, outputs @ carried, sensors, inputs)
