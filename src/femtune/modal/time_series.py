"""TimeSeries: time records of several channels with a common time base."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal.kinds import Quantity, Role
from femtune.modal.mode_set import read_only

QUANTITIES: tuple[str, ...] = get_args(Quantity)
ROLES: tuple[str, ...] = get_args(Role)

STEP_TOLERANCE = 1e-3
"""Relative deviation of time steps from the mean up to which samples are evenly spaced.

A timing error of a thousandth of a step is a phase error of 0.2 degrees at the Nyquist frequency.
"""
LONG_STEP = 1.5
"""Length of a step, relative to the usual one, from which samples are missing in it."""
LEAST_ROUNDED_SAMPLES = 50
"""Number of samples from which times are examined for rounding; fewer could have few digits by chance."""
MOST_DIGITS = 12
"""Largest number of decimals or digits of rounded times; the error of more is below any `STEP_TOLERANCE`."""


@dataclass(frozen=True)
class Channel:
    """Description of one channel of a record.

    Parameters
    ----------
    dof : measured DOF
    quantity : one of QUANTITIES
    unit : unit in the source, "" if none is given
    role : "response", "reference" (a response that all set-ups of an ambient test share), or "input" (a measured force
        or motion that drives the structure)
    name : name in the source, or ""

    Raises
    ------
    FemtuneError : ``record.channel`` for values that are not in QUANTITIES or ROLES
    """

    dof: Dof
    quantity: str = "unknown"
    unit: str = ""
    role: str = "response"
    name: str = ""

    def __post_init__(self) -> None:
        for word, known in ((self.quantity, QUANTITIES), (self.role, ROLES)):
            if word not in known:
                raise FemtuneError("record.channel", word=word, known=", ".join(known))

    def __str__(self) -> str:
        return self.name or str(self.dof)


@dataclass(frozen=True, eq=False, repr=False)
class TimeSeries:
    """Time records of several channels, sampled together; its arrays are read-only.

    Parameters
    ----------
    values : (channels, samples) real, each row in units of its channel; NaN marks a missing sample
    channels : description of each row; a DOF may occur once in each role
    sampling_hz : samples per second; None for unevenly spaced samples (with their times in `times_s`)
    t0_s : time of the first sample
    times_s : (samples,) times, or None if `sampling_hz` and `t0_s` give them; evenly spaced times become a rate
    source : origin of the data, a text

    Raises
    ------
    FemtuneError : ``record.shape`` for inconsistent sizes, ``record.values`` for infinite values or complex ones,
        ``record.times`` for times that are not finite or do not increase, or if neither a rate nor times are given,
        ``record.rate`` for a rate that is not positive or that the times contradict, ``dof.duplicate``

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> from femtune.modal import Channel
    >>> ft.TimeSeries(np.zeros((1, 512)), (Channel(ft.Dof(3, "Z"), "acceleration"),), sampling_hz=256.0)
    TimeSeries: 1 channel, 512 samples, 256 Hz
    """

    values: NDArray[np.float64]
    channels: tuple[Channel, ...]
    sampling_hz: float | None = None
    t0_s: float = 0.0
    times_s: NDArray[np.float64] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        if np.iscomplexobj(self.values):
            raise FemtuneError("record.values")
        object.__setattr__(self, "values", read_only(self.values, float))
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "times_s", read_only(self.times_s, float))
        self._check_sizes()
        self._check_clock()
        for role in ROLES:
            self.dofs(role)

    def __repr__(self) -> str:
        rate = f"{self.sampling_hz:g} Hz" if self.sampling_hz is not None else "uneven times"
        channels = "1 channel" if len(self.channels) == 1 else f"{len(self.channels)} channels"
        words = f", {self.source}" if self.source else ""
        return f"TimeSeries: {channels}, {self.values.shape[1]} samples, {rate}{words}"

    def _check_sizes(self) -> None:
        if self.values.ndim != 2 or len(self.channels) != len(self.values):
            sizes = {"values": self.values.shape, "channels": len(self.channels)}
            raise FemtuneError("record.shape", values=sizes)
        if np.isinf(self.values).any():
            bad = [str(self.channels[i]) for i in np.flatnonzero(np.isinf(self.values).any(axis=1))[:5]]
            first = int(np.flatnonzero(np.isinf(self.values).any(axis=0))[0]) + 1
            raise FemtuneError("record.values/infinite", values={"channels": " ".join(bad)}, sample=first)

    def _check_clock(self) -> None:
        rate = self.sampling_hz
        if rate is not None and not (np.isfinite(rate) and rate > 0.0):
            raise FemtuneError("record.rate/not-positive", rate=rate)
        if self.times_s is not None:
            self._check_times(self.times_s)
        elif rate is None:
            raise FemtuneError("record.times/none")

    def _check_times(self, times: NDArray[np.float64]) -> None:
        if times.shape != (self.values.shape[1],):
            sizes = {"times": times.shape, "samples": self.values.shape[1]}
            raise FemtuneError("record.times", values=sizes)
        if not np.isfinite(times).all():
            bad = int(np.flatnonzero(~np.isfinite(times))[0])
            raise FemtuneError("record.times/not-finite", sample=bad + 1, time=float(times[bad]))
        if len(falls := np.flatnonzero(np.diff(times) <= 0.0)):
            at = int(falls[0])
            code = "record.times/repeated" if times[at + 1] == times[at] else "record.times/back"
            before, after = (np.format_float_positional(t, trim="-") for t in times[at : at + 2])
            raise FemtuneError(code, values={"such steps": len(falls)}, sample=at + 2, before=before, after=after)
        rate = _even_rate(times)
        if self.sampling_hz is not None:
            _check_rate(self.sampling_hz, rate, times)
        if rate is not None:
            object.__setattr__(self, "sampling_hz", rate if self.sampling_hz is None else self.sampling_hz)
            object.__setattr__(self, "t0_s", float(times[0]))
            object.__setattr__(self, "times_s", None)

    def __len__(self) -> int:
        return len(self.channels)

    @property
    def samples(self) -> int:
        """Samples of each channel."""
        return int(self.values.shape[1])

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(samples,) times of the samples."""
        if self.times_s is not None:
            return self.times_s
        assert self.sampling_hz is not None
        return self.t0_s + np.arange(self.samples) / self.sampling_hz

    def _gaps(self) -> dict[str, str]:
        """Place and size of the longest step between two samples, for a message."""
        steps = np.diff(self.time_s)
        if not len(steps):
            return {}
        usual, at = float(np.median(steps)), int(np.argmax(steps))
        long = int((steps > LONG_STEP * usual).sum())
        longest = f"{steps[at]:.6g} s after {self.time_s[at]:.6g} s (sample {at + 1})"
        return {"usual step": f"{usual:.6g} s", "longest step": longest, "gaps": str(long)}

    @property
    def even_hz(self) -> float:
        """The sampling rate, for methods that need an even one (error ``record.uneven``)."""
        if self.sampling_hz is None:
            raise FemtuneError("record.uneven", values=self._gaps())
        return float(self.sampling_hz)

    @property
    def duration_s(self) -> float:
        """Duration from the first sample to one step after the last."""
        if self.times_s is None:
            return self.samples / self.even_hz
        return float(self.times_s[-1] - self.times_s[0])

    def positions(self, role: str) -> list[int]:
        """Rows of the channels of one role."""
        return [i for i, channel in enumerate(self.channels) if channel.role == role]

    def dofs(self, role: str = "response") -> DofSet:
        """The DOFs of the channels of one role, in their order."""
        return DofSet(self.channels[i].dof for i in self.positions(role))

    def select_channels(self, keep: Iterable[int]) -> TimeSeries:
        """The channels at the given positions, in that order."""
        at = [int(i) for i in keep]
        return replace(self, values=self.values[at], channels=tuple(self.channels[i] for i in at))

    def select_samples(self, first: int, end: int) -> TimeSeries:
        """Samples `first` to `end` − 1, on the same clock."""
        cut = slice(first, end)
        times = None if self.times_s is None else self.times_s[cut]
        return replace(self, values=self.values[:, cut], times_s=times, t0_s=float(self.time_s[first]))


