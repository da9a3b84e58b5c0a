"""Records of ASAM MDF files of version 4 (.mf4): channel groups with records of fixed length, plain or compressed.

Blocks and their links are those of the standard "ASAM MDF" 4.1. Formulas of conversions are not evaluated. Sizes that
the file states are compared with that of the file before memory is taken.
"""

from __future__ import annotations

import html
import itertools
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Notice
from femtune.files.records.arrays import check_size
from femtune.files.records.clocks import ClockGroup
from femtune.files.records.headings import stated_channel
from femtune.files.records.table import RecordTable, check_columns, problem

_HEADER = 24
"""Bytes of the header of a block: its kind, its length, and the number of its links."""
_FIRST = 64
"""Place of the first block, behind the identification of the file."""
_MOST_BLOCKS = 100_000
"""Blocks of one list; loggers write some thousands of blocks of data."""
_MOST_READ = 250_000
"""Blocks of a file that are read: some seconds."""
_MOST_TEXT = 65_536
"""Bytes of a text that are read."""
_BYTE = 8
"""Bits."""
_REAL_BITS = (16, 32, 64)
"""Sizes of real numbers."""
_REAL_TYPES = (4, 5)
"""Data types of channels that are real numbers; an odd number is big-endian."""
_SIGNED_TYPES = (2, 3)
"""Data types of signed integers; 0 and 1 are those without sign."""
_TRANSPOSED = 1
"""Compression of the transposed records; 0 is that of the records as they are."""
_STORED = (0, 2, 4)
"""Kinds of channels whose numbers stand in the record: values, times, and positions in another file."""
_COUNTED = (3, 6)
"""Kinds of channels whose numbers are those of the records: times and values."""
_MASTERS = (2, 3)
"""Kinds of channels that are the times, or another axis."""
_TIME = 1
"""Synchronisation of a master channel by time."""
_NOT_VALID = 1
"""Flag of a channel of which no sample is valid."""
_HAS_VALIDITY = 2
"""Flag of a channel of which a bit of each record says whether its sample is valid."""
_NO_RECORDS = 0b11111
"""Flags of channel groups with other contents than records: lengths that vary, events of a bus, times elsewhere."""


def read_mdf(path: Path) -> list[ClockGroup]:
    """The channel groups of an MDF file, with the channels that are numbers.

    Raises
    ------
    FemtuneError : ``record.file`` for a damaged file and for contents that are not read, ``record.too-large``
    """
    try:
        with path.open("rb") as stream:
            return list(_groups(_Blocks(path, stream, path.stat().st_size)))
    except (struct.error, zlib.error, OverflowError) as bad:
        raise _damaged(path, str(bad)[:120]) from bad


def _damaged(path: Path, words: str) -> FemtuneError:
    return problem(path, "record.file/mdf", problem=words)


@dataclass(frozen=True)
class _Block:
    """Kind of a block, its links, and place and length of its data."""

    kind: str
    links: tuple[int, ...]
    at: int
    length: int

    def link(self, number: int) -> int:
        """A link, 0 for one that the block does not have."""
        return self.links[number] if number < len(self.links) else 0


