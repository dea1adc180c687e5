# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of any table as columns of joints, in pieces and SI units."""

from typing import NamedTuple

import numpy as np
import pyarrow as pa

from diag_dynamics.bags.messages import Unread
from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.columns import Columns
from diag_dynamics.recordings.tables.joint_names import numbers_of, read_row_names
from diag_dynamics.recordings.tables.times import doubtful_unit, is_date, read_pairs, read_times

ROWS = 20_000
"""About as many rows are in a piece."""
MISSING = frozenset(
    ("", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "none", "-", "--")
)
"""Texts that stand for no number."""
BLANK = frozenset(text for text in MISSING if text.strip("-").lower() != "nan")
"""Texts of empty cells; nan is a value that a driver has sent."""
LEFT_OUT = "rows left out"
MAX_TEXT = 10_000
"""Characters of a text that is read, in Parquet."""
SAMPLE = 6
"""First rows that show what a column of texts holds."""


class Block(NamedTuple):
    """Rows of a table as arrays of pyarrow."""

    arrays: dict
    """pyarrow.Array by index of the column."""
    rows: np.ndarray
    """Rows of the file, int64, shape (n,)."""
    lines: object
    """Lines of these rows in a text; None of other tables."""
    decimal: str = "."

    def where(self, k):
        """Return the place of the k-th row."""
        return f"row {self.rows[k]}" if self.lines is None else f"line {self.lines[k]}"


class Losses:
    """Unreadable data, counted by cause."""

    def __init__(self, file):
        self._file, self._causes = file, {}

    def add(self, cause, where, unit="", count=1, example=""):
        """Count a loss of so many units, such as ``rows left out``; place and example of the first are kept."""
        entry = self._causes.setdefault((cause, unit), [where, example, 0])
        entry[2] += count

    def listed(self):
        """Return all losses as a list of Unread."""
        return [
            Unread(
                self._file, where, cause + (f" ({example})" if example else "") + (f": {count} {unit}" if unit else "")
            )
            for (cause, unit), (where, example, count) in self._causes.items()
        ]


