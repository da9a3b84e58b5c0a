"""A full set of results, of numbers made up for the purpose: three configurations, five modes, ten parameters."""

from __future__ import annotations

from typing import Any

from .compared_data import CONFIGURATIONS, LABELS, correlation, shapes

_NAMES = tuple(f"E_{part}" for part in ("col_1", "col_2", "col_3", "col_4")) + tuple(f"I_beam_{i}" for i in range(1, 7))
_SHA = "3f786850e387550fdab836ed7e6dc881de23001b3f786850e387550fdab836ed"


def _parameters() -> list[dict[str, Any]]:
    nominal = [2.1e11] * 4 + [1.94e-5] * 6
    facts = [
        {
            "name": n,
            "fields": [f"MAT1 {i + 1} E" if i < 4 else f"PBAR {i + 1} I1"],
            "unit": "Pa" if i < 4 else "m⁴",
            "nominal": p,
            "lower": 0.5 * p,
            "upper": 1.5 * p,
            "prior_mean": p,
            "prior_sd": p / 12**0.5,
        }
        for i, (n, p) in enumerate(zip(_NAMES, nominal))
    ]
    tied = {
        "name": "E_top",
        "fields": [],
        "unit": "Pa",
        "nominal": 2.1e11,
        "lower": None,
        "upper": None,
        "prior_mean": None,
        "prior_sd": None,
        "tie": "0.5*(E_col_1 + E_col_2)",
    }
    return [*facts, tied]


_FINAL = (0.615, 0.731, 1.005, 0.947, 1.259, 1.5, 0.813, 0.767, 0.77, 0.74)


def _result(fact: dict[str, Any], factor: float) -> dict[str, Any]:
    bound = factor == 1.5
    return {
        "name": fact["name"],
        "value": factor * fact["nominal"],
        "sd": None if bound else 0.04 * fact["nominal"],
        "sd_reason": "at bound, σ not given" if bound else "",
        "change_percent": 100 * (factor - 1),
        "at_bound": "upper" if bound else "",
        "written": [{"field": f, "value": factor * fact["nominal"]} for f in fact["fields"]],
    }


def _update(facts: list[dict[str, Any]]) -> dict[str, Any]:
    history = []
    for k in range(8):
        share = 1 - 0.45**k
        values = [f["nominal"] * (1 + share * (x - 1)) for f, x in zip(facts, _FINAL)]
        history.append(
            {
                "iteration": k,
                "objective_percent": 0.78 + 3.6 * 0.4**k,
                "step_length": None if k == 0 else 0.4 * 0.5**k,
                "damping": 10.0 ** (-k),
                "parameters": values,
                "active_bounds": ["I_beam_2"] if k > 4 else [],
                "events": ["NC: test mode 5 goes from model mode 4 to 5"] if k == 2 else [],
            }
        )
    return {
        "status": "CONVERGED_AT_BOUNDS",
        "message": "converged, with at least one parameter at its bound",
        "ok": True,
        "method": "Gauss-Newton with trust region and bounds",
        "objective_before_percent": 4.38,
        "objective_after_percent": 0.78,
        "objective_as_written_percent": 0.781,
        "history_parameters": _NAMES,
        "history": history,
        "parameters": [*(_result(f, x) for f, x in zip(facts, _FINAL)), _result(facts[-1], 0.673)],
        "pairing_events": [
            {"iteration": 2, "configuration": "NC", "sentence": "test mode 5 goes from model mode 4 to 5"}
        ],
        "regularisation": "minimum change",
        "regularisation_weight": 0.01,
        "residual_counts": [
            {"kind": "frequency", "count": 15, "misfit": 1.1},
            {"kind": "mode shape", "count": 90, "misfit": 0.4},
        ],
        "citations": [
            {"key": "a2011", "text": "A. Author (2011), A method", "bibtex": "@article{a2011,\n  year = {2011}\n}"}
        ],
    }


