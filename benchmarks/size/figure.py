"""Seconds against degrees of freedom, both logarithmic."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
from summary import exponent
from tables import Found, curves

from cases import CASES

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes


def write_figure(found: Found, path: Path) -> None:
    """One panel a case, as SVG with text as text."""
    drawn = {case: lines for case in CASES if (lines := curves(found, case))}
    mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "femtune"})
    figure, axes = plt.subplots(1, len(drawn), figsize=(5.4 * len(drawn), 4.2), squeeze=False, layout="constrained")
    for axis, (case, lines) in zip(axes[0], drawn.items()):
        _draw(axis, lines)
        axis.set(title=CASES[case].title, xlabel="degrees of freedom", ylabel="seconds", xscale="log", yscale="log")
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def _draw(axis: Axes, lines: Mapping[str, list[tuple[int, float]]]) -> None:
    for label, points in lines.items():
        sizes, seconds = zip(*points)
        slope = exponent(sizes, seconds)
        axis.plot(sizes, seconds, "o-", label=label if slope is None else f"{label} ({slope:.2f})")
    axis.grid(which="both", alpha=0.25)
    axis.legend(fontsize="small")