@dataclass(frozen=True)
class _Blocks:
    """The blocks of a file."""

    path: Path
    stream: IO[bytes]
    size: int
    count: Iterator[int] = field(default_factory=itertools.count)

    def bytes_at(self, at: int, count: int) -> bytes:
        if not 0 <= at <= at + count <= self.size:
            raise _damaged(self.path, "a block reaches beyond the end of the file")
        self.stream.seek(at)
        return self.stream.read(count)

    def block(self, at: int, *kinds: str) -> _Block:
        # lists of channels that many groups share would be read again and again
        if next(self.count) > _MOST_READ:
            raise _damaged(self.path, f"it has more than {_MOST_READ} blocks")
        mark, length, links = struct.unpack("<4s4xQQ", self.bytes_at(at, _HEADER))
        kind = mark.decode("latin-1").removeprefix("##")
        if kind not in kinds or length < _HEADER + 8 * links:
            raise _damaged(self.path, f"there is no block {' or '.join(kinds)} at byte {at}")
        begin = at + _HEADER + 8 * links
        to = struct.unpack(f"<{links}Q", self.bytes_at(at + _HEADER, 8 * links))
        return _Block(kind, to, begin, length - _HEADER - 8 * links)

    def chain(self, at: int, kind: str) -> Iterator[_Block]:
        """A block and those that follow by their first links."""
        seen: set[int] = set()
        while at:
            if at in seen or len(seen) >= _MOST_BLOCKS:
                raise _damaged(self.path, f"the list of its blocks {kind} does not end")
            seen.add(at)
            one = self.block(at, kind)
            yield one
            at = one.link(0)

    def fields(self, block: _Block, form: str) -> tuple:
        """The first data of a block."""
        size = struct.calcsize(form)
        if block.length < size:
            raise _damaged(self.path, f"its block {block.kind} is too short")
        return struct.unpack(form, self.bytes_at(block.at, size))

    def text(self, at: int) -> str:
        """A text, or the one within the tags of a comment."""
        if not at:
            return ""
        block = self.block(at, "TX", "MD")
        text = self.bytes_at(block.at, min(block.length, _MOST_TEXT)).split(b"\0")[0].decode("utf-8", "replace")
        if block.kind == "MD":
            inside = re.search(r"<TX[^<>]*>([^<]*)</TX>", text)
            text = html.unescape(inside[1]) if inside else ""
        return " ".join(text.split())


# ----------------------------------------------------------------------------------------------------
# Channel groups.


@dataclass(frozen=True)
class _Channel:
    """A channel: its block, kind, how its number stands in a record, and where the bit of its validity is."""

    block: _Block
    name: str
    kind: int
    synchronised: int
    data_type: int
    bit: int
    byte: int
    bits: int
    flags: int
    validity_bit: int

    @property
    def is_number(self) -> bool:
        """Whether the values are numbers of a size that is known."""
        if self.kind not in _STORED:
            return self.kind in _COUNTED
        if self.data_type in _REAL_TYPES:
            return self.bits in _REAL_BITS and self.bit == 0
        return self.data_type <= max(_SIGNED_TYPES) and 0 < self.bits <= 64 and self.bit + self.bits <= 64


def _groups(blocks: _Blocks) -> Iterator[ClockGroup]:
    mark, version = struct.unpack("<8s20xH", blocks.bytes_at(0, 30))
    if mark == b"UnFinMF ":
        raise _damaged(blocks.path, "its logger did not close it (UnFinMF)")
    if not mark.startswith(b"MDF"):
        raise _damaged(blocks.path, "it does not begin with the word MDF")
    if not 400 <= version < 500:
        raise problem(blocks.path, "record.format/mdf", version=f"{version / 100:.2f}")
    header = blocks.block(_FIRST, "HD")
    number, taken = 0, 0
    for data_group in blocks.chain(header.link(0), "DG"):
        (id_bytes,) = blocks.fields(data_group, "<B")
        groups = list(blocks.chain(data_group.link(1), "CG"))
        for group in groups:
            number += 1
            _, cycles, flags, record_bytes, validity_bytes = blocks.fields(group, "<QQH6xII")
            channels = [one for one in _channels(blocks, group) if one.is_number and not _is_state(blocks, one)]
            if flags & _NO_RECORDS or cycles < 2 or not channels:
                continue
            if len(groups) > 1:
                raise _damaged(blocks.path, "records of several channel groups are mixed (it is not sorted)")
            check_columns(len(channels), blocks.path)
            # numbers become reals of eight bytes, however short they are; all groups together are bounded
            taken += cycles * (8 * len(channels) + id_bytes + record_bytes + validity_bytes)
            check_size(blocks.path, taken)
            length = id_bytes + record_bytes + validity_bytes
            data = _data(blocks, data_group.link(2), cycles * length)
            records = np.frombuffer(data, np.uint8).reshape(cycles, length)[:, id_bytes:]
            made = _group(blocks, group, channels, records, record_bytes)
            if made is not None:
                yield ClockGroup(blocks.text(group.link(2)) or f"group {number}", made)


def _channels(blocks: _Blocks, group: _Block) -> Iterator[_Channel]:
    for block in blocks.chain(group.link(1), "CN"):
        kind, synchronised, data_type, bit, byte, bits, flags, validity = blocks.fields(block, "<BBBBIIII")
        name = blocks.text(block.link(2))
        yield _Channel(block, name, kind, synchronised, data_type, bit, byte, bits, flags, validity)


