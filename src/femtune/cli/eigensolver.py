"""The option --eigensolver: for one command it takes the place of the environment variable."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import click

_VARIABLE = "FEMTUNE_EIGENSOLVER"


def choose_eigensolver(context: click.Context, option: click.Parameter, name: str | None) -> None:
    """Set the variable that the model reads until the command ends."""
    if name is not None:
        context.with_resource(_set(name))


@contextmanager
def _set(name: str) -> Iterator[None]:
    before = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = before
