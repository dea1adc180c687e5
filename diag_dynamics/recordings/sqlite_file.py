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

from diag_dynamics.recordings.messages import Connection, group_rows


class SqliteFile:
    """A SQLite file. What a killed recorder left in a journal is read in a copy: no file changes."""

    def __init__(self, path, name, notes):
        self._path, self._lose = Path(path).absolute(), partial(notes.add_damage, name)
        self._advice = f"`sqlite3 {name} .recover` may find more"
        self.connections, self._topics, self.start, self._copy = [], {}, None, None
        journals = [Path(f"{self._path}{end}") for end in ("-wal", "-journal")]
        if journals := [one for one in journals if one.is_file() and one.stat().st_size]:
            self._copy = tempfile.TemporaryDirectory(prefix="diag_dynamics-")
            for one in (path, *journals):
                shutil.copy(one, self._copy.name)
            notes.add_oddity(name, " has a journal: its recorder was killed or still records. It is read, too.")
        try:
            with closing(self._open()) as database:
                for key, *declaration in database.execute("SELECT id, name, type, serialization_format FROM topics"):
                    self._topics[key] = len(self.connections)
                    self.connections.append(Connection(*map(str, declaration)))
        except sqlite3.Error as error:
            size = self._path.stat().st_size
            is_empty = not size and not self._copy
            self._lose("database", "the file is empty" if is_empty else f"{error}: {size} bytes; {self._advice}")
        with suppress(sqlite3.Error), closing(self._open()) as database:
            (start,) = database.execute("SELECT MIN(timestamp) FROM messages").fetchone()
            self.start = start if isinstance(start, int) else None

    def parts(self, wanted):
        """Yield (first log time, last one, function that returns Messages) in their order."""
        topics = {key: k for key, k in self._topics.items() if k in wanted}
        return group_rows(self._read_rows(topics)) if topics else ()

    def _read_rows(self, topics):
        """Yield (connection, log time, content) of each message."""
        marks, lost, time = ", ".join("?" * len(topics)), 0, None
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY timestamp, id"
        with closing(self._open()) as database:
            try:
                for key, time, data in database.execute(query, list(topics)):
                    if isinstance(data, bytes) and isinstance(time, int):
                        yield topics[key], time, data
                    else:
                        lost += 1
            except sqlite3.Error as error:
                self._lose("table messages", f"{error}: all after log time {time}; {self._advice}")
        if lost:
            self._lose("table messages", f"{lost} messages have no bytes, or no log time in int64")

    def _open(self):
        """Return a connection to the database."""
        path, options = self._path, "?mode=ro&immutable=1"
        if self._copy:
            path, options = f"{self._copy.name}/{self._path.name}", ""
        database = sqlite3.connect(f"file:{quote(str(path))}{options}", uri=True, check_same_thread=False)
        database.text_factory = lambda text: text.decode("utf-8", "backslashreplace")
        return database
