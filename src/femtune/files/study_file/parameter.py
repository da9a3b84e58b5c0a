"""[[parameter]]: free and tied parameters with their fields, bounds and priors."""

from __future__ import annotations

import keyword
import re
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from femtune.errors import FemtuneError, did_you_mean
from femtune.fem.fields import FieldRef
from femtune.files.study_file.kinds import (
    Elements,
    Expression,
    FieldText,
    Listed,
    NamesFile,
    Number,
    Positive,
    Text,
    TomlTable,
    Vector,
    field_reference,
)
from femtune.files.study_file.python_table import PythonTable, unnamed_arguments
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, named_twice, number, tables
from femtune.parameters import parse_expression

# ----------------------------------------------------------------------------------------------------
# `region` of a parameter: its elements by properties, materials or position.


class NearTable(TomlTable):
    """A sphere about a point, a grid point, or the middle of an element (a joint)."""

    distance: Positive
    """Radius, length. Example: `0.1`"""
    point: Vector | None = None
    """A position as the centre, basic coordinate system, length. Example: `[0.5, 0, 0]`"""
    node: Number | None = None
    """A grid point as the centre. Example: `12`"""
    element: Number | None = None
    """The centre of an element, which may be a rigid element: a joint. Example: `205`"""


class RegionTable(TomlTable):
    """Conditions that an element must satisfy together; the centre of an element is its position."""

    elements: Elements | None = None
    """Element numbers: a text with THRU, BY and EXCEPT, or a list. Example: `"1 THRU 4"`"""
    properties: Elements | None = None
    """Elements that refer to these property cards. Example: `[3, 4]`"""
    materials: Elements | None = None
    """Elements whose stiffness or mass depends on these materials. Example: `"1 THRU 5"`"""
    set: Number | None = None
    """Elements in this SET of the case control section. Example: `7`"""
    box: tuple[Vector, Vector] | None = None
    """Two opposite corners, basic coordinate system, length. Example: `[[0, 0, 0], [0.5, 1, 1]]`"""
    near: NearTable | None = None
    """Elements within a distance of a point, a grid point or an element. Example: `{ node = 12, distance = 0.1 }`"""


class Parameter(PythonTable):
    """A parameter of the update: fields of the deck, bounds and prior; a [[parameter]] of a study.

    A free parameter has bounds, a tied one an expression of others.

    Raises
    ------
    FemtuneError : ``study.field``, ``study.unknown-key``, ``study.type`` …, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.Parameter("E", fields=["MAT1 1 E"], lower=0.8, upper=1.2)
    Parameter(name='E', fields=('MAT1 1 E',), lower=0.8, upper=1.2)
    """

    name: Text = Field(kw_only=False)
    """Name of the parameter, unique: letters, digits and `_`, so that expressions can use it. Example: `"Icx1"`"""
    fields: Listed[FieldText] = ()
    """The fields that the parameter changes: card, number and field name. Without a number: the field of all cards of
    this name that are used by elements (of the region). `PARAM G` is the loss factor of the whole model, `MODAL 3 ZETA`
    the damping ratio of mode 3, `MODAL ZETA` that of all other modes ([damping as a
    parameter](theory/damping.md#damping-as-a-parameter)), `MATRIX FRAME` the factor of a matrix, `VARIABLE T` a
    variable of matrix sets; `STIFFNESS`, `MASS` and `VISCOUS` are factors on complete element matrices; `CBAR 12 W3A`
    is an offset; `GENERIC JOINT K1` a value of a [generic element](#generic). [The guide](guide/parameters.md) lists
    all of them. Empty for a parameter that is only used in expressions. Example: `["PBAR 1 I1", "PSHELL T"]`"""
    elements: Elements | None = None
    """Elements for which the field is changed: a text with THRU, BY and EXCEPT, or a list. Default: all elements that
    use it. Example: `"1 THRU 4"`"""
    region: RegionTable | None = None
    """Restricts the elements by properties, materials or position. Example: `{ properties = [3] }`"""
    lower: float | None = None
    """Lower bound, of the factor or of the value with `absolute`; required for a free parameter. Example: `0.3`"""
    upper: float | None = None
    """Upper bound, of the factor or of the value with `absolute`; required for a free parameter. Example: `3.0`"""
    nominal: float | None = None
    """Initial value. Default: 1 for a factor, the value in the deck with `absolute`. Example: `1.0`"""
    absolute: bool = False
    """The parameter is the value of the field, in its unit; otherwise a factor on the value of the deck. Example:
    `true`"""
    sd: Positive | None = None
    """Standard deviation of the prior, in units of `lower`. Default: (upper − lower)/√12. Example: `0.2`"""
    mean: float | None = None
    """Mean of the prior, in units of `lower`. Default: the nominal value. Example: `1.0`"""
    prior: Annotated[Text, NamesFile("catalogue of damping")] | None = None
    """Catalogue of damping values that gives the mean and standard deviation of the prior; requires `absolute = true`.
    Example: `"damping.toml"`"""
    prior_name: Text | None = None
    """Entry of the catalogue. Default: the entry with the name of the parameter. Example: `"clamp"`"""
    tie: Expression | None = None
    """Expression of other parameters: `+ - * / **`, parentheses, numbers, names and `sqrt exp log sin cos tan`; it is
    parsed, never executed as code. Example: `"2*Ibx1 - 1"`"""
    individual: bool = False
    """Each [specimen](guide/specimens.md) has its own value, and the parameter is named `Icx1_ID1` in the results;
    otherwise all have the same. Example: `true`"""
    unit: str = ""
    """Unit shown in tables. Example: `"m^4"`"""

    if not TYPE_CHECKING:

        def __init__(self, name: str, *unnamed: Any, **words: Any) -> None:
            if unnamed:
                raise unnamed_arguments(type(self), ("name",), unnamed)
            super().__init__(name=name, **words)

        __init__.__pydantic_base_init__ = True  # as that of `PythonTable`

    @property
    def free(self) -> bool:
        """True for a parameter without a tie."""
        return self.tie is None

    @property
    def targets(self) -> tuple[FieldRef, ...]:
        """The fields that it changes; number 0 stands for all cards of the name."""
        return tuple(field_reference(text) for text in self.fields)

    @property
    def moves_damping(self) -> bool:
        """True where all that it changes are loss factors, dashpots or damping ratios."""
        return bool(self.targets) and all(_DAMPING.fullmatch(ref.name) for ref in self.targets)


