"""From records and frequency response functions to modes and state-space models, with error bars."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.identification.averaging import Averaging, InputOutputSpectra, input_output_spectra, undo_exponential
    from femtune.identification.choice import (
        Candidate,
        Limits,
        Rule,
        change_choice,
        choose,
        chosen_poles,
        cluster,
        possible,
        stable,
    )
    from femtune.identification.equal_damping import EqualisedTest, check_equalised_lines, equalised_test
    from femtune.identification.estimators import FrfEstimate, estimate_frfs
    from femtune.identification.frf_checks import (
        Levels,
        Reciprocity,
        apparent_mass,
        check_frfs,
        check_mass,
        compare_levels,
        exchanged,
        power_in,
        reciprocity,
    )
    from femtune.identification.input_known import IdentifiedModes, InputKnown, identify_frfs
    from femtune.identification.join import FitQuality, complete_lines, fit_quality, in_band
    from femtune.identification.modal_fit import ModalFit, fit_modes
    from femtune.identification.n4sid import Subspace, n4sid_poles, subspace, subspace_poles
    from femtune.identification.periodic import PeriodicFrfs, periodic_frfs, stepped_frfs
    from femtune.identification.plscf import normal_equations, plscf_poles, residue_shapes
    from femtune.identification.pole_table import PoleTable, join_tables, table_of
    from femtune.identification.record_checks import check_record
    from femtune.identification.rigid_body import with_rigid_body, without_rigid_body
    from femtune.identification.shapes import (
        DrivingPoint,
        ScaledShapes,
        as_modes,
        driving_points,
        scaled_shapes,
    )
    from femtune.identification.state_space_fit import SystemFit, fit_system, residual_poles, stable_poles, system_fit
    from femtune.modal.joined import join_frfs
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Averaging",
    "Candidate",
    "DrivingPoint",
    "EqualisedTest",
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
    "SystemFit",
    "apparent_mass",
    "as_modes",
    "change_choice",
    "check_equalised_lines",
    "check_frfs",
    "check_mass",
    "check_record",
    "choose",
    "chosen_poles",
    "cluster",
    "compare_levels",
    "complete_lines",
    "driving_points",
    "equalised_test",
    "estimate_frfs",
    "exchanged",
    "fit_modes",
    "fit_quality",
    "fit_system",
    "identify_frfs",
    "in_band",
    "input_output_spectra",
    "join_frfs",
    "join_tables",
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
    "system_fit",
    "table_of",
    "undo_exponential",
    "with_rigid_body",
    "without_rigid_body",
]
