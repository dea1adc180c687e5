# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of rosbag2 in SQLite, ``.db3``, by Python's own sqlite3: a damaged one is read row by row."""

import os
import shutil
import sqlite3
import struct
import tempfile
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

import numpy as np

from diag_dynamics.bags.bag import Bag
from diag_dynamics.bags.compression import inflated
from diag_dynamics.bags.messages import Connection, Messages, normalize_type

_PIECE, _ROWS = 1 << 20, 1 << 14  # most bytes and most messages of a piece, and one more message
_JOURNALS = "-wal", "-journal"
_SIZES = (">H", 16), (">II", 24), (">I", 92)  # size of pages; changes, number of pages; changes when that was written
_MOST_ID = (1 << 63) - 1


class SqliteFile(Bag):
    """A file of rosbag2 in SQLite; see :class:`Bag`.

    Nothing is written beside it. What a recorder that was ended has left in a journal is read in a copy; so is a file that is
    cut within a page, the rest of which SQLite would take for zeros.
    """

    def __init__(self, path, name=None):
        super().__init__(path, name)
        self._copy, self._topics = None, {}
        with self.opened() as file:
            self._size = file.seek(0, 2)
            file.seek(0)
            begin = file.read(100)
        self._copy_if_needed(begin)
        with self._database() as database:
            self._survey(database)

    def _copy_if_needed(self, begin):
        """Look at the first bytes, and make a copy where the file cannot be read as it is."""
        journals = [f"{self.path}{end}" for end in _JOURNALS if _has_content(f"{self.path}{end}")]
        page = told = rest = 0
        if len(begin) == 100:
            (page,), (changes, told), (valid,) = (struct.unpack_from(kind, begin, at) for kind, at in _SIZES)
            page = 1 << 16 if page == 1 else page
            told = told if changes == valid else 0  # else what wrote last has not written the number of pages
            rest = self._size % page if page else 0
        if journals or rest:
            self._copy = tempfile.TemporaryDirectory(prefix="diag_dynamics-")
            for one in (self.path, *journals):
                shutil.copy(one, self._copy.name)
        if journals:
            self.find(" has a journal: its recorder was ended. What is in it is read, too.")
            return
        if rest:
            os.truncate(Path(self._copy.name) / self.path.name, self._size - rest)
        if page and self._size // page < told:
            self.lose(f"byte {self._size}", f"the file is cut: {told * page - self._size} bytes")

    @property
    def start(self):
        """Log time [ns] that no message is before; None without messages that can be read."""
        with self._database() as database:
            try:
                (start,) = database.execute("SELECT MIN(timestamp) FROM messages").fetchone()
            except sqlite3.Error:
                start = 0
        return start if isinstance(start, int) or start is None else 0

    def pieces(self, wanted=None):
        """Hand out messages in the order of their log time, those of the same time as they were recorded.

        Parameters
        ----------
        wanted : iterable of int, optional
            Indices into `connections`; without them all.

        Yields
        ------
        Messages
        """
        chosen = self.chosen(wanted)
        topics = {key: k for key, k in self._topics.items() if k in chosen}
        if not topics:
            return
        with self._database() as database:
            gathered = _Gathered(topics, set(self._topics) - set(topics))
            for row in self._rows(database, topics):
                if gathered.add(row):
                    yield gathered.take()
            if gathered.count:
                yield gathered.take()
            if gathered.unknown:
                self.lose("table messages", f"{gathered.unknown} messages are of topics that are not listed")
            if gathered.odd:
                self.lose("table messages", f"{gathered.odd} messages have no bytes, or no time that int64 can hold")

    @contextmanager
    def _database(self):
        path = Path(self._copy.name) / self.path.name if self._copy else self.path.absolute()
        uri = f"file:{quote(str(path))}" + ("" if self._copy else "?mode=ro&immutable=1")
        database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        database.execute("PRAGMA writable_schema = ON")  # else SQLite does not look at a file that is cut
        database.text_factory = lambda text: text.decode("utf-8", "backslashreplace")
        try:
            yield database
        finally:
            database.close()

    def _survey(self, database):
        if self._size == 0:
            self.lose("byte 0", "the file is empty")
            return
        try:
            topics = _table(database, "topics")
        except sqlite3.Error as error:
            self.lose("table topics", f"{error}: {self._size} bytes")
            return
        definitions = {}
        try:
            if database.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
                for row in _table(database, "message_definitions"):
                    if row["encoding"] == "ros2msg":
                        definitions[row["topic_type"]] = row["encoded_message_definition"]
            for row in topics:
                name, kind, encoding = row["name"], row["type"], row["serialization_format"]
                self._topics[row["id"]] = len(self.connections)
                definition = str(definitions.get(kind, ""))
                self.connections.append(Connection(str(name), normalize_type(str(kind)), str(encoding), definition))
        except sqlite3.Error as error:
            self.lose("table message_definitions", str(error))
        except KeyError as error:
            self.lose("table topics", f"it has no column {error}")

    def _rows(self, database, topics):
        """Rows (id, topic, time, data) in the order of time; where SQLite gives up, those that can be had one by one."""
        last, count = None, 0
        places = "" if len(topics) == len(self._topics) else f"WHERE topic_id IN ({', '.join('?' * len(topics))})"
        query = f"SELECT id, topic_id, timestamp, data FROM messages {places} ORDER BY timestamp, id"
        try:
            for row in database.execute(query, tuple(topics) if places else ()):
                yield row
                last, count = (row[2], row[0]), count + 1
        except sqlite3.Error as error:
            self.find(f": SQLite says '{error}', and messages are read one by one.")
            yield from self._salvaged(database, last)

    def _salvaged(self, database, last):
        """Rows behind the last one, by time and id, of what can still be read."""
        keys = sorted(
            key for key in self._readable(database) if isinstance(key[0], int) and (last is None or key > last)
        )
        failed = 0
        for _, key in keys:
            try:
                row = database.execute(
                    "SELECT id, topic_id, timestamp, data FROM messages WHERE id = ?", (key,)
                ).fetchone()
            except sqlite3.Error:
                failed += 1
            else:
                if row is not None:
                    yield row
        if failed:
            self.lose("table messages", f"the data of {failed} messages cannot be read")

    def _readable(self, database):
        """Time and id of all rows that can be read, by id."""
        found, last = [], -1
        while True:
            try:
                for key, time in database.execute(
                    "SELECT id, timestamp FROM messages WHERE id > ? ORDER BY id", (last,)
                ):
                    found.append((time, key))
                    last = key
                return found
            except sqlite3.Error:
                behind = _next_readable(database, last)
                if behind is None:
                    self.lose("table messages", f"messages behind number {last} cannot be read")
                    return found
                if behind[0] > last + 1:
                    self.lose("table messages", f"messages {last + 1} to {behind[0] - 1} cannot be read")
                found.append((behind[1], behind[0]))
                last = behind[0]


