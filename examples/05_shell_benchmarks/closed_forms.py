"""Natural frequencies known in closed form: circular plates, cylinders between diaphragms, rings, thin spheres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh
from scipy.optimize import brentq
from scipy.special import ive, jv

Reals = NDArray[np.float64]


def circular_plate(edge: str, nu: float, upto: float = 8.0) -> Reals:
    """ω R² √(ρt/D) below upto², each with its multiplicity; `edge` is C, S or F (Kirchhoff).

    Roots of the boundary conditions of w = A J_n(kr) + B I_n(kr), a 2 × 2 determinant for each n.
    """
    found: list[float] = []
    k = np.linspace(0.5, upto, 800)
    for n in range(0, 12):
        values = np.array([_determinant(x, n, edge, nu) for x in k])
        for i in np.flatnonzero(values[:-1] * values[1:] < 0):
            root = brentq(_determinant, k[i], k[i + 1], args=(n, edge, nu), xtol=1e-12)
            found += [root**2] * (1 if n == 0 else 2)
    return np.sort(found)


def _determinant(k: float, n: int, edge: str, nu: float) -> float:
    columns = []
    for bessel, sign in ((jv, -1.0), (ive, 1.0)):
        # Δw = ∓k²w, so that second and third derivatives follow from the value and the slope
        w = bessel(n, k)
        slope = 0.5 * k * (bessel(n - 1, k) + sign * bessel(n + 1, k))
        laplace = sign * k**2 * w
        moment = laplace - (1 - nu) * (slope - n**2 * w)
        shear = sign * k**2 * slope - (1 - nu) * n**2 * (slope - w)
        columns.append({"C": (w, slope), "S": (w, moment), "F": (moment, shear)}[edge])
    (a, b), (c, d) = columns
    return float(a * d - b * c)


def cylinder_between_diaphragms(R: float, L: float, t: float, E: float, nu: float, rho: float, count: int) -> Reals:
    """Lowest frequencies in Hz by Sanders' strains; v = w = 0 and u free at the ends; n > 0 counts twice."""
    found = []
    for n in range(0, 16):
        for m in range(1, 8):
            found += [np.sqrt(_sanders(n, m * np.pi / L, R, t, E, nu, rho)[0])] * (1 if n == 0 else 2)
    return np.sort(found)[:count] / (2 * np.pi)


def _sanders(n: int, k: float, R: float, t: float, E: float, nu: float, rho: float) -> Reals:
    """ω² of u = U cos kx cos nθ, v = V sin kx sin nθ, w = W sin kx cos nθ."""
    strain = np.array([[-k, 0, 0], [0, n / R, 1 / R], [-n / R, k, 0]])
    bend = np.array([[0, 0, k**2], [0, n / R**2, n**2 / R**2], [n / (2 * R**2), 1.5 * k / R, 2 * n * k / R]])
    law = E / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    return np.asarray(eigvalsh(t * strain.T @ law @ strain + t**3 / 12 * bend.T @ law @ bend) / (rho * t))


def free_ring_modes(R: float, t: float, E: float, rho: float, n: int) -> float:
    """Frequency in Hz of a free cylinder that bends without stretching, alike along its length (Rayleigh; ν = 0)."""
    return float(np.sqrt(E * t**2 / (12 * rho * R**4) * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)) / (2 * np.pi))


def sphere(n: int, nu: float) -> tuple[float, float]:
    """ω R √(ρ/E) of a full membrane sphere: the lower mode of degree n (Lamb 1882, Baker 1961), and the torsional one.

    Both are 2n + 1 modes.
    """
    b, c = n * (n + 1) + 1 + 3 * nu, n * (n + 1) - 2
    lower = (b - np.sqrt(b**2 - 4 * (1 - nu**2) * c)) / (2 * (1 - nu**2))
    return float(np.sqrt(lower)), float(np.sqrt(c / (2 * (1 + nu))))
