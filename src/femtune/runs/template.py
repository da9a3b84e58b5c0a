"""Input files of a solver with placeholders for the values of parameters: ``{{E}}``, ``{{E:n8}}``, ``{{E:12.5e}}``.

Nothing but a number is ever put in place of a placeholder, and never more columns than its format has, so that a value
cannot leave its field.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from femtune.errors import ErrorCollector, FemtuneError, Where, did_you_mean
from femtune.files.nastran.lines import format_real, parse_real

ENCODING = "latin-1"
"""Every byte is a character and is written as it was read."""
_PLACEHOLDER = re.compile(r"\{\{\s*([A-Za-z_]\w*)\s*(?::\s*([^{}\s]*)\s*)?\}\}")
_NUMBER_FORMAT = re.compile(r"(\d{1,2})?(?:\.(\d{1,2}))?([eEfgG])")
_NASTRAN = {"n8": 8, "n16": 16}
_PLAIN = "{:.12g}"


class InputFiles(Protocol):
    """What writes the input files of a run."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values that it needs."""
        ...

    @property
    def version(self) -> str:
        """Changes where something changes that the files refer to."""
        ...

    def texts(self) -> Iterable[bytes]:
        """Texts that may name further files, which the files of a run refer to; not those that `version` has."""
        ...

    def files(self, values: Mapping[str, float]) -> dict[str, bytes]:
        """Content by name of the file."""
        ...


@dataclass(frozen=True)
class _Field:
    """A placeholder: the name of its value, its format, and its line."""

    name: str
    format: str
    line: int

    def text(self, value: float, where: Where) -> str:
        """The number as it is written."""
        if not math.isfinite(value):
            raise FemtuneError("external.placeholder/not-finite", where=where, name=self.name, value=value)
        if self.format in _NASTRAN:
            width = _NASTRAN[self.format]
            return format_real(value, width).rjust(width)
        if not self.format:
            return _PLAIN.format(value)
        width = int(re.match(r"\d*", self.format)[0] or 0)  # type: ignore[index]
        text = f"{value:{self.format}}"
        if width and len(text) > width:
            raise FemtuneError(
                "external.placeholder/too-wide", where=where, name=self.name, value=value, text=text, width=width
            )
        return text

    def read_back(self, value: float, where: Where) -> float:
        """The number that the solver reads."""
        text = self.text(value, where)
        number = parse_real(text.strip()) if self.format in _NASTRAN else float(text)
        assert number is not None
        return number


