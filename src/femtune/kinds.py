"""Kinds: methods, forms and criteria that a study chooses from by a word. Each kind stands once, in its `Kinds`.

The modules ``kinds.py`` of the packages list them: the words as a `typing.Literal`, which type checkers and the JSON
schema of the study file read, and what is true of each word as a `Kind`. Study file, numerics, results and report take
words, labels, publications and functions from there. These modules import neither numpy nor scipy, so that a study is
checked without them; the function of a kind is imported when it is first used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeVar, get_args


def loaded(function: str) -> Any:
    """The function or class that ``package.module:name`` names.

    Examples
    --------
    >>> from femtune.kinds import loaded
    >>> loaded("math:sqrt")(9.0)
    3.0
    """
    module, _, name = function.partition(":")
    return getattr(import_module(module), name)


@dataclass(frozen=True)
class Kind:
    """One choice.

    Parameters
    ----------
    key : the word in a study
    label : its name in reports
    text : what it does, as a report says it
    citations : keys of `femtune.citations`
    function : the function or class that does it, as ``package.module:name``
    """

    key: str
    label: str = ""
    text: str = ""
    citations: tuple[str, ...] = ()
    function: str = ""

    def load(self) -> Any:
        """The function or class itself."""
        return loaded(self.function)


K = TypeVar("K", bound=Kind)


class Kinds(Mapping[str, K], Generic[K]):
    """The kinds of one key of a study, by their words.

    Parameters
    ----------
    words : the `typing.Literal` of all words
    kinds : one for each word, in the same order

    Raises
    ------
    TypeError : words and kinds differ

    Examples
    --------
    >>> from typing import Literal
    >>> from femtune.kinds import Kind, Kinds
    >>> ends = Kinds(Literal["free", "clamped"], Kind("free", "free end"), Kind("clamped", "clamped end"))
    >>> ends["free"].label
    'free end'
    """

    def __init__(self, words: Any, *kinds: K) -> None:
        self._kinds = {kind.key: kind for kind in kinds}
        if tuple(kind.key for kind in kinds) != get_args(words):
            raise TypeError(f"kinds {', '.join(self._kinds)} are not the words {', '.join(get_args(words))}")

    def __getitem__(self, key: str) -> K:
        return self._kinds[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)