class _Gathered:
    """Rows that become a piece."""

    def __init__(self, topics, others):
        self._topics, self._others = topics, others
        self.unknown, self.odd = 0, 0
        self._begin()

    def _begin(self):
        self._rows, self._bytes = [], 0

    @property
    def count(self):
        """Number of messages."""
        return len(self._rows)

    def add(self, row):
        """Take a row in; True if there are enough."""
        _, topic, time, data = row
        connection = self._topics.get(topic)
        if connection is None:
            self.unknown += topic not in self._others
        elif not isinstance(data, bytes) or not isinstance(time, int):
            self.odd += 1
        else:
            self._rows.append((connection, len(data), time, data))
            self._bytes += len(data)
        return self._bytes >= _PIECE or len(self._rows) >= _ROWS

    def take(self):
        """Messages of the rows, which are forgotten."""
        connection, size, log_time, data = zip(*self._rows, strict=True)
        connection, size, log_time = (np.array(column, np.int64) for column in (connection, size, log_time))
        self._begin()
        data = np.frombuffer(b"".join(data), np.uint8)
        return inflated(Messages(data, connection, np.cumsum(size) - size, size, log_time))


def _has_content(path):
    try:
        return Path(path).stat().st_size > 0
    except OSError:
        return False


def _table(database, name):
    """All rows of a table, by the names of its columns, which differ from release to release."""
    cursor = database.execute(f"SELECT * FROM {name}")
    return [dict(zip([column[0] for column in cursor.description], row, strict=True)) for row in cursor]


def _next_readable(database, last):
    """Id and time of the first row behind a place that cannot be read: it is between steps that double. None if none is."""

    def first(key):
        try:
            return database.execute(
                "SELECT id, timestamp FROM messages WHERE id >= ? ORDER BY id LIMIT 1", (key,)
            ).fetchone()
        except sqlite3.Error:
            return _BAD

    bad, step = last, 1
    good = first(last + 1)
    while good is _BAD:
        bad, step = last + step, 2 * step
        if last + step > _MOST_ID:
            return None
        good = first(last + step)
    high = last + step
    while high - bad > 1:
        middle = (bad + high) // 2
        row = first(middle)
        if row is _BAD:
            bad = middle
        else:
            high, good = middle, row
    return good


_BAD = object()