_DAMPING = re.compile(r"GE\d?|B\d?|ZETA|G")


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of the parameters of a study.


_SMALLEST_PRIOR = 1e-9
"""Smallest prior standard deviation over the width of the bounds: its square exceeds rounding errors."""
_KEYS_OF_FREE = ("lower", "upper", "nominal", "sd", "mean", "prior")
"""Keys of a free parameter, which a tied one must not have."""


def parameter_rules(data: Data, source: StudyLines) -> Problems:
    """Check names, bounds and ties."""
    entries = list(tables(data, "parameter"))
    yield from named_twice(entries, "parameter.duplicate/earlier", source)
    names = [entry["name"] for _, entry in entries if isinstance(entry.get("name"), str)]
    for place, entry in entries:
        yield from _name(place, entry, source)
        if "tie" in entry:
            yield from _tied(place, entry, names, source)
        else:
            yield from _bounds(place, entry, source)
            yield from _prior_sd(place, entry, source)
            yield from _catalogue(place, entry, source)


def _name(place: Place, entry: Data, source: StudyLines) -> Problems:
    name = entry.get("name")
    if isinstance(name, str) and name and (not name.isidentifier() or keyword.iskeyword(name)):
        yield source.error((*place, "name"), "parameter.name/in-study", {}, name=name)


def _tied(place: Place, entry: Data, names: list[str], source: StudyLines) -> Problems:
    for key in _KEYS_OF_FREE:
        if key in entry:
            yield source.error((*place, key), "parameter.tied", {key: entry[key]}, key=key)
    for name in expression_names(entry["tie"]):
        if name not in names:
            hint = did_you_mean(name, (n for n in names if n != entry.get("name")))
            yield source.error((*place, "tie"), "tie.unknown/in-study", {"tie": entry["tie"]}, hint=hint, name=name)


def expression_names(tie: object) -> tuple[str, ...]:
    """Names in a valid expression; errors of other expressions are reported by the models."""
    try:
        return parse_expression(tie).names if isinstance(tie, str) else ()
    except FemtuneError:
        return ()


def _catalogue(place: Place, entry: Data, source: StudyLines) -> Problems:
    """A prior from a catalogue excludes `mean` and `sd`, and is that of the field value."""
    if "prior_name" in entry and "prior" not in entry:
        yield source.error((*place, "prior_name"), "parameter.prior/no-catalogue", {})
    if "prior" not in entry:
        return
    for key in ("mean", "sd"):
        if key in entry:
            yield source.error((*place, key), "parameter.prior/given-twice", {key: entry[key]}, key=key)
    if entry.get("absolute") is not True:
        yield source.error((*place, "prior"), "parameter.prior/catalogue-of-factor", {})


def _bounds(place: Place, entry: Data, source: StudyLines) -> Problems:
    for key in ("lower", "upper"):
        if key not in entry:
            yield source.error((*place, key), "study.missing-key/bounds", {}, parameter=entry.get("name", ""), key=key)
    lower, upper = number(entry, "lower"), number(entry, "upper")
    if lower is None or upper is None:
        return
    if lower >= upper:
        yield _bad_bounds(place, entry, source)
    elif (start := _start(entry)) is not None and not lower <= start <= upper:
        shown = {"nominal": start, "lower": lower, "upper": upper}
        key = "nominal" if "nominal" in entry else "lower"
        nominal_given = "nominal" in entry or entry.get("absolute") is True
        code = (
            "parameter.bounds/nominal-outside-in-study" if nominal_given else "parameter.bounds/factor-outside-in-study"
        )
        yield source.error((*place, key), code, shown, parameter=entry.get("name", ""))


def _prior_sd(place: Place, entry: Data, source: StudyLines) -> Problems:
    """Refuse a prior whose width relative to the bounds is beyond numerical precision."""
    lower, upper, sd = (number(entry, key) for key in ("lower", "upper", "sd"))
    if lower is None or upper is None or sd is None or not lower < upper or sd <= 0.0:
        return
    if not _SMALLEST_PRIOR <= sd / (upper - lower) <= 1.0 / _SMALLEST_PRIOR:
        shown = {"sd": sd, "lower": lower, "upper": upper}
        yield source.error((*place, "sd"), "study.value/prior-sd", shown, parameter=entry.get("name", ""))


def _start(entry: Data) -> float | None:
    """The nominal value if the study states it; that of an absolute parameter may come from the deck."""
    if "nominal" in entry:
        return number(entry, "nominal")
    return None if entry.get("absolute") else 1.0


def _bad_bounds(place: Place, entry: Data, source: StudyLines) -> FemtuneError:
    shown = {"lower": entry["lower"], "upper": entry["upper"]}
    code = (
        "parameter.bounds/equal-in-study" if entry["lower"] == entry["upper"] else "parameter.bounds/crossed-in-study"
    )
    return source.error((*place, "lower"), code, shown, parameter=entry.get("name", ""))
