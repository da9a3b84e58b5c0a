"""A small dynamic stiffness by poles and residues, and on its basis, against its dense inverse."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.model.response.basis import ModalBasis
from femtune.model.response.reduced import ReducedStiffness, fields, pole_residues


def reduced(k: list[float], m: list[float], C: NDArray, H: NDArray) -> ReducedStiffness:
    r = len(k)
    return ReducedStiffness(ModalBasis(np.eye(r), np.array(k), np.array(m), r), C, H, np.eye(r), np.eye(r))


def inverse(k: list[float], m: list[float], C: NDArray, H: NDArray, s: NDArray) -> NDArray:
    return np.stack([np.linalg.inv(x * x * np.diag(m) + x * C + np.diag(k) + 1j * H) for x in s])


LINES = 1j * np.array([0.3, 1.1, 2.0, 4.5])
COUPLED = np.array([[0.2, 0.1, 0.0], [0.1, 0.3, 0.0], [0.0, 0.0, 0.0]])
LOSS = 0.05 * np.ones((3, 3))


def test_one_of_three_rigid_body_motions_is_damped() -> None:
    """A dashpot sees one combination of them; the two others move freely."""
    seen = np.array([1.0, -2.0, 0.5, 0.7, 0.2])
    k, m, C = [0.0, 0.0, 0.0, 3.0, 8.0], [1.0] * 5, 0.4 * np.outer(seen, seen)
    found = pole_residues(reduced(k, m, C, np.zeros((5, 5))), np.eye(5))
    assert found.free.shape == (5, 2)
    np.testing.assert_allclose(seen @ found.free, 0.0, atol=1e-14)
    exact = inverse(k, m, C, np.zeros((5, 5)), LINES)
    np.testing.assert_allclose(found.fields(LINES), exact, rtol=1e-9, atol=1e-10 * np.abs(exact).max())


def test_a_mass_that_is_rounding_is_none() -> None:
    k, massless = [2.0, 9.0, 1.0], [1.0, 1.0, 0.0]
    exact = inverse(k, massless, COUPLED, LOSS, LINES)
    for small in (0.0, 1e-19, 1e-15):
        found = pole_residues(reduced(k, [1.0, 1.0, small], COUPLED, LOSS), np.eye(3))
        np.testing.assert_allclose(found.fields(LINES), exact, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize(("time", "force"), [(1.0, 1e-14), (1e-10, 1.0), (1e6, 1e9)])
def test_units_do_not_matter(time: float, force: float) -> None:
    """The numbers of a structure in other units: stiffness goes with force, damping with force and time, mass twice."""
    k, m = np.array([2.0, 9.0, 1.0]), np.array([1.0, 1.0, 1e-3])
    units = list(force * k), list(force * time**2 * m), force * time * COUPLED, force * LOSS
    found = pole_residues(reduced(*units), np.eye(3)).fields(LINES / time)
    exact = inverse(list(k), list(m), COUPLED, LOSS, LINES)
    np.testing.assert_allclose(force * found, exact, rtol=1e-9, atol=1e-11)


def test_no_force_has_no_response() -> None:
    """Also beside forces that have one."""
    whole, forces = reduced([2.0, 9.0, 1.0], [1.0, 1.0, 0.1], COUPLED, LOSS), np.eye(3)[:, :2] * [1.0, 0.0]
    assert not fields(whole, LINES, np.zeros((3, 1))).any()
    np.testing.assert_allclose(fields(whole, LINES, forces)[:, :, 0], fields(whole, LINES, np.eye(3))[:, :, 0])
    assert not fields(whole, LINES, forces)[:, :, 1].any()