def _selection() -> dict[str, Any]:
    shares = [{"parameter": _NAMES[4], "coefficient": 0.71}, {"parameter": _NAMES[5], "coefficient": -0.71}]
    ratios = (0.08, 0.1, 0.12, 0.2, 0.71, 0.9, 0.3, 0.35, 0.42, 0.66)
    words = [
        "determined by the data"
        if r < 0.2
        else "partly determined: bounds or prior still affect it"
        if r < 0.7
        else "not determined by the data"
        for r in ratios
    ]
    return {
        "jacobian_key": "jacobian",
        "row_labels": [f"{c} mode {m} frequency" for c in CONFIGURATIONS for m in LABELS],
        "column_labels": _NAMES,
        "singular_values": [41, 22, 9.4, 6.1, 4.0, 2.2, 1.6, 1.1, 0.4, 0.0],
        "rank": 9,
        "rank_threshold": 4.1e-6,
        "undetermined": [
            {
                "singular_value": 0.0,
                "sd_ratio": 1.0,
                "shares": shares,
                "sentence": "I_beam_1 rises while I_beam_2 falls by as much: no measured mode changes.",
            }
        ],
        "weakly_determined": [
            {
                "singular_value": 0.4,
                "sd_ratio": 0.93,
                "shares": [{"parameter": _NAMES[9], "coefficient": 1.0}],
                "sentence": "I_beam_6 alone is weakly determined: its spread falls to 93 % of the prior's.",
            }
        ],
        "correlation_key": "correlation",
        "parameters": [{"parameter": n, "sd_ratio": r, "verdict": w} for n, r, w in zip(_NAMES, ratios, words)],
    }


def _configuration(name: str) -> dict[str, Any]:
    check = {
        "strain_energies": [1e-9] * 6,
        "relative_energies": [2e-16, 3e-16, 1e-16, 4e-15, 2e-15, 8e-16],
        "grounded": False,
        "verdict": "pass",
        "sentence": "No rigid motion strains the model.",
        "worst_dofs": [],
    }
    weighed = {"BC": None, "NC": 6120.0, "SC": 6890.0}[name]
    return {
        "configuration": name,
        "grids": 24,
        "free_dofs": 66,
        "supports": ["SPC 1: 4 grids clamped"],
        "held_dofs": [{"dof": f"{n}RZ+", "reason": "no stiffness about the bar's axis"} for n in (11, 12, 13)],
        "mass": 6053.2,
        "centre_of_gravity": [0.002, -0.011, 3.1],
        "inertia": [[8.1e3, 12.0, 0], [12.0, 7.7e3, 0], [0, 0, 9.2e3]],
        "weighed_mass": weighed,
        "mass_difference_percent": None if weighed is None else 100 * (6053.2 / weighed - 1),
        "rigid_body_check": check,
        "overlay": [] if name == "BC" else ["8 concrete blocks on floor 1"],
    }


def _model() -> dict[str, Any]:
    notice = {
        "level": "warning",
        "code": "deck.ignored",
        "sentence": "Two cards PLOTEL were ignored.",
        "where": "frame.bdf:88",
    }
    return {
        "cards_read": [{"name": n, "count": k} for n, k in (("GRID", 24), ("CBAR", 32), ("PBAR", 10), ("MAT1", 4))],
        "cards_ignored": [
            {
                "name": "PLOTEL",
                "count": 2,
                "first_file": "frame.bdf",
                "first_line": 88,
                "reason": "has no stiffness and no mass",
            }
        ],
        "deck_parameters": [
            {"name": "GRDPNT", "value": "0", "understood": True},
            {"name": "POST", "value": "-1", "understood": False, "remark": "no output file of that kind is written"},
        ],
        "notices": [notice],
        "configurations": [_configuration(c) for c in CONFIGURATIONS],
    }


