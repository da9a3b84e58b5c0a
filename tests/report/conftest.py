"""A full set of results, of numbers made up for the purpose: three configurations, five modes, ten parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from femtune.report import build_report
from femtune.report.document import Document
from femtune.study.results import Results

CONFIGURATIONS = ("BC", "NC", "SC")
_TEST_HZ = {"BC": (3.12, 3.86, 5.49, 14.1, 18.7), "NC": (2.9, 3.6, 5.2, 12.9, 17.6), "SC": (2.7, 3.4, 4.9, 12.2, 16.6)}
_LABELS = ("1", "2", "3", "5", "6")
_NUMBERS = (1, 2, 3, 4, 5, 6, 7)
_NAMES = tuple(f"E_{part}" for part in ("col_1", "col_2", "col_3", "col_4")) + tuple(f"I_beam_{i}" for i in range(1, 7))
_SHA = "3f786850e387550fdab836ed7e6dc881de23001b3f786850e387550fdab836ed"
_ERRORS = {
    "before": (1.9, 2.3, 0.6, 2.3, -3.0),
    "after": (0.21, -0.35, 0.12, 0.64, -0.48),
    "after as written": (0.21, -0.36, 0.12, 0.65, -0.48),
}
_MACS = {"before": (0.98, 0.97, 0.96, 0.87, 0.78), "after": (0.999, 0.997, 0.99, 0.97, 0.94)}


def _pairs(configuration: str, stage: str) -> list[dict[str, Any]]:
    macs = _MACS["before" if stage == "before" else "after"]
    shift = 0.07 * CONFIGURATIONS.index(configuration)
    return [
        {
            "test_label": _LABELS[i],
            "test_freq_hz": hz,
            "model_number": _NUMBERS[i if i < 3 else i + 1],
            "model_freq_hz": hz * (1 + (_ERRORS[stage][i] + shift) / 100),
            "freq_error_percent": _ERRORS[stage][i] + shift,
            "mac": macs[i] - shift / 10,
            "fixed_by_hand": i == 4 and configuration == "SC",
            "cluster": 1 if i in (0, 1) and configuration == "BC" else None,
        }
        for i, hz in enumerate(_TEST_HZ[configuration])
    ]


def _criteria(stage: str) -> list[dict[str, Any]]:
    good = "fail" if stage == "before" else "pass"
    return [
        {
            "name": "frequency error, NASA-STD-5002",
            "limit": 5.0,
            "sense": "at most",
            "measured": max(map(abs, _ERRORS[stage])),
            "unit": "%",
            "verdict": "pass",
            "remark": "mode 6",
        },
        {
            "name": "MAC, ECSS-E-ST-32-11C",
            "limit": 0.9,
            "sense": "at least",
            "measured": min(_MACS[stage[:6].strip()] if stage == "before" else _MACS["after"]),
            "unit": "",
            "verdict": good,
            "remark": "mode 6",
        },
        {
            "name": "cross-orthogonality",
            "limit": 0.9,
            "sense": "at least",
            "measured": None,
            "unit": "",
            "verdict": "not tested",
            "remark": "six sensors cannot carry the mass of the model",
        },
    ]


def _correlation(configuration: str, stage: str) -> dict[str, Any]:
    pairs = _pairs(configuration, stage)
    tested = configuration != "SC"
    clusters = [
        {
            "cluster": 1,
            "test_labels": ["1", "2"],
            "model_numbers": [1, 2],
            "angle_deg": 6.2,
            "sentence": "the model's vectors were rotated by 0.3° within theirs",
        }
    ]
    return {
        "configuration": configuration,
        "stage": stage,
        "pairs": pairs,
        "left_out": [
            {"test_label": t, "test_freq_hz": 9.8 + 0.6 * i, "reason": "braces vibrate on their own near 10 Hz"}
            for i, t in enumerate(("4a", "4b"))
        ],
        "unpaired_test": [
            {
                "test_label": "7",
                "test_freq_hz": 24.2,
                "reason": "best candidate is model mode 7: MAC 0.31, the MAC gate of 0.50 fails",
            }
        ],
        "unpaired_model": [{"model_number": 4, "model_freq_hz": 9.64}],
        "clusters": clusters if configuration == "BC" else [],
        "mac_key": f"mac/{configuration}/{stage}",
        "mac_test_labels": _LABELS,
        "mac_test_freq_hz": _TEST_HZ[configuration],
        "mac_model_numbers": _NUMBERS,
        "mac_model_freq_hz": [3.1, 3.9, 5.5, 9.64, 14.2, 18.5, 25.3],
        "auto_mac_test_key": f"auto_test/{configuration}/{stage}",
        "auto_mac_model_key": f"auto_model/{configuration}/{stage}",
        "comac": [
            {
                "dof": f"{n}{d}+",
                "comac": 0.999 - 0.015 * n * (4 if stage == "before" else 1) - (0.05 if d == "Z" else 0),
            }
            for n in (1, 2)
            for d in ("X", "Y", "RZ")
        ],
        "cross_orthogonality_key": f"xor/{configuration}/{stage}" if tested else None,
        "cross_orthogonality_reason": "" if tested else "the model was not reduced to the sensors",
        "criteria": _criteria(stage),
        "mac_gate": 0.5,
    }


def _mac(off: float, seed: int) -> Any:
    m = off * np.random.default_rng(seed).random((5, 7)) ** 2
    for i, j in enumerate((0, 1, 2, 4, 5)):
        m[i, j] = 1 - off * (0.05 + 0.12 * i)
    return m


def _shapes(configuration: str) -> dict[str, Any]:
    """A floor of four corners tied to its centre (last point) on four columns; sensors X, Y and RZ at the centre."""
    if configuration == "SC":
        return {"configuration": "SC", "stage": "after as written", "reason": "the model has 9000 lines"}
    names = ("points", "lines", "line_kinds", "translations", "sensor_positions", "sensor_directions")
    names += ("sensor_rotations", "test_shapes", "model_at_sensors")
    keys = {f"{name}_key": f"shapes/{configuration}/{name}" for name in names}
    return {"configuration": configuration, "stage": "after as written", **keys}


def _shape_arrays(configuration: str) -> dict[str, Any]:
    corners = np.array([[-2, -1.5, 0], [2, -1.5, 0], [2, 1.5, 0], [-2, 1.5, 0]], dtype=float)
    points = np.concatenate([corners, corners + np.array([0, 0, 3]), [[0, 0, 3]]])
    lines = [[i, i + 4] for i in range(4)] + [[i, 4 + (i - 3) % 4] for i in range(4, 8)] + [[i, 8] for i in range(4, 8)]
    at_sensors = np.random.default_rng(3).standard_normal((3, 7))
    at_sensors[:, 5] = [0, 0, 1]
    motion = np.zeros((9, 3, 7))
    for k in range(7):
        x, y, spin = at_sensors[:, k]
        motion[4:, :, k] = np.array([x, y, 0]) + np.cross([0, 0, spin], points[4:] - points[8])
    found = {
        "points": points,
        "lines": np.array(lines),
        "line_kinds": np.array([0] * 8 + [1] * 4),
        "translations": motion,
        "sensor_positions": np.tile(points[8], (3, 1)),
        "sensor_directions": np.eye(3),
        "sensor_rotations": np.array([0, 0, 1]),
        "test_shapes": 3.0 * at_sensors[:, [0, 1, 2, 4, 5]],
        "model_at_sensors": at_sensors,
    }
    return {f"shapes/{configuration}/{name}": a for name, a in found.items()}


def _arrays() -> dict[str, Any]:
    arrays: dict[str, Any] = {**_shape_arrays("BC"), **_shape_arrays("NC")}
    for k, c in enumerate(CONFIGURATIONS):
        for s, stage in enumerate(("before", "after", "after as written")):
            arrays[f"mac/{c}/{stage}"] = _mac((0.45, 0.12, 0.12)[s], k)
            arrays[f"xor/{c}/{stage}"] = np.sqrt(_mac((0.3, 0.08, 0.08)[s], k))
            arrays[f"auto_test/{c}/{stage}"] = np.eye(5) + 0.08 * (1 - np.eye(5))
            arrays[f"auto_model/{c}/{stage}"] = np.eye(7) + 0.05 * (1 - np.eye(7))
    rng = np.random.default_rng(7)
    arrays["jacobian"] = rng.standard_normal((15, 10)) * np.linspace(3, 0.1, 10)
    half = rng.standard_normal((10, 14))
    covariance = half @ half.T
    arrays["correlation"] = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    return arrays


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
        else "partly determined: the bounds or the prior still matter"
        if r < 0.7
        else "not determined by these data"
        for r in ratios
    ]
    return {
        "jacobian_key": "jacobian",
        "row_labels": [f"{c} mode {m} frequency" for c in CONFIGURATIONS for m in _LABELS],
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
        "correlations": [_correlation(c, s) for c in CONFIGURATIONS for s in ("before", "after", "after as written")],
        "mode_shapes": [_shapes(c) for c in CONFIGURATIONS],
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


@pytest.fixture
def data() -> dict[str, Any]:
    """Plain data that a test may change."""
    return full_data()


@pytest.fixture
def slim(data: dict[str, Any]) -> dict[str, Any]:
    """The same with one configuration and few pictures."""
    keys = ("auto_mac_test_key", "auto_mac_model_key", "cross_orthogonality_key")
    data["study"]["configurations"] = ["BC"]
    data["correlations"] = [
        {**c, **dict.fromkeys(keys)}
        for c in data["correlations"]
        if c["configuration"] == "BC" and c["stage"] != "after"
    ]
    data["mode_shapes"] = [m for m in data["mode_shapes"] if m["configuration"] == "BC"]
    return data


@pytest.fixture
def arrays() -> dict[str, Any]:
    """All arrays by key."""
    return _arrays()


@pytest.fixture(scope="session")
def results() -> Results:
    """The whole; frozen."""
    return Results.model_validate(full_data())


@pytest.fixture(scope="session")
def document(results: Results) -> Document:
    """Its report; pictures take time, so it is made once."""
    return build_report(results, _arrays())
