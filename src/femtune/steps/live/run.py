"""Make the live model of the report: second reduction of the models of an update, with a certificate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.steps.live.comparisons import FULL_POINTS
from femtune.steps.live.first import SMALL, TRAINING, trained
from femtune.steps.live.making import Making
from femtune.steps.live.mass import whole_masses
from femtune.steps.live.record import LiveConfiguration, LiveOtherPart, LiveParameter, LiveResults
from femtune.steps.live.region import AllowedRegion, Sampled, allowed_models

if TYPE_CHECKING:
    from femtune.residuals import CaseState, Evaluation
    from femtune.steps.live.region import Box
    from femtune.steps.update.run import FoundParameters
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

MOST_PARAMETERS = 40
"""Parameters that a page offers at most."""


def live_results(
    study: Study,
    found: FoundParameters,
    arrays: dict[str, NDArray],
    progress: Progress,
    sampled: Sampled | None = None,
) -> LiveResults | None:
    """The live model at the end of an update; None where there is nothing to change or to show.

    Its arrays go into `arrays`. Where it is not possible, the result says why. `sampled` are the samples of a posterior
    distribution, where there is one.
    """
    result, wanted = found.result, study.file.output.live
    states = [s for s in result.after.states if _shown(s)]
    if wanted is False or not result.parameters.free or not states:
        return None
    reason = _impossible(study, result) or _too_large(found, states, wanted)
    if reason:
        return LiveResults(reason=reason)
    region = AllowedRegion.of(result)
    made = Making(study, found, region, progress, result.parameters.bounds)
    configurations, stored = made.every(states)
    narrowed = ""
    if isinstance(configurations, str) and region is not None:
        narrowed, made.box = configurations, region.box(result, sampled)
        configurations, stored = made.every(states)
    if isinstance(configurations, str):
        return LiveResults(reason=narrowed or configurations)
    stored["live/x"] = np.asarray(result.x, float)
    kinds: dict[str, float] = {}
    for block in result.after.blocks:
        kinds[block.kind] = kinds.get(block.kind, 0.0) + float(block.values @ block.values)
    configurations, masses = whole_masses(_same_kinds(configurations, result.after), result.after)
    done = {part.kind for c in configurations for part in c.parts} | masses
    done |= _computed_functions(configurations, result.after)
    others = tuple(LiveOtherPart(kind=k, chi_square=v) for k, v in kinds.items() if k not in done)
    arrays |= stored
    return LiveResults(
        parameters=_parameters(result, made.box), narrowed=narrowed, x_key="live/x",
        region=region.record(arrays) if region else None,
        draws=allowed_models(result, region, sampled, made.box, bool(others), arrays),
        configurations=tuple(configurations), others=others, solutions=made.solutions,
    )  # fmt: skip


def _shown(state: CaseState) -> bool:
    """Whether a page has something to show of a configuration: modes, or FRFs that are compared."""
    case = state.case.on_full_model
    return (case.on_modes and bool(len(state.case.test))) or any(
        isinstance(settled(one), FrfResidual) for one in case.residuals
    )


def _computed_functions(configurations: Sequence[LiveConfiguration], at: Evaluation) -> set[str]:
    """Kinds of FRF residuals of which the page computes all, with the values of the update."""
    kinds = {f.label for c in configurations for f in c.functions if f.label}
    out = set()
    for kind in kinds:
        wanted = {b.configuration for b in at.blocks if b.kind == kind}
        known = {c.configuration: c for c in configurations}
        residuals = {
            s.case.name: [r for r in s.case.on_full_model.residuals if settled(r).label == kind] for s in at.states
        }
        whole = all(
            name in known
            and len([f for f in known[name].functions if f.label == kind and f.sd_key]) == len(residuals.get(name, ()))
            for name in wanted
        )  # fmt: skip
        if whole:
            out.add(kind)
    return out


def _impossible(study: Study, result: UpdateResult) -> str:
    """Why no live model can be made of a study, in words; "" where one can."""
    if study.source.needs_runs:
        return "the model is solved by an external program, whose matrices femtune does not have"
    if study.file.frequency_table:
        return "stiffness or damping depends on frequency"
    if len(result.parameters.free) > MOST_PARAMETERS:
        return f"there are {len(result.parameters.free)} parameters; a page offers up to {MOST_PARAMETERS}"
    return ""


def _too_large(found: FoundParameters, states: Sequence[CaseState], wanted: bool | str) -> str:
    large = [s.case.on_full_model.configured.n_free for s in states if trained(found, s) is None]
    most = max(large, default=0)
    if wanted is True or most <= SMALL:
        return ""
    compared = 2 * FULL_POINTS
    return (
        f"the model has {most:,} degrees of freedom and was not reduced for the update; `live = true` in [output] "
        f"makes one from about {2 * TRAINING + compared} more solutions of each configuration, and with [reduction] "
        f"it takes {compared} of them"
    )


def _parameters(result: UpdateResult, box: Box) -> tuple[LiveParameter, ...]:
    intervals, values, bounds = result.interval(), result.values, result.parameters.bounds
    out = []
    for i, p in enumerate(result.parameters.free):
        low, high = intervals[p.name]
        interval = (low, high) if np.isfinite([low, high]).all() else None
        out.append(
            LiveParameter(
                name=p.name, unit=p.unit, nominal=p.nominal, updated=values[p.name],
                lower=p.lower if box[0][i] == bounds[0][i] else p.nominal + p.scale * float(box[0][i]),
                upper=p.upper if box[1][i] == bounds[1][i] else p.nominal + p.scale * float(box[1][i]),
                scale=p.scale, interval_95=interval,
            )
        )  # fmt: skip
    return tuple(out)


def _same_kinds(configurations: list[LiveConfiguration], at: Evaluation) -> list[LiveConfiguration]:
    """Without parts of kinds that the page can compute in some of the configurations only."""
    every = {(b.kind, b.configuration) for b in at.blocks}
    done = {(p.kind, c.configuration) for c in configurations for p in c.parts}
    whole = {kind for kind, _ in every if all(pair in done for pair in every if pair[0] == kind)}
    return [c.model_copy(update={"parts": tuple(p for p in c.parts if p.kind in whole)}) for c in configurations]
