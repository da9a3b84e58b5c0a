"""Pictures of the guide that no report and no code of a page draws, from the tutorial's plate: `make pictures`.

They are kept beside the pages, with the hash of this module and of the tutorial. Texts stay texts: files are small.
"""

from __future__ import annotations

import hashlib
import io
import re
import tempfile
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import page_pictures
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

import femtune as ft
from femtune.files.uff import read_uff
from femtune.units import SI

_DOCS = Path(__file__).resolve().parents[1]
_PICTURES = _DOCS / "_static" / "pictures"
_HASH = _PICTURES / "guide.txt"
_BLUE, _ORANGE, _GREY, _INK = "#2f6fab", "#b4530f", "#b9c4d0", "#334155"


def made_from() -> str:
    """Hash of the tutorial and of this module."""
    text = (_DOCS / "tutorial.md").read_text(encoding="utf-8")
    tutorial = "".join(re.findall(r"```(?:python)?\n(.*?)```", text, re.S))
    return hashlib.sha256(tutorial.encode() + Path(__file__).read_bytes()).hexdigest()


def are_current() -> bool:
    """Whether the pictures were made from the present tutorial and module."""
    return _HASH.exists() and _HASH.read_text(encoding="utf-8").strip() == made_from()


# ----------------------------------------------------------------------------------------------------
# The pictures, in the folder of the tutorial after its steps.


def _quads() -> tuple[np.ndarray, np.ndarray]:
    """Corners (e, 4, 2) of the elements of plate.bdf, in mm, and the property of each."""
    lines = [line.split(",") for line in Path("plate.bdf").read_text(encoding="utf-8").splitlines()]
    at = {row[1]: (1000 * float(row[3]), 1000 * float(row[4])) for row in lines if row[0] == "GRID"}
    quads = [row for row in lines if row[0] == "CQUAD4"]
    return np.array([[at[n] for n in row[3:7]] for row in quads]), np.array([int(row[2]) for row in quads])


def _plate(axes: Axes, colours: list[str]) -> None:
    corners, _ = _quads()
    axes.add_collection(PolyCollection(list(corners), facecolors=colours, edgecolors="white", lw=0.8))
    axes.set(xlim=(-15, 615), ylim=(-15, 415), aspect="equal", xlabel="x, mm", ylabel="y, mm")


def _deck(axes: Axes) -> None:
    _, properties = _quads()
    _plate(axes, [_GREY if p == 1 else _BLUE for p in properties])
    axes.text(100, 200, "PSHELL 1\n5 mm", ha="center", va="center")
    axes.text(300, 200, "PSHELL 2\n8 mm", ha="center", va="center", color="white")


def _info(axes: Axes) -> None:
    corners, properties = _quads()
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * np.abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1))
    kilograms = 7850e-9 * area * np.where(properties == 1, 5.0, 8.0)
    mass = [kilograms[properties == p].sum() for p in (1, 2)]
    axes.barh(["PSHELL 1", "PSHELL 2"], mass, color=[_GREY, _BLUE], height=0.55)
    for i, m in enumerate(mass):
        axes.text(m, i, f" {m:.2f} kg", va="center")
    axes.set(xlabel=f"mass, kg; together {sum(mass):.2f} kg", xlim=(0, 1.25 * max(mass)))


