"""Binary files changed at random, as by a bad transfer or on purpose: words, blocks, counts, ends.

The mutations of a number are the same in every run.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Mapping

_WORDS = (0, 1, 2, 3, 7, 255, 256, 65_535, 65_536, 1 << 20, 1 << 30, (1 << 31) - 1, -1, -2, -(1 << 31))
_REALS = (0.0, -1.0, 1e-300, 1e300, float("inf"), float("nan"))
_LONGS = (1 << 33, 1 << 40, (1 << 63) - 1, -1)


def binary_mutant(files: Mapping[str, bytes], number: int) -> dict[str, bytes]:
    """The files with one to four changes, most of them near the beginning, where headers are."""
    chance = random.Random(number)
    out = dict(files)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 4))):
        name = chance.choice(list(out))
        out[name] = bytes(chance.choice(_CHANGES)(bytearray(out[name] or b" "), chance))
    return out


def _place(size: int, chance: random.Random) -> int:
    """A place in a file: in half of all cases in its first 2 KiB, in a quarter in its last 2 KiB."""
    end, drawn = max(size - 1, 0), chance.random()
    if drawn < 0.5:
        return chance.randint(0, min(2047, end))
    return chance.randint(max(end - 2047, 0) if drawn < 0.75 else 0, end)


def _put(data: bytearray, at: int, new: bytes) -> bytearray:
    data[at : at + len(new)] = new
    return data


def _bits(data: bytearray, chance: random.Random) -> bytearray:
    for _ in range(chance.randint(1, 8)):
        data[_place(len(data), chance)] ^= 1 << chance.randrange(8)
    return data


def _byte(data: bytearray, chance: random.Random) -> bytearray:
    data[_place(len(data), chance)] = chance.choice((0, 1, 0x20, 0x7F, 0x80, 0xFF, chance.randrange(256)))
    return data


def _word(data: bytearray, chance: random.Random) -> bytearray:
    """Four or eight bytes at a place of that alignment become another number."""
    kind, values = chance.choice((("i", _WORDS), ("i", _WORDS), ("q", _LONGS), ("d", _REALS), ("f", (0.0, -1.0, 1e30))))
    width = struct.calcsize(kind)
    at = _place(len(data), chance) // width * width
    return _put(data, at, struct.pack(chance.choice("<>") + kind, chance.choice(values)))


def _count(data: bytearray, chance: random.Random) -> bytearray:
    """A small number becomes a near one: counts that no longer agree."""
    for _ in range(200):
        at = _place(len(data), chance) // 4 * 4
        value = int.from_bytes(data[at : at + 4], "little", signed=True)
        if 0 < value < 100_000:
            return _put(data, at, struct.pack("<i", chance.choice((value - 1, value + 1, 2 * value, -value, 0))))
    return data


def _cut(data: bytearray, chance: random.Random) -> bytearray:
    return data[: chance.randint(0, len(data))]


def _tail(data: bytearray, chance: random.Random) -> bytearray:
    return data + bytes(chance.randrange(256) for _ in range(chance.randint(1, 64)))


def _drop(data: bytearray, chance: random.Random) -> bytearray:
    at = _place(len(data), chance)
    del data[at : at + chance.choice((1, 2, 4, 8, 16, 100, 512))]
    return data


def _repeat(data: bytearray, chance: random.Random) -> bytearray:
    at, width = _place(len(data), chance), chance.choice((1, 4, 8, 64, 512))
    data[at:at] = data[at : at + width]
    return data


def _copy(data: bytearray, chance: random.Random) -> bytearray:
    """A block takes the place of another one."""
    width, source = chance.choice((4, 8, 16, 64, 256)), _place(len(data), chance)
    return _put(data, _place(len(data), chance), bytes(data[source : source + width]))


def _blank(data: bytearray, chance: random.Random) -> bytearray:
    width = chance.choice((4, 16, 128, 1024))
    return _put(data, _place(len(data), chance), bytes([chance.choice((0, 0x20, 0xFF))]) * width)


_CHANGES = (_bits, _bits, _byte, _byte, _word, _word, _word, _count, _count, _cut, _tail, _drop, _repeat, _copy, _blank)
