# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External wrenches: on which link each acts, and for how long."""

from collections import Counter

import numpy as np

from diag_dynamics.exceptions import RejectedError
from diag_dynamics.simulation.drives import ROUNDING


class Pushes:
    """Wrenches on links, each held until another one on its link comes, or for some time.

    Parameters
    ----------
    links : sequence of str
        Links of the robot.
    timeout : float
        How long a wrench holds in simulated time [s]; 0: until the next one on its link.

    Attributes
    ----------
    counts : Counter
        Wrenches received, and rejected by cause.
    last_rejection : str
    """

    def __init__(self, links, timeout):
        self._links, self.timeout = frozenset(links), timeout
        self.counts, self.last_rejection = Counter(), ""
        self.forget()

    def forget(self):
        """Let nobody push."""
        self._held = {}

    def push(self, message, time):
        """Take over a WrenchStamped, whose frame_id is a link, at a simulated time [s].

        Raises
        ------
        RejectedError
            There is no such link, or a number is not finite; nothing changes then.
        """
        self.counts["wrenches received"] += 1
        link, f, n = message.header.frame_id, message.wrench.force, message.wrench.torque
        if link not in self._links:
            raise self._rejected("unknown link", f"header.frame_id '{link}' is no link of this robot")
        wrench = np.array([f.x, f.y, f.z, n.x, n.y, n.z])
        if not np.isfinite(wrench).all():
            raise self._rejected("not finite", f"wrench on '{link}' is {wrench.tolist()}, expected finite numbers")
        if wrench.any():
            self._held[link] = wrench, time
        else:
            self._held.pop(link, None)

    def _rejected(self, cause, message):
        self.counts[f"wrenches rejected: {cause}"] += 1
        self.last_rejection = message
        return RejectedError(cause, message)

    def at(self, time):
        """Wrenches by link at a simulated time [s], force first; empty without any."""
        if self.timeout:
            self._held = {link: held for link, held in self._held.items() if time - held[1] < self.timeout - ROUNDING}
        return {link: wrench for link, (wrench, _) in self._held.items()}
