"""From records and frequency response functions to modes and state-space models, with error bars."""

from femtune.identify.choice import Candidate, Rule, change_choice, choose, chosen_poles
from femtune.identify.lines import complete_lines, in_band
from femtune.identify.modal_fit import ModalFit, fit_modes
from femtune.identify.modes import as_modes, fit_notices
from femtune.identify.n4sid import Subspace, n4sid_poles, subspace, subspace_poles
from femtune.identify.plscf import normal_equations, plscf_poles, residue_shapes
from femtune.identify.pole_table import PoleTable, join_tables, table_of
from femtune.identify.scaling import DrivingPoint, ScaledShapes, driving_points, scaled_shapes
from femtune.identify.stabilisation import Limits, cluster, possible, stable

__all__ = [
    "Candidate",
    "DrivingPoint",
    "Limits",
    "ModalFit",
    "PoleTable",
    "Rule",
    "ScaledShapes",
    "Subspace",
    "as_modes",
    "change_choice",
    "choose",
    "chosen_poles",
    "cluster",
    "complete_lines",
    "driving_points",
    "fit_modes",
    "fit_notices",
    "in_band",
    "join_tables",
    "n4sid_poles",
    "normal_equations",
    "plscf_poles",
    "possible",
    "residue_shapes",
    "scaled_shapes",
    "stable",
    "subspace",
    "subspace_poles",
    "table_of",
]
