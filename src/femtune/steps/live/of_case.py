"""The record of the live model of one configuration, with its arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.model.live import LivePorts
from femtune.model.live.matrices import solved
from femtune.steps.live.certificate import CertifiedLive, elastic_groups
from femtune.steps.live.comparisons import MOST_PERCENT, certificates, too_inaccurate
from femtune.steps.live.drawing import NO_POINTS, drawing, mass_rows
from femtune.steps.live.mass import page_mass
from femtune.steps.live.record import (
    LiveCheck,
    LiveConfiguration,
    LiveFunctions,
    LivePair,
    LivePart,
    LiveTermRecord,
)
from femtune.steps.live.reduced_mass import page_reduced_mass
from femtune.steps.live.residuals import PagePart, page_parts

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model.live import LiveModel
    from femtune.residuals import CaseState
    from femtune.residuals.case import Residual
    from femtune.steps.live.comparisons import FunctionErrors
    from femtune.steps.live.first import First, Work
    from femtune.steps.live.frfs import ComparedFunctions
    from femtune.steps.live.points import Points
    from femtune.study.cases import StudyCase
    from femtune.updating import UpdateResult

_CHECKS = 3
"""Points whose eigenvalues are stored, by which a page checks itself when it is opened."""


@dataclass(frozen=True, eq=False)
class LiveOfCase:
    """The live model of a configuration.

    Parameters
    ----------
    first, vectors : the model that it is made of, and its basis there
    carriers : grid points that can carry a mass
    points : points of the region and of the ranges
    with_mass : whether criteria need the mass reduced to the sensors, and a page may have it
    """

    case: StudyCase
    state: CaseState
    first: First
    vectors: Reals
    model: LiveModel
    carriers: Sequence[int]
    points: Points
    with_mass: bool = False

    def record(
        self, result: UpdateResult, residuals: Sequence[Residual], functions: tuple[Sequence[ComparedFunctions], str],
        work: Work, prefix: str, arrays: dict[str, NDArray],
    ) -> LiveConfiguration | str:  # fmt: skip
        """The record, or why the model is too inaccurate; its arrays go into `arrays`.

        Parameters
        ----------
        functions : those that are compared, and why others are not
        prefix : of the keys of the arrays
        """
        model, state, full = self.model, self.state, self.first.full(self.vectors)
        states = result.after.states
        sensors = np.asarray(state.case.on_full_model.sensors @ full, np.float32)
        groups = elastic_groups(state, model)
        known = {i for tests, _ in groups for i in tests}
        parts = page_parts(result.after, states.index(state), residuals, known)
        certified = CertifiedLive(model, sensors.astype(float), state, parts)
        chosen, why_not = functions
        ports = [_ports_of(f, full, model) for f in chosen]
        (region, bounds, region_full, bounds_full), errors = certificates(
            certified, self.first, self.vectors, full, list(zip(chosen, ports)), self.points, work
        )
        worst = max(c.frequency_percent for c in (region, bounds, region_full, bounds_full) if c is not None)
        if worst > MOST_PERCENT:
            return too_inaccurate(worst, model.order, self.case.name)
        stored = self._stored(sensors, parts, full, len(states))
        compared = tuple(
            _function_record(f, p, e, f"{prefix}/functions_{i}", arrays)
            for i, (f, p, e) in enumerate(zip(chosen, ports, errors))
        )
        checks = self._checks(certified, ports, prefix, stored)
        arrays |= {f"{prefix}/{name}": a for name, a in stored.items()}
        drawn = {name: f"{prefix}/{name}" for name in ("drawing", "drawing_weights", "mass_rows") if name in stored}
        test = state.case.test
        return LiveConfiguration(
            configuration=self.case.name, order=model.order, dofs=state.case.on_full_model.configured.n_free,
            count=model.count, shift=model.shift,
            theta_key=f"{prefix}/theta", terms=_term_records(model),
            triangles_key=f"{prefix}/triangles", polynomials_key=f"{prefix}/polynomials",
            sensors_key=f"{prefix}/sensors", test_shapes_key=f"{prefix}/test_shapes",
            sensor_labels=tuple(map(str, test.dofs)),
            mass_points=tuple(f"grid {n}" for n in self.carriers),
            mass_reason="" if self.carriers else NO_POINTS,
            test_labels=tuple(test.labels),
            test_freq_hz=tuple(map(float, test.freq_hz)),
            pairs=tuple(
                LivePair(test=i, mode=j, modes=tuple(models))
                for tests, models in groups for i, j in zip(tests, models)
            ),
            parts=_part_records(parts), weights_key=f"{prefix}/weights",
            region=region, bounds=bounds, region_full=region_full, bounds_full=bounds_full, checks=checks,
            drawing_key=drawn.get("drawing"), drawing_weights_key=drawn.get("drawing_weights"),
            mass_rows_key=drawn.get("mass_rows"),
            mass=page_mass(state, model, self.points, result.after),
            reduced_mass=page_reduced_mass(state, model, sensors, self.points) if self.with_mass else None,
            functions=compared, functions_reason=why_not,
        )  # fmt: skip

    def _stored(
        self, sensors: NDArray, parts: Sequence[PagePart], full: Reals, configurations: int
    ) -> dict[str, NDArray]:
        """Arrays of the model, of its sensors and of what is drawn."""
        terms = self.model.terms
        return {
            "theta": self.model.theta,
            "triangles": np.array([t.triangle for t in terms]).reshape(len(terms), -1),
            "polynomials": np.concatenate([np.zeros(0), *(t.function.coefficients.ravel() for t in terms)]),
            "sensors": sensors,
            "test_shapes": np.asarray(self.state.case.test.shapes, float),
            "weights": np.concatenate([np.zeros(0), *(p.weights.ravel() for p in parts if p.weights is not None)]),
            **drawing(self.case, full, self.model, self.points, configurations),
            **mass_rows(self.carriers, self.case, full),
        }

    def _checks(
        self, certified: CertifiedLive, ports: Sequence[LivePorts], prefix: str, stored: dict[str, NDArray]
    ) -> tuple[LiveCheck, ...]:
        """Points with what the page has to find there; their arrays go into `stored`."""
        inside = self.points.in_region(1, 6)
        found: list[LiveCheck] = []
        for i, x in enumerate([*inside, *self.points.in_ranges(_CHECKS - len(inside), 6)]):
            modes = solved(self.model, x)
            if modes is None:
                continue
            stored |= {f"check_{i}_x": np.asarray(x), f"check_{i}": modes.eigenvalues}
            sums = tuple(float(np.sum(np.abs(p.values(self.model, np.asarray(x))) ** 2)) for p in ports)
            found.append(
                LiveCheck(
                    chi_square=certified.chi_square(modes), functions=sums, x_key=f"{prefix}/check_{i}_x",
                    eigenvalues_key=f"{prefix}/check_{i}",
                )
            )  # fmt: skip
        return tuple(found)


def _term_records(model: LiveModel) -> tuple[LiveTermRecord, ...]:
    """The terms, with the place of their polynomials in one array."""
    starts = np.cumsum([0, *(t.function.coefficients.size for t in model.terms)])
    return tuple(
        LiveTermRecord(
            kind="mass" if t.kind == "mass" else "stiffness", parameters=t.function.parameters,
            shape=t.function.coefficients.shape[1:], first=int(at), scale=t.scale,
        )
        for t, at in zip(model.terms, starts)
    )  # fmt: skip


def _ports_of(one: ComparedFunctions, full: Reals, model: LiveModel) -> LivePorts:
    """The functions on the live model, with the rows as they are stored."""
    seen, driven = (
        np.asarray(np.asarray(r @ full), np.float32).astype(float) for r in (one.ports.outputs, one.ports.inputs.T)
    )
    return LivePorts(one.kind, seen, driven, one.freq_hz, one.modes(model), one.damping)


def _part_records(parts: Sequence[PagePart]) -> tuple[LivePart, ...]:
    out, first = [], 0
    for p in parts:
        at = None if p.weights is None else first
        first += 0 if p.weights is None else p.weights.size
        out.append(
            LivePart(
                kind=p.kind, quantity=p.quantity, form=p.form, test=p.test, sd=p.sd,
                sensors=tuple(p.sensors.tolist()), weights_first=at,
                weights_size=0 if p.weights is None else len(p.weights), common=p.common,
            )
        )  # fmt: skip
    return tuple(out)


def _function_record(
    one: ComparedFunctions, ports: LivePorts, errors: FunctionErrors, prefix: str, arrays: dict[str, NDArray]
) -> LiveFunctions:
    stored: dict[str, NDArray] = {"hz": ports.freq_hz, "test": one.test, "outputs": ports.outputs.astype(np.float32),
              "inputs": ports.inputs.astype(np.float32)}  # fmt: skip
    if one.sd is not None:
        stored["sd"] = one.sd
    if one.shift is not None:
        stored["shift"] = one.shift
    arrays |= {f"{prefix}/{name}": array for name, array in stored.items()}
    return LiveFunctions(
        kind=one.kind, unit=one.unit, look=one.look, outputs=one.outputs, inputs=one.inputs,
        freq_key=f"{prefix}/hz", every=one.every, test_values_key=f"{prefix}/test", outputs_key=f"{prefix}/outputs",
        inputs_key=f"{prefix}/inputs", modes=ports.count, damping=one.how,
        damping_ratios=tuple(map(float, one.damping.ratios)), damping_hz=tuple(map(float, one.damping.freq_hz)),
        hysteretic=one.damping.hysteretic, loss_factor=one.damping.loss_factor, label=one.label, form=one.form,
        sd_key=f"{prefix}/sd" if "sd" in stored else None, shift_key=f"{prefix}/shift" if "shift" in stored else None,
        region=errors[0], bounds=errors[1],
    )  # fmt: skip
