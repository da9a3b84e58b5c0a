"""Pictures that the Python code of a page draws, and the picture of the first page of the guide: `make pictures`.

They are kept beside the pages, with the hash of the code that made them.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tempfile
from contextlib import chdir
from pathlib import Path

import matplotlib as mpl

_DOCS = Path(__file__).resolve().parents[1]
_PICTURES = _DOCS / "_static" / "pictures"
_HASHES = _PICTURES / "pages.json"
_PAGES = ("guide/posterior-or-intervals.md",)
"""Pages whose last Python code saves a picture ``guide_<page>.svg``."""
_OVERVIEW = "guide_index.svg"


def code_of(page: str) -> str:
    """The Python code of a page that draws its picture."""
    return str(re.findall(r"```python\n(.*?)```", (_DOCS / page).read_text(encoding="utf-8"), re.S)[-1])


def sources() -> dict[str, str]:
    """Code by the picture that it makes."""
    text = (_DOCS / "tutorial.md").read_text(encoding="utf-8")
    tutorial = "".join(re.findall(r"```(?:python)?\n(.*?)```", text, re.S))
    return {_OVERVIEW: tutorial + _OF_OVERVIEW} | {f"guide_{Path(page).stem}.svg": code_of(page) for page in _PAGES}


def hashes() -> dict[str, str]:
    """The hash of the code of each picture."""
    return {name: hashlib.sha256(code.encode()).hexdigest() for name, code in sources().items()}


def are_current() -> bool:
    """Whether each picture was made by the present code."""
    return _HASHES.exists() and json.loads(_HASHES.read_text(encoding="utf-8")) == hashes()


_OF_OVERVIEW = """
import matplotlib.pyplot as plt
import numpy as np

import femtune as ft

result = ft.run("study.toml", output="run")
figure = plt.figure(figsize=(10.5, 3.1), layout="constrained")
one, two, three = figure.subplots(1, 3, width_ratios=(1.25, 1.0, 1.0))
pairs = {when: getattr(result, when).pairs for when in ("before", "after")}
for shift, (when, table), colour in zip((-0.2, 0.2), pairs.items(), ("#b9c4d0", "#2f6fab")):
    errors = np.array(table.column("freq_error_percent"))
    one.bar(np.arange(1, len(errors) + 1) + shift, errors, 0.4, color=colour, label=f"{when} the update")
one.axhline(0.0, color="#334155", lw=0.8)
one.set(xlabel="mode of the test", ylabel="frequency error, %", title="Frequencies")
one.legend(frameon=False, fontsize=8)
two.imshow(result.mac, cmap="Blues", vmin=0.0, vmax=1.0)
two.set(xlabel="mode of the model", ylabel="mode of the test", title="MAC after the update", xticks=[], yticks=[])
rows = list(result.parameters)
for i, row in enumerate(rows):
    three.plot([row.interval_95_lower, row.interval_95_upper], [i, i], color="#2f6fab", lw=3)
    three.plot(row.nominal, i, "o", color="#b9c4d0", label="deck" if i == 0 else None)
    three.plot(row.value, i, "o", color="#2f6fab", label="updated, 95 %" if i == 0 else None)
three.set(yticks=range(len(rows)), yticklabels=[row.name for row in rows], ylim=(-0.6, len(rows) - 0.4))
three.set_title("Parameters")
three.set_xlabel("factor on the thickness in the deck")
three.legend(frameon=False, fontsize=8)
figure.savefig("guide_index.svg", metadata={"Date": None})
"""


def make() -> None:
    """Run the code in temporary folders and keep the pictures."""
    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "femtune"
    for name, code in sources().items():
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            if name == _OVERVIEW:
                _run_tutorial()
            exec(compile(_OF_OVERVIEW if name == _OVERVIEW else code, name, "exec"), {"__name__": "__main__"})
            shutil.copy(name, _PICTURES / name)
    _HASHES.write_text(json.dumps(hashes(), indent=1) + "\n", encoding="utf-8")


def _run_tutorial() -> None:
    """The files of the tutorial, up to the study."""
    import pictures  # noqa: PLC0415  it needs Pillow

    code, commands = pictures._steps()
    exec(compile(code, "plate.py", "exec"), {})
    for command in commands:
        if not command.startswith("femtune run"):
            pictures._run(command.removeprefix("femtune "))


if __name__ == "__main__":
    make()
