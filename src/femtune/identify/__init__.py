"""From records and frequency response functions to modes and state-space models, with error bars."""

from femtune.identify.averaging import Averaging, InputOutputSpectra, input_output_spectra, undo_exponential
from femtune.identify.choice import Candidate, Rule, change_choice, choose, chosen_poles
from femtune.identify.estimators import FrfEstimate, estimate_frfs
from femtune.identify.frf_checks import (
    Levels,
    Reciprocity,
    apparent_mass,
    check_frfs,
    check_mass,
    compare_levels,
    exchanged,
    levels_notice,
    power_in,
    reciprocity,
)
from femtune.identify.input_known import FRF_METHODS, IdentifiedModes, InputKnown, identify_frfs
from femtune.identify.join import FitQuality, fit_quality, join_frfs
from femtune.identify.lines import complete_lines, in_band
from femtune.identify.modal_fit import ModalFit, fit_modes
from femtune.identify.modes import as_modes, fit_notices
from femtune.identify.n4sid import Subspace, n4sid_poles, subspace, subspace_poles
from femtune.identify.periodic import PeriodicFrfs, periodic_frfs, stepped_frfs
from femtune.identify.plscf import normal_equations, plscf_poles, residue_shapes
from femtune.identify.pole_table import PoleTable, join_tables, table_of
from femtune.identify.record_checks import check_record
from femtune.identify.rigid_body import with_rigid_body, without_rigid_body
from femtune.identify.scaling import DrivingPoint, ScaledShapes, driving_points, scaled_shapes
from femtune.identify.stabilisation import Limits, cluster, possible, stable
from femtune.identify.state_space_fit import fit_system, residual_poles, stable_poles

__all__ = [
    "FRF_METHODS",
    "Averaging",
    "Candidate",
    "DrivingPoint",
    "FitQuality",
    "FrfEstimate",
    "IdentifiedModes",
    "InputKnown",
    "InputOutputSpectra",
    "Levels",
    "Limits",
    "ModalFit",
    "PeriodicFrfs",
    "PoleTable",
    "Reciprocity",
    "Rule",
    "ScaledShapes",
    "Subspace",
    "apparent_mass",
    "as_modes",
    "change_choice",
    "check_frfs",
    "check_mass",
    "check_record",
    "choose",
    "chosen_poles",
    "cluster",
    "compare_levels",
    "complete_lines",
    "driving_points",
    "estimate_frfs",
    "exchanged",
    "fit_modes",
    "fit_notices",
    "fit_quality",
    "fit_system",
    "identify_frfs",
    "in_band",
    "input_output_spectra",
    "join_frfs",
    "join_tables",
    "levels_notice",
    "n4sid_poles",
    "normal_equations",
    "periodic_frfs",
    "plscf_poles",
    "possible",
    "power_in",
    "reciprocity",
    "residual_poles",
    "residue_shapes",
    "scaled_shapes",
    "stable",
    "stable_poles",
    "stepped_frfs",
    "subspace",
    "subspace_poles",
    "table_of",
    "undo_exponential",
    "with_rigid_body",
    "without_rigid_body",
]