def _is_state(blocks: _Blocks, channel: _Channel) -> bool:
    """Whether the numbers of a channel stand for words."""
    at = channel.block.link(4)
    return bool(at) and blocks.fields(blocks.block(at, "CC"), "<B")[0] in _TO_TEXT


def _group(
    blocks: _Blocks, group: _Block, channels: Sequence[_Channel], records: NDArray[np.uint8], record_bytes: int
) -> RecordTable | None:
    """The channels of a group with its times; None without channels beside the times."""
    masters = [one for one in channels if one.kind in _MASTERS]
    own = [one for one in channels if one not in masters]
    if not own:
        return None
    times = None
    for master in masters:
        if master.synchronised != _TIME:
            raise _damaged(blocks.path, f"'{master.name}' counts its samples by another quantity than time")
        times = _values(blocks, master, records, record_bytes)
        if times is None:
            raise _damaged(blocks.path, f"the times '{master.name}' are given by a formula, which is not evaluated")
    values = [_values(blocks, one, records, record_bytes) for one in own]
    left = [one.name for one, row in zip(own, values) if row is None]
    notices = (Notice("record.left-out", channels=", ".join(left)),) if left else ()
    kept = [(one, row) for one, row in zip(own, values) if row is not None]
    stated = tuple(stated_channel(one.name, _unit(blocks, one)) for one, _ in kept)
    names = tuple(one.name for one, _ in kept)
    rows = np.array([row for _, row in kept]).reshape(len(kept), len(records))
    return RecordTable(rows, names, None, times, str(blocks.path), stated, notices)


def _unit(blocks: _Blocks, channel: _Channel) -> str:
    """The unit of a channel, or that of its conversion."""
    text = blocks.text(channel.block.link(6))
    if text or not channel.block.link(4):
        return text
    return blocks.text(blocks.block(channel.block.link(4), "CC").link(1))


# ----------------------------------------------------------------------------------------------------
# Blocks of data.


def _data(blocks: _Blocks, at: int, wanted: int) -> bytes:
    """The records of a group, as many bytes as it states."""
    pieces, count = list[bytes](), 0
    for piece in _pieces(blocks, at) if wanted else ():
        pieces.append(piece)
        count += len(piece)
        if count >= wanted:
            break
    if count < wanted:
        raise _damaged(blocks.path, f"it states {wanted} bytes of records and has {count}")
    return b"".join(pieces)[:wanted]


def _pieces(blocks: _Blocks, at: int) -> Iterator[bytes]:
    if not at:
        return
    first = blocks.block(at, "DT", "DZ", "DL", "HL", "LD")
    if first.kind == "LD":
        raise _damaged(blocks.path, "its data are stored by columns (LD), which is not read")
    if first.kind in ("DT", "DZ"):
        yield _piece(blocks, first)
        return
    seen: set[int] = set()
    for part in blocks.chain(first.link(0) if first.kind == "HL" else at, "DL"):
        for link in part.links[1:]:
            if link in seen:
                raise _damaged(blocks.path, "a block of data is listed twice")
            seen.add(link)
            if link:
                yield _piece(blocks, blocks.block(link, "DT", "DZ"))


