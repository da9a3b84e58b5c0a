"""Adds the place of a card in the deck to errors of kernels and constraints, which have only the element's number."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.built_model import BuiltModel


@contextmanager
def errors_at_cards(built: BuiltModel) -> Iterator[None]:
    """Errors raised inside the block that name an element, but no file, get file and line of its card."""
    try:
        yield
    except FemtuneErrors as several:
        raise FemtuneErrors(_placed(error, built) for error in several.errors) from several
    except FemtuneError as error:
        raise _placed(error, built) from error


def _placed(error: FemtuneError, built: BuiltModel) -> FemtuneError:
    place = built.place_of_element(error.facts.get("element", -1))
    return error if place is None or (error.where is not None and error.where.file) else error.at(place)
