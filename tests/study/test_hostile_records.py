"""The step identify with files that hold no measurement: a sentence with place and hint, whatever stands in them."""

from __future__ import annotations

import io

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from femtune import identify
from femtune.errors import FemtuneError

NOISE = np.random.default_rng(3).normal(size=(2000, 2))
ASKED = {"band_hz": (1.0, 10.0), "largest_order": 8, "sampling_hz": 50.0, "methods": ("SSI-cov",)}


def refused(path, **options):
    with pytest.raises(FemtuneError) as caught:
        identify(path, output=path.parent / "out", **{**ASKED, **options})
    assert path.name in str(caught.value.where), "no place"
    assert caught.value.hint
    return caught.value


def text(folder, values):
    path = folder / "record.csv"
    np.savetxt(path, values, delimiter=",")
    return path


def written(name):
    stream = io.BytesIO()
    if name.endswith("npz"):
        np.savez(stream, acc=NOISE)
    elif name.endswith("mat"):
        savemat(stream, {"acc": NOISE})
    else:
        wavfile.write(stream, 50, NOISE.astype(np.float32))
    return stream.getvalue()


@pytest.mark.parametrize("kept", [0, 10, 20, 90, 130, 1000, 20000])
@pytest.mark.parametrize("name", ["cut.npz", "cut.mat", "cut.wav"])
def test_a_file_cut_short_anywhere_is_named(tmp_path, name, kept):
    whole = written(name)
    path = tmp_path / name
    path.write_bytes(whole[: min(kept, len(whole) - 100)])
    assert refused(path).code in ("record.file", "record.variable")


@pytest.mark.parametrize(
    ("values", "code"),
    [
        (np.full((2000, 2), 3.3), "record.dead"),
        (np.zeros((2000, 2)), "record.dead"),
        (NOISE * 1e150, "record.values"),
        (NOISE * 1e250, "record.values"),
        (NOISE * 1e-200, "record.values"),
        (NOISE[:10], "identify.short-record"),
        (NOISE[:150], "identify.short-record"),
    ],
)
def test_signals_without_a_measurement_are_refused(tmp_path, values, code):
    assert refused(text(tmp_path, values)).code == code


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"band_hz": (3.01, 3.02)}, "identify.band"),
        ({"band_hz": (3.01, 3.02), "methods": ("FDD",)}, "identify.band"),
        ({"band_hz": (10.0, 1.0)}, "identify.record-band"),
        ({"band_hz": (1.0, 30.0)}, "identify.record-band"),
        ({"fragments": 100}, "identify.short-record"),
        ({"largest_order": 200, "fragments": 10}, "identify.short-record"),
        ({"methods": ("N4SID",)}, "identify.output-only"),
        ({"methods": ("SSI-cov", "pLSCF")}, "identify.output-only"),
    ],
)
def test_what_a_record_cannot_give_is_refused(tmp_path, options, code):
    assert refused(text(tmp_path, NOISE), **options).code == code


def test_a_folder_is_called_a_folder(tmp_path):
    folder = tmp_path / "measured"
    folder.mkdir()
    assert "folder" in refused(folder).what