class Table:
    """Rows of a table in pieces.

    Parameters
    ----------
    source : CsvSource, ParquetSource or NpzSource
        It has `path`, `choice`, `notes`, and `blocks(losses)`, which yields :class:`Block`.

    Attributes
    ----------
    joints : tuple of str
    notes : list of str
        How the columns were understood; complete when all pieces have been read.
    unread : list of Unread
        Likewise.
    without_values : int
        Rows without a value of any joint; likewise.
    """

    def __init__(self, source):
        self._source, self._choice = source, source.choice
        self.joints, self.without_values = source.choice.joints, 0
        self._losses = Losses(source.path)

    @property
    def unread(self):
        """Unreadable data."""
        return self._losses.listed()

    @property
    def notes(self):
        """How the columns were understood."""
        return [*self._choice.notes, *self._source.notes]

    def pieces(self):
        """Yield pieces as :class:`Columns`; a second call starts again.

        Raises
        ------
        InputError
            The unit of the times is in doubt, or rows of single joints are in the order of joints.
        """
        self._losses, self.without_values = Losses(self._source.path), 0
        first, joined, count = True, _JoinedRows(self._source.path), 0
        for block in self._source.blocks(self._losses):
            columns = self._read(block)
            count += len(block.rows)
            if not len(columns.rows):
                continue
            unit = doubtful_unit(columns.time) if first and self._choice.time_in_doubt else None
            if unit:
                raise InputError(
                    f"'{self._source.path}': times are about {np.median(columns.time):.6g}, which in seconds is no time: say "
                    f"what they are by `scale: {{time: {unit}}}` in the map of columns."
                )
            first = False
            if self._choice.names and not self._choice.names.listed and len(self._choice.names.columns) == 1:
                columns = joined.add(columns)
            if columns:
                yield columns
        if columns := joined.finish():
            yield columns
        if not count and not self.unread:
            self._losses.add("there is no row", "line 2" if isinstance(self._source.lines, int) else "row 0")

    # --- One block ---

    def _read(self, block):
        """The rows of a block that have a time and a value."""
        choice, count = self._choice, len(block.rows)
        time, stamp = self._times(block)
        values, names = {quantity: self._values(block, one) for quantity, one in choice.quantities.items()}, None
        if choice.names:
            names = read_row_names(choice.names, lambda k: read_texts(block.arrays[k]), count)
            values, names = self._place(values, names, block)
        empty, untimed = self._are_empty(block, values, names), np.isnan(time)
        if untimed.any():
            texts = [read_texts(block.arrays[k]) for k in choice.time if is_text(block.arrays[k].type)]
            said = [k for k in np.flatnonzero(untimed) if any((one[k] or "").strip() not in MISSING for one in texts)]
            empty[said] = False
            lost = np.flatnonzero(untimed & ~empty)
            if lost.size:
                example = " and ".join(f"'{(one[lost[0]] or '')[:40]}'" for one in texts)
                self._losses.add(
                    "no time, or one that is no number", block.where(lost[0]), LEFT_OUT, lost.size, example
                )
        self.without_values += int(empty.sum())
        kept = ~(untimed | empty)
        values = [None if one is None else one[kept] for one in values.values()]
        return Columns(time[kept], stamp[kept], *values, block.rows[kept], None if names is None else names[kept])

    def _times(self, block):
        arrays = [decoded(block.arrays[k]) for k in self._choice.time]
        if len(arrays) == 2:
            return read_pairs(*(read_times(one, 1.0, block.decimal)[0] for one in arrays))
        return read_times(arrays[0], self._choice.time_scale, block.decimal)

    def _values(self, block, quantity):
        """Values of a quantity in SI units, (n, k); None without columns."""
        if quantity is None:
            return None
        if quantity.whole:
            values = self._lists(block, quantity.columns[0])
            if values.shape[1] == len(quantity.scale):
                return values * quantity.scale
            if len(set(quantity.scale.tolist())) > 1:
                raise InputError(
                    f"scale has {len(quantity.scale)} numbers; expected one number, or one by joint, for rows that name "
                    "different joints."
                )
            return values * quantity.scale[:1]
        values = np.full((len(block.rows), len(quantity.columns)), np.nan)
        for joint, k in enumerate(quantity.columns):
            if k in block.arrays:
                values[:, joint] = self._numbers(block, k) * quantity.scale[joint]
        return values

    def _numbers(self, block, k):
        """Numbers of a column; NaN where there are none, which is counted of texts."""
        array = decoded(block.arrays[k])
        if not is_text(array.type):
            return array.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        if block.decimal == ".":
            try:
                return array.cast(pa.float64()).to_numpy(zero_copy_only=False)
            except pa.ArrowInvalid:
                pass
        texts = read_texts(array)
        numbers = [number_of(text, block.decimal) for text in texts]
        lost = [at for at, number in enumerate(numbers) if number is None]
        if lost:
            example = f"column '{self._source.headers[k]}': '{texts[lost[0]].strip()[:40]}'"
            self._losses.add("text where a number belongs", block.where(lost[0]), "fields are NaN", len(lost), example)
        return np.array(numbers, float)

    def _lists(self, block, k):
        """Numbers of a column of lists, (n, k): NaN behind the end of a list; other lengths than of joints are counted."""
        array, header = block.arrays[k], self._source.headers[k]
        if is_text(array.type):
            texts = read_texts(decoded(array))
            lists = [numbers_of(text or "") for text in texts]
            lost = [at for at, one in enumerate(lists) if one is None and (texts[at] or "").strip() not in MISSING]
            if lost:
                example = f"column '{header}': '{texts[lost[0]].strip()[:40]}'"
                where = block.where(lost[0])
                self._losses.add(
                    "text where a list of numbers belongs", where, "rows of it are NaN", len(lost), example
                )
            array = pa.array(lists, pa.list_(pa.float64()))
        lengths = array.value_lengths().fill_null(0).to_numpy(zero_copy_only=False)
        there = np.arange(lengths.max(initial=0)) < lengths[:, None]
        values = np.full(there.shape, np.nan)
        values[there] = decoded(array.flatten()).cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        if self._choice.names:
            return values
        width = len(self.joints)
        odd = (lengths != width) & (lengths > 0)
        if odd.any():
            at = int(np.argmax(odd))
            cause, example = (
                "list of another length than there are joints",
                f"column '{header}': {lengths[at]} instead of {width}",
            )
            self._losses.add(cause, block.where(at), "rows of it are NaN", int(odd.sum()), example)
        fitting = np.full((len(values), width), np.nan)
        fitting[lengths == width] = values[lengths == width][:, :width]
        return fitting

    def _are_empty(self, block, values, names):
        """Whether rows have neither a value nor the name of any joint, and no NaN in place of one."""
        empty = np.ones(len(block.rows), bool) if names is None else (names == "").all(axis=1)
        for one in values.values():
            if one is not None:
                empty &= np.isnan(one).all(axis=1)
        for k in self._choice.values & block.arrays.keys() if empty.any() else ():
            empty &= are_blank(block.arrays[k])
        return empty

    def _place(self, values, names, block):
        """Values and names of as many places, values in the scale of their joint; values without a name are lost."""
        width = max(one.shape[1] for one in (names, *values.values()) if one is not None)
        names = _widen(names, width, "")
        for quantity, one in values.items():
            if one is None:
                continue
            one = _widen(one, width, np.nan)
            if quantity in self._choice.scale_of:
                one *= _factors(self._choice.scale_of[quantity], names, quantity)
            odd = (names == "") & ~np.isnan(one)
            if odd.any():
                k = int(np.argmax(odd.any(axis=1)))
                example, cause = f"{quantity} {one[k][odd[k]][0]:g}", "values without the name of a joint"
                self._losses.add(cause, block.where(k), "values left out", int(odd.sum()), example)
                one[odd] = np.nan
            values[quantity] = one
        return values, names


