"""A model that is a Python function of the user: values of the parameters -> frequencies and shapes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any
from uuid import uuid4

import numpy as np

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.modes.solved import SolvedModes
from femtune.study.given_dofs import given_dofs

Function = Callable[[dict[str, float]], Any]
INPUT = "own_model"
"""Name that stands for its input file in a study."""


@dataclass(frozen=True, eq=False)
class OwnModel:
    """A function in place of a solver.

    Parameters
    ----------
    name : of the function or of its class
    function : values by name -> frequencies (m,) in Hz, or frequencies and shapes (n, m)
    derivatives : values by name -> by name of the parameter, the derivatives of what the function returns; None where
        differences take their place
    dofs : of the n rows of shapes, which are scalar points or components of nodes
    version : what keeps the runs of one model apart from those of another
    """

    name: str
    function: Function
    derivatives: Function | None
    dofs: DofSet | None
    version: str

    def modes(self, values: dict[str, float]) -> SolvedModes:
        """What it returns at a point (errors ``external.own-model``)."""
        freq_hz, shapes = self._parts(self.function(dict(values)), "frequencies", "shapes")
        if freq_hz.ndim != 1 or not freq_hz.size:
            raise self._error("frequencies", freq_hz, "(m,)")
        if shapes is None:
            if self.dofs is not None:
                raise self._error("shapes", None, f"({len(self.dofs)}, {len(freq_hz)})")
            return SolvedModes.of_frequencies(freq_hz)
        expected = (len(self.dofs) if self.dofs is not None else 0, len(freq_hz))
        if self.dofs is None:
            raise FemtuneError("external.own-model/no-dofs", name=self.name)
        if shapes.shape != expected:
            raise self._error("shapes", shapes, str(expected))
        return self._placed(freq_hz, shapes)

    def slopes(self, values: dict[str, float], modes: SolvedModes, names: Sequence[str]) -> dict[str, SolvedModes]:
        """Derivatives of frequencies and shapes by each parameter (errors ``external.own-model``)."""
        assert self.derivatives is not None
        given = self.derivatives(dict(values))
        if not isinstance(given, Mapping):
            raise self._error("derivatives", given, "a mapping by the names of the parameters")
        out, m = {}, len(modes.freq_hz)
        for name in names:
            if name not in given:
                raise FemtuneError("external.own-model/derivatives", name=self.name, parameter=name)
            freq_hz, shapes = self._parts(given[name], f"derivatives of frequencies by {name}", f"of shapes by {name}")
            if freq_hz.shape != (m,) or not np.isfinite(freq_hz).all():
                raise self._error(f"derivatives of frequencies by {name}", freq_hz, f"({m},) of finite numbers")
            if not modes.has_shapes:
                out[name] = SolvedModes.of_frequencies(freq_hz)
                continue
            assert self.dofs is not None
            if shapes is None or shapes.shape != (len(self.dofs), m):
                raise self._error(f"derivatives of shapes by {name}", shapes, f"({len(self.dofs)}, {m})")
            out[name] = self._placed(freq_hz, shapes)
        return out

    def _placed(self, freq_hz: Reals, shapes: Reals) -> SolvedModes:
        """Shapes at nodes; a DOF along a negative direction changes its sign."""
        assert self.dofs is not None
        nodes = np.unique(self.dofs.nodes)
        blocks = np.full((len(nodes), 6, len(freq_hz)), np.nan)
        blocks[np.searchsorted(nodes, self.dofs.nodes), self.dofs.components - 1] = self.dofs.signs[:, None] * shapes
        return SolvedModes(freq_hz, nodes, blocks)

    def _parts(self, returned: Any, first: str, second: str) -> tuple[Reals, Reals | None]:
        """Frequencies and shapes of what was returned."""
        pair = isinstance(returned, tuple) and len(returned) == 2 and np.ndim(returned[0]) == 1
        freq_hz, shapes = returned if pair else (returned, None)
        return self._numbers(freq_hz, first), None if shapes is None else self._numbers(shapes, second)

    def _numbers(self, given: Any, what: str) -> Reals:
        try:
            array = np.asarray(given)
        except ValueError:
            array = np.empty(0, object)
        if array.dtype.kind not in "iuf":
            raise self._error(what, given, "an array of real numbers")
        return array.astype(float)

    def _error(self, what: str, given: Any, expected: str) -> FemtuneError:
        found = f"the shape {given.shape} of {given.dtype}" if isinstance(given, np.ndarray) else type(given).__name__
        return FemtuneError("external.own-model", name=self.name, part=what, given=found, expected=expected)


def own_model_of(model: Any, dofs: Any, version: str, function: str) -> OwnModel:
    """The model of a function, or of an object with a method ``modes`` and, where it has one, ``derivatives``.

    Raises
    ------
    FemtuneError : ``call.argument``, ``external.own-model/call``, ``dof.*``
    """
    modes = getattr(model, "modes", model)
    derivatives = getattr(model, "derivatives", None)
    name = getattr(model, "__name__", type(model).__name__)
    if isinstance(model, type) or not callable(modes):
        facts: dict[str, Any] = {"name": "model", "function": function, "given": type(model).__name__}
        raise FemtuneError("call.argument", allowed="a function, or an object with a method modes", **facts)
    for called in (modes, derivatives):
        _check_call(called, name)
    rows = None if dofs is None else given_dofs(dofs, function)
    if rows is not None and (rows.components < 1).any():
        raise FemtuneError("external.own-model/scalar-points", name=name)
    return OwnModel(name, modes, derivatives, rows, version or uuid4().hex)


def _check_call(called: Any, name: str) -> None:
    if called is None:
        return
    try:
        signature(called).bind({})
    except TypeError as error:
        raise FemtuneError("external.own-model/call", name=name, given="one argument", reason=error) from None
    except ValueError:
        # a function of a compiled module has no signature
        return


def linear(modes: SolvedModes, slopes: SolvedModes, step: float) -> SolvedModes:
    """Modes beside a point, by their derivatives there."""
    freq_hz = modes.freq_hz + step * slopes.freq_hz
    return SolvedModes(freq_hz, modes.nodes, modes.shapes + step * slopes.shapes)
