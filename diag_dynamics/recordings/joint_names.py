# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in a recording that are not those of the robot: their map, and a proposal for one."""

from collections.abc import Mapping
from difflib import get_close_matches
from itertools import product, takewhile

from diag_dynamics.exceptions import InputError

ANY = "*"
"""Stands for the same text in a name of the recording and in that of the robot."""

FEW = 8
"""Names that a text has."""

MAX_NAMES = 100
"""Names of each side that a proposal is sought for."""


class JointNames:
    """A map from the names of joints in a recording to those of the robot.

    A name is mapped by the entry that equals it, otherwise by the longest one with ``*`` that fits. Without such an entry it
    stays as it is.

    Parameters
    ----------
    entries : mapping of str to str
        Both names of an entry have one ``*``, or neither has.
    where : str
        Source of the map, for errors.

    Raises
    ------
    InputError
        An entry is not possible, or two are of one joint.
    """

    def __init__(self, entries, where="joint_names"):
        if not isinstance(entries, Mapping) or not entries:
            raise InputError(f"{where} is {entries!r}; expected a mapping such as {{'fer_joint1': 'panda_joint1'}}.")
        joints = {}
        for name, joint in entries.items():
            if not (isinstance(name, str) and isinstance(joint, str) and name and joint):
                raise InputError(f"{where} maps {name!r} to {joint!r}; expected names of joints.")
            if max(name.count(ANY), joint.count(ANY)) > 1 or name.count(ANY) != joint.count(ANY):
                raise InputError(f"{where} maps '{name}' to '{joint}'; expected one * in both names or in neither.")
            if ANY not in joint and joints.setdefault(joint, name) != name:
                raise InputError(
                    f"{where} maps '{joints[joint]}' and '{name}' to '{joint}'; expected one name for each."
                )
        self._entries, self._where = dict(entries), where
        self._patterns = sorted((name for name in entries if ANY in name), key=len, reverse=True)

    def map_name(self, name):
        """Return the robot's name of a joint."""
        return _replaced(entry, self._entries[entry], name) if (entry := self._entry(name)) else name

    def unmap_joint(self, joint):
        """Return the recording's name of a joint of the robot."""
        for name, other in sorted(self._entries.items(), key=lambda entry: (ANY in entry[0], -len(entry[1]))):
            if _fits(other, joint) and self.map_name(found := _replaced(other, name, joint)) == joint:
                return found
        return joint

    def check_recording(self, pieces, model):
        """Compare the map with the joints of a recording, of which no more is read than necessary.

        Parameters
        ----------
        pieces : iterable of iterables of str
            Names of joints in the recording.
        model : RobotModel

        Returns
        -------
        list of str
            Names of joints in the recording, as far as it was read.

        Raises
        ------
        InputError
            An entry names no joint of the recording or of the robot, or two names are mapped to one joint.
        """
        names = {}
        for some in pieces:
            names |= dict.fromkeys(some)
            if all(any(_fits(entry, name) for name in names) for entry in self._entries):
                break
        robot, mapped = {*model.joint_names, *model.mimics, *model.locked_joints}, {}
        for entry in self._entries if names else ():
            self._check_entry(entry, names, robot, model)
        for name in names:
            joint = self.map_name(name)
            if joint in robot and mapped.setdefault(joint, name) != name:
                raise InputError(
                    f"{self._where} leads from '{mapped[joint]}' and from '{name}' to joint '{joint}'; expected one name "
                    "of the recording for each joint."
                )
        return list(names)

    def _check_entry(self, entry, names, robot, model):
        if not any(_fits(entry, name) for name in names):
            near = get_close_matches(entry, names, n=1)
            raise InputError(
                f"{self._where} has '{entry}', which is no joint of the recording. Its joints are {listed(names)}."
                f"{f' Is {near[0]!r} meant?' if near else ''}"
            )
        own = {name: self.map_name(name) for name in names if self._entry(name) == entry}
        if own and not robot & set(own.values()):
            name, joint = next(iter(own.items()))
            near = get_close_matches(joint, robot, n=1)
            raise InputError(
                f"{self._where} maps '{name}' to '{joint}', which is no joint of robot '{model.name}'. Its joints are "
                f"{listed(model.joint_names)}.{f' Is {near[0]!r} meant?' if near else ''}"
            )

    def _entry(self, name):
        """Return the entry by which a name is mapped, or None."""
        if name in self._entries and ANY not in name:
            return name
        return next((entry for entry in self._patterns if _fits(entry, name)), None)


