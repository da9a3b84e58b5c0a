"""Case control: SPC, MPC, METHOD, NSM, SDAMPING, titles and SETs of the subcase whose modes are requested.

Commands of a subcase take precedence over those above all subcases, and those of a STEP over those of its subcase.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.lines import parse_integer
from femtune.files.nastran.lists import IntegerList, read_list
from femtune.files.nastran.source import SourceLine

_COMMAND = re.compile(r"([A-Z][A-Z0-9]*)\s*(\([^)]*\))?\s*[=,]?\s*(.*)", re.IGNORECASE | re.DOTALL)
_SET = re.compile(r"(\d{1,9})\s*=\s*(.*)", re.DOTALL)
_PLOT_OUTPUT = re.compile(r"\(\s*(PLOT|XYPLOT|XYOUT)\b", re.IGNORECASE)
_SELECTIONS = ("SPC", "MPC", "METHOD", "NSM", "SDAMPING")
_TITLES = ("TITLE", "SUBTITLE", "LABEL")
# commands that begin a subcase; combinations of the results of others have no selections
_SUBCASES = ("SUBCASE", "SYM")
_COMBINATIONS = ("SUBCOM", "SYMCOM", "REPCASE")
# analyses without natural modes, although a METHOD may be selected (buckling)
_WITHOUT_MODES = ("STAT", "BUCK", "NLST", "HEAT", "HSTA", "HTRA", "DFRE", "DTRA", "DCEI", "PREL", "NLTR")


@dataclass(frozen=True)
class CaseCommand:
    """One command: `name` in upper case, `options` with their parentheses, `value` as written."""

    name: str
    options: str
    value: str
    line: SourceLine

    @property
    def where(self) -> Where:
        """Place of the command."""
        return Where(self.line.file, self.line.number, self.name)

    @property
    def text(self) -> str:
        """The command as written: ``STATSUB(PRELOAD) = 1``."""
        return f"{self.name}{self.options} = {self.value}"

    @property
    def number(self) -> int:
        """Number of the set or subcase that it selects (error ``deck.case-control``)."""
        number = parse_integer(self.value)
        if number is not None:
            return number
        raise FemtuneError("deck.case-control", where=self.where, command_name=self.name, command_value=self.value)

    @property
    def is_preload(self) -> bool:
        """Whether it selects the static preload of modes."""
        return self.name == "STATSUB" and self.options.replace(" ", "").upper() in ("", "(PRELOAD)")


@dataclass(frozen=True)
class StaticSubcase:
    """Selections of the subcase of a static preload: supports, equations, and loads (LOAD, TEMPERATURE, DEFORM)."""

    spc: int | None = None
    mpc: int | None = None
    loads: tuple[CaseCommand, ...] = ()


@dataclass(frozen=True)
class CaseControl:
    """Selections of the used subcase: its commands take precedence over those of the global level.

    `subcases` are all subcase numbers, `used` is the number of the used one, or None; `others` are the commands that
    are not interpreted, as written; `effective` are those of them that apply to the used subcase. `loading` names the
    steps before the used one in the same subcase, in each of which the structure is loaded, and `preload` is the static
    subcase that STATSUB selects. `of_superelements` are the selections of subcases that SUPER assigns to superelements,
    with the numbers of these. `selected` are the numbers that any level selects, by command.
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
    effective: tuple[CaseCommand, ...] = ()
    loading: tuple[str, ...] = ()
    preload: StaticSubcase | None = None
    parameter_lines: tuple[SourceLine, ...] = ()
    notices: tuple[Notice, ...] = ()
    of_superelements: tuple[tuple[IntegerList, CaseControl], ...] = ()
    selected: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def of_superelement(self, number: int) -> CaseControl:
        """Selections of the first subcase of a superelement, or else of the used subcase."""
        return next((case for numbers, case in self.of_superelements if number in numbers), self)


def read_case_control(lines: Sequence[SourceLine], method_is_modal: bool = True) -> CaseControl:
    """Read the lines between CEND and BEGIN BULK.

    Parameters
    ----------
    lines : the lines
    method_is_modal : False for a solution whose METHOD does not request natural modes (buckling)

    Raises
    ------
    FemtuneError : ``deck.case-control`` (a selection that is not a number), ``deck.list`` (a SET)
    """
    reading = _CaseControlReading(method_is_modal)
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
    """Full name of a known command, of which four letters suffice (``SUBT``, ``METH``)."""
    word = word.upper()
    known = ("METHOD", "SDAMPING", "SUBCASE", "ANALYSIS", "STATSUB", *_TITLES)
    full = (name for name in known if len(word) >= 4 and name.startswith(word))
    return next(full, word)


