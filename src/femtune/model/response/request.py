"""What an FRF is asked for, checked: lines, kind, method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.errors import FemtuneError
from femtune.modal.frf_set import KINDS
from femtune.model.configured import ModelPoint
from femtune.model.eigen import EigenSolution
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.modal_damping import DampingRatios, modal_damper
from femtune.model.response.ports import Ports

Reals = NDArray[np.float64]
Kind = Literal["receptance", "mobility", "accelerance"]
Method = Literal["direct", "real-modes", "complex-modes"]

METHODS: tuple[Method, ...] = ("direct", "real-modes", "complex-modes")


@dataclass(frozen=True, eq=False)
class Request:
    """Checked request: `s` (k,) is iω, `factor` (k,) what turns receptance into the kind that is wanted."""

    stiffness: DynamicStiffness
    modes: EigenSolution | None
    ports: Ports
    freq_hz: Reals
    kind: Kind
    method: Method

    @property
    def s(self) -> NDArray:
        """iω."""
        return 2j * np.pi * self.freq_hz

    @property
    def factor(self) -> NDArray:
        """(iω)⁰, (iω)¹ or (iω)²."""
        return np.asarray(self.s ** KINDS.index(self.kind), dtype=np.complex128)


def checked_request(
    model: ModelPoint | EigenSolution,
    ports: Ports,
    freq_hz: ArrayLike,
    kind: Kind,
    method: Method,
    damping: DampingRatios | None,
) -> Request:
    """The request, or an error that says what is wrong with it.

    Raises
    ------
    FemtuneError : ``frf.kind``, ``response.method``, ``response.frequencies``, ``response.modes-needed``,
        ``response.ports-differ``, ``response.damping-ratio``
    """
    modes = model if isinstance(model, EigenSolution) else None
    point = model.point if isinstance(model, EigenSolution) else model
    _check_words(kind, method)
    if modes is None and (method != "direct" or damping is not None or point.mode_ratios):
        raise _modes_needed(method)
    check_ports(point, ports)
    damper = None if modes is None else modal_damper(modes, damping)
    return Request(DynamicStiffness(point, damper), modes, ports, _lines(freq_hz), kind, method)


def _check_words(kind: str, method: str) -> None:
    if kind not in KINDS:
        raise FemtuneError("frf.kind", f"'{kind}' is not a kind of FRF", hint="one of " + ", ".join(KINDS))
    if method not in METHODS:
        raise FemtuneError(
            "response.method", f"'{method}' is no way to compute an FRF", hint="one of " + ", ".join(METHODS)
        )


def _modes_needed(method: str) -> FemtuneError:
    what = "modal damping needs" if method == "direct" else f'the method "{method}" needs'
    return FemtuneError(
        "response.modes-needed",
        f"{what} the modes of the model, and a model without them was given",
        hint="give solve_modes(point, count) in place of the point",
    )


def check_ports(point: ModelPoint, ports: Ports) -> None:
    """Refuse ports of another configuration (error ``response.ports-differ``)."""
    n = point.configured.n_free
    if ports.inputs.shape[0] != n or ports.outputs.shape[1] != n:
        raise FemtuneError(
            "response.ports-differ",
            "the ports were made for another configuration",
            values={"free DOFs of the model": n, "of the ports": ports.outputs.shape[1]},
            hint="make the ports with the configured model that the point belongs to",
        )


def _lines(freq_hz: ArrayLike) -> Reals:
    lines = np.atleast_1d(np.asarray(freq_hz, dtype=float))
    good = lines.ndim == 1 and lines.size and np.isfinite(lines).all() and (lines >= 0).all()
    if not good or (np.diff(lines) <= 0).any():
        raise FemtuneError(
            "response.frequencies",
            "frequency lines must be finite numbers, not negative, and increase; at least one is needed",
            values={"lines (Hz)": ", ".join(f"{line:.6g}" for line in lines.ravel()[:6])},
            hint="numpy.linspace(first, last, count) gives such lines",
        )
    return lines


def singular_at(point: ModelPoint, freq_hz: float) -> FemtuneError:
    """The error that the response is infinite at a frequency."""
    name = point.configured.configuration.name
    if freq_hz == 0.0:
        return FemtuneError(
            "response.free-at-zero",
            f"configuration {name}: at 0 Hz the structure moves without resistance, so its response is not finite",
            hint="begin at a frequency above zero, or hold the structure",
        )
    return FemtuneError(
        "response.resonance",
        f"configuration {name}: at {freq_hz:.9g} Hz the response is not finite, or lost to rounding",
        values={"frequency (Hz)": f"{freq_hz:.9g}"},
        hint="an undamped natural frequency lies there: give the model damping, or leave this line out",
    )
