"""The pages of the ground floor's errors show the very message that a user gets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError, Where
from femtune.modal import FrfSet, ModeSet
from femtune.parameters import Parameter, ParameterSet, parse_expression, tied
from femtune.units import unit_system

_W = Where("study.toml", 24, "parameter[2]")
_DOFS = DofSet.parse(["1X+", "2X+"])


def _modes(**facts: Any) -> ModeSet:
    return ModeSet(**({"freq_hz": [3.2, 4.1], "shapes": np.ones((2, 2)), "dofs": _DOFS} | facts))


def _frfs(**facts: Any) -> FrfSet:
    given = {"freq_hz": [1.0, 2.0], "values": np.ones((2, 1, 2)), "kind": "accelerance"}
    return FrfSet(**(given | {"responses": _DOFS, "references": DofSet.parse(["1X+"])} | facts))


_MAKERS: dict[str, Callable[[], object]] = {
    "units.unknown": lambda: unit_system("mm-to-s"),
    "dof.syntax": lambda: parse_dof("101Z"),
    "dof.duplicate": lambda: DofSet.parse(["101Z+", "7X+", "101Z-"]),
    "dof.missing": lambda: DofSet.parse(["101Z+", "102Z+"]).align(DofSet.parse(["101Z-"])),
    "parameter.name": lambda: Parameter("2nd storey", where=_W),
    "parameter.bounds": lambda: Parameter("E", 1.0, 2.0, 0.5, where=_W),
    "parameter.prior": lambda: Parameter("E", prior_sd=0.0, where=_W),
    "parameter.duplicate": lambda: ParameterSet((Parameter("E"), Parameter("E", where=_W))),
    "tie.syntax": lambda: parse_expression("Ibx1 if Icx1 else 2", _W),
    "tie.unknown": lambda: ParameterSet((Parameter("Ibx1"), tied("Ibx2", "Ibx11", where=_W))),
    "tie.circle": lambda: ParameterSet((Parameter("E"), tied("a", "2*b", where=_W), tied("b", "a/2"))),
    "tie.value": lambda: ParameterSet((Parameter("a"), tied("b", "1/(a - 1)", where=_W))),
    "modes.shape": lambda: _modes(shapes=np.ones((3, 2))),
    "modes.normalisation": lambda: _modes(normalisation="mas"),
    "modes.values": lambda: _modes(freq_hz=[3.2, -4.1]),
    "frf.shape": lambda: _frfs(values=np.ones((2, 2))),
    "frf.kind": lambda: _frfs(kind="inertance"),
    "frf.values": lambda: _frfs(freq_hz=[2.0, 1.0]),
}


@pytest.mark.parametrize("code", _MAKERS)
def test_the_page_shows_the_message(code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _MAKERS[code]()
    assert caught.value.code == code
    check_shown(code, caught.value)
