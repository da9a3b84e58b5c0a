"""Lists of identification numbers with THRU, BY, EXCEPT and ALL.

Ranges are kept as ranges: ``1 THRU 99999999`` needs no memory, and the user of a list can distinguish a number that is
listed from one that is only within a range.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.lines import parse_integer


@dataclass(frozen=True)
class Span:
    """Numbers of a THRU range without those after EXCEPT."""

    numbers: range
    exceptions: tuple[range, ...] = ()

    def __contains__(self, number: int) -> bool:
        return number in self.numbers and not any(number in left_out for left_out in self.exceptions)


@dataclass(frozen=True)
class IntegerList:
    """`singles` are listed individually, `spans` come from THRU, `every` is ALL."""

    singles: tuple[int, ...] = ()
    spans: tuple[Span, ...] = ()
    every: bool = False

    def __contains__(self, number: int) -> bool:
        return self.every or number in self.singles or self._in_span(number)

    def _in_span(self, number: int) -> bool:
        return any(number in span for span in self.spans)

    def among(self, numbers: Iterable[int]) -> tuple[int, ...]:
        """Those of `numbers` that are in the list, in ascending order."""
        singles = frozenset(self.singles)
        chosen = (n for n in set(numbers) if n in singles or self.every or self._in_span(n))
        return tuple(sorted(chosen))

    def expand(self, most: int = 1_000_000) -> tuple[int, ...]:
        """All numbers of the list in ascending order; ValueError for ALL or more than `most` numbers."""
        if self.every or sum(len(span.numbers) for span in self.spans) > most:
            raise ValueError("the list is too long to be written out")
        spread = {n for span in self.spans for n in span.numbers if n in span}
        return tuple(sorted(spread | set(self.singles)))


def read_list(tokens: Sequence[str], where: Where) -> IntegerList:
    """Read ``1, 5, 10 THRU 20 EXCEPT 12, 13, 30 THRU 40 BY 2`` (blank tokens are skipped).

    Numbers after EXCEPT are excluded from the range before it, up to the first one outside of that range.

    Raises
    ------
    FemtuneError : ``deck.list``
    """
    words = [token.strip().upper() for token in tokens if token.strip()]
    if words == ["ALL"]:
        return IntegerList(every=True)
    return _ListReading(words, where).read()


class _ListReading:
    """One pass over the words of a list."""

    def __init__(self, words: list[str], where: Where) -> None:
        self.words, self.where, self.at = words, where, 0
        self.singles: list[int] = []
        self.spans: list[Span] = []

    def read(self) -> IntegerList:
        while self.at < len(self.words):
            numbers = self._range()
            if isinstance(numbers, int):
                self.singles.append(numbers)
            else:
                self.spans.append(Span(numbers, self._exceptions(numbers)))
        return IntegerList(tuple(self.singles), tuple(self.spans))

    def _range(self) -> int | range:
        first = self._number()
        if not self._word("THRU"):
            return first
        last = self._number()
        step = self._number() if self._word("BY") else 1
        if last < first or step < 1:
            raise self._error("deck.list", first=first, last=last, step=step)
        return range(first, last + 1, step)

    def _exceptions(self, numbers: range) -> tuple[range, ...]:
        left_out: list[range] = []
        if self._word("EXCEPT"):
            while self._next_is_within(numbers):
                item = self._range()
                left_out.append(range(item, item + 1) if isinstance(item, int) else item)
        return tuple(left_out)

    def _next_is_within(self, numbers: range) -> bool:
        number = parse_integer(self.words[self.at]) if self.at < len(self.words) else None
        return number is not None and numbers.start <= number < numbers.stop

    def _number(self) -> int:
        word = self.words[self.at] if self.at < len(self.words) else "the end of the list"
        number = parse_integer(word)
        if number is None:
            raise self._error("deck.list/number", word=word)
        self.at += 1
        return number

    def _word(self, word: str) -> bool:
        matches = self.at < len(self.words) and self.words[self.at] == word
        self.at += matches
        return matches

    def _error(self, code: str, **facts: Any) -> FemtuneError:
        return FemtuneError(code, where=self.where, values={"list": " ".join(self.words)[:200]}, **facts)