def _tests_in(axes: Axes) -> None:
    _plate(axes, ["#eef2f6"] * 96)
    test = ft.read_test("test.uff")
    (modes,) = [test.modes] if hasattr(test, "modes") else [test]
    nodes = [dof.node for dof in modes.dofs]
    place = np.array([(50 * ((n - 1) % 100), 50 * ((n - 1) // 100)) for n in nodes])
    size = np.real(modes.shapes[:, 2])
    drawn = axes.scatter(
        *place.T, c=size / np.abs(size).max(), cmap="RdBu", vmin=-1, vmax=1, s=46, edgecolors=_INK, lw=0.6
    )
    axes.figure.colorbar(drawn, label=f"mode 3, {modes.freq_hz[2]:.1f} Hz, relative")


def _simulate(axes: Axes) -> None:
    command = "respond true.bdf --input 1Z+ --output 407Z+ --from 60 --to 320 --step 1 --ratio 0.01 --units m-kg-s"
    for name, more in (("plain", ""), ("test", " --scatter 0.1 --floor 0.02 --seed 1")):
        _run(f"{command}{more} --uff {name}.uff")
    for name, style in (("test", {"color": "#e0a06a", "lw": 1.6}), ("plain", {"color": _BLUE, "lw": 1.0})):
        frfs = read_uff(Path(f"{name}.uff"), units=SI, file_units=SI).test.frfs
        label = "simulated test" if name == "test" else "without noise"
        axes.semilogy(frfs.freq_hz, np.abs(frfs.values[0, 0]), label=label, **style)
    axes.set(xlabel="Hz", ylabel="accelerance, m/s²/N")
    axes.legend(frameon=False)


def _verdict(axes: Axes) -> None:
    result = ft.read_results("run")
    error = np.abs(np.array(result.after.pairs.column("freq_error_percent")))
    before = np.abs(np.array(result.before.pairs.column("freq_error_percent")))
    at = np.arange(1, len(error) + 1)
    axes.bar(at - 0.2, before, 0.4, color=_GREY, label="before")
    axes.bar(at + 0.2, error, 0.4, color=_BLUE, label="after")
    axes.axhline(3.0, color=_ORANGE, ls="--", label="a limit of 3 %")
    axes.set(xlabel="mode of the test", ylabel="|frequency error|, %", xticks=at)
    axes.legend(frameon=False)


def _chain(n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.eye(n), 1e6 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))


def _matrices(axes: Axes) -> None:
    n = 12
    M, K = _chain(n)
    axes.set_axis_off()
    left, right = axes.inset_axes((0.0, 0.0, 0.38, 1.0)), axes.inset_axes((0.5, 0.1, 0.5, 0.85))
    i, k = np.nonzero(K)
    left.plot(k + 1, i + 1, "s", ms=5, color=_BLUE)
    left.set(
        aspect="equal", xlim=(0.3, n + 0.7), ylim=(n + 0.7, 0.3), title="entries of K", xticks=[1, n], yticks=[1, n]
    )
    squares, shapes = np.linalg.eigh(np.linalg.solve(M, K))
    for j, colour in zip(range(3), (_BLUE, _ORANGE, _INK)):
        shape = shapes[:, j] * np.sign(shapes[0, j])
        right.plot(
            range(1, n + 1), shape, "o-", ms=3, color=colour, label=f"{np.sqrt(squares[j]) / (2 * np.pi):.0f} Hz"
        )
    right.set(xlabel="mass", title="modes", yticks=[])
    right.legend(frameon=False, fontsize=8)


def _reduce(axes: Axes) -> None:
    """A chain of 200 masses, softened in the middle, in the space of the modes of the chain with equal springs."""
    n, wanted = 200, 6
    _, K = _chain(n)
    _, basis = np.linalg.eigh(K)
    soft = np.where((np.arange(n + 1) > 80) & (np.arange(n + 1) < 120), 0.6, 1.0) * 1e6
    changed = np.diag(soft[:-1] + soft[1:]) - np.diag(soft[1:-1], 1) - np.diag(soft[1:-1], -1)
    exact = np.sqrt(np.linalg.eigvalsh(changed)[:wanted])
    orders = (8, 12, 16, 24, 32, 48, 64, 96)
    error = [
        100 * np.abs(np.sqrt(np.linalg.eigvalsh(basis[:, :m].T @ changed @ basis[:, :m])[:wanted]) / exact - 1).max()
        for m in orders
    ]
    axes.loglog(orders, error, "o-", color=_BLUE)
    axes.set(xlabel="modes in the basis", ylabel="largest frequency error, %", xticks=orders, xticklabels=orders)
    axes.minorticks_off()


def _researchers(axes: Axes) -> None:
    """A beam with a spring at its foot as a function of one's own: frequencies by the stiffness, and a measured one."""
    stiffness = np.geomspace(0.1, 100.0, 80)
    n = 10
    hz = []
    for k in stiffness:
        _, K = _chain(n)
        K[0, 0] = 1e6 * (1 + k)
        K[-1, -1] = 1e6
        hz.append(np.sqrt(np.linalg.eigvalsh(K)[:3]) / (2 * np.pi))
    axes.semilogx(stiffness, np.array(hz), color=_BLUE)
    axes.semilogx([], [], color=_BLUE, label="my function")
    true = hz[45]
    axes.plot(np.full(3, stiffness[45]), true, "o", color=_ORANGE, label="test")
    axes.set(xlabel="stiffness of the foot, relative", ylabel="frequency, Hz")
    axes.legend(frameon=False)


# ----------------------------------------------------------------------------------------------------
# Boxes with arrows, for pages about what happens in which order.


def _boxes(axes: Axes, texts: list[str], back: str = "") -> None:
    axes.set(xlim=(-0.1, len(texts) * 1.5 - 0.3), ylim=(-0.75 if back else -0.1, 1.05))
    axes.set_axis_off()
    for i, text in enumerate(texts):
        axes.text(1.5 * i + 0.5, 0.5, text, ha="center", va="center", fontsize=9,
                  bbox={"boxstyle": "round,pad=0.5", "fc": "#eef2f6", "ec": _BLUE})  # fmt: skip
        if i:
            axes.annotate(
                "", (1.5 * i - 0.06, 0.5), (1.5 * i - 0.44, 0.5), arrowprops={"arrowstyle": "->", "color": _INK}
            )
    if back:
        end = 1.5 * (len(texts) - 1) + 0.5
        axes.annotate("", (0.5, 0.15), (end, 0.15),
                      arrowprops={"arrowstyle": "->", "color": _ORANGE, "connectionstyle": "bar,fraction=-0.12"},
                      )  # fmt: skip
        axes.text(0.5 * (0.5 + end), -0.62, back, ha="center", fontsize=9, color=_ORANGE)


def _solvers(axes: Axes) -> None:
    texts = ["values of the\nparameters", "deck with\nthese values", "your solver", "modes and\nmatrices", "residuals"]
    _boxes(axes, texts, "next values, until the residuals are least")


def _interrupted(axes: Axes) -> None:
    solved, again = 7, 12
    axes.barh([1] * solved, [0.8] * solved, left=range(solved), color=_BLUE, height=0.4)
    axes.barh([0] * solved, [0.1] * solved, left=np.arange(solved) * 0.14, color=_GREY, height=0.4)
    axes.barh(
        [0] * (again - solved), [0.8] * (again - solved), left=np.arange(again - solved) + 1.2, color=_BLUE, height=0.4
    )
    axes.plot(solved + 0.1, 1, "x", color=_ORANGE, ms=9, mew=2)
    axes.text(solved + 0.35, 1, "stopped", va="center", color=_ORANGE)
    axes.text(0, 0.36, "read from the journal", color=_INK, fontsize=8)
    axes.set(
        yticks=[1, 0],
        yticklabels=["first run", "same command again"],
        xlabel="solutions in time",
        xticks=[],
        xlim=(-0.2, 9),
    )


def _slurm(axes: Axes) -> None:
    _boxes(
        axes,
        ["femtune run", "scheduler\nof Dask", "workers on nodes:\none run each", "journal"],
        "results; the next runs",
    )


def _write_back(axes: Axes) -> None:
    result = ft.read_results("run")
    _, properties = _quads()
    rows = list(result.parameters)
    _plate(axes, [_GREY if p == 1 else _BLUE for p in properties])
    for x, row, initial, colour in ((100, rows[0], 5.0, _INK), (300, rows[1], 8.0, "white")):
        axes.text(
            x,
            200,
            f"T\n{initial:.2f} mm\n→ {initial * row.value / row.nominal:.2f} mm",
            ha="center",
            va="center",
            color=colour,
        )


DRAWN: dict[str, tuple[Callable[[Axes], None], tuple[float, float]]] = {
    "deck": (_deck, (5.0, 3.4)),
    "info": (_info, (5.6, 1.8)),
    "tests-in": (_tests_in, (6.0, 3.4)),
    "simulate-a-test": (_simulate, (6.4, 2.8)),
    "verdict": (_verdict, (6.4, 2.6)),
    "matrices": (_matrices, (6.6, 2.8)),
    "reduce": (_reduce, (5.6, 2.8)),
    "researchers": (_researchers, (5.6, 2.8)),
    "external-solvers": (_solvers, (7.6, 1.7)),
    "interrupted-runs": (_interrupted, (6.6, 1.7)),
    "slurm": (_slurm, (7.0, 1.7)),
    "write-back": (_write_back, (5.0, 3.4)),
}
"""Page of the guide, what draws its picture, and the size in inches."""


def _run(command: str) -> None:
    import pictures  # noqa: PLC0415  it needs Pillow

    pictures._run(command)


def make() -> None:
    """Run the tutorial in a temporary folder and draw the pictures."""
    mpl.use("Agg")
    mpl.rcParams |= {"svg.hashsalt": "femtune", "svg.fonttype": "none", "font.size": 9, "font.family": "sans-serif"}
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        page_pictures._run_tutorial()
        _run("run study.toml")
        for page, (draw, size) in DRAWN.items():
            figure = plt.figure(figsize=size, layout="constrained")
            draw(figure.subplots())
            text = io.StringIO()
            figure.savefig(text, format="svg", metadata={"Date": None})
            plt.close(figure)
            (_PICTURES / f"guide_{page}.svg").write_text(_smaller(text.getvalue()), encoding="utf-8")
    _HASH.write_text(made_from() + "\n", encoding="utf-8")


def _smaller(text: str) -> str:
    """Numbers with two decimals are exact enough for a picture."""
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    return re.sub(r"(\d+\.\d{2})\d+", r"\1", text)


if __name__ == "__main__":
    make()
