# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in a recording that are not those of the robot: their map, and a proposal for one."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from itertools import product, takewhile

from diag_dynamics.exceptions import InputError
from diag_dynamics.text import listed

ANY = "*"  # the same text in a name of the recording and in that of the robot
MAX_NAMES = 100  # names of each side that a proposal is sought for


class JointNames:
    """A map from names in a recording to joints of a robot, with at most one ``*`` in each name.

    The entry that equals a name counts, otherwise the longest one with ``*`` that fits; other names
    stay.
    """

    def __init__(self, entries):
        if not isinstance(entries, Mapping) or not entries:
            raise InputError(
                f"joint_names is {entries!r}; expected a mapping such as "
                "{'fer_joint1': 'panda_joint1'}."
            )
        joints = {}
        for name, joint in entries.items():
            if not (isinstance(name, str) and isinstance(joint, str) and name and joint):
                text = f"joint_names maps {name!r} to {joint!r}"
                raise InputError(f"{text}; expected names of joints.")
            if max(name.count(ANY), joint.count(ANY)) > 1 or name.count(ANY) != joint.count(ANY):
                text = f"joint_names maps '{name}' to '{joint}'"
                raise InputError(f"{text}; expected one * in both names or in neither.")
            if ANY not in joint and joints.setdefault(joint, name) != name:
                text = f"joint_names maps '{joints[joint]}' and '{name}' to '{joint}'"
                raise InputError(f"{text}; expected one name for each.")
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
        """Compare the map with the joints of a recording, whose names are in `pieces`."""
        names = {}
        unused = set(self._entries)
        for piece in pieces:
            names |= dict.fromkeys(piece)
            fitting = {entry for entry in unused for name in names if _replace(entry, entry, name)}
            unused -= fitting
            if not unused:
                break
        robot = {*model.joint_names, *model.mimics, *model.followers, *model.locked_joints}
        for entry in self._entries if names else ():
            joints = {name: self.map_name(name) for name in names if self._entry(name) == entry}
            if entry in unused:
                text = f"has '{entry}', which is no joint of the recording"
                joints_text = f"Its joints are {listed(names)}.{suggest(entry, names)}"
                raise InputError(f"joint_names {text}. {joints_text}")
            if joints and not robot & set(joints.values()):
                name, joint = next(iter(joints.items()))
                text = f"maps '{name}' to '{joint}', which is no joint of robot '{model.name}'"
                joints_text = f"Its joints are {listed(model.joint_names)}.{suggest(joint, robot)}"
                raise InputError(f"joint_names {text}. {joints_text}")
        mapped = {}
        for name in names:
            joint = self.map_name(name)
            if joint in robot and mapped.setdefault(joint, name) != name:
                text = f"maps both '{mapped[joint]}' and '{name}' to joint '{joint}'"
                expected = "expected one name of the recording for each joint"
                raise InputError(f"joint_names {text}; {expected}.")

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


def complete_maps(names, missing, there, given):
    """Return tuples of entries that map as many names as possible to joints that are missing.

    `there` are joints that the recording has already; they get no second name. The tuples begin
    with the entries `given`. There are several if it is ambiguous, as for two arms.
    """
    completed = {}
    for entries, mapped in _combine_entries(names[:MAX_NAMES], missing[:MAX_NAMES]):
        whole = *given, *entries
        map_name = JointNames(dict(whole)).map_name
        targets = {name: map_name(name) for name in names}
        is_unique = len(dict(whole)) == len(whole) and not set(targets.values()) & set(there)
        if not is_unique or targets | mapped != targets:
            whole = *given, *mapped.items()
        completed[frozenset(whole)] = whole
    return list(completed.values())


def _combine_entries(names, joints):
    """Yield tuples of entries with ``*``, and the joints to which they lead by name."""
    for entry, mapped in _find_entries(names, joints):
        names_left = [name for name in names if name not in mapped]
        joints_left = [joint for joint in joints if joint not in mapped.values()]
        more = list(_combine_entries(names_left, joints_left))
        entries, more_joints = more[0] if len(more) == 1 else ((), {})
        yield (entry, *entries), mapped | more_joints


def _find_entries(names, joints):
    """Return the entries with ``*`` that map most names, and joints by name; several if ambiguous.

    Prefixes are compared first, then suffixes. An entry maps every name or joint, otherwise at
    least two and half of the joints.
    """
    for step in (1, -1):  # reversed texts for suffixes
        targets = {joint[::step]: joint for joint in joints}
        turned = {name[::step]: name for name in names}
        entries = {}
        for old, new in sorted({_heads(*pair) for pair in product(turned, targets)} - {None}):
            rests = [text[len(old) :] for text in turned if text.startswith(old)]
            fitting = [rest for rest in rests if new + rest in targets]
            mapped = tuple((turned[old + rest], targets[new + rest]) for rest in fitting)
            is_whole = len(mapped) in (len(joints), len(names))
            if is_whole or 2 * len(mapped) >= max(4, len(joints)):
                entries.setdefault(mapped, []).append((old + ANY, new + ANY))
        most = max(map(len, entries), default=0)
        if most:
            largest = [mapped for mapped in entries if len(mapped) == most]
            shortest = [min(entries[mapped]) for mapped in largest]
            texts = [(old[::step], new[::step]) for old, new in shortest]
            return list(zip(texts, map(dict, largest), strict=True))
    return []


def _heads(name, joint):
    """Return the texts before the longest common words at the end of two names, or None."""
    words = [re.findall(r"\d+|[^\W\d_]+|[\W_]", text) for text in (name, joint)]
    pairs = zip(*map(reversed, words), strict=False)
    common = [word for word, other in takewhile(lambda pair: pair[0] == pair[1], pairs)]
    if len(common) > 1 and not common[-1].isalnum() and len(common) < min(map(len, words)):
        common.pop()  # the separator goes with the words before it
    length = len("".join(common))
    return (name[:-length], joint[:-length]) if length else None
