"""Modes in objects of other programs, recognised by their attributes; none of these programs is imported.

=========  =============================================================================
pyOMA2     result of an algorithm: ``Fn``, ``Phi``, and ``Xi``, ``Fn_std`` if it has them
sdypy      ``EMA.Model``: ``nat_freq``, ``nat_xi``, and the shapes ``phi``, else ``A``
pyNastran  table of eigenvectors: ``mode_cycles``, ``node_gridtype``, ``data``
=========  =============================================================================
"""

from __future__ import annotations

from typing import Any

import numpy as np

from femtune.errors import FemtuneError

_COMPONENTS = range(1, 7)
"""Three translations and three rotations of a grid point."""


def handed_over(given: Any) -> dict[str, Any] | None:
    """Arguments of `femtune.modal_test` from an object; None for what is none of these objects (error
    ``call.argument`` for a table of eigenvectors whose arrays do not belong together)."""
    if hasattr(given, "Fn") and hasattr(given, "Phi"):
        sd: Any = getattr(given, "Fn_std", None)
        known = sd is not None and np.size(sd) == np.size(given.Fn)
        return {
            "freq_hz": given.Fn, "shapes": given.Phi, "damping_ratio": getattr(given, "Xi", None),
            "freq_sd_hz": np.ravel(sd) if known else None,
        }  # fmt: skip
    if hasattr(given, "nat_freq") and hasattr(given, "nat_xi"):
        shapes = getattr(given, "phi", None)
        shapes = getattr(given, "A", None) if shapes is None else shapes
        return {"freq_hz": given.nat_freq, "shapes": shapes, "damping_ratio": given.nat_xi}
    if hasattr(given, "node_gridtype") and hasattr(given, "mode_cycles"):
        return _of_eigenvectors(given)
    return None


def _of_eigenvectors(given: Any) -> dict[str, Any]:
    """Shapes (modes, nodes, 6) of a solver; scalar points have one component, and DOFs without motion are left out."""
    data, rows = np.asarray(given.data), np.asarray(given.node_gridtype)
    if rows.ndim != 2 or data.ndim != 3 or data.shape[1] != len(rows) or data.shape[2] != _COMPONENTS.stop - 1:
        expected = f"(modes, {len(rows) if rows.ndim == 2 else 'nodes'}, 6)"
        raise FemtuneError(
            "call.argument/array-shape", name="data", function="modal_test", given=str(data.shape), expected=expected,
            meaning="one row for each entry of node_gridtype, and six components",
        )  # fmt: skip
    dofs, columns = [], []
    for i, (node, kind) in enumerate(rows):
        components = _COMPONENTS if int(kind) == 1 else (0,)
        for component in components:
            values = data[:, i, max(component - 1, 0)]
            if np.any(values):
                dofs.append((int(node), component))
                columns.append(values)
    return {"freq_hz": np.asarray(given.mode_cycles, float), "shapes": np.array(columns), "dofs": dofs}