@dataclass(eq=False)
class _Level:
    """Commands above all subcases (`begin` is None), of a subcase, or of a STEP of the subcase `parent`."""

    begin: CaseCommand | None = None
    parent: _Level | None = None
    commands: dict[str, CaseCommand] = field(default_factory=dict)
    sets: dict[int, IntegerList] = field(default_factory=dict)
    others: list[CaseCommand] = field(default_factory=list)
    steps: list[_Level] = field(default_factory=list)

    @property
    def path(self) -> list[_Level]:
        """The levels that apply here, the outermost first."""
        return [*(self.parent.path if self.parent else ()), self]

    @property
    def own(self) -> list[_Level]:
        """The levels of the subcase, without the global one."""
        return [level for level in self.path if level.begin is not None]

    def analysis(self) -> str:
        """Word of ANALYSIS, upper case; empty without one."""
        words = [c.value.upper() for level in self.path for c in level.others if c.name == "ANALYSIS"]
        return words[-1] if words else ""

    @property
    def superelements(self) -> IntegerList | None:
        """Numbers that SUPER assigns the level to, of a SET or one; None without SUPER."""
        words = [c.value for level in self.path for c in level.others if c.name == "SUPER"]
        word = words[-1].split(",")[0].strip().upper() if words else ""
        number = parse_integer(word)
        if number is None:
            return IntegerList(every=True) if word == "ALL" else None
        sets = {n: numbers for level in self.path for n, numbers in level.sets.items()}
        return sets.get(number, IntegerList((number,)))

    @property
    def of_superelement(self) -> bool:
        """Whether SUPER assigns the level to superelements and not to the residual structure."""
        return self.superelements is not None and 0 not in self.superelements

    @property
    def has_no_modes(self) -> bool:
        """Whether ANALYSIS requests an analysis without modes."""
        return self.analysis().startswith(_WITHOUT_MODES)

    @property
    def name(self) -> str:
        """SUBCASE or STEP with its number."""
        return "" if self.begin is None else f"{self.begin.name} {self.begin.value}".strip()


