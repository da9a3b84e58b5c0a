"""Several set-ups of one structure: each is identified by itself, and the shapes are merged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.identification_file import IdentifyFile, SetupEntry
from femtune.identification.choice import has_candidate
from femtune.identification.harmonics import distinct
from femtune.identification.setups import PartlyFound, merge_setups, same_modes
from femtune.modal import ModeSet
from femtune.steps.identify.identified import Found
from femtune.testdata import NO_GEOMETRY

IdentifyEach = Callable[[Sequence[tuple[IdentifyFile, str]]], list[Found]]
"""Identifies the measurements of files; a text names each of them while it is at work."""


def setup_file(file: IdentifyFile, entry: SetupEntry) -> IdentifyFile:
    """The identification file of one set-up: the common settings with its own measurement and channels."""
    values: dict[str, object] = {"record": entry.record, "frfs": entry.frfs}
    values |= {"take_hz": entry.take_hz, "drop_hz": entry.drop_hz}
    values |= {key: value for key in ("sampling_hz", "variable") if (value := getattr(entry, key)) is not None}
    table = file.identify.model_copy(update=values)
    made = file.model_copy(update={"identify": table, "channel": entry.channel or file.channel, "setup": ()})
    made._path, made._source = file._path, file._source
    return made


def found_from_setups(file: IdentifyFile, identify: IdentifyEach) -> Found:
    """Merged modes of all set-ups.

    Parameters
    ----------
    identify : identifies the measurements of files, each with the words for its set-up

    Raises
    ------
    FemtuneError : ``identify.setups``, ``dof.duplicate``, and what `identify` raises, with the name of the set-up
    """
    names = [entry.name or str(i) for i, entry in enumerate(file.setup, 1)]
    each = identify([(setup_file(file, entry), f"set-up {name}") for name, entry in zip(names, file.setup)])
    modes, left = same_modes([_of_structure(setup) for setup in each])
    more = _to_take(left, each)
    entries = {k: file.setup[k].model_copy(update={"take_hz": (*file.setup[k].take_hz, *f)}) for k, f in more.items()}
    words = "with modes of the other set-ups"
    again = identify([(setup_file(file, entry), f"set-up {names[k]}, {words}") for k, entry in entries.items()])
    each = [dict(zip(entries, again)).get(k, setup) for k, setup in enumerate(each)]
    if left:
        modes, left = same_modes([_of_structure(setup) for setup in each])
    if not len(modes[0]):
        values = {name: ", ".join(f"{f:.4g}" for f in setup.modes.freq_hz) + " Hz" for name, setup in zip(names, each)}
        raise FemtuneError(
            "identify.setups/none-common", where=Where(str(file.path)), values=values, n_setups=len(each)
        )
    merged = replace(merge_setups(modes), normalisation="unknown")
    merged = replace(merged, shapes=merged.shapes / np.linalg.norm(merged.shapes, axis=0), normalisation="unit-norm")
    collinearity = np.array([min(_collinearity(setup, f) for setup in each) for f in merged.freq_hz])
    return Found(
        merged, collinearity, None, (), {}, replace(each[0].curve, words=f"{each[0].curve.words}, set-up {names[0]}"),
        found_in=np.full(len(merged), len(each)), estimates=len(each),
        lines=distinct([line for setup in each for line in setup.lines]),
        notices=(*_notices(each), *likelihood_notice(names, each), *left_notice(left, len(each))),
        geometry=next((setup.geometry for setup in each if len(setup.geometry)), NO_GEOMETRY),
    )  # fmt: skip


LEAST_SHARE = 0.5
"""Share of the set-ups that must have a mode so that a cluster of stable poles is accepted in the others.

A mode that less than half of the set-ups have may be a pole of noise.
"""


def _to_take(left: list[PartlyFound], each: list[Found]) -> dict[int, tuple[float, ...]]:
    """Frequencies of clusters, by set-up, that are accepted because most other set-ups have the mode."""
    out: dict[int, tuple[float, ...]] = {}
    for mode in (m for m in left if len(m.having) >= LEAST_SHARE * len(each)):
        for k in sorted(set(range(len(each))) - set(mode.having)):
            if has_candidate(each[k].candidates, mode.freq_hz):
                out[k] = (*out.get(k, ()), mode.freq_hz)
    return out


def _of_structure(identified: Found) -> ModeSet:
    return identified.modes.select_modes([i for i in range(len(identified.modes)) if identified.of_structure(i)])


def _collinearity(identified: Found, freq: float) -> float:
    return float(identified.collinearity[int(np.argmin(np.abs(identified.modes.freq_hz - freq)))])


def _notices(each: list[Found]) -> tuple[Notice, ...]:
    """Those of all set-ups, those of one kind and text once; what was refined is told by `likelihood_notice`."""
    seen: dict[str, Notice] = {}
    for identified in each:
        for notice in (n for n in identified.notices if n.code != _LIKELIHOOD):
            seen.setdefault(f"{notice.code} {notice.what}", notice)
    return tuple(seen.values())


_LIKELIHOOD = "identify.likelihood"


def likelihood_notice(names: Sequence[str], each: Sequence[Found]) -> tuple[Notice, ...]:
    """How many modes of all set-ups were refined, and where they were not all or one was divided; () for FRFs."""
    refined, count, others = 0, 0, list[str]()
    for name, setup in zip(names, each):
        facts = {key: value for n in setup.notices if n.code == _LIKELIHOOD for key, value in n.facts.items()}
        if not facts:
            continue
        refined, count = refined + facts["refined"], count + facts["count"]
        pair = f", two modes near {facts['frequencies']} Hz" if "frequencies" in facts else ""
        if facts["refined"] < facts["count"] or pair:
            others.append(f"set-up {name}: {facts['refined']} of {facts['count']}{pair}")
    if not count:
        return ()
    more = [f"and {len(others) - _MOST_LISTED} more set-ups"] if len(others) > _MOST_LISTED else []
    words = f" ({'; '.join([*others[:_MOST_LISTED], *more])})" if others else ""
    return (Notice("identify.likelihood/setups", level="info", refined=refined, count=count, others=words),)


_MOST_LISTED = 5
"""Set-ups that the notice lists, so that it stays one sentence."""


def left_notice(left: list[PartlyFound], setups: int) -> tuple[Notice, ...]:
    """A notice of the modes that only some set-ups have; () if there are none."""
    if not left:
        return ()
    words = ", ".join(f"{mode.freq_hz:.4g} Hz in {len(mode.having)}" for mode in left[:10])
    return (Notice("identify.setups-left", level="info", n_setups=setups, modes=words),)
