"""Execute the notebooks, each in a folder of its own; an error in a cell ends it."""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

_SECONDS = 300


def main() -> None:
    """All notebooks beside this file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write the executed notebooks there")
    keep = parser.parse_args().keep
    # pictures are drawn into the notebook, whatever the machine has
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    for path in sorted(Path(__file__).parent.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        with tempfile.TemporaryDirectory() as folder:
            NotebookClient(notebook, timeout=_SECONDS, resources={"metadata": {"path": folder}}).execute()
        pictures = sum("image/png" in o.get("data", {}) for c in notebook.cells for o in c.get("outputs", ()))
        print(f"{path.name}: {sum(c.cell_type == 'code' for c in notebook.cells)} cells, {pictures} pictures")
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            nbformat.write(notebook, keep / path.name)


if __name__ == "__main__":
    main()
