"""The page: machine, stages, ways beside one another, goals, cost against size."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from statistics import median

from goals import goals, times
from summary import CHANGED, MODES, Summary, exponent, ratio

from cases import CASES, CHANGE, SENSORS

Found = Mapping[tuple[str, int], Mapping[str, Summary]]

NAMES = {
    "femtune": "femtune",
    "eigsh-pardiso": "eigsh on PARDISO",
    "slepc": "SLEPc with MUMPS, MPI",
    "eigsh-superlu-symmetric": "eigsh on SuperLU, symmetric mode",
    "eigsh-superlu": "eigsh by itself (SuperLU)",
    "calculix": "CalculiX (C3D8I, SPOOLES)",
}
_INTRODUCTION = f"""# Speed and memory against size

Generated structures without supports, of which the tables below show those that were run: the shell subframe of
`structures.subframe` (a welded car subframe with
rubber bushings of solids, 15 parameters: 12 thicknesses, 3 moduli) and the solid bracket (6 parameters: moduli and
densities of its three parts). Each run is a process of its own; times are medians of the runs; memory is the largest
resident memory of the process, that of its children added. All ways but CalculiX have the same matrices, and eigsh and
SLEPc are given the shift that femtune found. The re-solve is at parameters that all differ by {100 * CHANGE:.0f} % up
or down: femtune starts from the old modes, eigsh from the sum of the old shapes; the ordering is known to both.
Derivatives are those of all eigenvalues and of all eigenvectors at {SENSORS} sensors of one direction each.

