"""Differential stiffness: the contribution of the internal forces of a static state to the stiffness of an element.

The internal forces of an element of stiffness k are its mean stress resultants S_j, the axial force of a bar, the three
membrane forces of a shell, the six stresses of a solid. An element that passes the patch test has a field of
displacements v_j of constant unit strain j, so that virtual work gives S_j = v_jᵀ k u / V for any law and any
displacements u; V is the length, area or volume. The differential stiffness is Σ_j S_j G_j with constant G_j: ∫ ∇Nᵀ e_j
∇N dV for each direction of displacement, e_j the unit tensor of stress j (Zienkiewicz, Taylor and Fox, The Finite
Element Method for Solid and Structural Mechanics, 2014, section 6.4). Solids with mid-side nodes also have fields of
linear unit strains, so that their stresses are determined as linear functions of position. For a bar the transverse
displacements have cubic shape functions (Przemieniecki, Theory of Matrix Structural Analysis, 1968, section 15.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.fem.elements import placement
from femtune.fem.elements.bending import PLANES
from femtune.fem.structure import ElementBatch, Structure


@dataclass(frozen=True, eq=False)
class Differential:
    """m elements with k internal forces each.

    Parameters
    ----------
    patterns : (m, k, d) the internal forces are patterns · (element stiffness · displacements)
    matrices : (m, k, d, d) symmetric; differential stiffness of a unit of each internal force
    """

    patterns: Reals
    matrices: Reals


# ----------------------------------------------------------------------------------------------------
# Lines: the axial force.


def of_rod(ends: Reals, length: Reals) -> Differential:
    """A straight line between two points: F/L times the squared transverse differences. `ends` as of bars."""
    across = np.stack([ends[:, row + 6] - ends[:, row] for row in (1, 2)], axis=1)
    matrices = placement.sum_of_squares(across) / length[:, None, None]
    return Differential(_stretch(ends), matrices[:, None])


def of_bar(ends: Reals, length: Reals, pins: Flags) -> Differential:
    """Cubic transverse displacements in both planes; at releases they are those of pure bending."""
    matrices = np.zeros((len(ends), 12, 12))
    for rows, signs in PLANES.values():
        shapes = _released(length, pins[:, rows]) * signs[:, None] * signs
        bent = np.swapaxes(shapes, 1, 2) @ (_cubic(length) * np.outer(signs, signs)) @ shapes
        matrices += placement.carry(ends[:, rows], bent)
    return Differential(_stretch(ends), matrices[:, None])


def _stretch(ends: Reals) -> Reals:
    """(m, 1, 12) displacements of the grid points that move the second end by a unit along the element."""
    unit = np.zeros((12, 1))
    unit[6] = 1.0
    return np.swapaxes(np.linalg.solve(ends, np.broadcast_to(unit, (len(ends), 12, 1))), 1, 2)


def _cubic(length: Reals) -> Reals:
    """(m, 4, 4) ∫ v′² dx of cubic polynomials, on (v, v′) of both ends."""
    scale = np.stack([np.ones_like(length), length] * 2, axis=1)
    unit = np.array([
        [36.0, 3.0, -36.0, 3.0], [3.0, 4.0, -3.0, -1.0], [-36.0, -3.0, 36.0, -3.0], [3.0, -1.0, -3.0, 4.0],
    ])  # fmt: skip
    return np.asarray(scale[:, :, None] * unit * scale[:, None, :] / (30.0 * length[:, None, None]))


def _released(length: Reals, pins: Flags) -> Reals:
    """(m, 4, 4) from (v, v′) of the grid points to those of the ends of bars with releases."""
    out = np.broadcast_to(np.eye(4), (len(length), 4, 4)).copy()
    curvature, antisymmetric = np.array([0.0, -1.0, 0.0, 1.0]), np.array([1.0, 0.5, -1.0, 0.5])
    unit = np.outer(curvature, curvature) + 12.0 * np.outer(antisymmetric, antisymmetric)
    for pattern in np.unique(pins[pins.any(axis=1)], axis=0):
        at = np.flatnonzero((pins == pattern).all(axis=1))
        follow = np.eye(4)
        follow[pattern] = 0.0
        inverse = np.linalg.pinv(unit[np.ix_(pattern, pattern)])
        follow[np.ix_(pattern, ~pattern)] = -inverse @ unit[np.ix_(pattern, ~pattern)]
        scale = np.stack([np.ones(len(at)), length[at]] * 2, axis=1)
        out[at] = follow * scale[:, None, :] / scale[:, :, None]
    return out


# ----------------------------------------------------------------------------------------------------
# Shells and solids: stresses times the products of gradients of the displacements.


def of_continuum(
    batch: ElementBatch, structure: Structure, gradients: Reals, sizes: Reals, tensors: Reals, components: int
) -> Differential:
    """Elements whose shape functions have given gradients.

    Parameters
    ----------
    gradients : (m, p, n, 3) of the shape functions at points, in the basic frame
    sizes : (m, p) areas or volumes of the points
    tensors : (m, k, 3, 3) e_j, symmetric, in the basic frame
    components : displacements of a node among the DOFs of the batch, 3 or 6
    """
    at = batch.nodes
    m, n = at.shape
    xyz, turn = structure.nodes.xyz[at], np.swapaxes(structure.nodes.frames[at], 2, 3)
    xyz = xyz - xyz.mean(axis=1, keepdims=True)
    # strain of the field e_j x: shears are twice its entries off the diagonal
    traces = np.abs(np.trace(tensors, axis1=2, axis2=3))
    fields = np.einsum("mkij,mnj->mkni", tensors * np.where(traces > 0.5, 1.0, 0.5)[:, :, None, None], xyz)
    fields = np.where((at >= 0)[:, None, :, None], fields, 0.0) / sizes.sum(axis=1)[:, None, None, None]
    patterns = np.zeros((m, tensors.shape[1], n, components))
    patterns[..., :3] = np.einsum("mnij,mknj->mkni", turn, fields)
    products = np.einsum("mp,mpai,mkij,mpbj->mkab", sizes, gradients, tensors, gradients, optimize=True)
    products = 0.5 * (products + np.swapaxes(products, 2, 3))
    between = np.einsum("maix,mbjx->maibj", turn, turn)
    matrices = np.zeros((m, tensors.shape[1], n, components, n, components))
    matrices[:, :, :, :3, :, :3] = products[:, :, :, None, :, None] * between[:, None]
    d = n * components
    return Differential(patterns.reshape(m, -1, d), matrices.reshape(m, -1, d, d))


_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))


def of_surface(
    batch: ElementBatch, structure: Structure, functions: Reals, weights: Reals, axes: Reals
) -> Differential:
    """Shells: the membrane forces along axes (m, 3, 3), columns, the third one normal.

    Parameters
    ----------
    functions : (m, p, 3, n) shape functions at points and their derivatives along r and s; m may be 1
    weights : (p,) of the points on the reference shape
    """
    xyz = np.where((batch.nodes >= 0)[:, :, None], structure.nodes.xyz[batch.nodes], 0.0)
    slopes = np.broadcast_to(functions[:, :, 1:], (len(batch), *functions[:, :, 1:].shape[1:]))
    bases = slopes @ xyz[:, None]
    metric = bases @ np.swapaxes(bases, 2, 3)
    gradients = np.swapaxes(slopes, 2, 3) @ (np.linalg.inv(metric) @ bases)
    sizes = np.sqrt(np.linalg.det(metric)) * weights
    x, y = axes[:, :, 0], axes[:, :, 1]
    tensors = np.stack([placement.outer(x), placement.outer(y), placement.outer(x, y)], axis=1)
    return of_continuum(batch, structure, gradients, sizes, tensors, 6)


def of_solid(batch: ElementBatch, structure: Structure, gradients: Reals, sizes: Reals) -> Differential:
    """Solids: the mean stresses along the basic axes; `gradients` (m, p, n, 3) and volumes (m, p) of the points."""
    tensors = np.broadcast_to(_stresses(), (len(batch), 6, 3, 3))
    return of_continuum(batch, structure, gradients, sizes, tensors, 3)


@dataclass(frozen=True, eq=False)
class SolidRule:
    """Points in m solids with mid-side nodes.

    Parameters
    ----------
    nodes : (m, n, 3) positions of the nodes in the basic frame; not used for nodes that are left out
    points : (m, p, 3) positions of the points from the same origin
    gradients : (m, p, n, 3) of the shape functions, in the basic frame
    volumes : (m, p) of the points
    """

    nodes: Reals
    points: Reals
    gradients: Reals
    volumes: Reals


def of_quadratic_solid(batch: ElementBatch, structure: Structure, rule: SolidRule) -> Differential:
    """Solids with mid-side nodes: stresses along the basic axes that are linear functions of position.

    A stress is Σ_a s_a φ_a with φ = (1, x, y, z) about the centre, in units of the element's size. Displacements v_b
    whose strain is the unit strain times φ_b give ∫ σ φ_b dV = v_bᵀ k u = Σ_a s_a ∫ φ_a φ_b dV, which is solved for s.
    An element that lacks a mid-side node has no such displacements; its stress is the mean.
    """
    at, w = batch.nodes, rule.volumes
    m, n = at.shape
    there, whole = at >= 0, (at >= 0).all(axis=1)
    size = w.sum(axis=1)[:, None, None]
    centre = np.einsum("mp,mpi->mi", w, rule.points)[:, None] / size
    x, y = ((places - centre) / np.cbrt(size) for places in (rule.nodes, rule.points))
    powers = np.concatenate([np.ones((m, y.shape[1], 1)), y], axis=2)
    inverse = np.linalg.inv(np.einsum("mp,mpa,mpb->mab", w, powers, powers))
    inverse[~whole, 1:] = 0.0
    fields = _linear_strains(np.where(there[:, :, None], x, 0.0)) * np.cbrt(size)[:, None, None]
    turn = np.swapaxes(structure.nodes.frames[at], 2, 3)
    patterns = np.einsum("mnij,mab,mbknj->makni", turn, inverse, fields, optimize=True)
    # one matrix product, because there are 24 internal forces
    stresses = np.einsum("mp,mpa,kij,mpyj->mpakiy", w, powers, _stresses(), rule.gradients, optimize=True)
    products = np.einsum("mpxi,mpakiy->makxy", rule.gradients, stresses, optimize=True)
    products = 0.5 * (products + np.swapaxes(products, 3, 4))
    between = np.einsum("maix,mbjx->maibj", turn, turn)
    matrices = products[:, :, :, :, None, :, None] * between[:, None, None]
    return Differential(patterns.reshape(m, -1, 3 * n), matrices.reshape(m, -1, 3 * n, 3 * n))


def _stresses() -> Reals:
    """(6, 3, 3) unit tensors of the stresses."""
    tensors = np.zeros((6, 3, 3))
    for k, (i, j) in enumerate(_PAIRS):
        tensors[k, i, j] = tensors[k, j, i] = 1.0
    return tensors


def _linear_strains(x: Reals) -> Reals:
    """(m, 4, 6, n, 3) displacements at positions (m, n, 3) whose strains are the six unit strains times 1, x, y and z.

    A strain E x_b is that of u_i = E_ij x_j x_b − ½ δ_ib E_jk x_j x_k.
    """
    stresses = _stresses()
    strains = stresses * np.where(np.trace(stresses, axis1=1, axis2=2) > 0.5, 1.0, 0.5)[:, None, None]
    constant = np.einsum("kij,mnj->mkni", strains, x)
    linear = np.einsum("mkni,mnb->mbkni", constant, x)
    square = np.einsum("mkni,mni->mkn", constant, x)
    for b in range(3):
        linear[:, b, :, :, b] -= 0.5 * square
    return np.concatenate([constant[:, None], linear], axis=1)
