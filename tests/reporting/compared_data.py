"""Made-up results of test against model, for the tests of the report."""

from __future__ import annotations

from typing import Any

import numpy as np

CONFIGURATIONS = ("BC", "NC", "SC")
_TEST_HZ = {"BC": (3.12, 3.86, 5.49, 14.1, 18.7), "NC": (2.9, 3.6, 5.2, 12.9, 17.6), "SC": (2.7, 3.4, 4.9, 12.2, 16.6)}
LABELS = ("1", "2", "3", "5", "6")
_NUMBERS = (1, 2, 3, 4, 5, 6, 7)
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
            "test_label": LABELS[i],
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


def correlation(configuration: str, stage: str) -> dict[str, Any]:
    """Pairs, matrices and criteria of a configuration."""
    pairs = _pairs(configuration, stage)
    tested = configuration != "SC"
    clusters = [
        {
            "cluster": 1,
            "test_labels": ["1", "2"],
            "model_numbers": [1, 2],
            "angle_deg": 6.2,
            "sentence": "the model modes were rotated by 0.3° within their subspace",
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
        "mac_test_labels": LABELS,
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


def shapes(configuration: str) -> dict[str, Any]:
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


def all_arrays() -> dict[str, Any]:
    """Arrays by key."""
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