def listed(names):
    """Return some names as a text."""
    names = list(map(str, names))
    return ", ".join(names[:FEW]) + (f" and {len(names) - FEW} more" if len(names) > FEW else "")


def propose_maps(names, joints):
    """Return entries with ``*`` that each map names of a recording to joints of a robot.

    Prefixes are compared first, then suffixes. An entry leads to every joint, or from every name; without such an entry, to
    two joints or more and half of them.

    Parameters
    ----------
    names, joints : sequence of str
        Without those that are alike on both sides.

    Returns
    -------
    list of tuple
        Both names of an entry, and the number of joints it leads to. Two or more where it is not certain which is meant, as
        for two arms.
    """
    names, joints = list(names)[:MAX_NAMES], list(joints)[:MAX_NAMES]
    for turn in (str, _reversed):
        turned, wanted = [turn(name) for name in names], {turn(joint) for joint in joints}
        whole, part = {}, {}
        for old, new in {_heads(name, joint) for name, joint in product(turned, wanted)} - {None}:
            own = {name: new + name[len(old) :] for name in turned if name.startswith(old)}
            own = {name: joint for name, joint in own.items() if joint in wanted}
            entry = turn(old + ANY), turn(new + ANY), len(own)
            if own and len(own) in (len(wanted), len(turned)):
                whole.setdefault(tuple(sorted(own.items())), set()).add(entry)
            elif 2 * len(own) >= max(4, len(wanted)):
                part.setdefault(tuple(sorted(own.items())), set()).add(entry)
        if whole or part:
            return sorted(min(alike, key=lambda entry: (len(entry[0]), entry)) for alike in (whole or part).values())
    return []


def describe_maps(found, names, joints):
    """Return entries of :func:`propose_maps` as a sentence without its point.

    Parameters
    ----------
    found : list of tuple
    names, joints : iterable of str
        Names of the recording, and all joints of the robot.
    """
    options = " or ".join(f"--joint-names '{name}={joint}'" for name, joint, _ in found)
    names, (entry, joint, _) = list(names), found[0]
    count = sum(_fits(entry, name) and _replaced(entry, joint, name) in joints for name in names)
    which = "they" if count == len(names) else f"{count} of them"
    return f"With {options} (joint_names) {which} are the robot's"


def _fits(entry, name):
    """Return whether a name is an entry, or an entry with * fits it."""
    head, star, tail = entry.partition(ANY)
    if not star:
        return entry == name
    return len(name) >= len(head) + len(tail) and name.startswith(head) and name.endswith(tail)


def _replaced(entry, other, name):
    """Return the name that `other` gives for one that fits an entry."""
    head, star, tail = entry.partition(ANY)
    return other.replace(ANY, name[len(head) : len(name) - len(tail)]) if star else other


def _reversed(text):
    return text[::-1]


def _heads(name, joint):
    """Return what stands before the longest common end of two names, None without one that begins with a word."""
    pairs = zip(_reversed(name), _reversed(joint), strict=False)
    common = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    for k in range(common, 0, -1):
        at, there = len(name) - k, len(joint) - k
        if _begins_word(name, at) and _begins_word(joint, there):
            if at and there and k > 1 and not name[at].isalnum():  # the separator goes with what is before it
                at, there = at + 1, there + 1
            return name[:at], joint[:there]
    return None


def _begins_word(text, at):
    """Return whether a word or a number begins at a place, or ends before it."""
    if at == 0 or not (text[at - 1].isalnum() and text[at].isalnum()):
        return True
    return text[at - 1].isdigit() != text[at].isdigit()
