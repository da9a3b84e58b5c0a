"""The time that a step which counts still needs, from the time that its last parts took."""

from __future__ import annotations

from collections import deque

_PARTS = 20
"""Reports that are kept: the pace is that of the last parts, because known solutions are recalled at once."""
_LEAST_S = 2.0
"""Time in s that must have been observed before a remaining time is told; a shorter one is mostly start-up."""
_MINUTE = 60.0
"""In s."""
_HOUR = 3600.0
"""In s."""
_DAY = 86400.0
"""In s."""


class Pace:
    """The pace of one step at a time: a step with another text or another total begins anew.

    Steps whose total is only a limit (the iterations of an update) have a text that changes with every report, so that
    no time is told for them.

    Examples
    --------
    >>> from femtune.cli.pace import Pace
    >>> pace = Pace()
    >>> [pace.left(float(10 * i), "starts", i, 9) for i in range(3)]
    ['', 'about 1 min 20 s left', 'about 1 min 10 s left']
    """

    def __init__(self) -> None:
        self._of: tuple[str, int | None] = ("", None)
        self._seen: deque[tuple[float, int]] = deque(maxlen=_PARTS)

    def left(self, now: float, text: str, done: int, total: int | None) -> str:
        """Remaining time in words after a report at the time `now` in s; "" if it is not known."""
        if (text, total) != self._of or (self._seen and done < self._seen[-1][1]):
            self._of = (text, total)
            self._seen.clear()
        if not self._seen or done > self._seen[-1][1]:
            self._seen.append((now, done))
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        if not total or last == first or last_s - first_s < _LEAST_S or done >= total:
            return ""
        return f"about {duration((last_s - first_s) / (last - first) * (total - last) - (now - last_s))} left"


def duration(seconds: float) -> str:
    """A time in two units at most, rounded as an estimate deserves.

    Examples
    --------
    >>> from femtune.cli.pace import duration
    >>> [duration(s) for s in (0.4, 47.0, 75.0, 4000.0, 90000.0)]
    ['1 s', '47 s', '1 min 20 s', '1 h 7 min', '25 h']
    """
    if seconds < _MINUTE:
        return f"{max(1, round(seconds))} s"
    if seconds < 10 * _MINUTE:
        minutes, rest = divmod(10 * round(seconds / 10), 60)
        return f"{minutes} min" + (f" {rest} s" if rest else "")
    if seconds < _HOUR:
        return f"{round(seconds / _MINUTE)} min"
    if seconds < _DAY:
        hours, rest = divmod(round(seconds / _MINUTE), 60)
        return f"{hours} h" + (f" {rest} min" if rest else "")
    return f"{round(seconds / _HOUR)} h"
