# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders of rosbag2: the files of a recording, which is one bag."""

import re
from collections import Counter
from contextlib import suppress
from functools import partial

import numpy as np

from diag_dynamics.bags.bag import Bag
from diag_dynamics.bags.compression import extra
from diag_dynamics.bags.files import KNOWN, begins_as_bag, is_named_as_bag, open_file
from diag_dynamics.bags.ordered import Source, in_order
from diag_dynamics.exceptions import InputError

METADATA = "metadata.yaml"
"""What rosbag2 writes into a folder when it has closed the recording."""


class BagFolder(Bag):
    """A folder of files of messages, which are one recording; see :class:`Bag`.

    Those are read that its metadata.yaml lists, renamed ones too; without one, all, in the order of their names and numbers.
    A topic of several files is one connection.
    """

    def __init__(self, path):
        super().__init__(path)
        self._told, self._signs = {}, {}  # of metadata.yaml: messages by topic; first time and messages by file
        self._bags, self._maps = [], []
        for file in self._files():
            bag = open_file(file)
            self._bags.append(bag)
            self._maps.append(self._mapped(bag.connections))
        self._gather()

    @property
    def start(self):
        """Log time [ns] that no message is before; None without messages."""
        return min((start for bag in self._bags if (start := bag.start) is not None), default=None)

    @property
    def misplaced(self):
        """See :class:`Bag`."""
        return any(bag.misplaced for bag in self._bags)

    def limit(self, begin=None, end=None):
        """See :class:`Bag`."""
        super().limit(begin, end)
        for bag in self._bags:
            bag.limit(begin, end)

    def starts(self, wanted):
        """See :class:`Bag`; empty if it is for one of the files."""
        found = []
        for bag, places in zip(self._bags, self._maps, strict=True):
            own = [k for k, place in enumerate(places) if place in set(wanted)]
            if own:
                found.append(bag.starts(own))
        return sorted(start for starts in found for start in starts) if all(found) else []

    def pieces(self, wanted=None):
        """Hand out messages in the order of their log time, those of the same time in the order of the files.

        Parameters
        ----------
        wanted : iterable of int, optional
            Indices into `connections`; without them all.

        Yields
        ------
        Messages
        """
        chosen, counts = self.chosen(wanted), Counter()
        sources = []
        for bag, places in zip(self._bags, self._maps, strict=True):
            own = [k for k, place in enumerate(places) if place in chosen]
            if own:
                start = bag.start
                sources.append(Source(0 if start is None else start, partial(_renamed, bag, own, places)))
        try:
            for piece in in_order(sources):
                counts.update(dict(enumerate(np.bincount(piece.connection))))
                yield piece
        finally:
            self._gather()
        if self.begin is None and self.end is None:
            self._compare(chosen, counts)

    def _files(self):
        """Paths of the files."""
        listed, names = self._listed(), self._names(is_named_as_bag)
        if not listed:
            names = names or self._names(lambda name: begins_as_bag(self.path / name))
            if not names:
                has = f"no {METADATA} and no" if listed is None else f"a {METADATA} that lists no files, and no"
                raise InputError(f"'{self.name}' has {has} bags in it; there are {KNOWN}.{self._inner()}")
            if listed is not None:
                self.find(f": {METADATA} lists no files. All bags in it are read, in the order of their names.")
            return [self.path / name for name in names]
        files = {name: self._stored(name) for name in listed}
        missing = [name for name, file in files.items() if file is None]
        others = [name for name in names if name not in files.values()]
        if missing:
            others = others or self._names(lambda name: name not in names and begins_as_bag(self.path / name))
            files |= self._renamed(missing, others, len(missing) == len(listed))
        for name, file in files.items():
            if file is None:
                self.lose(name, f"{METADATA} lists this file, which is not there")
        read = [file for file in files.values() if file is not None]
        if others := sorted(set(others) - set(read)):
            self.find(f": {METADATA} does not list {', '.join(others)}: not read.")
        return [self.path / file for file in read]

    def _names(self, wanted):
        """Names of the files in the folder for which a function is true, by their numbers."""
        try:
            return sorted(
                (one.name for one in self.path.iterdir() if one.is_file() and wanted(one.name)), key=_by_number
            )
        except OSError as error:
            raise InputError(f"'{self.name}' cannot be read: {error.strerror}.") from error

    def _inner(self):
        """A sentence with the folders in this one that are bags; empty without any."""
        names = sorted(path.parent.name for path in self.path.glob(f"*/{METADATA}"))
        return f" Is one of its folders meant: {', '.join(names[:8])}?" if names else ""

    def _stored(self, name):
        """Name of a listed file as it is in the folder, compressed or not; None if it is not there."""
        stored = name, f"{name}.zstd", name.removesuffix(".zstd")  # rosbag2 lists what it has, or had, compressed
        return next((one for one in stored if (self.path / one).is_file()), None)

    def _renamed(self, missing, others, is_every):
        """Return files with other names by the listed name that each had.

        A file is recognized by its first time, its topics and the number of its messages. Where none of the listed files is
        there (`is_every`), as many others are taken for them.

        Raises
        ------
        InputError
            None of the listed files is there, and it is not certain which others are meant.
        """
        signs = [self._signs.get(name) for name in missing]
        bags = {other: open_file(self.path / other) for other in others}
        found = {}
        for name, sign in zip(missing, signs, strict=True):
            alike = [other for other, bag in bags.items() if self._fits(bag, sign)] if signs.count(sign) == 1 else []
            if len(alike) == 1:
                (found[name],) = alike
        rest = [name for name in missing if name not in found]
        left = [other for other in others if other not in found.values()]
        if is_every and rest and left:
            if len(rest) != len(left):
                raise InputError(
                    f"'{self.name}': {METADATA} lists {', '.join(missing)}; the folder has {', '.join(others)} instead, and "
                    f"it is not certain which are meant. Give one file, or delete {METADATA} to read all of them."
                )
            found |= zip(rest, left, strict=True)
        for name, other in found.items():
            self.find(f": {METADATA} lists {name}, which is not there; {other} is read instead.")
        return found

    def _fits(self, bag, sign):
        """Whether a bag has the first time [ns] and the number of messages of a listed file, and no other topics."""
        if sign is None or bag.start != sign[0] or not {one.topic for one in bag.connections} <= self._told.keys():
            return False
        return sum(len(piece.at) for piece in bag.pieces()) == sign[1]

    def _listed(self):
        """Names of files that metadata.yaml lists; None without one that can be read."""
        try:
            text = (self.path / METADATA).read_text(encoding="utf-8")
        except FileNotFoundError:
            self.find(
                f" has no {METADATA}: its recorder was ended. All bags in it are read, in the order of their names."
            )
            return None
        except (OSError, UnicodeDecodeError) as error:
            self._find_damage(error)
            return None
        yaml = extra("yaml")
        try:
            told = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))["rosbag2_bagfile_information"]
            listed = [_last_part(name) for name in told["relative_file_paths"]]
            for topic in told.get("topics_with_message_count") or ():
                self._told[str(topic["topic_metadata"]["name"])] = int(topic["message_count"])
            self._signs = _signs(told, listed)
        except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
            self._find_damage(error)
            return None
        return list(dict.fromkeys(listed))

    def _find_damage(self, error):
        self._told, self._signs = {}, {}
        what = " ".join(str(error).split()) or type(error).__name__
        self.find(f": {METADATA} is damaged ({what}). All bags in the folder are read, in the order of their names.")

    def _mapped(self, connections):
        """Places of a file's connections among all of them: of one topic, those of several writers are told apart."""
        places, taken = [], set()
        for one in connections:
            alike = (k for k, other in enumerate(self.connections) if k not in taken and other[:3] == one[:3])
            place = next(alike, None)
            if place is None:
                place = len(self.connections)
                self.connections.append(one)
            elif one.definition and not self.connections[place].definition:
                self.connections[place] = one
            taken.add(place)
            places.append(place)
        return places

    def _gather(self):
        """Take over what the files have not given, and what is odd about them."""
        for bag in self._bags:
            self.unread += [lost for lost in bag.unread if lost not in self.unread]
            self.findings += [finding for finding in bag.findings if finding not in self.findings]

    def _compare(self, chosen, counts):
        """Say which topics have less or more messages than metadata.yaml tells of."""
        found = Counter()
        for k, connection in enumerate(self.connections):
            if k in chosen:
                found[connection.topic] += counts[k]
        for topic, told in self._told.items():
            complete = {k for k, one in enumerate(self.connections) if one.topic == topic} <= chosen
            if complete and (topic in found or told) and found[topic] != told:
                self.find(f": {METADATA} tells of {told} messages of '{topic}', and {found[topic]} are there.")


def _renamed(bag, own, places):
    """Pieces of a file, with the places that its connections have in the folder."""
    places = np.array(places, np.int64)
    for piece in bag.pieces(own):
        yield piece._replace(connection=places[piece.connection])


def _last_part(path):
    """Return the name of a file that metadata.yaml lists, whatever system has written its path."""
    return str(path).replace("\\", "/").rpartition("/")[2]


def _signs(told, listed):
    """Return first time [ns] and number of messages of files by name, as far as metadata.yaml has them."""
    signs = {}
    for file in told.get("files") or ([told | {"path": listed[0]}] if len(listed) == 1 else []):
        with suppress(KeyError, TypeError, AttributeError):
            signs[_last_part(file["path"])] = file["starting_time"]["nanoseconds_since_epoch"], file["message_count"]
    return signs


def _by_number(name):
    """Key by which `bag_10` comes behind `bag_9`."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