A run counts only where its frequencies are those of femtune to 1e-7 (CalculiX, whose element is another one, to
10 %) and, for femtune, where the energy of residuals √(rᵀ(K − σM)⁻¹r/(λ − σ)) with r = Kφ − λMφ is below 1e-8, shapes
are mass-orthonormal to 1e-10, the Sturm count agrees and derivatives are right to 1e-4 (by Nelson's method, two modes).
The column of residuals has the largest such energy, that of frequencies the largest difference from femtune's.
"""


def page(found: Found, machine: Mapping[str, str], limits: str, figure: str | None) -> str:
    """The whole page."""
    lines = [_INTRODUCTION, *_machine(machine, limits)]
    for (case, asked), ways in found.items():
        if _is_compared(ways) or (asked == CASES[case].main_size and len(ways) > 1):
            title = CASES[case].title
            size = next(iter(ways.values())).equations
            lines += [f"\n## {title.capitalize()}, {size:,} degrees of freedom\n"]
            lines += [*_stages(ways), "", *_ways(ways), "", *_goals(ways)]
    return "\n".join([*lines, *_growth(found, figure), ""])


def _is_compared(ways: Mapping[str, Summary]) -> bool:
    return len(ways) > 2 or any(len(way.rows) > 1 for way in ways.values())


def _machine(machine: Mapping[str, str], limits: str) -> Iterator[str]:
    yield from ("| machine | |", "|---|---|")
    yield from (f"| {name} | {value} |" for name, value in machine.items())
    yield f"| a run is ended | {limits} |"


def _stages(ways: Mapping[str, Summary]) -> Iterator[str]:
    own = ways.get("femtune")
    if own is None or not own.good:
        yield f"femtune: no run counts. {own.why if own else ''}"
        return
    yield "| stage of femtune | seconds | of the processor | peak GiB | |"
    yield "|---|---|---|---|---|"
    for stage in own.good[0]["stages"]:
        cpu, peak = median(own.of_stage(stage, "cpu_seconds")), max(own.of_stage(stage, "peak_mib")) / 1024
        yield f"| {stage} | {own.seconds(stage):.2f} | {cpu:.2f} | {peak:.2f} | {_remark(own, stage)} |"
    yield f"| from the deck to the modes | {number(own.total())} | | {number(own.peak_gib())} | {_load(own)} |"


def _remark(own: Summary, stage: str) -> str:
    measured = own.good[0]["stages"][stage]
    if "columns" in measured:
        return (
            f"{measured['factorisations']} factorisations ({measured['factor_seconds']:.1f} s), "
            f"{measured['solves']} solves of {measured['columns']} columns ({measured['solve_seconds']:.1f} s)"
        )
    if stage == "reduced model":
        return f"order {own.good[0]['reduced_model']['order']}: the modes of both points"
    return "a sample; the modes make their own" if stage == "factorise" else ""


def _load(own: Summary) -> str:
    loads = [row["load"] for row in own.good]
    return f"load before: {min(loads):.1f} to {max(loads):.1f}; {len(loads)} runs"


def _ways(ways: Mapping[str, Summary]) -> Iterator[str]:
    own = ways.get("femtune")
    yield "| way | 50 modes, s | × femtune | re-solve, s | × femtune | peak GiB | residual | frequencies | runs |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for way in (ways[name] for name in NAMES if name in ways):
        if not way.good:
            yield f"| {NAMES[way.way]} | {way.why} | | | | | | | 0 of {len(way.rows)} |"
            continue
        first, second = _times(way, own)
        cells = [NAMES[way.way], *first, *second, number(way.peak_gib())]
        cells += [small(way.worst("energy")), small(way.difference()), f"{len(way.good)} of {len(way.rows)}"]
        yield "| " + " | ".join(cells) + " |"


def _times(way: Summary, own: Summary | None) -> tuple[list[str], list[str]]:
    """Modes and re-solve; of CalculiX from its input to the modes, beside femtune from the deck to the modes."""
    if way.way == "calculix":
        took = way.total()
        return [f"{number(took)} with reading and assembly", times(ratio(took, own.total() if own else None))], [
            "–",
            "–",
        ]
    pairs = ((way.modes(suffix), own.modes(suffix) if own else None) for suffix in ("", CHANGED))
    first, second = ([number(took), times(ratio(took, ours))] for took, ours in pairs)
    return first, second


def _goals(ways: Mapping[str, Summary]) -> Iterator[str]:
    yield from ("| goal | wanted | measured | |", "|---|---|---|---|")
    for goal in goals(ways):
        yield f"| {goal.what} | {goal.wanted} | {goal.measured} | {goal.verdict} |"


def curves(found: Found, case: str) -> dict[str, list[tuple[int, float]]]:
    """Cost by number of equations: whole way of femtune, its modes, derivatives, and eigsh on PARDISO."""
    out: dict[str, list[tuple[int, float]]] = {}
    for (name, _), ways in found.items():
        if name == case:
            own, peer = ways.get("femtune"), ways.get("eigsh-pardiso")
            pairs = {
                "femtune, deck to modes": own and own.total(),
                "femtune, 50 modes": own and own.modes(),
                "femtune, re-solve": own and own.modes(CHANGED),
                "femtune, derivatives": own and own.seconds("derivatives"),
                "eigsh on PARDISO, 50 modes": peer and peer.modes(),
            }
            for label, seconds in pairs.items():
                if seconds:
                    out.setdefault(label, []).append((next(iter(ways.values())).equations, seconds))
    return out


def _growth(found: Found, figure: str | None) -> Iterator[str]:
    yield "\n## Cost against size\n"
    if figure:
        yield f"![seconds against degrees of freedom]({figure})\n"
    for case in CASES:
        yield from _growth_of(case, found)


def _growth_of(case: str, found: Found) -> Iterator[str]:
    lines = curves(found, case)
    sizes = sorted({size for points in lines.values() for size, _ in points})
    if not sizes:
        return
    yield f"Seconds, {CASES[case].title}; the exponent is the slope of a straight line through the logarithms.\n"
    yield "| degrees of freedom | " + " | ".join(f"{size:,}" for size in sizes) + " | exponent |"
    yield "|---|" + "---|" * (len(sizes) + 1)
    for label, points in lines.items():
        by_size = dict(points)
        slope = exponent(*zip(*points))
        yield f"| {label} | " + " | ".join(number(by_size.get(size)) for size in sizes) + f" | {number(slope)} |"
    peaks = {
        way["femtune"].equations: way["femtune"].peak_gib()
        for (name, _), way in found.items()
        if name == case and "femtune" in way
    }
    yield "| peak memory of femtune, GiB | " + " | ".join(number(peaks.get(size)) for size in sizes) + " | |\n"


def number(value: float | None) -> str:
    """Two decimals, three digits at least."""
    return "–" if value is None else f"{value:.2f}" if value < 100 else f"{value:.0f}"


def small(value: float | None) -> str:
    """An error."""
    return "–" if value is None else f"{value:.0e}"


def short(row: Mapping[str, object]) -> str:
    """One line for the terminal while it runs."""
    stages = row.get("stages")
    took = {k: v["seconds"] for k, v in stages.items()} if isinstance(stages, dict) else {}
    text = ", ".join(f"{name} {seconds:.1f}" for name, seconds in took.items())
    head = f"{row['case']} {row['size']:,} {row['way']} #{row['repeat']}"
    return f"{head}: {row['status']} {row.get('why') or ''} {text}"


__all__ = ["MODES", "NAMES", "curves", "page", "short"]
