# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External wrenches on links, as records for the sweeps."""

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.checks import array_of, choice, mapping, numbers
from diag_dynamics.exceptions import InputError


def wrenches_on_links(model, f_ext, frame):
    """Records of external wrenches for the sweeps: see :data:`sweeps.WRENCH`.

    Parameters
    ----------
    f_ext : dict
        Force [N] and moment [N m] at the link's origin, six numbers, by link name.
    frame : {"link", "world"}
        Axes they are in.
    """
    choice("frame", frame, ("link", "world"))
    mapping("f_ext", f_ext)
    records = np.zeros(len(f_ext), sweeps.WRENCH)
    for k, (name, wrench) in enumerate(f_ext.items()):
        if name not in model.link_names:
            raise InputError(f"f_ext: '{name}' is not a link of robot '{model.name}'.")
        wrench = numbers(f"f_ext on link '{name}'", wrench, (6,), "six finite numbers, force [N] then moment [N m]")
        records[k] = wrenches_at(model, name, wrench[None], (0.0, 0.0, 0.0), frame)[0]
    return records


def wrenches_on_links_of_many(model, f_ext, frame, count):
    """Records of external wrenches at many states, those of each state next to each other; see :func:`wrenches_on_links`.

    Parameters
    ----------
    f_ext : dict
        By link name, six numbers for all states, or an array of shape (count, 6).
    """
    choice("frame", frame, ("link", "world"))
    mapping("f_ext", f_ext)
    records = np.zeros((count, len(f_ext)), sweeps.WRENCH)
    for k, (name, given) in enumerate(f_ext.items()):
        if name not in model.link_names:
            raise InputError(f"f_ext: '{name}' is not a link of robot '{model.name}'.")
        array = array_of(given)
        if array is None or array.shape not in ((6,), (count, 6)) or not np.isfinite(array).all():
            expected = f"six finite numbers, force [N] then moment [N m], or ({count}, 6) of them: a row for each state"
            raise InputError(f"f_ext on link '{name}' is {given!r}, expected {expected}.")
        wrenches = np.broadcast_to(array, (count, 6))
        records[:, k] = wrenches_at(model, name, wrenches, (0.0, 0.0, 0.0), frame)
    return records.reshape(-1)


def wrenches_at(model, link, wrenches, point, frame):
    """Records of wrenches, shape (number, 6), that act at a point of one link: see :data:`sweeps.WRENCH`.

    Parameters
    ----------
    point : array_like, shape (3,)
        From the link's origin, in its axes [m].
    frame : {"link", "world"}
        Axes of the wrenches.
    """
    choice("frame", frame, ("link", "world"))
    point = numbers("point", point, (3,), "three finite numbers [m]")
    body, placement = model.placement_in_body(link)
    turn = np.eye(3) if frame == "world" else placement[:3, :3]
    records = np.zeros(len(wrenches), sweeps.WRENCH)
    records["body"], records["point"] = body, placement[:3, 3] + placement[:3, :3] @ point
    records["force"], records["moment"] = wrenches[:, :3] @ turn.T, wrenches[:, 3:] @ turn.T
    return records
