"""Modes from those of a model nearby, by one factorisation above them, and what it stands on."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from femtune.fem import Structure
from femtune.fem.fields import FieldRef
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.eigen import nearby
from femtune.model.eigen.accuracy import Above, energy_bound_from_above, energy_residuals
from femtune.model.eigen.krylov import orthonormalise
from femtune.model.eigen.pencil import Inverse, Pencil
from femtune.model.linear.blocks import empty_block, recycled
from femtune.model.linear.dense_products import add, multiply, subtract, transposed_times, turn
from femtune.model.linear.sparse_products import product
from femtune.model.linear.symmetric import symmetric
from femtune.parameters import Parameter, ParameterSet
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure


def plate() -> Structure:
    mesh = shell_mesh(rectangle(0.7, 0.5), 14, 9)
    return shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(Isotropic(2.1e11, 0.3, 7850.0), 2e-3))])


def model() -> ConfiguredModel:
    """A free plate whose thickness is a parameter."""
    fields = [Assignment("t", FieldRef("PSHELL", 1, "T"))]
    return configure(parametric_model(plate(), ParameterSet((Parameter("t"),)), fields), Configuration("test"))


def test_nearly_equal_columns_of_a_block_are_both_kept():
    """What tells them apart is below what their Gram matrix shows, and above rounding."""
    rng = np.random.default_rng(1)
    first, other = rng.standard_normal((2, 300))
    mass = product(symmetric(np.diag(rng.uniform(1.0, 2.0, 300))))
    for apart, kept in ((1e-3, 2), (1e-9, 2), (1e-16, 1)):
        W = np.asfortranarray(np.column_stack([first, first + apart * other]))
        Q, MQ, B = orthonormalise(W.copy(order="F"), np.zeros((300, 0)), mass, 1e-20)
        assert Q.shape[1] == kept
        np.testing.assert_allclose(Q @ B, W, atol=2e-12)
        np.testing.assert_allclose(Q.T @ MQ, np.eye(kept), atol=1e-12)
        np.testing.assert_allclose(MQ, mass @ Q, atol=1e-12)


@pytest.mark.slow
def test_memory_in_use_is_not_handed_out():
    rows, columns = 1 << 15, 8
    with recycled():
        block = empty_block(rows, columns)
        column = block[:, 3]
        del block
        gc.collect()
        other = empty_block(rows, columns)
        assert not np.shares_memory(column, other)
        address = other.ctypes.data
        del other
        assert empty_block(rows, columns, "C").ctypes.data == address
    assert empty_block(rows, columns).base is None


@pytest.mark.parametrize("rows", [50, 40_000])
def test_products_of_tall_blocks(rows: int):
    rng = np.random.default_rng(2)
    V, W = (np.asfortranarray(rng.standard_normal((rows, k))) for k in (9, 4))
    C = rng.standard_normal((9, 4))
    np.testing.assert_allclose(multiply(V, C), V @ C, atol=1e-12)
    # the library for tall blocks takes Fortran's order only
    for one, other in ((V, W), (np.ascontiguousarray(V), W), (V, np.ascontiguousarray(W))):
        np.testing.assert_allclose(transposed_times(one, other), V.T @ W, atol=1e-9)
    for function, sign in ((subtract, -1.0), (add, 1.0)):
        out = W.copy(order="F")
        function(out, V, C)
        np.testing.assert_allclose(out, W + sign * (V @ C), atol=1e-12)
    wanted = V @ C
    np.testing.assert_allclose(turn(V, C), wanted, atol=1e-12)


@pytest.mark.slow
def test_the_bound_from_above_is_one():
    """Not below the largest residual, measured with factors below the spectrum, nor far above it."""
    point = model().at(np.zeros(1))
    solution = solve_modes(point, 20)
    pencil = Pencil(point.symmetric_stiffness, point.symmetric_mass)
    count = solution.sturm_count
    values, shapes = solution.eigenvalues[:count], solution.shapes[:, :count]
    noise = np.random.default_rng(3).standard_normal(shapes.shape) * np.linalg.norm(shapes, axis=0)
    for size in (1e-12, 1e-9, 1e-7):
        disturbed = shapes + size * noise / np.sqrt(len(noise))
        true = energy_residuals(Inverse(pencil, solution.shift), values, disturbed, count).max()
        factor = pencil.factorise(solution.sturm_shift)
        following = solution.eigenvalues[count]
        above = Above(factor.solve, solution.sturm_shift, 1.0 / (following - solution.sturm_shift))
        bound = energy_bound_from_above(pencil, above, solution.shift, values, disturbed)
        assert 0.98 * true <= bound <= 10.0 * true


@pytest.mark.slow
def test_what_cannot_be_shown_is_sought_from_below(monkeypatch: pytest.MonkeyPatch):
    old = solve_modes(model().at(np.zeros(1)), 20)
    point = model().at(np.array([0.1]))
    monkeypatch.setattr(nearby, "NEGLIGIBLE_RESIDUAL", 0.0)
    new = solve_modes(point, 20, start=old)
    assert new.known_factor is not None
    np.testing.assert_allclose(new.freq_hz[6:], solve_modes(point, 20).freq_hz[6:], rtol=1e-9)
