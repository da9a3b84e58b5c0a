"""Effect of small added masses by Rayleigh's quotient, against solutions without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.fem import Structure
from femtune.model import AddedMass, Configuration, configure, parametric_model, solve_modes
from femtune.model.mass_effect import effect_of_masses
from femtune.parameters import ParameterSet
from structures.beams import three_beams

COUNT = 8
_ENDS = ((1, "123456"), (11, "123456"))


def _modes(structure: Structure, masses: tuple[AddedMass, ...]):  # type: ignore[no-untyped-def]
    model = parametric_model(structure, ParameterSet(()), ())
    return solve_modes(
        configure(model, Configuration("test", masses=masses, supports_added=_ENDS)).at(np.zeros(0)), COUNT
    )


@pytest.fixture(scope="module")
def frame() -> Structure:
    return three_beams()


def _masses(structure: Structure, size: float) -> tuple[AddedMass, ...]:
    ids = structure.nodes.ids
    arm = (0.01, -0.02, 0.03)
    inertia = tuple(tuple(1e-4 * size * v for v in row) for row in ((2.0, 0.0, 0.0), (0.0, 3.0, 0.5), (0.0, 0.5, 1.0)))
    return (AddedMass(int(ids[len(ids) // 3]), size, arm, inertia), AddedMass(int(ids[len(ids) // 2]), 0.5 * size))


def test_the_error_of_the_estimate_is_of_second_order(frame: Structure) -> None:
    exact = _modes(frame, ()).freq_hz[:COUNT]
    errors = []
    for size in (0.4, 0.2, 0.1):
        masses = _masses(frame, size)
        found = effect_of_masses(_modes(frame, masses), masses)
        assert found.shares.shape == (2, COUNT)
        # Rayleigh's quotient is never below the lowest eigenvalue
        assert found.freq_hz[0] >= exact[0] * (1.0 - 1e-12)
        errors.append(found.freq_hz / exact - 1.0)
    large = np.abs(errors[0]) > 1e-8
    assert large.any()
    slopes = np.log2(np.abs(np.array(errors)[:-1, large] / np.array(errors)[1:, large]))
    assert slopes[-1] == pytest.approx(2.0, abs=0.2)


def test_shares_are_those_of_the_mass_matrices(frame: Structure) -> None:
    masses = _masses(frame, 3.0)
    solution = _modes(frame, masses)
    without = configure(solution.point.configured.model, Configuration("bare", supports_added=_ENDS)).at(np.zeros(0))
    difference = solution.point.mass - without.mass
    phi = solution.shapes[:, :COUNT]
    found = effect_of_masses(solution, masses)
    assert found.shares.sum(axis=0) == pytest.approx(np.einsum("im,im->m", phi, difference @ phi), rel=1e-10, abs=1e-14)


def test_a_mass_on_one_spring_has_its_closed_form() -> None:
    """One degree of freedom: the shape does not change, and the estimate is exact."""
    from structures.springs import factor_model, spring_structure  # noqa: PLC0415

    model = factor_model(spring_structure([(-1, 0, 4.0e4)], [2.0]), {"k": [1]}).model
    node = int(model.structure.nodes.ids[0])
    mass = AddedMass(node, 0.5)
    solution = solve_modes(configure(model, Configuration("loaded", masses=(mass,))).at(np.zeros(1)), 1)
    found = effect_of_masses(solution, [mass])
    assert found.shares[0, 0] == pytest.approx(0.5 / 2.5, rel=1e-12)
    assert found.freq_hz[0] == pytest.approx(np.sqrt(4.0e4 / 2.0) / (2.0 * np.pi), rel=1e-12)
    assert replace(mass, of_test=True) != mass
