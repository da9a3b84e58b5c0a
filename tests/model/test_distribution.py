"""Values that vary over a region by functions of position: exact terms, few of them, and their derivatives."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import Structure
from femtune.fem.distribution import Distribution, amplitude_ref, with_distribution
from femtune.fem.fields import FieldRef
from femtune.fem.values import TableJet
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.model.coefficients import CoefficientBook, CoefficientGroup, Coefficients
from femtune.parameters import Parameter, ParameterSet
from femtune.parameters.jet import Jet
from femtune.testing import check_model
from structures.ladder_frame import shell_frame
from structures.meshed import write_structure

T = FieldRef("PSHELL", 1, "T")


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Structure:
    deck = write_structure(shell_frame(2500), tmp_path_factory.mktemp("frame") / "frame.bdf")
    return build_structure(read_deck(deck)).structure


def _distribution(structure: Structure, n: int) -> Distribution:
    at = structure.values.index(T)
    assert at is not None
    elements = structure.direct_users(at)
    batch = next(b for b in structure.batches if np.isin(elements, b.ids).any())
    rows = np.flatnonzero(np.isin(batch.ids, elements))
    x = structure.nodes.xyz[batch.nodes[rows]].mean(axis=1)
    u = 2.0 * (x - x.min(axis=0)) / np.ptp(x, axis=0) - 1.0
    functions = [np.ones(len(u)), u[:, 0], u[:, 2] * u[:, 0], 1.0 - u[:, 1] ** 2]
    return Distribution("THIN", (T,), batch.ids[rows], np.array(functions[:n]).T)


def _model(structure: Structure, n: int, with_e: bool = False):  # type: ignore[no-untyped-def]
    names = [f"a{j + 1}" for j in range(n)]
    parameters = [Parameter(name, 0.0, -0.3, 0.3) for name in names]
    fields = [Assignment(name, amplitude_ref("THIN", j + 1), relative=False) for j, name in enumerate(names)]
    if with_e:
        parameters.append(Parameter("E", 1.0, 0.8, 1.2))
        fields.append(Assignment("E", FieldRef("MAT1", 1, "E")))
    made = with_distribution(structure, _distribution(structure, n))
    return configure(parametric_model(made, ParameterSet(tuple(parameters)), fields), Configuration())


@pytest.mark.slow
def test_matrices_are_those_of_a_model_whose_elements_have_these_values(frame: Structure) -> None:
    """Against the same structure with the thickness of each element written into its own entry."""
    d = _distribution(frame, 3)
    configured = _model(frame, 3)
    a = np.array([0.1, -0.2, 0.15])
    point = configured.at(a / configured.model.parameters.scale)
    direct, copies = frame.split_each(frame.values.index(T) or 0, d.elements.tolist(), [f"e{e}" for e in d.elements])
    values = direct.values.values.copy()
    values[copies] *= 1.0 + d.functions @ a
    again = parametric_model(replace(direct, values=replace(direct.values, values=values)), ParameterSet(()), ())
    other = configure(again, Configuration()).at(np.zeros(0))
    for kind in ("stiffness", "mass"):
        one, two = getattr(point, kind), getattr(other, kind)
        assert abs(one - two).max() < 1e-12 * abs(two).max()


@pytest.mark.slow
@pytest.mark.parametrize(("power", "n"), [(1, 1), (1, 3), (3, 1), (3, 2), (3, 4)])
def test_there_are_as_few_functions_as_monomials(power: int, n: int) -> None:
    """(1 + Σ a_j f_j)³ of n amplitudes has C(n + 3, 3) monomials, whatever the number of elements."""
    rng, m = np.random.default_rng(n), 400
    functions, amplitudes = rng.uniform(-1.0, 1.0, (m, n)), rng.uniform(-0.3, 0.3, (200, n))
    book = CoefficientBook(1.0 + amplitudes @ functions.T)
    source = CoefficientGroup(lambda roles, facts: roles["t"] ** power, {"t": np.arange(m)}, {})
    found = book.spanned(source)
    assert found is not None
    assert len(found.numbers) == comb(n + power, power)
    # at points that it has not seen, with gradients
    a, table = rng.uniform(-0.3, 0.3, n), np.zeros(m)
    table[:] = 1.0 + functions @ a
    moving = Jet(np.append(table, 0.0), np.vstack([functions, np.zeros(n)]), np.zeros((m + 1, n, n)))
    at = TableJet(table, np.arange(m), moving)
    few, every = Coefficients(book, found.numbers)(at), source.jet(at)
    assert found.factors.T @ few.value == pytest.approx(every.value, rel=1e-11)
    assert found.factors.T @ few.grad == pytest.approx(every.grad, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_the_terms_of_a_region_are_few(frame: Structure) -> None:
    """The mass needs as many functions as there are amplitudes, with the function 1 among them."""
    configured = _model(frame, 3)
    mass = [p.term for p in configured.projected if p.term.matrix == "mass" and p.term.coefficient is not None]
    assert len({int(n) for term in mass for n in term.coefficient.numbers}) == 3  # type: ignore[union-attr]


@pytest.mark.parametrize("with_e", [False, True])
@pytest.mark.slow
def test_derivatives_are_exact(frame: Structure, with_e: bool) -> None:
    """By complex step, also with Young's modulus of the same elements as a parameter."""
    configured = _model(frame, 2, with_e)
    x = np.array([0.2, -0.3, 0.05])[: 2 + with_e]
    check_model(configured.at(x), modes=(7,), count=10)


@pytest.mark.slow
def test_a_uniform_amplitude_is_a_factor(frame: Structure) -> None:
    """With the function 1 the frequencies are those of a model with another thickness."""
    configured = _model(frame, 1)
    hz = solve_modes(configured.at(np.array([0.1 / configured.model.parameters.scale[0]])), 12).freq_hz[6:12]
    plain = parametric_model(frame, ParameterSet((Parameter("t", 1.1),)), [Assignment("t", T)])
    assert hz == pytest.approx(
        solve_modes(configure(plain, Configuration()).at(np.zeros(1)), 12).freq_hz[6:12], rel=1e-9
    )


def test_two_distributions_of_a_field_may_not_overlap(frame: Structure) -> None:
    d = _distribution(frame, 1)
    made = with_distribution(frame, d)
    with pytest.raises(FemtuneError) as caught:
        with_distribution(made, replace(d, name="AGAIN"))
    assert caught.value.code == "distribution.field"
