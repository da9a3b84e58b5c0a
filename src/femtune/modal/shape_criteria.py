"""Modal assurance criterion and related criteria; complex shapes are conjugated, NaN entries left out pair by pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal.mode_set import ModeSet

ZERO_MOTION = 1e-12
"""Motion, as a fraction of a shape's largest entry, up to which it is rounding error.

Eigenvectors have errors of about 1e-14; no sensor resolves motion as small as this.
"""


@checked
def mac(a: NDArray | ModeSet, b: NDArray | ModeSet, weight: NDArray | None = None) -> Reals:
    """MAC_ij = |a_iᴴ W b_j|² / (a_iᴴ W a_i · b_jᴴ W b_j) over the entries that both shapes have.

    Parameters
    ----------
    a, b : (n, p) and (n, q) real or complex, NaN marks an entry that was not measured; or two `ModeSet`, of which the
        common DOFs are compared, with their signs
    weight : (n, n) Hermitian positive weighting (a mass matrix), or None for the identity

    Returns
    -------
    (p, q) in 0 … 1; NaN where two shapes have no moving entry in common

    Raises
    ------
    FemtuneError : ``modal.zero-shape`` for a column without motion, ``modal.rows-differ``

    Source: Allemang and Brown (1982).

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> ft.mac(np.array([[1.0, 1.0], [2.0, -1.0]]), np.array([[1.0], [1.0]]))
    array([[0.9],
           [0. ]])
    """
    if isinstance(a, ModeSet) and isinstance(b, ModeSet):
        common = a.dofs.common(b.dofs)
        a, b = a.select_dofs(common).shapes, b.select_dofs(common).shapes
    first, second = (one.shapes if isinstance(one, ModeSet) else one for one in (a, b))
    check_rows(first, second)
    check_shapes(first, "the first set")
    check_shapes(second, "the second set")
    return mac_where_defined(first, second, weight)


def mac_where_defined(a: NDArray, b: NDArray, weight: NDArray | None = None) -> Reals:
    """Like `mac`, but a column without motion gives NaN instead of an error."""
    check_rows(a, b)
    a, b = unit_largest(a), unit_largest(b)
    inner, norm_a, norm_b = _products(a, b) if weight is None else _weighted_products(a, b, weight)
    still = (norm_a <= ZERO_MOTION**2) | (norm_b <= ZERO_MOTION**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.abs(inner) ** 2 / (norm_a * norm_b)
    return np.where(still, np.nan, np.minimum(value, 1.0))


def auto_mac(shapes: NDArray, weight: NDArray | None = None) -> Reals:
    """MAC of a set with itself, (m, m)."""
    return mac(shapes, shapes, weight)


def modal_scale_factor(a: NDArray, b: NDArray) -> NDArray:
    """Factors c, one per column, that bring c·b nearest to a: c = bᴴa / bᴴb over common entries.

    Parameters
    ----------
    a, b : (n, m) paired columns

    Returns
    -------
    (m,), complex if a or b is

    Raises
    ------
    FemtuneError : ``modal.zero-shape``, ``modal.rows-differ``
    """
    check_rows(a, b)
    known = ~(np.isnan(a) | np.isnan(b))
    a, b = np.where(known, a, 0.0), np.where(known, b, 0.0)
    check_shapes(b, "the reference shapes")
    return np.sum(b.conj() * a, axis=0) / np.sum(np.abs(b) ** 2, axis=0)


def comac(test: NDArray, model: NDArray) -> Reals:
    """Coordinate MAC of each DOF over paired modes: |Σ_r a_kr b*_kr|² / (Σ_r |a_kr|² Σ_r |b_kr|²).

    Each pair is brought to unit norm and to one phase first, so that no mode outweighs the others by its scaling.
    The modulus is taken of the sum (Allemang 2003), so that a DOF that agrees in magnitude but not in sign from mode to
    mode gets a low value, unlike with the modulus of each product (Lieven and Ewins 1988).

    Parameters
    ----------
    test, model : (n, m) paired columns

    Returns
    -------
    (n,) in 0 … 1; 0 if only one side moves, NaN if neither does (or nothing was measured)

    Raises
    ------
    FemtuneError : ``modal.zero-shape``, ``modal.rows-differ``

    Source: Lieven and Ewins (1988); Allemang (2003), Sound and Vibration 37(8).
    """
    a, b = _paired_units(test, model)
    return _squared_ratio(np.abs(np.sum(a * b.conj(), axis=1)) ** 2, a, b)


def enhanced_comac(test: NDArray, model: NDArray) -> Reals:
    """Enhanced COMAC of each DOF over paired modes: Σ_r |a_kr − b_kr| / 2L, 0 for agreement in L modes.

    The test's shapes are scaled to a largest entry of one, the model's to the test's by the modal scale factor. Unlike
    `comac` it shows wrong scales and reversed signs of a sensor that are the same in all modes.

    Parameters
    ----------
    test, model : (n, m) paired columns; NaN entries are left out

    Returns
    -------
    (n,) 0 where both agree, half the relative amplitude of the DOF, averaged over the modes, if the sensor is
    reversed; NaN if nothing was measured

    Raises
    ------
    FemtuneError : ``modal.zero-shape``, ``modal.rows-differ``

    Source: Hunt (1992), with this scale of the shapes.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.modal import enhanced_comac
    >>> model = np.ones((50, 1))
    >>> test = model.copy()
    >>> test[3] = -1.0
    >>> enhanced_comac(test, model)[[0, 3]].round(2)
    array([0.02, 0.98])
    """
    factor = modal_scale_factor(test, model)
    check_shapes(test, "the test")
    size = np.nanmax(np.abs(test), axis=0)
    known = ~(np.isnan(test) | np.isnan(model))
    gap = np.abs(np.where(known, test - factor * model, 0.0)) / size
    count = known.sum(axis=1)
    return np.where(count > 0, gap.sum(axis=1) / (2.0 * np.maximum(count, 1)), np.nan)


def mac_without_each(test: NDArray, model: NDArray) -> Reals:
    """MAC of each pair when one DOF is left out, (n, m): above the MAC of all DOFs if this DOF lowers it.

    Parameters
    ----------
    test, model : (n, m) paired columns

    Returns
    -------
    (n, m); NaN if the DOF was not measured, if fewer than two others were, or if no motion is left

    Raises
    ------
    FemtuneError : ``modal.rows-differ``

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.modal import mac_without_each
    >>> test = np.array([[1.0], [2.0], [-3.0], [4.0]])
    >>> mac_without_each(test, np.abs(test)).round(2).ravel()
    array([0.14, 0.09, 1.  , 0.08])
    """
    check_rows(test, model)
    a, b = unit_largest(test), unit_largest(model)
    known = ~(np.isnan(a) | np.isnan(b))
    a, b = np.where(known, a, 0.0), np.where(known, b, 0.0)
    products = (a.conj() * b, np.abs(a) ** 2, np.abs(b) ** 2)
    inner, own_a, own_b = (p.sum(axis=0) - p for p in products)
    defined = known & (known.sum(axis=0) > 2) & (own_a > ZERO_MOTION**2) & (own_b > ZERO_MOTION**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.abs(inner) ** 2 / (own_a * own_b)
    return np.where(defined, np.minimum(value, 1.0), np.nan)


def motion_agreement(test: NDArray, model: NDArray) -> Reals:
    """Signed companion of `comac`, (n,) in −1 … 1: near −1 if a DOF moves opposite to the model in every mode."""
    a, b = _paired_units(test, model)
    inner = np.sum(a * b.conj(), axis=1).real
    return np.sign(inner) * np.sqrt(_squared_ratio(inner**2, a, b))


def cross_orthogonality(test: NDArray, model: NDArray, mass: NDArray) -> Reals:
    """|ψ_iᴴ M φ_j| with ψ and φ scaled to ψᴴMψ = φᴴMφ = 1, so that 1 is full agreement.

    Parameters
    ----------
    test, model : (n, t) and (n, m) at the DOFs of the mass matrix, complete
    mass : (n, n) symmetric

    Returns
    -------
    (t, m) in 0 … 1; cross_orthogonality(test, test, mass) is the test's self-orthogonality

    Raises
    ------
    FemtuneError : ``modal.missing-entries`` for NaN (a mass matrix cannot be cut to fewer DOFs afterwards),
        ``modal.mass-not-positive``, ``modal.zero-shape``, ``modal.rows-differ``
    """
    check_rows(test, model)
    check_rows(mass, model)
    psi, phi = _mass_normalised(test, mass, "test"), _mass_normalised(model, mass, "model")
    return np.minimum(np.abs(psi.conj().T @ mass @ phi), 1.0)


def check_shapes(shapes: NDArray, whose: str) -> None:
    """Raise ``modal.zero-shape`` for columns without a measured, moving entry."""
    size = np.max(np.where(np.isnan(shapes), 0.0, np.abs(shapes)), axis=0, initial=0.0)
    still = np.flatnonzero(size == 0.0)
    if len(still):
        raise FemtuneError(
            "modal.zero-shape",
            values={"columns (from 1)": ", ".join(str(i + 1) for i in still[:10])},
            still=len(still),
            total=shapes.shape[1],
            owner=whose,
        )


def check_rows(a: NDArray, b: NDArray) -> None:
    """Raise ``modal.rows-differ`` unless both are matrices of numbers with equally many rows."""
    numbers = a.dtype.kind in "biufc" and b.dtype.kind in "biufc"
    if not numbers or a.ndim != 2 or b.ndim != 2 or a.shape[0] != b.shape[0]:
        raise FemtuneError("modal.rows-differ", values={"shape of the first": a.shape, "shape of the second": b.shape})


def unit_largest(shapes: NDArray) -> NDArray:
    """Columns with largest entry 1, so that squares neither overflow nor vanish."""
    size = np.max(np.where(np.isnan(shapes), 0.0, np.abs(shapes)), axis=0, initial=0.0)
    return shapes / np.where(size > 0.0, size, 1.0)


def _products(a: NDArray, b: NDArray) -> tuple[NDArray, Reals, Reals]:
    known_a, known_b = ~np.isnan(a), ~np.isnan(b)
    a, b = np.where(known_a, a, 0.0), np.where(known_b, b, 0.0)
    norm_a = (np.abs(a) ** 2).T @ known_b.astype(float)
    norm_b = known_a.astype(float).T @ np.abs(b) ** 2
    return a.conj().T @ b, norm_a, norm_b


def _weighted_products(a: NDArray, b: NDArray, weight: NDArray) -> tuple[NDArray, Reals, Reals]:
    check_rows(weight, a)
    shape = (a.shape[1], b.shape[1])
    if not (np.isnan(a).any() or np.isnan(b).any()):
        own_a, own_b = (np.einsum("ij,ij->j", s.conj(), weight @ s).real for s in (a, b))
        return a.conj().T @ (weight @ b), np.broadcast_to(own_a[:, None], shape), np.broadcast_to(own_b, shape)
    inner, norm_a, norm_b = np.empty(shape, complex), np.empty(shape), np.empty(shape)
    for at in np.ndindex(shape):
        x, y = a[:, at[0]], b[:, at[1]]
        known = ~(np.isnan(x) | np.isnan(y))
        W, x, y = weight[np.ix_(known, known)], x[known], y[known]
        inner[at], norm_a[at], norm_b[at] = x.conj() @ W @ y, (x.conj() @ W @ x).real, (y.conj() @ W @ y).real
    return inner, norm_a, norm_b


def _paired_units(test: NDArray, model: NDArray) -> tuple[NDArray, NDArray]:
    """Paired columns of unit norm over common entries (0 elsewhere), the model's rotated to the test's phase."""
    factor = modal_scale_factor(test, model)
    known = ~(np.isnan(test) | np.isnan(model))
    a, b = np.where(known, test, 0.0), np.where(known, model, 0.0)
    check_shapes(a, "the test")
    phase = np.where(factor == 0, 1.0, factor) / np.where(factor == 0, 1.0, np.abs(factor))
    return a / np.linalg.norm(a, axis=0), phase * b / np.linalg.norm(b, axis=0)


def _squared_ratio(top: Reals, a: NDArray, b: NDArray) -> Reals:
    moved_a, moved_b = np.sum(np.abs(a) ** 2, axis=1), np.sum(np.abs(b) ** 2, axis=1)
    still = (moved_a <= ZERO_MOTION**2) & (moved_b <= ZERO_MOTION**2)
    product = moved_a * moved_b
    ratio = np.minimum(top / np.where(product > 0.0, product, 1.0), 1.0)
    one_side = (moved_a <= ZERO_MOTION**2) | (moved_b <= ZERO_MOTION**2)
    return np.where(still, np.nan, np.where(one_side, 0.0, ratio))


def _mass_normalised(shapes: NDArray, mass: NDArray, whose: str) -> NDArray:
    if np.isnan(shapes).any():
        raise FemtuneError("modal.missing-entries", dofs=int(np.isnan(shapes).any(axis=1).sum()), owner=whose)
    check_shapes(shapes, f"the {whose}")
    modal_mass = np.einsum("ij,ik,kj->j", shapes.conj(), mass, shapes).real
    if (modal_mass <= 0.0).any():
        raise FemtuneError(
            "modal.mass-not-positive",
            values={"column (from 1)": int(np.argmin(modal_mass)) + 1, "modal mass": float(modal_mass.min())},
            owner=whose,
        )
    return shapes / np.sqrt(modal_mass)


# ----------------------------------------------------------------------------------------------------
# The phase of a complex shape: the rotation that brings it nearest to the real axis.


def turn_to_real_axis(shapes: NDArray) -> NDArray[np.complex128]:
    """Factors of modulus one, one per shape, that minimise the imaginary part of each shape.

    The phase is half the argument of Σ φ², the least-squares line through the entries.

    Parameters
    ----------
    shapes : (n,) or (n, m); NaN entries are ignored
    """
    return np.asarray(np.exp(-0.5j * np.angle(np.nansum(shapes**2, axis=0))), dtype=complex)
