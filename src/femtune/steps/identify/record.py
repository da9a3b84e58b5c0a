"""Records of an identification, as ``identified.json`` holds them."""

from __future__ import annotations

from femtune.study.record import Alert, InputFile, Record, ReportFacts


class IdentifiedMode(Record):
    """One mode."""

    label: str
    """Its name."""
    freq_hz: float
    """Natural frequency."""
    freq_sd_hz: float | None
    """Standard deviation of it, None if the method gives none."""
    damping_ratio: float | None
    """Fraction of critical damping, None if the method gives none."""
    damping_sd: float | None
    """Standard deviation of it."""
    by_method: dict[str, float | None]
    """Frequency by each method, None if it did not find the mode."""
    phase_collinearity: float | None
    """Phase collinearity of the complex shape: 1 if it is real except for a factor; None if it is not known."""
    estimates: int | None
    """Number of estimates (methods and fragments) that contain it, None with only one estimate."""
    of_input: bool | None
    """True if the excitation has the same peak, None if it was not recorded."""
    doubtful: bool
    """True if its damping or its modal mass is not that of a mode of a structure, or a neighbour has the same shape."""
    remark: str
    """Remarks on its origin, its damping, modal mass and shape, and on the methods that found it."""


class PoleCluster(Record):
    """Poles that are stable from order to order."""

    freq_hz: float
    """Median."""
    damping_ratio: float
    """Median."""
    chosen: bool
    """True if it was chosen as a mode."""
    reason: str
    """The reason."""


class HarmonicLine(Record):
    """A line of a machine or of the mains in a record of responses; it is no mode."""

    freq_hz: float
    """Its mean frequency."""
    kurtosis: float
    """Kurtosis of the band-passed signal: 1.5 for a sine, 3 for a mode under random forces."""
    width_hz: float
    """Half the bandwidth within which it was judged."""
    share: float
    """Share of the power of the channels in this bandwidth, each channel relative to its own power."""
    multiple: str
    """Its integer ratio to another line or to the mains; "" if it has none."""


class LevelTrend(Record):
    """Change of the frequency or the damping ratio of a mode with the level of the force."""

    largest_percent: float | None
    """(value − value at the first level)/value at the first level of largest magnitude, in %; None if the mode was
    found at one level only."""
    sd_percent: float | None
    """Standard deviation of this change, in %; None if not known."""
    per_doubling_percent: float | None
    """Change for twice the force by a line over the logarithm of the force, in %; None if all levels are equal."""
    per_doubling_sd_percent: float | None
    """Its standard deviation, in %; None if not known."""
    beyond_limit: bool
    """True if a change is above the limit, and above three standard deviations where these are known."""


class LevelMode(Record):
    """A mode of the first level at all levels."""

    label: str
    """Label of the mode at the first level."""
    freq_hz: tuple[float | None, ...]
    """Natural frequency by level, Hz; None where the mode was not found."""
    damping_ratio: tuple[float | None, ...]
    """Damping ratio by level; None where it is not known."""
    mac: tuple[float | None, ...]
    """MAC with the shape at the first level."""
    frequency: LevelTrend
    """Change of the frequency."""
    damping: LevelTrend
    """Change of the damping ratio."""
    linear: bool | None
    """Whether neither change is beyond its limit; None if the mode was found at the first level only."""


class LevelFunctions(Record):
    """FRFs of one level beside those of the first."""

    functions: int
    """Number of functions that are compared; 0 if none."""
    lines: int
    """Number of common frequency lines."""
    frac: float | None
    """FRAC of all functions together."""
    lowest_frac: float | None
    """FRAC of the function that differs most."""
    lowest: str
    """Response and reference of this function."""
    change_percent: float | None
    """|H − H of the first level| relative to |H of the first level|, all functions together, in %."""
    noise_percent: float | None
    """The value that noise alone would give, in %; None if the noise is not known."""
    differing: int
    """Number of functions whose FRAC is below the limit and that differ by more than noise; if the noise is not known,
    1 if the FRAC of all functions together is below the limit."""
    reason: str
    """The reason why nothing was compared; "" if it was."""


class LinearityResults(Record):
    """Linearity from tests at several levels of force."""

    names: tuple[str, ...]
    """The levels; the first is the reference."""
    forces: tuple[float, ...]
    """Their forces."""
    modes: tuple[LevelMode, ...]
    """Modes of the first level."""
    functions: tuple[LevelFunctions, ...]
    """One entry for each further level."""
    linear: bool | None
    """The verdict; None if neither modes nor functions could be compared."""
    frequency_limit_percent: float
    """Accepted change of a frequency, in %."""
    damping_limit_percent: float
    """Accepted change of a damping ratio, in %."""
    frac_limit: float
    """Accepted FRAC."""
    sentence: str
    """The verdict with its numbers."""


class Identification(Record):
    """An identification without its arrays."""

    femtune_version: str
    """Version that wrote it."""
    title: str
    """Its title."""
    source: InputFile
    """The record or the functions."""
    units: str
    """length-mass-s."""
    dofs: tuple[str, ...]
    """Rows of the shapes."""
    normalisation: str
    """Of the shapes: mass, unit-norm or unit-max."""
    modes: tuple[IdentifiedMode, ...]
    """The identified modes."""
    clusters: tuple[PoleCluster, ...]
    """The clusters from which the modes were chosen."""
    largest_misfit_percent: float | None
    """Relative error of the synthesised function with the poorest fit; None if the input is not known."""
    alerts: tuple[Alert, ...]
    """Alerts."""
    harmonics: tuple[HarmonicLine, ...] = ()
    """Lines of machines and of the mains, which are not among the modes."""
    inputs: tuple[InputFile, ...] = ()
    """All measured files of one record or one set of functions, in their order; () for several set-ups."""
    linearity: LinearityResults | None = None
    """Comparison of tests at several levels of force; None if only one level was measured."""
    report: ReportFacts = ReportFacts()
    """Document number, persons, and what is stated about the test."""