def _even_rate(times: NDArray[np.float64]) -> float | None:
    """The sampling rate of evenly spaced times; None if they are uneven or fewer than two."""
    if len(times) < 2:
        return None
    step = (times[-1] - times[0]) / (len(times) - 1)
    if np.abs(np.diff(times) - step).max() <= STEP_TOLERANCE * step:
        return float(1.0 / step)
    if len(times) < LEAST_ROUNDED_SAMPLES:
        return None
    step, first = np.polyfit(np.arange(len(times)), times, 1)
    away = np.abs(times - (first + step * np.arange(len(times)))).max()
    even = any(unit <= step and away <= 0.6 * unit for unit in _last_digits(times))
    return float(1.0 / step) if even else None


def _last_digits(times: NDArray[np.float64]) -> Iterator[float]:
    """The largest unit of a last digit, if all times have one number of decimals, or one number of digits."""
    ones = np.ones_like(times)
    decades = np.floor(np.log10(np.where(times == 0.0, 1.0, np.abs(times))))
    for powers in (lambda n: -n * ones, lambda n: decades - n + 1):
        units = (10.0 ** powers(n) for n in range(MOST_DIGITS + 1))
        rounded = (unit for unit in units if (np.abs(times - unit * np.round(times / unit)) <= 1e-4 * unit).all())
        yield from (float(unit.max()) for unit in itertools.islice(rounded, 1))


def _check_rate(said: float, found: float | None, times: NDArray[np.float64]) -> None:
    if found is not None and abs(found - said) <= STEP_TOLERANCE * found:
        return
    mean = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else float("nan")
    raise FemtuneError(
        "record.rate/of-times",
        values={"rate said": f"{said:g} Hz", "rate of the times": f"{mean:g} Hz" + ("" if found else ", uneven")},
    )
