"""Degrees of freedom that are given in Python: as texts, as nodes with components, or as arrays of either."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from femtune.dofs import DIRECTIONS, Dof, DofSet, parse_dof
from femtune.errors import FemtuneError


def given_dofs(given: Any, function: str) -> DofSet:
    """The DOFs of the rows of an array.

    Parameters
    ----------
    given : n entries, each ``"12Z+"``, ``"12Z"``, (node, component) or a `Dof`; an array (n, 2) or of n texts
    function : the function that was called

    Raises
    ------
    FemtuneError : ``call.argument`` for an entry that is none of these, ``dof.syntax``, ``dof.duplicate``
    """
    if isinstance(given, DofSet):
        return given
    entries = given.tolist() if hasattr(given, "tolist") else given
    if not isinstance(entries, Iterable) or isinstance(entries, str | bytes | Mapping):
        raise FemtuneError("call.argument/dof", values={"dofs": repr(given)}, name="dofs", function=function)
    return DofSet(_dof(entry, function) for entry in entries)


def _dof(given: Any, function: str) -> Dof:
    if isinstance(given, Dof):
        return given
    if isinstance(given, str):
        return parse_dof(given if given.strip()[-1:] in ("+", "-") else f"{given.strip()}+")
    if isinstance(given, Iterable) and not isinstance(given, Mapping) and len(pair := list(given)) == 2:
        node, component = pair
        if component in range(len(DIRECTIONS)):
            return parse_dof(f"{node}{DIRECTIONS[int(component)]}+")
    raise FemtuneError("call.argument/dof", values={"entry": repr(given)}, name="dofs", function=function)
