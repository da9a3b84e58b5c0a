"""[parallel]: where runs that do not depend on each other are made."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.study_file.kinds import Text, TomlTable


class ParallelTable(TomlTable):
    """[parallel]: where runs that do not depend on each other are made: starts, bootstrap runs."""

    how: Literal["auto", "processes", "serial", "cluster"] = "auto"
    """Worker `"processes"` with one thread each, `"serial"` in the process of femtune, or the workers of a Dask
    `"cluster"` (extra `cluster`); `"auto"`: processes if a configuration has more than 3000 free DOFs, or if `workers`
    is above 1. Example: `"processes"`"""
    workers: Annotated[int, Field(ge=0, le=1024)] = 0
    """Number of worker processes; 0: one for each core. Example: `4`"""
    address: Text = "tcp://127.0.0.1:8786"
    """Address of the Dask scheduler, for `"cluster"`. Example: `"tcp://127.0.0.1:9000"`"""
    remote: bool = False
    """Allow an address on another machine; everyone who reaches the cluster can run programs in your name. Example:
    `true`"""
