"""Fields of the deck that no parameter represents and that the residuals ask for."""

from __future__ import annotations

from femtune.study.record import Record

PARAMETER = "parameter"
"""What a parameter at its bound is, among fields of the deck."""


class RefittedField(Record):
    """The update continued with a field as a further parameter."""

    factor: float
    """Factor on the value of the deck, or of the parameter that sets it, at the end; of a mass that the deck does not
    have, the mass relative to `largest_mass`; of a support, its compliance relative to 1/`stiffness`."""
    sd: float | None
    """Standard deviation of the factor by the stated deviations; None if none is given."""
    at_bound: bool
    """Whether the factor ended at a bound of its usual range."""
    converged: bool
    """Whether the update ended at an optimum."""
    iterations: int
    """Iterations that it took."""
    chi_square: float
    """χ² at the end."""
    p_value: float | None
    """Probability that noise lowers χ² as much, by the F test with the scales of the kinds; None if other modes are
    compared."""
    mode: str = ""
    """The test mode, with its configuration in brackets, whose residuals alone ask for the field: most of the decrease
    of χ² is its own, and the test without it finds nothing. "" where several modes ask for the field."""
    mode_before: float | None = None
    """Its part of χ² at the end of the update; None without such a mode."""
    mode_after: float | None = None
    """Its part of `chi_square`."""
    p_without_mode: float | None = None
    """Probability that noise alone explains as much, by the test of the field without this mode."""


class MissingField(Record):
    """A field that the update does not change, tested by itself."""

    field: str
    """The field of the deck: "PSHELL 3 T"; "mass" for one that the deck does not have; "support" for a constraint."""
    place: str
    """The elements: "" for all that use it, "elements of property 3", "40 elements near (0.2, 0.1, 0)"."""
    what: str
    """What the field is: a material, a property, a joint or a mass; a parameter at its bound."""
    change_percent: float | None
    """Change that the residuals ask for, in % of the value, of `largest_mass`, or of the largest compliance, by linear
    extrapolation; None if it is beyond the usual range, where the extrapolation means little."""
    increase: bool
    """Whether the value is to increase."""
    lower_percent: float
    """Lower end of the usual range of such a field, change in %."""
    upper_percent: float
    """Upper end."""
    f: float
    """Statistic: the square of the change over its standard deviation."""
    share: float
    """Part of the gain of log likelihood that a change inside the usual range reaches, 0 to 1."""
    degrees_of_freedom: float
    """Degrees of freedom of its denominator."""
    p_value: float
    """Probability of such a statistic in any field, or of a finding of the two other tests of the fit, if nothing is
    missing."""
    alike: tuple[str, ...] = ()
    """Other fields that the data hardly tell from it."""
    refit: RefittedField | None = None
    """The update with the field as a further parameter; None if it was not repeated with this one."""
    lines: str = ""
    """Lines for the study that make it a parameter; "" for a parameter that is at its bound."""
    largest_mass: float | None = None
    """Largest plausible mass, for a mass that the deck does not have; None for a field."""
    mass_unit: str = ""
    """Its unit."""
    points: tuple[int, ...] = ()
    """Grid points of such a mass, or of a support."""
    stiffness: float | None = None
    """Least plausible stiffness of a support at each of its grid points, the inverse of the largest compliance; None
    for all else."""
    stiffness_unit: str = ""
    """Its unit."""

    @property
    def name(self) -> str:
        """The field with its place."""
        if self.stiffness is not None:
            return f"{self.field} {self.place}"
        return f"{self.field}, {self.place}" if self.place else self.field


class MissingResults(Record):
    """The test of fields of the deck that are no parameters, at the end of the update."""

    reason: str = ""
    """Why nothing was tested; "" if fields were tested."""
    tested: int = 0
    """Number of fields, and parts of fields, that were tested."""
    invisible: int = 0
    """Number of further ones that the data do not see, or whose effect the parameters represent."""
    left_out: int = 0
    """Number of further ones that were not tested because there are too many."""
    chi_square: float = 0.0
    """χ² at the end of the update, over the residuals that are compared here: without FRFs where the model is large."""
    p_value: float | None = None
    """The least adjusted p value of all; None if nothing was tested."""
    fields: tuple[MissingField, ...] = ()
    """The first groups of fields, those that explain most by a change inside their usual range first."""
    corners_key: str | None = None
    """Key of the corners of the elements (elements, 4, 3) in the arrays; None if nothing is suspected to be missing."""
    gain_key: str | None = None
    """Key of the largest gain of log likelihood by a usual change of the fields of each element (elements,)."""
