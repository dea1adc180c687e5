# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in a recording that are not those of the robot: their map, and a proposal for one."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from itertools import product, takewhile
from shlex import quote

from diag_dynamics.exceptions import InputError
from diag_dynamics.text import listed

ANY = "*"  # the same text in a name of the recording and in that of the robot
MAX_NAMES = 100  # names of each side that a proposal is sought for


class JointNames:
    """A map from names in a recording to joints of a robot, with at most one ``*`` in each name.

    The entry that equals a name counts, otherwise the longest one with ``*`` that fits; other names
    stay.
    """

    def __init__(self, entries, where="joint_names"):
        if not isinstance(entries, Mapping) or not entries:
            raise InputError(
                f"{where} is {entries!r}; expected a mapping such as {{'fer_joint1': 'panda_joint1'}}."
            )
        joints = {}
        for name, joint in entries.items():
            if not (isinstance(name, str) and isinstance(joint, str) and name and joint):
                raise InputError(f"{where} maps {name!r} to {joint!r}; expected names of joints.")
            if max(name.count(ANY), joint.count(ANY)) > 1 or name.count(ANY) != joint.count(ANY):
                raise InputError(
                    f"{where} maps '{name}' to '{joint}'; expected one * in both names or in neither."
                )
            if ANY not in joint and joints.setdefault(joint, name) != name:
                raise InputError(
                    f"{where} maps '{joints[joint]}' and '{name}' to '{joint}'; expected one name for each."
                )
        self._where = where
        self._entries = dict(
            sorted(entries.items(), key=lambda entry: (ANY in entry[0], -len(entry[0])))
        )

    def map_name(self, name):
        """Return the robot's name of a joint."""
        entry = self._entry(name)
        return _replace(entry, self._entries[entry], name) if entry else name

    def unmap_joint(self, joint):
        """Return the names that a recording may have for a joint of the robot."""
        names = [_replace(other, name, joint) for name, other in self._entries.items()]
        return [name for name in names if name and self.map_name(name) == joint] or [joint]

    def check_recording(self, pieces, model):
        """Compare the map with the joints of a recording; return the names that were read from `pieces`."""
        names = {}
        for some in pieces:
            names |= dict.fromkeys(some)
            if all(any(_replace(entry, entry, name) for name in names) for entry in self._entries):
                break
        robot, mapped = (
            {*model.joint_names, *model.mimics, *model.followers, *model.locked_joints},
            {},
        )
        for entry in self._entries if names else ():
            own = {name: self.map_name(name) for name in names if self._entry(name) == entry}
            if not any(_replace(entry, entry, name) for name in names):
                found = f"has '{entry}', which is no joint of the recording. Its joints are {listed(names)}."
                raise InputError(f"{self._where} {found}{suggest(entry, names)}")
            if own and not robot & set(own.values()):
                name, joint = next(iter(own.items()))
                found = f"maps '{name}' to '{joint}', which is no joint of robot '{model.name}'. Its joints are"
                raise InputError(
                    f"{self._where} {found} {listed(model.joint_names)}.{suggest(joint, robot)}"
                )
        for name in names:
            joint = self.map_name(name)
            if joint in robot and mapped.setdefault(joint, name) != name:
                raise InputError(
                    f"{self._where} maps both '{mapped[joint]}' and '{name}' to joint '{joint}'; expected one name of "
                    "the recording for each joint."
                )
        return list(names)

    @property
    def entries(self):
        """Pairs of a name and a joint."""
        return tuple(self._entries.items())

    def _entry(self, name):
        """Return the entry by which a name is mapped, or None."""
        return next((entry for entry in self._entries if _replace(entry, entry, name)), None)


def suggest(name, names):
    """Return a question with the name that is nearest to another one, or an empty text."""
    near = get_close_matches(name, names, n=1)
    return f" Is '{near[0]}' meant?" if near else ""