def is_text(kind):
    """Return whether a type of pyarrow is of texts."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return str(kind) in ("string", "large_string", "string_view", "binary", "large_binary", "binary_view")


def decoded(array):
    """Return an array without its dictionary."""
    return array.dictionary_decode() if pa.types.is_dictionary(array.type) else array


def read_texts(array):
    """Return texts, or lists of them; None of null, and of a text that is too long for a name, such as a picture."""
    return [_text(one) for one in array.to_pylist()]


def _text(value):
    if isinstance(value, list):
        return list(map(_text, value))
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    return value if value is None or len(value) <= MAX_TEXT else None


def number_of(text, decimal="."):
    """Return the number in a text, NaN of a sign of no value; None of any other text."""
    text = (text or "").strip()
    if text in MISSING:
        return np.nan
    if decimal == ",":
        text = "" if "." in text else text.replace(",", ".")
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def sample_column(column, texts):
    """Return a column with what its first texts show: lists of numbers, times, or names."""
    texts = tuple((text or "").strip() for text in texts)
    given = [text for text in texts if text not in MISSING]
    if any(number_of(text.replace(",", ".")) is not None or is_date(text) for text in given):
        return column._replace(dated=True, moments=all(map(is_date, given)))
    lists = [numbers_of(text) for text in given]
    if given and None not in lists and any(lists):
        return column._replace(width=max(map(len, lists)), listed=True, numeric=True)
    return column._replace(sample=texts, listed=bool(given) and all(text.endswith((")", "]")) for text in given))


def are_blank(array):
    """Return whether cells hold nothing, bool (n,): null, an empty list, or a text for it. NaN is a value."""
    if is_text(array.type):
        return np.array([(text or "").strip() in (*BLANK, "[]", "()") for text in read_texts(array)], bool)
    if hasattr(array, "value_lengths"):
        return array.value_lengths().fill_null(0).to_numpy(zero_copy_only=False) == 0
    return array.is_null().to_numpy(zero_copy_only=False)


def _widen(values, width, fill):
    return np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=fill)


def _factors(scale, names, quantity):
    """The scale of each value by its joint."""
    factors = {name: scale.get(name, scale.get(ALL)) for name in set(names.ravel().tolist())} | {"": 1.0}
    lacking = [name for name, factor in factors.items() if factor is None]
    if lacking:
        raise InputError(f"scale: {quantity} has nothing for '{min(lacking)}', which rows name. Add it, or \"*\".")
    return np.vectorize(factors.get, otypes=[float])(names)


class _JoinedRows:
    """Rows of single joints at one time as one row; the last time waits for its other rows."""

    def __init__(self, path):
        self._path, self._held, self._joint = path, None, None

    def add(self, columns):
        """Return all rows of times before the last one, or None."""
        self._require_order_of_time(columns)
        if self._held:
            pairs = zip(self._held, columns, strict=True)
            columns = Columns(*(None if a is None else np.concatenate([a, b]) for a, b in pairs))
        starts = _starts(columns)
        self._held = _part(columns, slice(starts[-1], None))
        return _join(_part(columns, slice(0, starts[-1])), starts[:-1]) if len(starts) > 1 else None

    def finish(self):
        """Return the rows of the last time, or None."""
        return _join(self._held, [0]) if self._held else None

    def _require_order_of_time(self, columns):
        """Reject rows in the order of joints: times start again with the second one."""
        for name, stamp, time in zip(columns.names[:, 0].tolist(), columns.stamp.tolist(), columns.time, strict=True):
            joint, last = self._joint or (name, stamp)
            if name != joint:
                if stamp < last:
                    raise InputError(
                        f"'{self._path}': rows are in the order of joints, '{joint}' before '{name}'; times begin again at "
                        f"{time:g} s. Sort the rows by time."
                    )
                self._require_order_of_time = lambda _: None
                return
            self._joint = name, stamp


def _starts(columns):
    """First row of each time: rows of one time that name different joints belong together."""
    starts, there, last = [], set(), None
    for k, (stamp, name) in enumerate(zip(columns.stamp.tolist(), columns.names[:, 0].tolist(), strict=True)):
        if stamp != last or name in there:
            starts.append(k)
            there, last = set(), stamp
        there.add(name)
    return starts


def _part(columns, which):
    return Columns(*(None if one is None else one[which] for one in columns))


def _join(columns, starts):
    """Rows from each start on as one."""
    counts = np.diff([*starts, len(columns.rows)])
    row = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(columns.rows)) - np.array(starts)[row]

    def widen(values, fill):
        if values is None:
            return None
        wide = np.full((len(starts), counts.max()), fill, values.dtype)
        wide[row, place] = values[:, 0]
        return wide

    values = [widen(one, np.nan) for one in columns[2:5]]
    return Columns(columns.time[starts], columns.stamp[starts], *values, columns.rows[starts], widen(columns.names, ""))
