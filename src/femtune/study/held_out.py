"""Modes and sensors of a test that the update does not see: they are kept to judge it by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError
from femtune.files.study_file import ConfigurationEntry, HoldOutEntry, StudyFile
from femtune.modal import ModeSet
from femtune.residuals import ModalCase

HELD_OUT = "held out for validation"


@dataclass(frozen=True)
class HeldOut:
    """Positions of the test modes and of the sensors that are held out in one configuration."""

    modes: frozenset[int] = frozenset()
    sensors: frozenset[int] = frozenset()

    @property
    def any(self) -> bool:
        """True where something is held out."""
        return bool(self.modes or self.sensors)


def held_out(file: StudyFile, entry: ConfigurationEntry, case: ModalCase) -> HeldOut:
    """What the study holds out of a configuration's test.

    Raises
    ------
    FemtuneError : ``study.unknown-mode``, ``study.hold-out`` (a sensor that the test does not have, or nothing left)
    """
    modes: set[int] = set()
    sensors: set[int] = set()
    for i, one in enumerate(file.hold_out):
        if entry.use == "update" and one.configuration in (None, entry.name):
            modes |= set(_modes(file, i, one, case.test)) - set(case.left_out)
            sensors |= set(_sensors(file, i, one, case.test.dofs))
    found = HeldOut(frozenset(modes), frozenset(sensors))
    _check_something_left(file, entry, case, found)
    return found


def _modes(file: StudyFile, i: int, one: HoldOutEntry, test: ModeSet) -> Iterator[int]:
    for j, label in enumerate(one.modes):
        if label not in test.labels:
            raise FemtuneError(
                "study.unknown-mode",
                f"no mode of the test is called '{label}'",
                where=file.where("hold_out", i, "modes", j),
                values={"test modes": ", ".join(test.labels)},
                hint="name one of these modes; with several configurations say which: configuration = …",
            )
        yield test.labels.index(label)
    for k, hz in enumerate(test.freq_hz):
        if hz > (one.above_hz or np.inf) or hz < (one.below_hz or -np.inf):
            yield k


def _sensors(file: StudyFile, i: int, one: HoldOutEntry, dofs: DofSet) -> Iterator[int]:
    at = {(dof.node, dof.direction): k for k, dof in enumerate(dofs)}
    for j, label in enumerate(one.sensors):
        dof = parse_dof(label)
        if (dof.node, dof.direction) not in at:
            raise FemtuneError(
                "study.hold-out",
                f"the test has no sensor {label}",
                where=file.where("hold_out", i, "sensors", j),
                values={"sensors": _some(dofs)},
                hint="name a degree of freedom of the test",
            )
        yield at[dof.node, dof.direction]


def _some(dofs: Iterable[object]) -> str:
    names = [str(dof) for dof in dofs]
    return ", ".join(names[:8]) + (f" … ({len(names)} in all)" if len(names) > 8 else "")


def _check_something_left(file: StudyFile, entry: ConfigurationEntry, case: ModalCase, found: HeldOut) -> None:
    modes = len(case.test) - len(found.modes | set(case.left_out))
    sensors = len(case.test.dofs) - len(found.sensors)
    if found.any and (modes < 1 or sensors < 2):
        left = "no mode" if modes < 1 else "fewer than two sensors"
        raise FemtuneError(
            "study.hold-out",
            f"configuration {entry.name}: {left} would be left for the update",
            where=file.where("hold_out"),
            hint='hold out less, or keep the whole configuration: use = "validation"',
        )


def without(case: ModalCase, held: HeldOut) -> ModalCase:
    """The case as the update sees it."""
    if not held.any:
        return case
    keep = [k for k in range(len(case.test.dofs)) if k not in held.sensors]
    return replace(
        case,
        test=case.test.select_dofs(case.test.dofs.select(keep)),
        sensors=sp.csr_array(case.sensors[keep]),
        left_out={**dict.fromkeys(sorted(held.modes), HELD_OUT), **case.left_out},
        fixed=tuple(pair for pair in case.fixed if pair[0] not in held.modes),
    )
