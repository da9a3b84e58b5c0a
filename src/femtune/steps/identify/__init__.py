"""Modes with standard deviations from records or FRFs."""

from __future__ import annotations

from typing import get_args

import click

from femtune.identification.kinds import GapWay
from femtune.steps.step import (
    FILE,
    JOBS,
    JSON,
    OUTPUT,
    Command,
    Step,
    given_words,
    identification_of,
)

STEP = Step(
    "identify",
    command=Command(
        group="Test",
        help=(
            "Identify modes with standard deviations from time records or FRFs.\n\n"
            "PATH is an identification file (.toml), a record (CSV, UFF, .npy, .npz, .mat, HDF5, WAV, LVM, TDMS, "
            "MDF) or functions or spectra (UFF). Options replace keys of [identify] in the file."
        ),
        params=(
            click.Argument(["path"], type=FILE),
            OUTPUT,
            click.Option(
                ["--band", "band_hz"], type=(float, float), metavar="LOW HIGH", help="Frequency range of the modes, Hz."
            ),
            click.Option(["--order", "largest_order"], type=int, help="Largest model order."),
            click.Option(
                ["--rate", "sampling_hz"], type=float, metavar="HZ", help="Sampling rate, if the file states none."
            ),
            click.Option(
                ["--variable"], metavar="NAME", help="Name of the array or group of channels, if there are several."
            ),
            click.Option(
                ["--method", "methods"], multiple=True, metavar="NAME", help="N4SID, pLSCF, SSI-cov, ERA …; repeatable."
            ),
            click.Option(["--fragments"], type=int, help="Divide the record into this number of parts and average."),
            click.Option(
                ["--take", "take_hz"], type=float, multiple=True, metavar="HZ", help="Select this cluster; repeatable."
            ),
            click.Option(
                ["--drop", "drop_hz"], type=float, multiple=True, metavar="HZ", help="Drop this cluster; repeatable."
            ),
            click.Option(
                ["--remove", "remove_hz"],
                type=float,
                multiple=True,
                metavar="HZ",
                help="Subtract the line of a machine from the record; repeatable.",
            ),
            click.Option(
                ["--gaps"],
                type=click.Choice(get_args(GapWay)),
                help="Cut a record at its gaps: use the parts as records of their own, or the longest one.",
            ),
            click.Option(
                ["--choices"],
                type=click.Path(path_type=str, resolve_path=True),
                metavar="FILE",
                help="Poles that were picked on the page of an identification, as saved there.",
            ),
            click.Option(
                ["--exponential", "exponential_s"],
                type=float,
                metavar="S",
                help="Time constant of an exponential window on hits, or with which FRFs were made.",
            ),
            click.Option(
                ["--force-window", "force_window_s"],
                type=float,
                metavar="S",
                help="Length of the force window, from the beginning of a hit.",
            ),
            click.Option(
                ["--record", "further_records"],
                type=click.Path(path_type=str, resolve_path=True),
                multiple=True,
                metavar="FILE",
                help="A further record of the same channels, such as another hit; repeatable.",
            ),
            click.Option(["--units"], metavar="m-kg-s", help="Units, if the file states none."),
            JOBS,
            JSON,
        ),
        reads=identification_of,
        asked=given_words,
        all_remarks=False,
        page_of=lambda result: result.report,
        document="identify.page:build_identification_page",
        shown=None,
    ),
)
