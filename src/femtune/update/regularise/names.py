"""Free parameters by name."""

from __future__ import annotations

from femtune.errors import FemtuneError, did_you_mean
from femtune.parameters import ParameterSet


def position(parameters: ParameterSet, name: str) -> int:
    """Position of a free parameter in x.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``
    """
    names = tuple(p.name for p in parameters.free)
    if name in names:
        return names.index(name)
    tied = name in parameters.names
    raise FemtuneError(
        "update.unknown-parameter",
        f"{name} is tied to other parameters and does not move by itself" if tied else f"{name} is no parameter",
        values={"free parameters": ", ".join(names) or "none"},
        hint="name the parameters that it is tied to" if tied else did_you_mean(name, names),
    )
