"""A chain of four masses to ground, of whose springs three are wrong."""

from __future__ import annotations

from femtune.residuals import FrequencyResidual, ShapeResidual, UpdateProblem
from structures.springs import factor_model, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
TRUTH = (0.25, -0.3, 0.15)


def chain_problem() -> UpdateProblem:
    """Frequencies and shapes of the chain with its true springs; the parameters a, b and c start at zero."""
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1], "b": [2], "c": [3]})
    case = simulated_case(model, TRUTH, range(4), 4)  # type: ignore[arg-type]
    return UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.01), ShapeResidual(0.1)))
