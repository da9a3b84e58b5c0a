"""The finite element kernel: structures as arrays, elements as exact terms, constraints, checks."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.fem.assembled import AssembledMatrix
    from femtune.fem.contribution import Contribution, product
    from femtune.fem.fields import FieldRef
    from femtune.fem.structure import (
        ALL_MODES,
        MODAL,
        ConstraintRows,
        ElementBatch,
        NodeTable,
        OverallDamping,
        Structure,
        join_constraints,
        mode_ratio_field,
        no_constraints,
        with_mode_ratios,
    )
    from femtune.fem.values import Derived, ValueTable, ValueTableBuilder
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ALL_MODES",
    "MODAL",
    "AssembledMatrix",
    "ConstraintRows",
    "Contribution",
    "Derived",
    "ElementBatch",
    "FieldRef",
    "NodeTable",
    "OverallDamping",
    "Structure",
    "ValueTable",
    "ValueTableBuilder",
    "join_constraints",
    "mode_ratio_field",
    "no_constraints",
    "product",
    "with_mode_ratios",
]
