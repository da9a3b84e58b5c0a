"""The finite element kernel: structures as arrays, elements as exact terms, constraints, checks."""

from femtune.fem.assembled import AssembledMatrix
from femtune.fem.contribution import Contribution, product
from femtune.fem.mode_ratios import ALL_MODES, MODAL, mode_ratio_field, with_mode_ratios
from femtune.fem.structure import (
    ConstraintRows,
    ElementBatch,
    NodeTable,
    OverallDamping,
    Structure,
    join_constraints,
    no_constraints,
)
from femtune.fem.values import Derived, FieldRef, ValueTable, ValueTableBuilder

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
