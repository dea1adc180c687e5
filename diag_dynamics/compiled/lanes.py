# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers side by side: eight in a vector register, or a single one where all is compiled plainly."""

from diag_dynamics.compiled.switch import PLAIN

if PLAIN:
    from diag_dynamics.compiled.single import (
        EIGHT,
        WIDTH,
        from_lane,
        lane_of,
        lanes_at,
        nought,
        record_of_lanes,
        set_lanes,
        set_lanes_from,
        spreader,
        with_lane,
    )
else:
    from diag_dynamics.compiled.registers import (
        EIGHT,
        WIDTH,
        from_lane,
        lane_of,
        lanes_at,
        nought,
        record_of_lanes,
        set_lanes,
        set_lanes_from,
        spreader,
        with_lane,
    )

__all__ = [
    "EIGHT",
    "WIDTH",
    "from_lane",
    "lane_of",
    "lanes_at",
    "nought",
    "record_of_lanes",
    "set_lanes",
    "set_lanes_from",
    "spreader",
    "with_lane",
]
