"""Methods of global search, by their words in [search]."""

from __future__ import annotations

from typing import Literal

from femtune.kinds import Kind, Kinds

SearchWord = Literal["differential-evolution", "genetic", "cma-es"]
METHODS = Kinds(
    SearchWord,
    Kind(
        "differential-evolution",
        citations=("storn1997",),
        function="femtune.global_search.methods:by_differential_evolution",
    ),
    Kind("genetic", citations=("deb2001",), function="femtune.global_search.methods:by_genetic_algorithm"),
    Kind("cma-es", citations=("hansen2001",), function="femtune.global_search.methods:by_cma_es"),
)
