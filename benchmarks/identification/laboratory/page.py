"""The page of the benchmark, from the rows of its journal."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import numpy as np
from score import HELD, NORMAL_95
from simulated import AMBIENT_S, BAND, BURSTS, KINDS, RATE, SWEEP_S

Row = dict[str, Any]
_MEDIAN_OF_NORMAL = 0.6745
_EARLY = " The run was ended early; of each excitation, its tests are the first of a drawn order."


def page(rows: list[Row], wanted: int) -> str:
    """All tables, and how many of the tests they are from: those that femtune and its peers have finished."""
    rows = _of_both(rows)
    whos = [row["who"] for row in rows]
    counts = ", ".join(f"{who} {whos.count(who)}" for who in dict.fromkeys(whos))
    return "\n".join([
        "# Identification of what laboratories record", "",
        f"Measured on {datetime.now(UTC):%Y-%m-%d} by `make bench-laboratory`: {len(rows)} of {wanted} identifications "
        f"({counts})."
        + (_EARLY if len(rows) < wanted else ""), "",
        *_about(), "",
        "## Modes", "",
        "| excitation | who | tests | true modes found | in close pairs | not held by the data, found | "
        "false, not doubtful | false, doubtful | no result |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |", *_modes(rows), "",
        "## Errors and intervals", "",
        "Of the modes that the data hold and that were found. *Over the bound*: median error over that of a normal "
        "distribution with the standard deviation of the bound.", "",
        "| excitation | who | modes | frequency over the bound | damping over the bound | 95 % intervals of "
        "frequencies hold | of damping ratios |",
        "| --- | --- | --- | --- | --- | --- | --- |", *_errors(rows), "",
        "## Time", "",
        "Seconds of the processor, one thread: the file is read, functions or correlations are computed and modes "
        "chosen; femtune also writes its result. The peers get arrays.", "",
        "| excitation | who | median s | largest s |", "| --- | --- | --- | --- |", *_times(rows), "",
    ])  # fmt: skip


def _of_both(rows: list[Row]) -> list[Row]:
    done: dict[tuple[int, str], set[str]] = {}
    for row in rows:
        done.setdefault((row["seed"], row["kind"]), set()).add(row["who"])
    most = max(map(len, done.values()), default=0)
    return [row for row in rows if len(done[row["seed"], row["kind"]]) == most]


def _about() -> list[str]:
    return [
        f"Structures with three to eight modes of {BAND[0]:g} to {BAND[1]:g} Hz and one above, mean damping ratios "
        "of 0.1 to 8 %, 1 to 40 channels and noise 20 to 60 dB below the rms of each channel. Three of five structures "
        "have a close pair, 1, 0.3 or 0.1 of its bandwidth apart. Records have "
        f"{RATE:g} samples a second: one or five hits of a hammer, {BURSTS} bursts of random force over half of a "
        f"block, a sweep of {SWEEP_S:g} s, and {AMBIENT_S:g} s of responses to white forces, half of those with three "
        "channels or more in mixed quantities. Harmonics are a machine, twice its speed and the mains, outside of the "
        "bandwidths of the modes, with 0.3 to 2 times the rms.",
        "",
        f"The data hold a mode if the least standard deviation of its damping ratio is below {HELD:g} of it. This is "
        "the Cramér-Rao bound, with the true noises of responses and force (80 dB below its rms) and all residues "
        "unknown, for known forces; for responses alone it "
        "is Whittle's, up to 16 channels (with more channels all modes are counted as held). A mode found is true if "
        "its frequency is within half the bandwidth or 0.3 %, and its damping ratio within 100 % or 0.5 % of critical "
        "damping, or both within four times the bound. Modes are matched one to one; all others are false.",
        "",
        "femtune identifies the file by its defaults; modes that it marks as doubtful count as neither found nor "
        "false. The peers get functions of whole blocks without a window (sdypy-EMA, LSCF, order 60), or the responses "
        "(pyOMA2, SSI-cov, order 60); their poles go through the rule of choice of femtune, and have no standard "
        "deviations.",
    ]


def _kinds(rows: list[Row]) -> Iterator[tuple[str, str, list[Row]]]:
    for kind in (*KINDS, "all"):
        for who in dict.fromkeys(row["who"] for row in rows):
            some = [row for row in rows if row["who"] == who and kind in ("all", row["kind"])]
            if some:
                yield kind, who, some


def firm(mode: Row) -> bool:
    """Found and not marked as doubtful."""
    return mode["found"] is not None and not mode["found"]["doubtful"]


def _modes(rows: list[Row]) -> Iterator[str]:
    for kind, who, some in _kinds(rows):
        modes = [mode for row in some for mode in row["modes"]]
        held = [m for m in modes if m["held"] is not False]
        cells = [_share([firm(m) for m in held if not m["close"]]), _share([firm(m) for m in held if m["close"]])]
        cells.append(_share([firm(m) for m in modes if m["held"] is False]))
        false = [f for row in some for f in row["false"]]
        sure = sum(not f["doubtful"] for f in false)
        shown = sure + sum(firm(m) for m in modes)
        cells.append(_share([True] * sure + [False] * (shown - sure)))
        cells += [str(len(false) - sure), str(sum(bool(row["error"]) for row in some))]
        yield f"| {kind} | {who} | {len(some)} | {' | '.join(cells)} |"


def _share(hits: list[bool]) -> str:
    return f"{100.0 * sum(hits) / len(hits):.1f} % ({sum(hits)} of {len(hits)})" if hits else ""


def _errors(rows: list[Row]) -> Iterator[str]:
    for kind, who, some in _kinds(rows):
        modes = [m for row in some for m in row["modes"] if m["held"] is not False and firm(m)]
        cells = [_over(modes, i, key) for i, key in enumerate(("freq_hz", "damping_ratio"))]
        cells += [_inside(modes, *names) for names in (("freq_hz", "freq_sd_hz"), ("damping_ratio", "damping_sd"))]
        yield f"| {kind} | {who} | {len(modes)} | {' | '.join(cells)} |"


def _over(modes: list[Row], i: int, key: str) -> str:
    over = [abs(m["found"][key] - m[key]) / m["bound"][i] for m in modes if m["bound"][i]]
    return f"{np.median(over) / _MEDIAN_OF_NORMAL:.2f}" if over else ""


def _inside(modes: list[Row], key: str, sd: str) -> str:
    known = [m for m in modes if m["found"][sd] is not None and np.isfinite(m["found"][sd])]
    return _share([abs(m["found"][key] - m[key]) <= NORMAL_95 * m["found"][sd] for m in known])


def _times(rows: list[Row]) -> Iterator[str]:
    for kind, who, some in _kinds(rows):
        seconds = [row["seconds"] for row in some]
        yield f"| {kind} | {who} | {np.median(seconds):.1f} | {max(seconds):.1f} |"
