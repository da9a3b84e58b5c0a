"""Messages of elements and constraints: each is the example that its page shows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.fem.constraints import rigid_bar_rows, rigid_element_rows
from femtune.fem.elements import contributions
from femtune.fem.elimination import eliminate
from femtune.fem.splines import spline_rows
from femtune.fem.structure import ConstraintRows, NodeTable
from structures.frames import bars, make_structure

_SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}
_NODES = NodeTable(np.array([10, 20]), np.array([[0.0, 0, 0], [0, 0, 2.0]]), np.tile(np.eye(3), (2, 1, 1)))
_ALL = (1, 2, 3, 4, 5, 6)
_LINE = NodeTable(
    np.array([1, 2, 3, 4]),
    np.array([[0, 0, 0], [1e-12, 1e-12, 0], [1, 1, 0.5], [1, 1, 2.0]]),
    np.tile(np.eye(3), (4, 1, 1)),
)


def _describe(dof: int) -> Dof:
    return Dof(dof // 6 + 1, ("X", "Y", "Z", "RX", "RY", "RZ")[dof % 6])


def _bars(values: dict[str, float], **more: object) -> Callable[[], object]:
    def build() -> object:
        pairs = [[0, 1]] * 12 if "end" not in more else [[0, 1]] * 11 + [[1, 1]]
        part = bars(pairs, {**_SECTION, **values}, **{k: v for k, v in more.items() if k != "end"})  # type: ignore
        structure = make_structure(_NODES.xyz, [part])
        batch = structure.batches[0]
        only = np.arange(11, 12)
        one = type(batch)(
            batch.kind, batch.card, batch.ids[only], batch.nodes[only], batch.dofs[only],
            {k: v[only] for k, v in batch.roles.items()}, {k: v[only] for k, v in batch.facts.items()},
        )  # fmt: skip
        return contributions(one, structure)

    return build


def _solve(dependent: list[int], terms: list[tuple[int, int, float]], owner: list[int], held: list[int]) -> object:
    row, dof, coefficient = (np.array(x) for x in zip(*terms))
    rows = ConstraintRows(np.array(dependent), row, dof, coefficient, np.array(owner))
    return eliminate(12, rows, held, _describe)


CASES: dict[str, Callable[[], object]] = {
    "element.zero-length": _bars({}, end=True),
    "element.orientation": _bars({}, orientation=(0.0, 0.0, 1.0)),
    "element.pinned-i12": _bars({"I12": 0.1}, pins=(5,)),
    "constraint.own-node": lambda: rigid_element_rows(_NODES, 10, [20, 10], _ALL, 7),
    "constraint.spline": lambda: spline_rows(_LINE, (1, 2, 3, 4), ((), _ALL, _ALL, ()), 1e-3, 9),
    "constraint.rigid-independent": lambda: rigid_bar_rows(_NODES, (10, 20), ((1, 2, 3, 4, 5), ()), ((), ()), 9),
    "constraint.twice-in-element": lambda: rigid_bar_rows(_NODES, (10, 20), (_ALL, ()), ((6,), ()), 9),
    "constraint.dependent-twice": lambda: _solve(
        [0, 0], [(0, 0, 1.0), (0, 1, -1.0), (1, 0, 1.0), (1, 2, -1.0)], [5, 6], []
    ),
    "constraint.dependent-held": lambda: _solve([7], [(0, 7, 1.0), (0, 1, -1.0)], [5], [7]),
    "constraint.zero-coefficient": lambda: _solve([7], [(0, 7, 0.0), (0, 1, -1.0)], [0], []),
    "constraint.circular": lambda: _solve([0, 1], [(0, 0, 1.0), (0, 1, -1.0), (1, 1, 1.0), (1, 0, -1.0)], [5, 6], []),
}


@pytest.mark.parametrize("code", CASES)
def test_message_is_the_example_of_its_page(code: str):
    with pytest.raises(FemtuneError) as caught:
        CASES[code]()
    check_shown(code, str(caught.value))
