# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External wrenches on links, as records :data:`records.WRENCH`."""

import numpy as np

from diag_dynamics.checks import array_of, choice, mapping, numbers
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps.records import WRENCH

_NUMBERS = "six finite numbers, force [N] then moment [N m]"


def wrenches_on_links(model, f_ext, frame):
    """Return a record for each link of `f_ext`: six numbers by link name, in the axes of "link" or "world"."""
    return _records(model, f_ext, frame, (), _NUMBERS)


def wrenches_on_links_of_many(model, f_ext, frame, count):
    """Return the records of many states, state by state; six numbers for all of them, or an array of shape (count, 6)."""
    expected = f"{_NUMBERS}, or ({count}, 6) of them: a row for each state"
    return _records(model, f_ext, frame, (count,), expected)


def _records(model, f_ext, frame, states, expected):
    choice("frame", frame, ("link", "world"))
    mapping("f_ext", f_ext)
    records = np.zeros((*(states or (1,)), len(f_ext)), WRENCH)
    for k, (name, given) in enumerate(f_ext.items()):
        if name not in model.link_names:
            raise InputError(f"f_ext: '{name}' is not a link of robot '{model.name}'.")
        array = array_of(given)
        if array is None or array.shape not in ((6,), (*states, 6)) or not np.isfinite(array).all():
            raise InputError(f"f_ext on link '{name}' is {given!r}, expected {expected}.")
        wrenches = np.broadcast_to(array, (len(records), 6))
        records[:, k] = wrenches_at(model, name, wrenches, (0.0, 0.0, 0.0), frame)
    return records.reshape(-1)


def wrenches_at(model, link, wrenches, point, frame):
    """Return records of wrenches, shape (number, 6), at a point of one link [m], from its origin and in its axes."""
    choice("frame", frame, ("link", "world"))
    point = numbers("point", point, (3,), "three finite numbers [m]")
    body, placement = model.placement_in_body(link)
    turn = np.eye(3) if frame == "world" else placement[:3, :3]
    records = np.zeros(len(wrenches), WRENCH)
    records["body"], records["point"] = body, placement[:3, 3] + placement[:3, :3] @ point
    records["force"], records["moment"] = wrenches[:, :3] @ turn.T, wrenches[:, 3:] @ turn.T
    return records
