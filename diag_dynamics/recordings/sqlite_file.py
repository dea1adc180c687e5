# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""SQLite files of rosbag2 (.db3), by Python's sqlite3."""

import shutil
import sqlite3
import tempfile
from collections import Counter
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from urllib.parse import quote

from diag_dynamics.recordings.messages import LAST_TIME, Messages, Stream

ROWS = 2000
"""Messages that are read together."""
HEAD = (16, 2), (24, 4), (28, 4), (92, 4)
"""Place and length of page size, number of changes, number of pages, and changes when that was written."""


class SqliteFile:
    """A SQLite file. What a killed recorder left in a journal is read in a copy, so that no file changes.

    `declarations` are (topic, type, encoding, definition, MD5 sum) of its topics, without the last two.
    """

    def __init__(self, path, name, notes):
        self._path, self._name, self._notes = Path(path), name, notes
        self._lose, self._advice = partial(notes.add_damage, name), f"`sqlite3 {name} .recover` may find more"
        self.declarations, self._topics, self.start, self._copy = [], {}, 0, None
        self._copy_if_needed()
        with closing(self._open()) as database:
            try:
                for key, *declaration in database.execute("SELECT id, name, type, serialization_format FROM topics"):
                    self._topics[key] = len(self.declarations)
                    self.declarations.append((*map(str, declaration), "", ""))
            except sqlite3.Error as error:
                self._lose("table topics", f"{error}: {self._path.stat().st_size} bytes; {self._advice}")
            with suppress(sqlite3.Error):  # of an index: messages may be readable
                (start,) = database.execute("SELECT MIN(timestamp) FROM messages").fetchone()
                self.start = start if isinstance(start, int | None) else 0

    def streams(self, wanted):
        """Yield the stream of messages of some declarations."""
        topics = {key: k for key, k in self._topics.items() if k in wanted}
        if topics:
            yield Stream(self.start or 0, LAST_TIME, partial(self._read_messages, topics))

    def _copy_if_needed(self):
        """Copy a file with a journal, and one that ends within a page, the rest of which SQLite takes for zeros."""
        journals = [path for end in ("-wal", "-journal") if _has_content(path := Path(f"{self._path}{end}"))]
        with open(self._path, "rb") as file:
            head, size = file.read(100).ljust(100, b"\0"), file.seek(0, 2)
        page, changes, pages, valid = (int.from_bytes(head[at : at + n], "big") for at, n in HEAD)
        rest = size % page if page > 1 else 0
        if journals or rest:
            self._copy = tempfile.TemporaryDirectory(prefix="diag_dynamics-")
            for path in (self._path, *journals):
                shutil.copy(path, self._copy.name)
        if journals:
            self._notes.add_finding(self._name, " has a journal: its recorder was ended. What is in it is read, too.")
            return
        if rest:
            with open(Path(self._copy.name) / self._path.name, "r+b") as file:
                file.truncate(size - rest)
        if changes == valid and size < pages * page:
            self._lose(f"byte {size}", f"the file is cut: {pages * page - size} bytes; {self._advice}")

    def _open(self):
        """Return a connection to the database."""
        path = Path(self._copy.name) / self._path.name if self._copy else self._path.absolute()
        uri = f"file:{quote(str(path))}" + ("" if self._copy else "?mode=ro&immutable=1")
        database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        database.execute("PRAGMA writable_schema = ON")  # else SQLite does not open a file that is cut
        database.text_factory = lambda text: text.decode("utf-8", "backslashreplace")
        return database

    def _read_messages(self, topics):
        """Yield messages by log time; behind damage, those that a scan of the table reads."""
        others, last = [key for key in self._topics if key not in topics], (-1, -1)
        lost, errors = Counter(), []
        where = f"WHERE topic_id NOT IN ({', '.join('?' * len(others))})"
        with closing(self._open()) as database:
            for rows in _read_rows(database, f"{where} ORDER BY timestamp, id", others, errors):
                if rows and isinstance(rows[-1][0], int):
                    last = rows[-1][:2]
                yield from self._convert(rows, topics, lost)
            if errors:
                what = f": SQLite says '{errors[0]}', and messages are read in the order of their numbers."
                self._notes.add_finding(self._name, what)
                for rows in _read_rows(database, f"NOT INDEXED {where} ORDER BY id", others, errors):
                    rows = [row for row in rows if isinstance(row[0], int) and row[:2] > last]
                    last = max([last, *(row[:2] for row in rows)])
                    yield from self._convert(rows, topics, lost)
                if len(errors) > 1:
                    self._lose("table messages", f"{errors[1]}: all behind message {last[1]}; {self._advice}")
        for what, count in lost.items():
            self._lose("table messages", f"{count} messages {what}")

    def _convert(self, rows, topics, lost):
        """Yield the Messages of rows; count those that are none."""
        good = [
            (topics[topic], time, data)
            for time, _, topic, data in rows
            if topic in topics and isinstance(data, bytes) and isinstance(time, int)
        ]
        if len(good) < len(rows):
            unknown = sum(row[2] not in self._topics for row in rows)
            lost["are of topics that are not listed"] += unknown
            lost["have no bytes, or no time that int64 can hold"] += len(rows) - len(good) - unknown
        if good:
            yield Messages.from_rows(*zip(*good, strict=True))


def _read_rows(database, condition, values, errors):
    """Yield lists of rows; append the error that ends them to a list."""
    rows = []
    try:
        for row in database.execute(f"SELECT timestamp, id, topic_id, data FROM messages {condition}", values):
            rows.append(row)
            if len(rows) == ROWS:
                yield rows
                rows = []
    except sqlite3.Error as failure:
        errors.append(failure)
    yield rows


def _has_content(path):
    return path.is_file() and path.stat().st_size > 0