def _piece(blocks: _Blocks, block: _Block) -> bytes:
    if block.kind == "DT":
        return blocks.bytes_at(block.at, block.length)
    kind, way, columns, stated, stored = blocks.fields(block, "<2sBxIQQ")
    if kind != b"DT" or way > _TRANSPOSED or 24 + stored > block.length:
        raise _damaged(blocks.path, f"a block of data is compressed in a way that is not known ({way})")
    check_size(blocks.path, stated)
    inflate = zlib.decompressobj()
    data = inflate.decompress(blocks.bytes_at(block.at + 24, stored), max(stated, 1))
    if len(data) != stated:
        raise _damaged(blocks.path, f"a block of {stated} bytes of data has {len(data)}")
    if way != _TRANSPOSED or columns < 2:
        return data
    whole = len(data) // columns * columns
    turned = np.frombuffer(data, np.uint8, whole).reshape(columns, whole // columns).T
    return turned.tobytes() + data[whole:]


# ----------------------------------------------------------------------------------------------------
# Values of channels.


def _values(blocks: _Blocks, channel: _Channel, records: NDArray[np.uint8], record_bytes: int) -> Reals | None:
    """The physical values of a channel, NaN where they are not valid; None where a formula would give them."""
    if channel.kind in _COUNTED:
        raw = np.arange(len(records), dtype=float)
    else:
        raw = _raw(blocks, channel, records, record_bytes)
    values = _converted(blocks, channel, raw)
    if values is None:
        return None
    if channel.flags & _NOT_VALID:
        return np.full(len(values), np.nan)
    at = record_bytes + channel.validity_bit // _BYTE
    if channel.flags & _HAS_VALIDITY and at < records.shape[1]:
        values = np.where(records[:, at] >> (channel.validity_bit % _BYTE) & 1, np.nan, values)
    return values


def _raw(blocks: _Blocks, channel: _Channel, records: NDArray[np.uint8], record_bytes: int) -> Reals:
    count = -(-(channel.bit + channel.bits) // _BYTE)
    if channel.byte + count > record_bytes:
        raise _damaged(blocks.path, f"'{channel.name}' reaches beyond its record")
    part = records[:, channel.byte : channel.byte + count]
    part = part[:, ::-1] if channel.data_type % 2 else part
    if channel.data_type in _REAL_TYPES:
        return np.ascontiguousarray(part).view(f"<f{count}")[:, 0].astype(float)
    wide = np.zeros((len(part), 8), np.uint8)
    wide[:, :count] = part
    whole = wide.view("<u8")[:, 0] >> np.uint64(channel.bit)
    # the sign is that of the first bit: shifted up, and down again with it
    up = np.uint64(64 - channel.bits)
    if channel.data_type in _SIGNED_TYPES:
        return ((whole << up).view(np.int64) >> up.astype(np.int64)).astype(float)
    return ((whole << up) >> up).astype(float)


def _converted(blocks: _Blocks, channel: _Channel, raw: Reals) -> Reals | None:
    """By the conversion of a channel: a straight line, a quotient of polynomials, or a table; None for a formula."""
    at = channel.block.link(4)
    if not at:
        return raw
    block = blocks.block(at, "CC")
    kind, count = blocks.fields(block, "<B5xH")
    if kind == _FORMULA:
        return None
    way = _CONVERSIONS.get(kind)
    few = min(count, _MOST_BLOCKS)
    numbers = np.array(blocks.fields(block, f"<24x{few}d"))
    if way is None or not np.isfinite(numbers).all():
        raise _damaged(blocks.path, f"the conversion of '{channel.name}' is not known (kind {kind})")
    with np.errstate(all="ignore"):
        values = way(numbers, raw)
    if values is None:
        raise _damaged(blocks.path, f"the conversion of '{channel.name}' has a wrong number of values")
    return values


def _as_it_is(numbers: Reals, raw: Reals) -> Reals:
    return raw


def _line(numbers: Reals, raw: Reals) -> Reals | None:
    return numbers[0] + numbers[1] * raw if len(numbers) == 2 else None


def _quotient(numbers: Reals, raw: Reals) -> Reals | None:
    if len(numbers) != 6:
        return None
    return np.asarray(np.polyval(numbers[:3], raw) / np.polyval(numbers[3:], raw))


def _interpolated(numbers: Reals, raw: Reals) -> Reals | None:
    keys = numbers[::2]
    usable = len(numbers) >= 2 and len(numbers) % 2 == 0 and (np.diff(keys) > 0.0).all()
    return np.asarray(np.interp(raw, keys, numbers[1::2])) if usable else None


def _nearest(numbers: Reals, raw: Reals) -> Reals | None:
    """The value of the next key; of the lower one where both are as near."""
    keys = numbers[::2]
    if len(numbers) < 2 or len(numbers) % 2 or not (np.diff(keys) > 0.0).all():
        return None
    return np.asarray(numbers[1::2][np.searchsorted(0.5 * (keys[1:] + keys[:-1]), raw)])


_FORMULA = 3
"""Conversion by a formula: text of the file, which is not evaluated."""
_CONVERSIONS: dict[int, Callable[[Reals, Reals], Reals | None]] = {
    0: _as_it_is, 1: _line, 2: _quotient, 4: _interpolated, 5: _nearest,
}  # fmt: skip
_TO_TEXT = range(7, 11)
"""Conversions of words: such a channel is a state and no signal."""
