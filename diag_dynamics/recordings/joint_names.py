# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in a recording that are not the robot's: their map, and a proposal for one."""

import re
from collections import Counter
from collections.abc import Mapping
from itertools import product
from os.path import commonprefix

from diag_dynamics.exceptions import InputError

ANY = "*"  # the same text in a name of the recording and in that of the robot
MAX_NAMES = 100  # names of each side that a proposal is sought for


class JointNames:
    """A map from names in a recording to joints of a robot, with at most one ``*`` in each name.

    The entry that equals a name counts, otherwise the longest one with ``*`` that fits; other names
    stay.
    """

    def __init__(self, entries):
        joints = {}
        if not isinstance(entries, Mapping) or not all(
            isinstance(name, str) and name for entry in entries.items() for name in entry
        ):
            raise InputError(
                f"joint_names is {entries!r}; expected a mapping of names such as "
                "{'fer_joint1': 'panda_joint1'}."
            )
        for name, joint in entries.items():
            if not name.count(ANY) == joint.count(ANY) <= 1:
                raise InputError(
                    f"joint_names maps '{name}' to '{joint}'; expected one * in both names or in "
                    "neither."
                )
            if ANY not in joint and joints.setdefault(joint, name) != name:
                raise InputError(
                    f"joint_names maps '{joints[joint]}' and '{name}' to '{joint}'; expected one "
                    "name for each."
                )
        self._entries = dict(
            sorted(entries.items(), key=lambda entry: (ANY in entry[0], -len(entry[0])))
        )

    def map_name(self, name):
        """Return the robot's name of a joint."""
        entry = self._entry(name)
        return _replace(entry, self._entries[entry], name) if entry else name

    def unmap_joint(self, joint):
        """Return the names that a recording may have for a joint of the robot."""
        names = [_replace(target, name, joint) for name, target in self._entries.items()]
        return [name for name in names if name and self.map_name(name) == joint] or [joint]

    @property
    def entries(self):
        """Pairs of a name and a joint."""
        return tuple(self._entries.items())

    def _entry(self, name):
        """Return the entry by which a name is mapped, or None."""
        return next((entry for entry in self._entries if _replace(entry, entry, name)), None)


SAME_NAMES = JointNames({})


def _replace(entry, target, name):
    """Return the name that `other` gives for one that fits an entry; None for one that does not."""
    match = re.fullmatch(re.escape(entry).replace(re.escape(ANY), "(.*)"), name, re.DOTALL)
    return target.replace(ANY, *match.groups()) if match and ANY in entry else match and target


def propose_map(names, missing, present, entries):
    """Return the entries and those that map names to missing joints; empty if unclear.

    One prefix in place of another explains them. Joints that are present keep their names.
    """
    entries = [entry for entry in entries if entry[1] not in missing]
    pairs = list(product(names[:MAX_NAMES], missing[:MAX_NAMES]))
    counts = {
        prefixes: count
        for prefixes, count in Counter(_split_prefixes(*pair) for pair in pairs).items()
        if count > 1 or "" in prefixes or len(pairs) == 1
    }
    most = [prefixes for prefixes, n in counts.items() if n == max(counts.values())]
    if len(most) != 1:
        return ()
    ((old, new),) = most
    targets = {name: new + name.removeprefix(old) for name in names if name.startswith(old)}
    is_renamed = any(joint.startswith(old) or joint in targets.values() for joint in present)
    if entries or len(targets) == 1 or is_renamed:
        return (*entries, *(pair for pair in targets.items() if pair[1] in missing))
    return ((old + ANY, new + ANY),)


def _split_prefixes(name, joint):
    """Return the texts before the longest common end of two names."""
    end = commonprefix([name[::-1], joint[::-1]])[::-1]  # noqa: RUF071  # no paths
    return name.removesuffix(end), joint.removesuffix(end)
