"""Who identifies: femtune by its defaults from the file, sdypy-EMA and pyOMA2 from the same samples."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where peers.py lies

import numpy as np
import peers
from simulated import BAND, RATE, Recorded

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.identification import Averaging, Limits, choose, estimate_frfs, input_output_spectra
from femtune.identification.pole_table import PoleTable
from femtune.modal import Channel, FrfSet, TimeSeries
from femtune.steps.identify.run import identify

Found = list[dict[str, float | bool | None]]
"""Of each mode: freq_hz, damping_ratio, their standard deviations or None, and whether it is marked as doubtful."""


def write_test(test: Recorded, folder: Path) -> Path:
    """The record and its identification file."""
    rows = test.responses if test.force is None else np.vstack([test.responses, test.force])
    np.save(folder / "record.npy", rows.T)
    text = f'[identify]\nrecord = "record.npy"\nsampling_hz = {RATE}\nband_hz = [{BAND[0]}, {BAND[1]}]\n'
    for i, quantity in enumerate(test.quantities):
        text += f'\n[[channel]]\ncolumn = {i + 1}\ndof = "{i + 1}Z+"\nquantity = "{quantity}"\n'
    if test.force is not None:
        text += f'\n[[channel]]\ncolumn = {len(rows)}\ndof = "1Z+"\nquantity = "force"\nrole = "input"\n'
    path = folder / "identify.toml"
    path.write_text(text, encoding="utf-8")
    return path


def by_femtune(test: Recorded, path: Path) -> tuple[Found, str]:
    """Modes, and the code of the error where there are none."""
    try:
        found = identify(path, path.parent / "identified")
    except FemtuneError as error:
        if not error.code.startswith("identify.no-"):
            raise
        return [], error.code
    keys = ("freq_hz", "damping_ratio", "freq_sd_hz", "damping_sd", "doubtful")
    return [{key: getattr(mode, key) for key in keys} for mode in found.record.modes], ""


def by_peer(test: Recorded, path: Path) -> tuple[Found, str]:
    """Poles of a peer through the rule of choice of femtune, since it has none of its own."""
    channels = [Channel(Dof(i + 1, "Z"), q) for i, q in enumerate(test.quantities)]
    responses = TimeSeries(test.responses, channels, sampling_hz=RATE)
    if test.force is None:
        order, references = 60, list(range(min(len(channels), 4)))
        rows = max(40, -(-6 * order // (5 * len(references))))
        table = peers.pyoma2_ssi(responses, references, rows, order)
    else:
        table = peers.ema_lscf(_functions(test, responses), 60)
    return _chosen(table), ""


def _functions(test: Recorded, responses: TimeSeries) -> FrfSet:
    """H1 of whole blocks without a window, the best that there is for forces that end before their block does."""
    whole = TimeSeries(
        np.vstack([test.responses, test.force]),
        [*responses.channels, Channel(Dof(1, "Z"), "force", role="input")],
        sampling_hz=RATE,
    )
    pieces = [whole.select_samples(a, b) for a, b in test.blocks]
    estimate = estimate_frfs(input_output_spectra(pieces, Averaging(pieces[0].samples, 0.0, "boxcar")), "H1")
    lines = np.flatnonzero((estimate.frfs.freq_hz >= BAND[0]) & (estimate.frfs.freq_hz <= BAND[1]))
    frfs = estimate.frfs
    return FrfSet(
        frfs.freq_hz[lines], frfs.values[:, :, lines], frfs.responses, DofSet([frfs.references[0]]), "accelerance"
    )


def _chosen(table: PoleTable) -> Found:
    none = {"freq_sd_hz": None, "damping_sd": None, "doubtful": False}
    return [
        {"freq_hz": c.freq_hz, "damping_ratio": c.damping_ratio, **none}
        for c in choose(table, Limits(band_hz=BAND))
        if c.chosen
    ]
