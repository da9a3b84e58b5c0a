"""The residuals of an update in parts, the shapes beside their neighbours, and the errors by kind."""

from __future__ import annotations

from femtune.judge.kinds import PartFamily
from femtune.study.record import Record

NOT_ACCEPTED = 0.01
"""Family-wise level of the tests: a right model is not accepted at most so often."""
RESERVED = 0.05
"""The same for a reservation."""
SHARE_OF_MISSING = 0.6
SHARE_OF_PARTS = 0.2
SHARE_OF_NEIGHBOURS = 0.2
"""Of these levels, which the search for missing parameters, the parts and the neighbours have together, being tests of
one question: a probability is divided by the share of its test (weighted Bonferroni). The search has most of it, since
it finds most of the wrong models: with equal shares 73 of 81 were found in trials with true standard deviations, so
76. The shares were chosen on these trials; in 46 others 1 of 24 right models was accused, and 21 of 21 wrong ones
were found."""
LEAST_SHARE = 0.01
"""Share of a neighbouring mode below which nothing is said: it changes the MAC by less than 0.0001, which no modal test
resolves, and simulated shapes without noise differ by rounding alone."""


class PartRecord(Record):
    """A part of the residuals, and the chance of it where the model is right."""

    family: PartFamily
    """What it is one of: "kinds" of residual or all together, "modes", "comparisons" of another kind, "sensors",
    "configurations", "priors" of parameters, what the "bounds" keep, or what a "side constraint" keeps."""
    kind: str
    """Kind of residual; "" for several."""
    configuration: str
    """Configuration; "" for several."""
    mode: str
    """Label of the test mode, or of what else is compared; of a prior the parameter; "" for several."""
    sensor: str
    """Sensor; "" for several."""
    values: int
    """Number of residuals."""
    chi_square: float
    """Sum of squares of what the parameters cannot change, in units of the standard deviations."""
    degrees_of_freedom: float
    """Its mean for noise of the stated size."""
    p_value: float
    """Probability of at least this sum for noise of the stated size."""
    p_family_wise: float
    """The same, corrected for the number of parts and for the three tests of a fit that share the level."""

    @property
    def ratio(self) -> float:
        """Actual over stated standard deviation."""
        return float((self.chi_square / self.degrees_of_freedom) ** 0.5)

    @property
    def words(self) -> str:
        """What the part is, as it stands in a sentence."""
        if self.family == "bounds":
            return "what the bounds keep"
        if self.family == "side constraint":
            return "what the side constraint keeps"
        if self.family == "priors":
            return f"the prior of {self.mode}"
        if self.family == "sensors":
            return f"sensor {self.sensor}"
        if self.family == "configurations":
            return f"configuration {self.configuration}"
        if not self.kind:
            return "all residuals together"
        if not self.mode:
            return f"the {self.kind} residuals"
        of = f"mode {self.mode}" if self.family == "modes" else self.mode
        return f"the {self.kind} residual of {of} ({self.configuration})"

    @property
    def numbers(self) -> str:
        """Chi-square, degrees of freedom and corrected probability, as they stand in brackets; of a prior, of which
        the data leave a small part of a degree of freedom, the probability alone."""
        if self.family == "priors":
            return chance_words(self.p_family_wise)
        exact = self.degrees_of_freedom
        degrees = f"{exact:.0f}" if exact >= 9.5 else f"{exact:.2g}"
        return (
            f"chi-square {self.chi_square:.3g} on {degrees} {'degree' if degrees == '1' else 'degrees'} of freedom, "
            f"{chance_words(self.p_family_wise)}"
        )


def chance_words(p: float) -> str:
    """A probability in a sentence."""
    return f"p = {p:.2g}" if p >= 1e-12 else "p < 1e-12"


class NeighbourRecord(Record):
    """A mode whose shape was compared with those of the neighbouring model modes."""

    configuration: str
    """Configuration of the test."""
    test_label: str
    """Label of the test mode."""
    model_number: int
    """Number of the model mode that is paired with it."""
    neighbours: tuple[int, ...]
    """Numbers of the neighbouring model modes."""
    other_number: int
    """Number of that of which the shape contains most."""
    other_label: str
    """Label of the test mode that is paired with that one; "" if none is."""
    share: float
    """How much of it the shape contains, relative to its own mode, by the length of the shapes at the sensors."""
    F: float
    """Mean square of the part in the shapes of the neighbours over that of the rest."""
    degrees_of_freedom: tuple[int, int]
    """Degrees of freedom of both."""
    p_value: float
    """Probability of at least this ratio for noise of any size."""
    p_family_wise: float
    """The same, corrected for the number of modes and for the three tests of a fit that share the level."""
    scatter: float
    """Root mean square of the rest, relative to the largest entry of the shape: an estimate of the noise."""


class KindOfErrors(Record):
    """The size of the errors of one kind of residual, as the residuals show it."""

    kind: str
    """Kind of residual."""
    factor: float | None
    """Actual over stated standard deviation; None if less than one degree of freedom is left."""
    degrees_of_freedom: float
    """Degrees of freedom of the estimate."""
    key: str
    """The key of the study that states the standard deviation: "frequency_sd"; "" if the test gives it."""
    stated: float | None
    """The value of the key; None if it is no number."""
    assumed: bool
    """Whether the standard deviation is an assumption: by default, by `assumed` in [residuals], or with scatter =
    "estimated"."""
    p_small: float | None
    """Probability of residuals as small where the stated standard deviation is right, corrected for the number of
    kinds; None if it is an assumption."""
    p_large: float | None = None
    """Probability of residuals as large where an assumed standard deviation is right; None if it is stated."""

    @property
    def fits(self) -> float | None:
        """The standard deviation that fits the residuals."""
        return None if self.stated is None or self.factor is None else self.stated * self.factor


class UntestedKind(Record):
    """A kind of residual without a test, and the reason."""

    kind: str
    """Kind of residual."""
    reason: str
    """Why its size is not tested."""


class PartsResults(Record):
    """The residuals in parts."""

    parts: tuple[PartRecord, ...]
    """All parts that are tested, family by family."""
    neighbours: tuple[NeighbourRecord, ...]
    """All modes with enough sensors."""
    kinds: tuple[KindOfErrors, ...]
    """The size of the errors by kind of residual."""
    untested: tuple[UntestedKind, ...] = ()
    """Kinds whose size is not tested."""
    only_prior: bool = False
    """Whether the data alone may be noise of the stated size, and contradict the prior."""

    def named(self, level: float) -> PartRecord | None:
        """The part to name, of those that are larger than noise at a level: the most certain one that says where.

        All residuals together, and a kind, say that something is wrong; a mode, a sensor, a prior say where. If that
        holds for more than half of the modes, the kind is named.
        """
        significant = [p for p in self.parts if p.p_family_wise < level]
        if self.only_prior:
            significant = [p for p in significant if p.family == "priors"] or significant
        best = min(significant, key=lambda p: (p.family == "kinds", p.p_family_wise, p.p_value, p.values), default=None)
        if best is None or best.family not in ("modes", "comparisons", "sensors"):
            return best
        alike = [p for p in self.parts if (p.family, p.kind) == (best.family, best.kind)]
        everywhere = 2 * sum(p.p_family_wise < level for p in alike) > len(alike) > 1
        of_kind = [p for p in significant if p.family == "kinds" and p.kind == best.kind]
        return of_kind[0] if everywhere and of_kind else best
