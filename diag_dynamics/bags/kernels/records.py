# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of MCAP: found in bytes, and written from columns.

A record is a byte that says its kind, its length in eight bytes, and so many bytes of content.
"""

from numba import types

from diag_dynamics.compiled.arrays import address_of, array_at
from diag_dynamics.compiled.kernel import COUNT, entry_kernel, kernel

BYTES = types.Array(types.uint8, 1, "C", readonly=True)
WRITTEN_BYTES = types.Array(types.uint8, 1, "C")
NUMBERS = types.Array(types.int64, 1, "C", readonly=True)
ROWS_OF_NUMBERS = types.Array(types.int64, 2, "C")

HEAD = 9
"""Bytes before a record's content."""

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS = 1, 2, 3, 4, 5, 6, 7, 8, 11
SUMMARY_OFFSET, DATA_END = 14, 15
"""Kinds of records, as the format numbers them."""

LAST_KIND = 15
"""Those up to here are the format's; others are skipped, as it demands."""

MESSAGE_HEAD, CHUNK_HEAD = 22, 40
"""Bytes of content before the data of a message, and at least before the records of a chunk."""

CHANNELS = 1 << 16
"""So many channels a file may have."""

END = 8
"""Bytes behind the last record, which say again that the file is one of MCAP."""

SKIPPED, UNKNOWN, STOP = -1, -2, -3
"""What :func:`find` does with records that it does not write down: nothing, counts them, or ends before them."""

CONNECTION, AT, SIZE, LOG_TIME, FOUND = 0, 1, 2, 3, 4
"""Rows of what it has found, and their number."""


@kernel
def _number(data, at, size):
    """Number of `size` bytes, the least significant first; negative if it is 2⁶³ or more."""
    number = 0
    for k in range(size):
        number |= types.int64(data[at + k]) << (8 * k)
    return number


@entry_kernel(BYTES, COUNT, NUMBERS, ROWS_OF_NUMBERS, nogil=True)
def find(data, begin, of, found):
    """Write down where records lie in `data`, from `begin` on.

    `of` says what becomes of a record, by its channel if it is a message, by :data:`CHANNELS` plus its kind if it is another:
    a number that is not negative is written down as its CONNECTION, for others see :data:`SKIPPED`. AT and SIZE are those of
    a message's data, of other records' content. It returns where it has ended, how many columns of `found` it has filled, and
    how many messages it has not written down: of an unknown channel, later than int64 has nanoseconds, and too short for one.
    It ends where the data do, where `found` is full, before a record that `of` says to stop at, and before what is no record
    that ends within the data.
    """
    at, n, unknown, late, short = begin, 0, 0, 0, 0
    while at + HEAD <= len(data) and n < found.shape[1]:
        kind, length = types.int64(data[at]), _number(data, at + 1, 8)
        if kind == 0 or length < 0 or length > len(data) - at - HEAD:
            break
        first = at + HEAD
        if kind != MESSAGE:
            to = of[CHANNELS + kind]
            if to == STOP:
                break
            if to >= 0:
                found[CONNECTION, n], found[AT, n], found[SIZE, n], found[LOG_TIME, n] = to, first, length, 0
                n += 1
        elif length < MESSAGE_HEAD:
            short += 1
        else:
            to = of[_number(data, first, 2)]
            if to >= 0:
                time = _number(data, first + 6, 8)
                if time < 0:
                    late += 1
                else:
                    found[CONNECTION, n], found[AT, n] = to, first + MESSAGE_HEAD
                    found[SIZE, n], found[LOG_TIME, n] = length - MESSAGE_HEAD, time
                    n += 1
            elif to == UNKNOWN:
                unknown += 1
        at = first + length
    return at, n, unknown, late, short


@kernel
def _length(data, at, rest):
    """Length of the record at a place of which it is not known whether one begins there; -1 if none does.

    `rest` is the number of bytes from the first one of `data` to the end of the file. Of a chunk, two lengths must agree.
    """
    kind, length = data[at], _number(data, at + 1, 8)
    if kind == 0 or kind > LAST_KIND or length < 0 or length > rest - at - HEAD:
        return -1
    if kind == MESSAGE and length < MESSAGE_HEAD:
        return -1
    if kind == CHUNK:
        if length < CHUNK_HEAD or at + HEAD + 32 > len(data):
            return -1
        name = _number(data, at + HEAD + 28, 4)
        if name > 16 or at + HEAD + CHUNK_HEAD + name > len(data):
            return -1
        if _number(data, at + HEAD + 32 + name, 8) != length - CHUNK_HEAD - name:
            return -1
    return length


@entry_kernel(BYTES, COUNT, COUNT, nogil=True)
def next_record(data, begin, rest):
    """Where the first record from `begin` on lies that is followed by two others, or by the end of the file; -1 if none is.

    `rest` is as :func:`_length` has it. What follows beyond the end of `data` is not looked at.
    """
    for at in range(begin, len(data) - HEAD + 1):
        place = at
        for _ in range(3):
            length = _length(data, place, rest)
            if length < 0:
                place = -1
                break
            place += HEAD + length
            if place + HEAD > len(data) or rest - place in (0, END):
                break
        if place > 0:
            return at
    return -1


_words = array_at(types.int64, 1)


@kernel
def _put(data, at, number, size):
    for k in range(size):
        data[at + k] = (number >> (8 * k)) & 255


@entry_kernel(BYTES, *[NUMBERS] * 6, WRITTEN_BYTES, nogil=True)
def lay(data, begin, size, channel, sequence, log_time, at, records):
    """Write records of messages: one at at[k] of `records`, whose data are `size[k]` bytes of `data` from begin[k] on.

    They are published when they are logged. The data are copied by eight bytes, in a ninth of the time.
    """
    source, target = address_of(data), address_of(records)
    for k in range(len(begin)):
        first = at[k] + HEAD
        records[at[k]] = MESSAGE
        _put(records, at[k] + 1, MESSAGE_HEAD + size[k], 8)
        _put(records, first, channel[k], 2)
        _put(records, first + 2, sequence[k], 4)
        _put(records, first + 6, log_time[k], 8)
        _put(records, first + 14, log_time[k], 8)
        first += MESSAGE_HEAD
        count = size[k] >> 3
        from_words, to_words = _words(source + begin[k], (count,)), _words(target + first, (count,))
        for j in range(count):
            to_words[j] = from_words[j]
        for j in range(count << 3, size[k]):
            records[first + j] = data[begin[k] + j]
