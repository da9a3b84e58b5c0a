"""From records and frequency response functions to modes and state-space models, with error bars."""

from femtune.identify.choice import Candidate, Rule, change_choice, choose, chosen_poles
from femtune.identify.join import FitQuality, fit_quality, join_frfs
from femtune.identify.lines import complete_lines, in_band
from femtune.identify.modal_fit import ModalFit, fit_modes
from femtune.identify.modes import as_modes, fit_notices
from femtune.identify.n4sid import Subspace, n4sid_poles, subspace, subspace_poles
from femtune.identify.plscf import normal_equations, plscf_poles, residue_shapes
from femtune.identify.pole_table import PoleTable, join_tables, table_of
from femtune.identify.rigid_body import with_rigid_body, without_rigid_body
from femtune.identify.scaling import DrivingPoint, ScaledShapes, driving_points, scaled_shapes
from femtune.identify.stabilisation import Limits, cluster, possible, stable
from femtune.identify.state_space_fit import fit_system, residual_poles, stable_poles

__all__ = [
    "Candidate",
    "DrivingPoint",
    "FitQuality",
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
    "fit_quality",
    "fit_system",
    "in_band",
    "join_frfs",
    "join_tables",
    "n4sid_poles",
    "normal_equations",
    "plscf_poles",
    "possible",
    "residual_poles",
    "residue_shapes",
    "scaled_shapes",
    "stable",
    "stable_poles",
    "subspace",
    "subspace_poles",
    "table_of",
    "with_rigid_body",
    "without_rigid_body",
]