class _CaseControlReading:
    """Commands of all levels, gathered line by line."""

    def __init__(self, method_is_modal: bool) -> None:
        self.method_is_modal = method_is_modal
        self.top = _Level()
        self.at = self.top
        self.subcases: list[_Level] = []
        self.others: list[CaseCommand] = []
        self.parameters: list[SourceLine] = []
        self.plotting = False
        self.selected: dict[str, list[int]] = {}

    def take(self, command: CaseCommand) -> None:
        if command.name == "OUTPUT":
            self.plotting = _PLOT_OUTPUT.match(command.options) is not None
        if command.name in _SUBCASES:
            self._subcase(command)
        elif command.name in _COMBINATIONS:
            self.plotting, self.at = False, _Level(command, self.top)
        elif command.name == "STEP" and self.at is not self.top:
            self._step(command)
        elif self.plotting:
            self.others.append(command)
        elif command.name in _TITLES or (command.name in _SELECTIONS and not _of_fluid(command)):
            self.at.commands[command.name] = command
            if command.name in _SELECTIONS and (number := parse_integer(command.value)) is not None:
                self.selected.setdefault(command.name, []).append(number)
        elif command.name == "SET":
            self._set(command)
        elif command.name == "PARAM":
            self.parameters.append(command.line)
        else:
            self._other(command)

    def _subcase(self, command: CaseCommand) -> None:
        _ = command.number
        self.plotting, self.at = False, _Level(command, self.top)
        self.subcases.append(self.at)

    def _step(self, command: CaseCommand) -> None:
        subcase = self.at.own[0]
        self.plotting, self.at = False, _Level(command, subcase)
        subcase.steps.append(self.at)

    def _other(self, command: CaseCommand) -> None:
        self.others.append(command)
        self.at.others.append(command)

    def _set(self, command: CaseCommand) -> None:
        match = _SET.fullmatch(command.value)
        if match is None or not re.match(r"ALL$|\d+(?:[\s,]|$)", match[2].strip(), re.IGNORECASE):
            self._other(command)
        else:
            self.at.sets[int(match[1])] = read_list(re.split(r"[\s,]+", match[2]), command.where)

    def result(self) -> CaseControl:
        level, notices = self._chosen()
        others = ((other.superelements, other) for other in self.subcases)
        assigned = tuple((numbers, self._control(other, ())) for numbers, other in others if numbers is not None)
        return replace(self._control(level, notices), of_superelements=assigned)

    def _control(self, level: _Level, notices: tuple[Notice, ...]) -> CaseControl:
        used = {name: command for above in level.path for name, command in above.commands.items()}
        selected = {name: used[name].number if name in used else None for name in _SELECTIONS}
        if not self.method_is_modal or level.has_no_modes:
            selected["METHOD"] = None
        title, subtitle, label = (used[name].value if name in used else "" for name in _TITLES)
        return CaseControl(
            spc=selected["SPC"],
            mpc=selected["MPC"],
            method=selected["METHOD"],
            nsm=selected["NSM"],
            damping=selected["SDAMPING"],
            title=title,
            subtitle=subtitle,
            label=label,
            sets={number: numbers for above in level.path for number, numbers in above.sets.items()},
            subcases=tuple(subcase.begin.number for subcase in self.subcases if subcase.begin),
            used=level.own[0].begin.number if level.own and level.own[0].begin else None,
            others=tuple(self.others),
            effective=tuple(command for above in level.path for command in above.others),
            loading=_before(level),
            preload=self._preload(level),
            parameter_lines=tuple(self.parameters),
            notices=notices,
            selected={name: tuple(numbers) for name, numbers in self.selected.items()},
        )

    def _chosen(self) -> tuple[_Level, tuple[Notice, ...]]:
        """The level whose selections are used: the first with METHOD, else with ANALYSIS = MODES, else the first."""
        parts = [part for subcase in self.subcases for part in subcase.steps or [subcase]]
        if not parts:
            return self.top, ()
        with_method = [part for part in parts if self._selects_method(part)]
        # those of superelements request the modes of components
        with_method = [part for part in with_method if not part.of_superelement] or with_method
        with_modes = [part for part in parts if part.analysis().startswith("MODE")]
        used = (with_method or with_modes or parts)[0]
        if len(parts) < 2 or used.begin is None:
            return used, ()
        if len(with_method) > 1:
            code, requesting = "deck.several-subcases/several-methods", with_method
        elif with_method or (with_modes and len(with_modes) < len(parts)):
            code, requesting = "deck.several-subcases/modal", with_method or with_modes
        else:
            code, requesting = "deck.several-subcases", parts
        only = code == "deck.several-subcases/modal" and len(requesting) == 1
        return used, (
            Notice(
                code,
                where=used.begin.where,
                level="info" if only else "warning",
                subcases=_named(parts),
                requesting=_named(requesting),
                request="METHOD" if with_method else "ANALYSIS = MODES",
                used=_named([used]),
            ),
        )

    def _selects_method(self, part: _Level) -> bool:
        """Whether modes are solved there: METHOD applies, and no other subcase uses it as static preload."""
        if not self.method_is_modal or part.has_no_modes or not any("METHOD" in level.commands for level in part.path):
            return False
        subcase = part.own[0]
        number = subcase.begin.number if subcase.begin else 0
        return number not in {
            preload for other in self.subcases if other is not subcase for preload in _preloads(other)
        }

    def _preload(self, level: _Level) -> StaticSubcase | None:
        """The first of the subcases that a level uses as static preload."""
        wanted = set(_preloads(level))
        others = [s for s in self.subcases if s.begin and s is not level.own[0]] if level.own else []
        static = next((s for s in others if s.begin and s.begin.number in wanted), None)
        if static is None:
            return None
        used = {name: command for above in static.path for name, command in above.commands.items()}
        spc, mpc = (used[name].number if name in used else None for name in ("SPC", "MPC"))
        loads = {(c.name, c.options): c for above in static.path for c in above.others if _is_load(c)}
        return StaticSubcase(spc, mpc, tuple(loads.values()))


def _preloads(level: _Level) -> list[int]:
    """Numbers of the static subcases whose loads change the stiffness (STATSUB)."""
    given = (c for above in [*level.path, *level.steps] for c in above.others if c.is_preload)
    return [number for c in given if (number := parse_integer(c.value)) is not None]


def _is_load(command: CaseCommand) -> bool:
    if command.name.startswith("TEMP"):
        return "LOAD" in command.options.upper() or "BOTH" in command.options.upper() or not command.options
    return command.name in ("LOAD", "DEFORM")


def _before(level: _Level) -> tuple[str, ...]:
    """Steps before a step of the same subcase."""
    subcase = level.parent
    if subcase is None or level not in subcase.steps:
        return ()
    return tuple(step.name for step in subcase.steps[: subcase.steps.index(level)])


def _named(parts: Sequence[_Level]) -> str:
    """Numbers of subcases, with those of their steps: ``1, 2 STEP 3``."""
    return ", ".join(
        " ".join([*(level.begin.value for level in part.own[:1] if level.begin), *(s.name for s in part.own[1:])])
        for part in parts
    )


def _of_fluid(command: CaseCommand) -> bool:
    return "FLUID" in command.options.upper()
