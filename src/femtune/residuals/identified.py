"""Changes of residuals when the measured FRFs behind identified tests are drawn again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femtune.arrays import Reals
from femtune.identification.kinds import Drawing
from femtune.identification.redrawn import RedrawnTest
from femtune.residuals.weights import ResidualBlock


def identified_tests(blocks: Sequence[ResidualBlock]) -> tuple[RedrawnTest, ...]:
    """Identified tests whose FRFs are compared, each once."""
    values = [b.samples.identified for b in blocks if b.samples is not None]
    return tuple({id(v.test): v.test for v in values if v is not None}.values())


def drawn_changes(
    blocks: Sequence[ResidualBlock], how: Drawing, rng: np.random.Generator, *, complete: bool = False
) -> list[Reals | None]:
    """Change of the residuals of each block with one draw of the measured FRFs; None for blocks of other data.

    Parameters
    ----------
    complete : identify the tests completely, with their choice of modes, instead of one step of the identification

    Raises
    ------
    FemtuneError : as `RedrawnTest.identified_again` where complete
    """
    functions = {}
    for test in identified_tests(blocks):
        change = test.draw(how, rng)
        functions[id(test)] = test.identified_again(change) if complete else test.functions(change)
    changes: list[Reals | None] = []
    for block in blocks:
        values = None if block.samples is None else block.samples.identified
        changes.append(None if values is None else values.change(functions[id(values.test)]))
    return changes
