# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How loading grows with the description, and what is refused before it costs anything."""

import sys
from itertools import pairwise

import pytest

import diag_dynamics as dd
from diag_dynamics.model import robot as loader
from diag_dynamics.model import urdf
from diag_dynamics.model.robot import MAX_COUPLED
from diag_dynamics.model.urdf import MAX_JOINTS
from robots import description, joint, link

SMALL = 60


def robot(count, parent=lambda k: k - 1, leader=lambda k: None, kind="revolute"):
    """Return as many joints; -1 for a parent is the root, and None for a leader is nobody."""
    parts = [link("l-1")]
    for k in range(count):
        element = joint(f"j{k}", kind, f"l{parent(k)}", f"l{k}", axis=(0, 0, 1))
        if leader(k) is not None:
            element = element.replace("</joint>", f'<mimic joint="j{leader(k)}" multiplier="-1"/></joint>')
        parts += [link(f"l{k}", 1.0, (0.1, 0.2, 0.3), (0.1, 0, 0, 0.1, 0, 0.1)), element]
    return description("grown", *parts)


def star(_):
    """Every link hangs on the root."""
    return -1


def previous(k):
    """Every joint follows the one before."""
    return k - 1 if k else None


def odd(k):
    """Every other joint follows the one before."""
    return k - 1 if k % 2 else None


SHAPES = {
    "chain": {},
    "chain of fixed joints": {"kind": "fixed"},
    "star": {"parent": star},
    "pairs in a chain": {"leader": odd},
    "pairs in a star": {"parent": star, "leader": odd},
    "a leader of all, in a chain": {"leader": lambda k: 0 if k else None},
    "a leader of all, in a star": {"parent": star, "leader": lambda k: 0 if k else None},
    "a chain of leaders, in a chain": {"leader": previous},
    "a chain of leaders, in a star": {"parent": star, "leader": previous},
    "one group after the other, all of them in one": {"leader": lambda k: k // 2 if k else None},
}


def lines(text, **options):
    """Count the lines of this package that loading runs, a loop's once for each turn; and calls of all other functions."""
    count = 0

    def trace(frame, event, _):
        nonlocal count
        count += 1
        ours = "diag_dynamics" in frame.f_code.co_filename
        return trace if ours else None

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        dd.load_urdf(text, **options)
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize("shape", SHAPES)
def test_loading_grows_with_the_number_of_joints(shape):
    """Twice the joints, twice the lines that are run: what a group costs by nature is compiled, and not counted here."""
    counts = [lines(robot(n, **SHAPES[shape]), max_coupled=4 * SMALL) for n in (SMALL, 2 * SMALL, 4 * SMALL)]
    assert all(more < 2.3 * less for less, more in pairwise(counts)), counts


@pytest.fixture
def untouched(monkeypatch):
    """Fail where a description is worked on that should have been refused."""

    def never(*_):
        raise AssertionError("this should have been refused before")

    def refuse(module, name):
        monkeypatch.setattr(module, name, never)

    return refuse


@pytest.mark.parametrize(
    "shape", [shape for shape in SHAPES if "chain of leaders" in shape or "leader of all" in shape]
)
def test_large_groups_are_refused_before_they_are_evaluated(shape, untouched):
    """Each evaluation takes time as the cube of a group's size; how large it may be can be said."""
    untouched(loader, "massless_freedoms")
    count = MAX_COUPLED + 1
    with pytest.raises(
        dd.MimicJointError, match=rf"of {count} coupled joints.*no more than {MAX_COUPLED} .*max_coupled"
    ):
        dd.load_urdf(robot(count, **SHAPES[shape]))
    with pytest.raises(dd.MimicJointError, match=r"of 11 bodies, and no more than 10 "):
        dd.load_urdf(robot(11, **SHAPES[shape]), max_coupled=10)


def test_what_is_carried_within_a_group_counts_with_its_freedoms():
    """A floating joint between two coupled ones has six."""
    parts = [link(name, 1.0, (0.1, 0.2, 0.3), (0.1, 0, 0, 0.1, 0, 0.1)) for name in "abcd"]
    follower = joint("follower", "revolute", "c", "d", axis=(0, 0, 1))
    follower = follower.replace("</joint>", '<mimic joint="leader"/></joint>')
    leader = joint("leader", "revolute", "a", "b", axis=(0, 0, 1))
    text = description("six", *parts, leader, joint("free", "floating", "b", "c"), follower)
    assert dd.load_urdf(text, max_coupled=8).nv == 7
    with pytest.raises(dd.MimicJointError, match="a group of 3 coupled joints, 'leader' to 'follower', of 8 bodies"):
        dd.load_urdf(text, max_coupled=7)


def test_locking_may_not_make_a_group_that_is_too_large():
    """The bounds are those of the load; a model that is made of another one keeps them, through a pickle, too."""
    model = dd.load_urdf(robot(6, leader=odd), max_coupled=2)
    assert model.with_locked_joints({"j0": 0.1}).nv == 2
    assert model._options.max_coupled == 2


@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_more_joints_than_asked_for_are_refused_before_they_are_looked_at(kind, untouched):
    text = robot(MAX_JOINTS + 1, kind=kind)
    untouched(urdf, "_add_links")
    with pytest.raises(dd.UrdfError, match=rf"{MAX_JOINTS + 1} joints .*no more than {MAX_JOINTS} joints .*max_joints"):
        dd.load_urdf(text)


def test_links_without_joints_count_as_well(untouched):
    untouched(urdf, "_add_links")
    with pytest.raises(dd.UrdfError, match=r"0 joints and 5 links, and no more than 3 joints"):
        dd.load_urdf(description("scattered", *map(link, "abcde")), max_joints=3)


def test_bounds_can_be_raised_and_lowered():
    text = robot(MAX_COUPLED + 20, parent=star, leader=previous)
    assert dd.load_urdf(text, max_coupled=MAX_COUPLED + 20).nv == 1
    assert dd.load_urdf(robot(5), max_joints=5).nv == 5
    with pytest.raises(dd.UrdfError, match=r"has 5 joints .* no more than 4"):
        dd.load_urdf(robot(5), max_joints=4)


@pytest.mark.parametrize("name", ["max_joints", "max_coupled"])
@pytest.mark.parametrize("value", [0, -1, 2.5, "many", None, True])
def test_bounds_are_whole_numbers(name, value):
    with pytest.raises(dd.InputError, match=f"{name} is .*, expected a whole number >= 1"):
        dd.load_urdf(robot(1), **{name: value})
