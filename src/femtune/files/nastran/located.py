"""Errors of kernels and constraints, which know an element's number only, with the place of its card in the deck."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from femtune.errors import FemtuneError, FemtuneErrors, Where
from femtune.files.nastran.build import BuiltModel

_NUMBER = re.compile(r"(?:[A-Z][A-Z0-9]*|rigid element) (\d+)")


@contextmanager
def located(built: BuiltModel) -> Iterator[None]:
    """Errors raised inside the block that name an element, but no file, get file and line of its card."""
    try:
        yield
    except FemtuneErrors as several:
        raise FemtuneErrors(_placed(error, built) for error in several.errors) from several
    except FemtuneError as error:
        raise _placed(error, built) from error


def _placed(error: FemtuneError, built: BuiltModel) -> FemtuneError:
    where = error.where
    match = _NUMBER.fullmatch(where.record) if where is not None and not where.file else None
    at = built.element_cards.get(int(match[1])) if match else None
    if at is None:
        return error
    place: Where = built.deck.cards[at].where()
    return FemtuneError(error.code, error.what, where=place, values=error.values, hint=error.hint)
