"""Case control: SPC, MPC, METHOD, NSM, SDAMPING, titles and SETs of the first subcase over the global level."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.lines import parse_integer
from femtune.files.nastran.lists import IntegerList, read_list
from femtune.files.nastran.source import SourceLine

_COMMAND = re.compile(r"([A-Z][A-Z0-9]*)\s*(\([^)]*\))?\s*[=,]?\s*(.*)", re.IGNORECASE | re.DOTALL)
_SET = re.compile(r"(\d{1,9})\s*=\s*(.*)", re.DOTALL)
_PLOT_OUTPUT = re.compile(r"\(\s*(PLOT|XYPLOT|XYOUT)\b", re.IGNORECASE)
_SELECTIONS = ("SPC", "MPC", "METHOD", "NSM", "SDAMPING")
_TITLES = ("TITLE", "SUBTITLE", "LABEL")


@dataclass(frozen=True)
class CaseCommand:
    """One command: `name` in upper case, `options` with their parentheses, `value` as it stands."""

    name: str
    options: str
    value: str
    line: SourceLine

    @property
    def where(self) -> Where:
        """Place of the command."""
        return Where(self.line.file, self.line.number, self.name)


@dataclass(frozen=True)
class CaseControl:
    """What the used subcase selects: its own commands over those of the global level.

    `subcases` are all subcase numbers, `used` the one taken (None where there is none); `others` are the
    commands without a meaning here, kept as they stand.
    """

    spc: int | None = None
    mpc: int | None = None
    method: int | None = None
    nsm: int | None = None
    damping: int | None = None
    title: str = ""
    subtitle: str = ""
    label: str = ""
    sets: Mapping[int, IntegerList] = field(default_factory=dict)
    subcases: tuple[int, ...] = ()
    used: int | None = None
    others: tuple[CaseCommand, ...] = ()
    parameter_lines: tuple[SourceLine, ...] = ()
    notices: tuple[Notice, ...] = ()

    @property
    def other_counts(self) -> dict[str, int]:
        """How often each command without a meaning here occurs."""
        return dict(Counter(command.name for command in self.others))


def read_case_control(lines: Sequence[SourceLine]) -> CaseControl:
    """Read the lines between CEND and BEGIN BULK.

    Raises
    ------
    FemtuneError : ``deck.case-control`` (a selection that is not a number), ``deck.list`` (a SET)
    """
    reading = _CaseControlReading()
    for command in _commands(lines):
        reading.take(command)
    return reading.result()


def _commands(lines: Sequence[SourceLine]) -> list[CaseCommand]:
    """Commands with their continuations (after a comma at the end of a line) joined."""
    commands: list[CaseCommand] = []
    body, first = "", None
    for line in lines:
        text = line.body.strip()
        if not text:
            continue
        first = first or line
        body = f"{body} {text}".strip()
        if not text.endswith(",") or _is_title(body):
            commands.append(_command(body, first))
            body, first = "", None
    if first is not None:
        commands.append(_command(body, first))
    return commands


def _is_title(body: str) -> bool:
    match = _COMMAND.match(body)
    return match is not None and _full_name(match[1]) in _TITLES


def _command(body: str, line: SourceLine) -> CaseCommand:
    match = _COMMAND.fullmatch(body)
    if match is None:
        return CaseCommand(body.split(maxsplit=1)[0].upper(), "", body, line)
    return CaseCommand(_full_name(match[1]), match[2] or "", match[3].strip(), line)


def _full_name(word: str) -> str:
    """Four letters are enough for the commands that we know (``SUBT``, ``METH``)."""
    word = word.upper()
    known = ("METHOD", "SDAMPING", "SUBCASE", *_TITLES)
    full = (name for name in known if len(word) >= 4 and name.startswith(word))
    return next(full, word)


class _CaseControlReading:
    """Values of the global level and of the first subcase, as the commands go by."""

    def __init__(self) -> None:
        self.levels: list[dict[str, CaseCommand]] = [{}]
        self.sets: dict[int, IntegerList] = {}
        self.subcases: list[int] = []
        self.others: list[CaseCommand] = []
        self.parameters: list[SourceLine] = []
        self.plotting = False
        self.first_subcase: CaseCommand | None = None

    def take(self, command: CaseCommand) -> None:
        if command.name == "OUTPUT":
            self.plotting = _PLOT_OUTPUT.match(command.options) is not None
        if command.name == "SUBCASE":
            self._subcase(command)
        elif self.plotting:
            self.others.append(command)
        elif command.name in _TITLES or (command.name in _SELECTIONS and not _of_fluid(command)):
            self.levels[-1][command.name] = command
        elif command.name == "SET":
            self._set(command)
        elif command.name == "PARAM":
            self.parameters.append(command.line)
        else:
            self.others.append(command)

    def _subcase(self, command: CaseCommand) -> None:
        self.plotting = False
        self.subcases.append(_number(command))
        self.levels.append({})
        self.first_subcase = self.first_subcase or command

    def _set(self, command: CaseCommand) -> None:
        match = _SET.fullmatch(command.value)
        if match is None or not re.match(r"ALL$|\d+(?:[\s,]|$)", match[2].strip(), re.IGNORECASE):
            self.others.append(command)
        elif len(self.levels) <= 2:
            self.sets[int(match[1])] = read_list(re.split(r"[\s,]+", match[2]), command.where)

    def result(self) -> CaseControl:
        used = {**self.levels[0], **(self.levels[1] if len(self.levels) > 1 else {})}
        selected = {name: _number(used[name]) if name in used else None for name in _SELECTIONS}
        texts = {name.lower(): used[name].value if name in used else "" for name in _TITLES}
        return CaseControl(
            spc=selected["SPC"],
            mpc=selected["MPC"],
            method=selected["METHOD"],
            nsm=selected["NSM"],
            damping=selected["SDAMPING"],
            **texts,
            sets=self.sets,
            subcases=tuple(self.subcases),
            used=self.subcases[0] if self.subcases else None,
            others=tuple(self.others),
            parameter_lines=tuple(self.parameters),
            notices=self._notices(),
        )

    def _notices(self) -> tuple[Notice, ...]:
        if len(self.subcases) < 2 or self.first_subcase is None:
            return ()
        named = ", ".join(map(str, self.subcases))
        return (
            Notice(
                "deck.several-subcases", where=self.first_subcase.where, subcases=named, first_subcase=self.subcases[0]
            ),
        )


def _of_fluid(command: CaseCommand) -> bool:
    return "FLUID" in command.options.upper()


def _number(command: CaseCommand) -> int:
    number = parse_integer(command.value)
    if number is not None:
        return number
    raise FemtuneError("deck.case-control", where=command.where, command_name=command.name, command_value=command.value)
