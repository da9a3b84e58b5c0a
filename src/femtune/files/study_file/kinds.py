"""Kinds of values in a study file: lists of elements, supports, degrees of freedom, units, rotations."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    StringConstraints,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError, Where
from femtune.fem.fields import FACTORS, FieldRef, amplitude_ref, factor_ref, generic_ref
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.lists import IntegerList, read_list
from femtune.files.study_file.source import is_integer, is_number
from femtune.parameters import parse_expression
from femtune.runs.kinds import check_result_name
from femtune.units import SI, unit_system
from femtune.updating.kinds import WEIGHT_RULES, WeightRule

T = TypeVar("T")

_MOST_SUPPORTS = 100_000
"""Grid points of one range of supports: a longer range is a mistyped number."""
_SMALLEST_SD = 1e-12
"""Smallest standard deviation, and the reciprocal of the largest: squares of the reciprocals stay finite."""
_LARGEST_WEIGHT = 1e12
"""Largest weight, for the same reason."""
_COMPONENTS = re.compile(r"0|(?!.*(.).*\1)[1-6]{1,6}")
"""Components of a grid point, each at most once, or 0 for a scalar point."""
_GROUP = r"[A-Z][A-Z0-9]{0,15}"
"""A name of capital letters and digits, such as that of a generic element."""
_GENERIC = re.compile(rf"GENERIC +({_GROUP}) +([KS][0-9]+(?:-[0-9]+)?)")
"""An eigenvalue or a shape of a generic element."""
_AMPLITUDE = re.compile(rf"DISTRIBUTION +({_GROUP}) +F([1-9][0-9]?)")
"""The amplitude of a function of a distribution."""
_FIELD = re.compile(r"([A-Z][A-Z0-9]{0,7})(?: +([0-9]{1,18}))? +([A-Z][A-Z0-9]{0,15})")
"""A field of a card: card, number (optional) and field name."""


def checked(check: Callable[[Any], object]) -> AfterValidator:
    """A validator that runs `check`; its FemtuneError is added to the collected errors."""
    return AfterValidator(_guarded(lambda value: (check(value), value)[1]))


def read_by(read: Callable[[Any], object]) -> PlainValidator:
    """As `checked`, but `read` also checks the type."""
    return PlainValidator(_guarded(lambda value: (read(value), value)[1]))


def _guarded(function: Callable[[T], T]) -> Callable[[T], T]:
    def run(value: T) -> T:
        try:
            return function(value)
        except FemtuneError as error:
            raise PydanticCustomError("femtune", "{error}", {"error": error}) from error

    return run


def element_list(value: str | Sequence[int]) -> IntegerList:
    """Elements from text with THRU, BY and EXCEPT, or from a list of numbers.

    Raises
    ------
    FemtuneError : ``study.list`` for a list that cannot be read, ``study.type``
    """
    if isinstance(value, tuple | list) and all(is_integer(n) for n in value):
        return _positive(IntegerList(tuple(value)), value)
    if not isinstance(value, str):
        raise FemtuneError("study.type/element-list")
    try:
        return _positive(read_list(re.split(r"[,\s]+", value), Where()), value)
    except FemtuneError as error:
        raise FemtuneError("study.list/elements", reason=error.what, hint=error.hint) from error


def number_list(value: str | Sequence[int]) -> IntegerList:
    """Numbers of grid points or modes, written as a list of elements is.

    Raises
    ------
    FemtuneError : ``study.list``, ``study.type``
    """
    try:
        return element_list(value)
    except FemtuneError as error:
        if error.code == "study.type":
            raise FemtuneError("study.type/number-list") from error
        raise FemtuneError("study.list/numbers") from error


def _positive(numbers: IntegerList, value: object) -> IntegerList:
    if not value or min((*numbers.singles, *(s.numbers.start for s in numbers.spans)), default=1) < 1:
        raise FemtuneError("study.list")
    return numbers


def off_list(value: str | Sequence[int]) -> frozenset[int]:
    """Numbers that are switched off, written out (error ``study.list``, also for ALL)."""
    if not isinstance(value, str) and not value:
        return frozenset()
    try:
        return frozenset(element_list(value).expand())
    except ValueError as error:
        raise FemtuneError("study.list/off") from error


def support(text: str) -> tuple[tuple[int, str], ...]:
    """``13 THRU 15:3`` -> ((13, "3"), (14, "3"), (15, "3")); components 1 to 6, or 0 for a scalar point.

    Raises
    ------
    FemtuneError : ``study.support``
    """
    nodes, colon, components = text.rpartition(":")
    if not colon or not _COMPONENTS.fullmatch(components.strip()):
        raise _bad_support(text)
    try:
        numbers = _positive(read_list(re.split(r"[,\s]+", nodes), Where()), nodes.strip())
        return tuple((node, components.strip()) for node in numbers.expand(_MOST_SUPPORTS))
    except (FemtuneError, ValueError) as error:
        raise _bad_support(text) from error


def _bad_support(text: str) -> FemtuneError:
    return FemtuneError("study.support")


def field_reference(text: str) -> FieldRef:
    """``PBAR 1 I1`` -> the field I1 of PBAR 1; ``PBAR I1``, number 0, -> that of every PBAR.

    ``STIFFNESS`` is the factor of element matrices, ``GENERIC JOINT K1`` an eigenvalue of a group, and
    ``DISTRIBUTION THIN F2`` the amplitude of a function.

    Raises
    ------
    FemtuneError : ``study.field``
    """
    if text.strip() in FACTORS:
        return factor_ref(text.strip())
    generic = _GENERIC.fullmatch(text.strip())
    if generic is not None:
        return generic_ref(generic[1], generic[2])
    amplitude = _AMPLITUDE.fullmatch(text.strip())
    if amplitude is not None:
        return amplitude_ref(amplitude[1], int(amplitude[2]))
    match = _FIELD.fullmatch(text.strip())
    if match is None or (match[2] is not None and int(match[2]) == 0):
        raise FemtuneError("study.field", hint=_form_of_field(text))
    return FieldRef(match[1], int(match[2] or 0), match[3])


def _form_of_field(text: str) -> str:
    """How a field is written; for a known card also the names of its fields."""
    word = re.match(r"\s*(\w*)", text)
    card = word[1].upper() if word else ""
    names = list(CATALOGUE[card].values) if card in CATALOGUE else []
    if card == "GENERIC":
        return 'write the name of a [[generic]] and K1, or S1-2: "GENERIC JOINT K1"'
    if not names:
        return 'write card, number and field in capitals, for example "PBAR 1 I1" or "MAT1 2 E"'
    return f'write card, number and field in capitals, as in "{card} 1 {names[0]}"; {card} has {", ".join(names)}'


def _frequency_sd(value: object) -> None:
    if value == "test":
        return None
    if is_number(value) and 0 <= value < float("inf"):  # type: ignore[operator]
        return _spread(value)  # type: ignore[arg-type]
    raise FemtuneError("study.type/frequency-sd")


def _weight(value: object) -> None:
    if value in WEIGHT_RULES:
        return
    if not is_number(value):
        raise FemtuneError("study.type/weight")
    if not 0 <= value <= _LARGEST_WEIGHT:  # type: ignore[operator]
        raise FemtuneError("study.value/weight", largest=_LARGEST_WEIGHT)


def numbered(value: object) -> object:
    """Keys of a TOML table are text; whole numbers among them become numbers."""
    if not isinstance(value, dict):
        return value
    return {int(k) if k.isdecimal() and len(k) <= 18 else k: v for k, v in value.items()}


def _by_node(value: object) -> None:
    """A number of 0 or more, or such a number for some test nodes."""
    numbers: list[tuple[Any, Any]] = list(value.items()) if isinstance(value, dict) else [(1, value)]
    if not all(is_integer(n) and is_number(x) for n, x in numbers):
        raise FemtuneError("study.type/by-node")
    if not all(n > 0 and 0 <= x < float("inf") for n, x in numbers):
        raise FemtuneError("study.value/by-node")


def _group_name(text: str) -> None:
    if not re.fullmatch(_GROUP, text):
        raise FemtuneError("study.value/group-name")


def _specimen_name(text: str) -> None:
    if not re.fullmatch("[A-Za-z0-9_]{1,32}", text):
        raise FemtuneError("study.value/specimen-name")


def _components(text: str) -> None:
    if not re.fullmatch("[1-6]{1,6}", text):
        raise FemtuneError("study.value/components")


def _spread(value: float) -> None:
    """Refuse standard deviations outside the range of any measurement; squares of their reciprocals would overflow."""
    if value != 0 and not _SMALLEST_SD <= value <= 1.0 / _SMALLEST_SD:
        raise FemtuneError("study.value/standard-deviation", least=_SMALLEST_SD, largest=1.0 / _SMALLEST_SD)


def _rotation(value: tuple[tuple[float, float, float], ...]) -> None:
    # only a study with a rotation needs numpy; errors of the others are reported without importing it
    from femtune.testdata import ModalTest, place  # noqa: PLC0415

    place(ModalTest("", SI), value, (0.0, 0.0, 0.0), allow_mirrored=True)


def _inertia(value: object) -> None:
    rows = value if isinstance(value, tuple) else ()
    flat = [x for row in rows for x in (row if isinstance(row, tuple) else (row,))]
    shape = [len(row) if isinstance(row, tuple) else 0 for row in rows]
    if shape not in ([0, 0, 0], [3, 3, 3]) or not all(is_number(x) and abs(x) < float("inf") for x in flat):
        hint = "write [Ixx, Iyy, Izz], or the symmetric matrix as three rows of three numbers"
        raise FemtuneError("study.type/inertia", hint=hint)
    if shape[0] == 3 and any(rows[i][j] != rows[j][i] for i in range(3) for j in range(i)):
        raise FemtuneError("study.value/inertia-not-symmetric")
    import numpy as np  # noqa: PLC0415  as in `_rotation`

    moments = np.linalg.eigvalsh(np.array(rows, float) if shape[0] else np.diag(rows))
    if moments[0] < -1e-9 * np.abs(moments).max():
        hint = "moments of inertia must not be negative, and the products of inertia must not be too large for them"
        raise FemtuneError("study.value/inertia-negative", hint=hint)


def _covariance(value: object) -> None:
    rows = value if isinstance(value, tuple) else ()
    square = bool(rows) and all(isinstance(row, tuple) and len(row) == len(rows) for row in rows)
    if square and all(is_number(x) and abs(x) < float("inf") for row in rows for x in row):
        return
    if value != "test":
        raise FemtuneError("study.type/covariance")


_NUMBERED = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "integer", "minimum": 1}}]}
"""JSON Schema of a list of numbers, as text or list."""
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
"""JSON Schema of a vector."""
_ROWS = {"type": "array", "items": {"type": "array", "items": {"type": "number"}}}
"""JSON Schema of a matrix by rows."""
_NOT_NEGATIVE = {"type": "number", "minimum": 0}
"""JSON Schema of a number that is not negative."""

if TYPE_CHECKING:
    Listed = Sequence
else:
    Listed = tuple[T, ...]
"""A list of TOML, kept as a tuple; in Python any sequence is accepted."""


@dataclass(frozen=True)
class NamesFile:
    """Declares that the text of a key is the name of an input file, relative to the file that has the key.

    The declaration is all that a key needs: `files_named` finds it, and existence checks, checksums and the protection
    against overwriting are made from that.

    Parameters
    ----------
    what : what the file is, for messages
    needed : False for a text that may be the name of a file, such as a word of a command
    """

    what: str
    needed: bool = True


Text = Annotated[str, StringConstraints(min_length=1)]
DeckName = Annotated[Text, NamesFile("deck")]
TestName = Annotated[Text, NamesFile("test file")]
RunsName = Annotated[Text, NamesFile("table of runs")]
TemplateName = Annotated[Text, NamesFile("template")]
SolverFileName = Annotated[Text, NamesFile("file of the solver")]
SolverResultName = Annotated[Text, checked(check_result_name)]
SpecimenName = Annotated[str, checked(_specimen_name)]
Number = Annotated[int, Field(gt=0, lt=10**18)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
Ratio = Annotated[float, Field(ge=0, lt=1)]
Hertz = Annotated[float, Field(ge=0, le=1e12)]
HertzAboveZero = Annotated[float, Field(gt=0, le=1e12)]
Seed = Annotated[int, Field(ge=0, le=2**63 - 1)]
Spread = Annotated[float, checked(_spread)]
Vector = tuple[float, float, float]
PositiveVector = tuple[Positive, Positive, Positive]
Units = Annotated[str, checked(unit_system)]
Component = Literal["X", "Y", "Z", "RX", "RY", "RZ"]
DofLabel = Annotated[str, checked(parse_dof)]
Labels = Annotated[tuple[DofLabel, ...], Field(min_length=1)]
Elements = Annotated[str | Listed[int], read_by(element_list), WithJsonSchema(_NUMBERED)]
Numbers = Annotated[str | Listed[int], read_by(number_list), WithJsonSchema(_NUMBERED)]
ElementsOff = Annotated[str | Listed[int], read_by(off_list), WithJsonSchema(_NUMBERED)]
Support = Annotated[str, checked(support)]
FieldText = Annotated[str, checked(field_reference)]
GroupName = Annotated[str, checked(_group_name)]
Components = Annotated[str, checked(_components)]
Expression = Annotated[str, checked(parse_expression)]
Weight = Annotated[
    float | WeightRule,
    read_by(_weight),
    WithJsonSchema({"anyOf": [_NOT_NEGATIVE, {"enum": list(WEIGHT_RULES)}]}),
]
FrequencySd = Annotated[
    float | str, read_by(_frequency_sd), WithJsonSchema({"anyOf": [_NOT_NEGATIVE, {"const": "test"}]})
]
Covariance = Annotated[
    Listed[Listed[float]] | str, read_by(_covariance), WithJsonSchema({"anyOf": [_ROWS, {"const": "test"}]})
]
ByNode = Annotated[
    float | dict[int, float],
    read_by(_by_node),
    BeforeValidator(numbered),
    WithJsonSchema({"anyOf": [_NOT_NEGATIVE, {"type": "object", "additionalProperties": _NOT_NEGATIVE}]}),
]
"""A number, or one for some test nodes."""
Inertia = Annotated[
    Vector | tuple[Vector, Vector, Vector],
    read_by(_inertia),
    WithJsonSchema({"anyOf": [_VECTOR, {"type": "array", "items": _VECTOR, "minItems": 3, "maxItems": 3}]}),
]
Rotation = Annotated[tuple[Vector, Vector, Vector], checked(_rotation)]


# ----------------------------------------------------------------------------------------------------
# The base of all tables of a study file.

SCHEMA_VERSION = 1
"""Version of the study file and of the identification file.

Versions count from the first release. A version rises when keys are removed or change their meaning.
"""
SchemaVersion = Annotated[int, Field(ge=1, le=SCHEMA_VERSION)]


class TomlTable(BaseModel):
    """Frozen; unknown keys, values of another type, NaN and infinity are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True)


def tables_by_kind(annotation: Any) -> dict[str, type[Any]]:
    """The tables by their `kind`, for a key whose tables have several kinds; empty for all other keys."""
    union_tables = list(tables_in(annotation))
    return {get_args(t.model_fields["kind"].annotation)[0]: t for t in union_tables} if len(union_tables) > 1 else {}


def tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables among the types of a key."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from tables_in(part)


def _words(value: object) -> object:
    """A command as a single text is split as in a shell; nothing in it is replaced."""
    if not isinstance(value, str):
        return value
    try:
        return tuple(shlex.split(value))
    except ValueError as error:
        raise ValueError(f"the command cannot be split into words: {error}") from error


Command = Annotated[
    tuple[Annotated[Text, NamesFile("program or script", needed=False)], ...],
    Field(min_length=1),
    BeforeValidator(_words),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}),
]
