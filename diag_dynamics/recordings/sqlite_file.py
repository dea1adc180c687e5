# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""SQLite files of rosbag2 (.db3), by Python's sqlite3."""

import shutil
import sqlite3
import tempfile
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from urllib.parse import quote

from diag_dynamics.recordings.messages import Connection, Messages

ROWS = 2000
"""Messages that are read together."""
TOPICS = "SELECT id, name, type, serialization_format FROM topics"


class SqliteFile:
    """A SQLite file. What a killed recorder left in a journal is read in a copy: no file changes."""

    def __init__(self, path, name, notes):
        self._path, self._lose = Path(path), partial(notes.add_damage, name)
        self._advice = f"`sqlite3 {name} .recover` may find more"
        self.connections, self._topics, self.start, self._copy = [], {}, None, None
        if journals := [one for end in ("-wal", "-journal") if _has_content(one := f"{path}{end}")]:
            self._copy = tempfile.TemporaryDirectory(prefix="diag_dynamics-")
            for one in (path, *journals):
                shutil.copy(one, self._copy.name)
            what = " has a journal: its recorder was ended. What is in it is read, too."
            notes.add_finding(name, what)
        try:
            with closing(self._open()) as database:
                for key, *declaration in database.execute(TOPICS):
                    self._topics[key] = len(self.connections)
                    self.connections.append(Connection(*map(str, declaration)))
        except sqlite3.Error as error:
            size = self._path.stat().st_size
            self._lose("database", f"{error}: {size} bytes; {self._advice}")
        with suppress(sqlite3.Error), closing(self._open()) as database:
            (start,) = database.execute("SELECT MIN(timestamp) FROM messages").fetchone()
            self.start = start if isinstance(start, int) else None

    def parts(self, wanted):
        """Yield (first log time, last one, function that returns Messages) in their order."""
        topics = {key: k for key, k in self._topics.items() if k in wanted}
        for rows in self._read_rows(topics) if topics else ():
            messages = Messages.from_rows(rows)
            yield rows[0][1], rows[-1][1], lambda messages=messages: messages

    def _read_rows(self, topics):
        """Yield lists of (connection, log time, content)."""
        marks = ", ".join("?" * len(topics))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY timestamp, id"
        rows, lost, time = [], 0, None
        with closing(self._open()) as database:
            try:
                for key, time, data in database.execute(query, list(topics)):
                    if not isinstance(data, bytes) or not isinstance(time, int):
                        lost += 1
                        continue
                    rows.append((topics[key], time, data))
                    if len(rows) == ROWS:
                        yield rows
                        rows = []
            except sqlite3.Error as error:
                self._lose("table messages", f"{error}: all behind log time {time}; {self._advice}")
        if rows:
            yield rows
        if lost:
            what = f"{lost} messages have no bytes, or no time that int64 can hold"
            self._lose("table messages", what)

    def _open(self):
        """Return a connection to the database."""
        path = Path(self._copy.name) / self._path.name if self._copy else self._path.absolute()
        uri = f"file:{quote(str(path))}" + ("" if self._copy else "?mode=ro&immutable=1")
        database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        database.text_factory = lambda text: text.decode("utf-8", "backslashreplace")
        return database


def _has_content(path):
    return Path(path).is_file() and Path(path).stat().st_size > 0
