"""DOFs that AUTOSPC holds, told by kind: thousands of them must fit into a line or two."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.report.numbers import counted
from femtune.study.results_model import ModelConfiguration

_RANGES = 5


def held_lines(c: ModelConfiguration) -> list[str]:
    """A sentence each reason: how many, in which directions, at which points; the results list each."""
    reasons = dict.fromkeys(h.reason for h in c.held_dofs)
    return [_line(reason, [h.dof for h in c.held_dofs if h.reason == reason]) for reason in reasons]


def _line(reason: str, names: Sequence[str]) -> str:
    kinds = _by_kind(names)
    told = [f"{' '.join(directions)} of {_points(nodes)}" for directions, nodes in kinds]
    left = any(len(_ranges(nodes)) > _RANGES for _, nodes in kinds)
    rest = " (results.json, or femtune info --json, lists each)" if left else ""
    return f"{counted(len(names), 'DOF')}, {reason}: {'; '.join(told) or ', '.join(names[:_RANGES])}{rest}"


def _by_kind(names: Iterable[str]) -> list[tuple[tuple[str, ...], list[int]]]:
    """Directions that are held together and the points where they are, most points first; [] for unknown names."""
    by_node: dict[int, list[str]] = {}
    kinds: dict[tuple[str, ...], list[int]] = {}
    try:
        for dof in map(parse_dof, names):
            by_node.setdefault(dof.node, []).append(dof.direction)
    except FemtuneError:
        return []
    for node, directions in sorted(by_node.items()):
        kinds.setdefault(tuple(directions), []).append(node)
    return sorted(kinds.items(), key=lambda kind: -len(kind[1]))


def _points(nodes: Sequence[int]) -> str:
    ranges = _ranges(nodes)
    shown = ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in ranges[:_RANGES])
    left = sum(b - a + 1 for a, b in ranges[_RANGES:])
    return f"{counted(len(nodes), 'point')}, {shown}{f' and {left} more' if left else ''}"


def _ranges(nodes: Sequence[int]) -> list[tuple[int, int]]:
    """Runs of numbers without a gap, of ascending numbers."""
    found: list[tuple[int, int]] = []
    for node in nodes:
        if found and node == found[-1][1] + 1:
            found[-1] = found[-1][0], node
        else:
            found.append((node, node))
    return found
