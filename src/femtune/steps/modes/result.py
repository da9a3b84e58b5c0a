"""The result of `modes`: natural modes and shapes of each configuration, for Python users."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.steps.info.record.model import ModelModes
from femtune.study.rows import Rows

if TYPE_CHECKING:
    from femtune.modal import ModeSet
    from femtune.steps.results import Results
from femtune.steps.result import Arrays, OfConfigurations, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class ModesResult(OfConfigurations[ModelModes], ResultWithPage):
    """Natural modes of each configuration, at the initial values of the parameters.

    `records` are those of results.json, ``modes``; `remarks` what a user should know; `shapes` gives the shapes by
    configuration, `whole` the results and their arrays; `report` is the page that was written, None without one.
    """

    page = "modes"
    shapes: Callable[[], Mapping[str, ModeSet]] = field(kw_only=True)
    whole: Callable[[], tuple[Results, Arrays]] = field(kw_only=True)
    report: Path | None = field(default=None, kw_only=True)

    @property
    def frequencies(self) -> Rows:
        """`configuration`, number of the `mode` from 1, `freq_hz`, and whether it is a `rigid_body` motion."""
        return Rows.of(
            {"configuration": m.configuration, "mode": i + 1, "freq_hz": f, "rigid_body": i < m.rigid_body_modes}
            for m in self.records
            for i, f in enumerate(m.freq_hz)
        )

    @property
    def mesh_errors(self) -> Rows:
        """`configuration`, `mode`, `freq_hz`, `refined_hz` of a mesh of half the element size, estimated
        `error_percent` due to the mesh, and `converged_hz`; none where the mesh was not checked."""
        return Rows.of(
            {"configuration": r.configuration, **m.model_dump()}
            for r in self.records
            for m in (r.mesh.modes if r.mesh is not None else ())
        )

    @property
    def freq_hz(self) -> NDArray[np.float64]:
        """(modes,) frequencies in Hz of the only configuration (error ``study.unknown-configuration`` for several)."""
        return np.array(self._only("record").freq_hz)

    @cached_property
    def mode_sets(self) -> Mapping[str, ModeSet]:
        """By configuration: modes with mass-normalised shapes at all DOFs of the model, in its displacement frames."""
        return self.shapes()

    @property
    def results(self) -> Results:  # type: ignore[override]  # made when first used
        """The results in the schema of results.json: provenance, facts of the model, modes, shapes for drawing."""
        return self._whole[0]

    @property
    def arrays(self) -> Arrays:  # type: ignore[override]
        """Arrays that `results` refers to by key."""
        return self._whole[1]

    @cached_property
    def _whole(self) -> tuple[Results, Arrays]:
        return self.whole()

    def _sentences(self) -> list[str]:
        sentences = []
        for m in self.records:
            shown = ", ".join(f"{f:.5g}" for f in m.freq_hz[:6]) + (" …" if len(m.freq_hz) > 6 else "")
            rigid = f", {m.rigid_body_modes} of them rigid-body modes" if m.rigid_body_modes else ""
            sentences.append(f"{m.configuration}: {len(m.freq_hz)} modes{rigid}: {shown} Hz")
        return [*sentences, *(a.sentence for m in self.records for a in m.alerts), *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.frequencies