def _replace(entry, other, name):
    """Return the name that `other` gives for one that fits an entry; None for one that does not."""
    match = re.fullmatch(re.escape(entry).replace(re.escape(ANY), "(.*)"), name, re.DOTALL)
    return other.replace(ANY, *match.groups()) if match and ANY in entry else match and other


def propose_maps(names, joints):
    """Return entries with ``*`` that map names of a recording to joints; several if ambiguous, as for two arms.

    Prefixes are compared first, then suffixes. An entry maps every name or joint, otherwise at
    least two and half of them.
    """
    names, joints = list(names)[:MAX_NAMES], list(joints)[:MAX_NAMES]
    for turn in (str, lambda text: text[::-1]):
        turned, wanted = [turn(name) for name in names], {turn(joint) for joint in joints}
        whole, part = {}, {}
        for old, new in {_heads(name, joint) for name, joint in product(turned, wanted)} - {None}:
            own = [(name, new + name[len(old) :]) for name in turned if name.startswith(old)]
            own = tuple(pair for pair in own if pair[1] in wanted)
            entry = turn(old + ANY), turn(new + ANY)
            if own and len(own) in (len(wanted), len(turned)):
                whole.setdefault(own, []).append(entry)
            elif 2 * len(own) >= max(4, len(wanted)):
                part.setdefault(own, []).append(entry)
        if whole or part:
            return sorted(
                min(alike, key=lambda entry: (len(entry[0]), entry))
                for alike in (whole or part).values()
            )
    return []


def complete_maps(names, missing, there, given):
    """Return tuples of entries that map as many names as possible to joints that are missing.

    `there` are joints that the recording has already; they get no second name. The tuples begin
    with the entries `given`. There are several if it is ambiguous.
    """
    completed = {}
    for entries, mapped in _combine_maps(names, missing):
        whole = *given, *entries
        map_name = JointNames(dict(whole)).map_name
        targets = {name: map_name(name) for name in names}
        expected = targets | mapped
        is_unique = len(dict(whole)) == len(whole) and not set(targets.values()) & set(there)
        if not is_unique or targets != expected:
            whole = *given, *mapped.items()
        completed[frozenset(whole)] = whole
    return list(completed.values())


def _combine_maps(names, missing):
    """Yield tuples of entries with ``*``, and the joints to which they lead by name."""
    for entry in propose_maps(names, missing):
        targets = {name: _replace(*entry, name) for name in names}
        mapped = {name: joint for name, joint in targets.items() if joint in missing}
        others = [name for name in names if name not in mapped]
        more = list(_combine_maps(others, [j for j in missing if j not in mapped.values()]))
        entries, joints = more[0] if len(more) == 1 else ((), {})
        yield (entry, *entries), mapped | joints


def describe_maps(found, names, joints):
    """Return tuples of entries as options, in a sentence without its point, and joints by name.

    `joints` are all those of the robot. The first tuple maps.
    """
    texts = [" ".join(quote(f"{name}={joint}") for name, joint in one) for one in found]
    options = " or ".join(f"--joint-names {text}" for text in texts)
    mapped = {name: JointNames(dict(found[0])).map_name(name) for name in names}
    count = sum(joint in joints for joint in mapped.values())
    which = "them" if count == len(mapped) else f"{count} of them"
    return f"{options} (joint_names) maps {which} to the robot's joints", mapped


def _heads(name, joint):
    """Return what stands before the longest common words at the end of two names; None without any."""
    words = [re.findall(r"\d+|[^\W\d_]+|[\W_]", text) for text in (name, joint)]
    pairs = zip(*map(reversed, words), strict=False)
    common = [word for word, other in takewhile(lambda pair: pair[0] == pair[1], pairs)]
    if not common:
        return None
    alone = min(map(len, words)) == len(common)
    if not (
        alone or len(common) == 1 or common[-1].isalnum()
    ):  # the separator goes with what is before it
        common.pop()
    return tuple("".join(some[: len(some) - len(common)]) for some in words)
