# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders of rosbag2: the files of a recording, which is one bag."""

import re
from collections import Counter
from functools import partial

import numpy as np

from diag_dynamics.bags.bag import Bag
from diag_dynamics.bags.compression import extra
from diag_dynamics.bags.files import KNOWN, is_named_as_bag, open_file
from diag_dynamics.bags.ordered import Source, in_order
from diag_dynamics.exceptions import InputError

METADATA = "metadata.yaml"
"""What rosbag2 writes into a folder when it has closed the recording."""


class BagFolder(Bag):
    """A folder of files of messages, which are one recording; see :class:`Bag`.

    Those are read that its metadata.yaml lists; without one, all, in the order of their names and numbers. A topic of several
    files is one connection.
    """

    def __init__(self, path):
        super().__init__(path)
        self._told = {}  # numbers of messages, by topic, as metadata.yaml has them
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
        try:
            names = sorted((path.name for path in self.path.iterdir() if is_named_as_bag(path.name)), key=_by_number)
        except OSError as error:
            raise InputError(f"'{self.name}' cannot be read: {error.strerror}.") from error
        listed = self._listed()
        if listed is None:
            if not names:
                raise InputError(f"'{self.name}' has no {METADATA} and no bags in it; there are {KNOWN}.")
            return [self.path / name for name in names]
        files = []
        for name in listed:
            # rosbag2 lists what it has not compressed yet, or what it has.
            there = next(
                (one for one in (name, f"{name}.zstd", name.removesuffix(".zstd")) if (self.path / one).is_file()), None
            )
            if there is None:
                self.lose(name, f"{METADATA} lists this file, which is not there")
            else:
                files.append(self.path / there)
        others = sorted(set(names) - {file.name for file in files})
        if others:
            self.find(f": {METADATA} does not list {', '.join(others)}: not read.")
        return files

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
            listed = [str(name).replace("\\", "/").rpartition("/")[2] for name in told["relative_file_paths"]]
            for topic in told.get("topics_with_message_count") or ():
                self._told[str(topic["topic_metadata"]["name"])] = int(topic["message_count"])
        except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
            self._find_damage(error)
            return None
        return listed

    def _find_damage(self, error):
        self._told = {}
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


def _by_number(name):
    """Key by which `bag_10` comes behind `bag_9`."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
