"""Messages of FRFs, complex modes and static response: each is the example that its page shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.messages.shown import check_shown

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    configure,
    parametric_model,
    solve_modes,
)
from femtune.model.damping import constant_damping
from femtune.model.response import (
    Signal,
    complex_derivatives,
    complex_eigen,
    complex_mode_derivative,
    complex_modes,
    frf,
    make_ports,
    static,
    static_response,
)
from femtune.model.response.dynamic_stiffness import NoSolutionError
from femtune.parameters import Parameter, ParameterSet
from structures.frames import make_structure, scalars

from .patched import patched


def _model(n: int, springs: Sequence[tuple[int, int, float]], dashpot: float = 0.0) -> ConfiguredModel:
    """Unit masses along X with springs, and a dashpot from the first to ground; held but along X."""
    ends = [[6 * a if a >= 0 else -1, 6 * b] for a, b, _ in springs]
    parts = [
        scalars("spring", ends, "K", [k for *_, k in springs]),
        scalars("scalar-mass", [[6 * i, -1] for i in range(n)], "M", 1.0),
    ]
    parts += [scalars("dashpot", [[0, -1]], "B", dashpot)] if dashpot else []
    structure = make_structure([[float(i), 0.0, 0.0] for i in range(n)], parts)
    names = ParameterSet((Parameter("k"),))
    model = parametric_model(structure, names, [Assignment("k", FieldRef("CELAS2", 1, "K"))])
    return configure(model, Configuration("BC"))


def _held(n: int = 2, dashpot: float = 0.0) -> ConfiguredModel:
    return _model(n, [(i - 1, i, 100.0) for i in range(n)], dashpot)


def _free() -> ConfiguredModel:
    return _model(2, [(0, 1, 100.0)])


def _solved(model: ConfiguredModel) -> EigenSolution:
    return solve_modes(model.at(np.zeros(1)), 2)


def _frf(model: ConfiguredModel, freq_hz: Sequence[float] = (1.0, 2.0), **more: object) -> object:
    ports = make_ports(model, ["1X+"], ["2X+"] if model.n_free > 1 else ["1X+"])
    return frf(_solved(model), ports, freq_hz, **more)  # type: ignore[arg-type]


def _fails(*arguments: object, **more: object) -> None:
    raise complex_eigen.spla.ArpackError(-9999)


def _no_solution(*arguments: object) -> None:
    raise NoSolutionError


def _large(*arguments: NDArray) -> NDArray:
    return np.array([3e-6])


def _nan_weight() -> object:
    return make_ports(_held(), [Signal(parse_dof("1X+"), {parse_dof("2X+"): np.nan}, "pair")], ["1X+"])


def _of_another() -> object:
    return frf(_solved(_held(3)), make_ports(_held(), ["1X+"], ["1X+"]), [1.0])


def _static(model: ConfiguredModel) -> object:
    return static_response(model.at(np.zeros(1)), make_ports(model, ["1X+"], ["2X+"]))


def _derivative(model: ConfiguredModel, mode: int) -> object:
    return complex_mode_derivative(complex_modes(_solved(model)), mode)


UNIT = _model(1, [(-1, 0, 4.0 * np.pi**2)])
CRITICAL = _model(1, [(-1, 0, 100.0)], 20.0)
CASES: dict[str, Callable[[], object]] = {
    "response.no-ports": lambda: make_ports(_held(), [], ["1X+"]),
    "response.held-port": lambda: make_ports(_held(), ["1X+", "1Y+"], ["1X+"]),
    "response.weight": _nan_weight,
    "response.frequencies": lambda: _frf(_held(), (1.0, np.nan, 3.0)),
    "response.method": lambda: _frf(_held(), method="modal"),
    "response.modes-needed": lambda: frf(_held().at(np.zeros(1)), make_ports(_held(), ["1X+"], ["1X+"]), [1.0]),
    "response.ports-differ": _of_another,
    "response.damping-ratio": lambda: _frf(_held(), damping=constant_damping(-0.01)),
    "response.free-at-zero": lambda: _frf(_free(), (0.0, 1.0)),
    "response.resonance": lambda: _frf(UNIT, (0.5, 1.0)),
    "response.defective": lambda: complex_modes(solve_modes(CRITICAL.at(np.zeros(1)), 1)),
    "response.static-free": lambda: _static(_free()),
    "response.static-inaccurate": patched(lambda: _static(_held()), (static, "sparse_solver", _no_solution)),
    "complex.no-convergence": patched(
        lambda: complex_modes(_solved(_held(40)), 2),
        (complex_eigen, "DENSE_UP_TO", 5),
        (complex_eigen.spla, "eigs", _fails),
    ),
    "derivative.close-poles": lambda: _derivative(_free(), 0),
    "derivative.pole-inaccurate": patched(
        lambda: _derivative(_held(2, 1.0), 0), (complex_derivatives, "relative_residuals", _large)
    ),
}


@pytest.mark.parametrize("code", CASES)
def test_message_is_the_example_of_its_page(code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        CASES[code]()
    assert caught.value.code == code
    check_shown(code, caught.value)


def test_message_of_an_inaccurate_complex_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(complex_eigen, "energy_residuals_of", lambda *a: np.full(len(a[2]), 3e-6))
    monkeypatch.setattr(complex_eigen, "backward_error", lambda *a: 1e-8)
    with pytest.raises(FemtuneError) as caught:
        complex_modes(_solved(_held(2, 1.0)))
    check_shown("complex.inaccurate", caught.value)


def test_notice_of_modes_that_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(complex_eigen, "DENSE_UP_TO", 5)
    (notice,) = complex_modes(_solved(_held(40, 5.0)), 3).notices
    check_shown("complex.not-counted", notice)