def _sensors(name: str) -> dict[str, Any]:
    matched = [
        {"test_dof": f"{n}{d}+", "test_node": n, "model_node": 100 + n, "distance": 0.004, "how": "nearest grid"}
        for n in (1, 2)
        for d in ("X", "Y")
    ]
    spin = {"test_dof": "1RZ+", "test_node": 1, "model_node": None, "distance": None, "how": "combination of 3 DOFs"}
    aside = [{"test_dof": "9Z+", "reason": "no grid within 0.05: the nearest, 104, is 0.31 away"}]
    return {
        "configuration": name,
        "test_file": f"{name.lower()}.uff",
        "tolerance": 0.05,
        "matched": [*matched, spin],
        "unmatched": aside,
    }


def _write_back() -> dict[str, Any]:
    edit = {
        "card": "MAT1 1",
        "field": "E",
        "file": "updated.bdf",
        "line": 41,
        "old_text": "2.1+11  ",
        "new_text": "1.2915+11",
        "value": 1.29153e11,
        "rounded_value": 1.2915e11,
        "parameter": "E_col_1",
    }
    return {
        "files": ["updated.bdf"],
        "edits": [edit, {**edit, "card": "PBAR 5", "field": "I1", "line": 57, "parameter": "I_beam_1"}],
        "splits": [],
        "without_field": ["E_top is tied and sets no field."],
        "includes_changed": [],
    }


def full_data() -> dict[str, Any]:
    """The whole as plain data, to be changed by tests."""
    facts = _parameters()
    solved = [
        {
            "configuration": c,
            "stage": s,
            "freq_hz": [3.1, 3.9, 5.5, 9.6, 14.2, 18.5, 25.3],
            "rigid_body_modes": 0,
            "sturm_shift_hz": 30.0,
            "sturm_count": 7,
            "modes_below_shift": 7,
        }
        for c in CONFIGURATIONS
        for s in ("before", "after")
    ]
    held = {
        "configuration": "BC",
        "test_label": "4a",
        "test_freq_hz": 9.8,
        "model_number": 4,
        "model_freq_hz": 9.75,
        "freq_error_percent": -0.51,
        "mac": 0.93,
        "before_freq_error_percent": -1.6,
        "remark": "left out: braces",
    }
    return {
        "provenance": {
            "femtune_version": "0.1.0",
            "started_at": "2026-11-20T14:03:11+01:00",
            "command": "femtune run study.toml",
            "study_file": {"path": "study.toml", "sha256": _SHA},
            "input_files": [{"path": "frame.bdf", "sha256": _SHA}, {"path": "bc.uff", "sha256": _SHA}],
            "python_version": "3.11.2",
            "numpy_version": "2.4",
            "scipy_version": "1.16",
            "eigen_solver": "PARDISO, shift-invert",
            "durations": [{"step": "read", "duration_s": 0.21}, {"step": "update", "duration_s": 3.4}],
        },
        "study": {
            "title": "Two-storey steel building",
            "units": "m-kg-s",
            "deck_file": "frame.bdf",
            "configurations": CONFIGURATIONS,
        },
        "model": _model(),
        "sensors": [_sensors(c) for c in CONFIGURATIONS],
        "parameters": facts,
        "modes": solved,
        "correlations": [correlation(c, s) for c in CONFIGURATIONS for s in ("before", "after", "after as written")],
        "mode_shapes": [shapes(c) for c in CONFIGURATIONS],
        "selection": _selection(),
        "update": _update(facts),
        "write_back": _write_back(),
        "validation": {
            "predictions": [held],
            "not_tested": ["Damping was not compared.", "Other excitation levels were not tested."],
        },
        "alerts": [
            {
                "level": "warning",
                "code": "update.at-bound",
                "sentence": "I_beam_2 ended at its upper bound; its σ is not given.",
            },
            {"level": "info", "code": "report.left-out", "sentence": "Modes 4a and 4b were left out by the study."},
        ],
    }