@dataclass(frozen=True)
class Template:
    """A text with placeholders.

    Parameters
    ----------
    name : of the file that is written
    parts : texts and placeholders in their order
    where : the file of the template

    Examples
    --------
    >>> from femtune.runs import Template
    >>> Template.of_text("beam.bdf", "MAT1    1       {{E:n8}}").fill({"E": 2.1e11})
    'MAT1    1         2.1+11'
    """

    name: str
    parts: tuple[str | _Field, ...]
    where: Where = field(default_factory=Where)

    @classmethod
    def of_text(cls, name: str, text: str, where: Where | None = None) -> Template:
        """The template in a text.

        Raises
        ------
        FemtuneError : ``external.placeholder``, all that are wrong together
        """
        where = Where(name) if where is None else where
        errors, at = ErrorCollector(), 0
        parts: list[str | _Field] = []
        for match in _PLACEHOLDER.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            with errors.catch():
                _check_format(match[2] or "", match[1], Where(where.file, line))
            parts += [text[at : match.start()], _Field(match[1], match[2] or "", line)]
            at = match.end()
        parts.append(text[at:])
        for line, rest in enumerate(_PLACEHOLDER.sub("", text).split("\n"), start=1):
            if "{{" in rest:
                malformed, place = rest[rest.index("{{") :][:40], Where(where.file, line)
                with errors.catch():
                    raise FemtuneError("external.placeholder/malformed", where=place, text=malformed)
        errors.raise_if_any()
        return cls(name, tuple(parts), where)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the placeholders."""
        return tuple(dict.fromkeys(part.name for part in self.parts if isinstance(part, _Field)))

    def fill(self, values: Mapping[str, float]) -> str:
        """The text with numbers in place of its placeholders.

        Raises
        ------
        FemtuneError : ``external.placeholder/not-finite``, ``external.placeholder/too-wide``
        """
        return "".join(
            part if isinstance(part, str) else part.text(float(values[part.name]), Where(self.where.file, part.line))
            for part in self.parts
        )

    def read_back(self, name: str, value: float) -> Iterator[tuple[Where, float]]:
        """What the solver reads where a value stands, for each placeholder of a name (errors as of `fill`)."""
        for part in self.parts:
            if isinstance(part, _Field) and part.name == name:
                where = Where(self.where.file, part.line)
                yield where, part.read_back(value, where)


def _check_format(text: str, name: str, where: Where) -> None:
    if text and text not in _NASTRAN and not _NUMBER_FORMAT.fullmatch(text):
        raise FemtuneError("external.placeholder/format", where=where, name=name, format=text)


def read_template(path: Path, name: str | None = None) -> Template:
    """The template in a file.

    Raises
    ------
    FemtuneError : ``external.unreadable``, ``external.placeholder``
    """
    return Template.of_text(name or path.name, _content(path).decode(ENCODING), Where(str(path)))


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise FemtuneError("external.unreadable", where=Where(str(path)), reason=error.strerror) from error


@dataclass(frozen=True)
class Templates:
    """The input files of a solver: templates, and files that are the same in every run.

    Parameters
    ----------
    templates : the files with placeholders
    copied : files that are copied into the folder of every run
    version : of what these files refer to elsewhere, in words
    """

    templates: tuple[Template, ...]
    copied: tuple[Path, ...] = ()
    version: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all placeholders."""
        return tuple(dict.fromkeys(name for template in self.templates for name in template.names))

    def __post_init__(self) -> None:
        """Refuse two files of one name, of which one would replace the other (error ``external.same-name``)."""
        places: dict[str, str] = {}
        for name, place in [(t.name, t.where.file or t.name) for t in self.templates] + [
            (path.name, str(path)) for path in self.copied
        ]:
            if name in places:
                raise FemtuneError("external.same-name", name=name, values={"one": places[name], "other": place})
            places[name] = place

    def texts(self) -> Iterator[bytes]:
        """See `InputFiles`; placeholders are left out."""
        for template in self.templates:
            yield "".join(part for part in template.parts if isinstance(part, str)).encode(ENCODING)
        yield from map(_content, self.copied)

    def files(self, values: Mapping[str, float]) -> dict[str, bytes]:
        """See `InputFiles`; errors as of `Template.fill`, ``external.unreadable``."""
        same = {path.name: _content(path) for path in self.copied}
        return same | {t.name: t.fill(values).encode(ENCODING) for t in self.templates}


def check_names(placeholders: Sequence[str], known: Iterable[str], wanted: Iterable[str], where: Where) -> None:
    """Refuse placeholders that are no parameter, and parameters that occur in no template.

    Parameters
    ----------
    placeholders : names in the templates
    known : names of all parameters
    wanted : names of those that must occur

    Raises
    ------
    FemtuneError : ``external.placeholder/unknown``, ``external.placeholder/unused``
    """
    known = tuple(known)
    ErrorCollector(list(_bad_names(placeholders, known, wanted, where))).raise_if_any()


def _bad_names(
    placeholders: Sequence[str], known: Sequence[str], wanted: Iterable[str], where: Where
) -> Iterator[FemtuneError]:
    for name in placeholders:
        if name not in known:
            hint = did_you_mean(name, known) or f'add a [[parameter]] with name = "{name}"'
            yield FemtuneError("external.placeholder/unknown", where=where, hint=hint, name=name)
    for name in wanted:
        if name not in placeholders:
            hint = did_you_mean(name, placeholders) or f"write {{{{{name}}}}} where its value stands in a template"
            yield FemtuneError("external.placeholder/unused", where=where, hint=hint, name=name)
