"""What compiled steps find where: rows of the arrays that they are given."""

DAMPING, FRICTION, STIFFNESS, LIMIT_DAMPING = range(4)
"""Rows of what joints are like, one entry for each degree of freedom. A stiffness of inf is that of a hard limit."""

LOWER, UPPER = range(2)
"""Rows of position limits, one entry for each position coordinate."""

EFFORT_WORK, DAMPING_WORK, FRICTION_WORK, LIMIT_WORK, WRENCH_WORK, TAKEN, WORKS = range(7)
"""Entries of what work has been done on the robot [J], that of limits without what they store; and how many steps taken."""

FREE, HELD = 0.0, 2.0
"""What a degree of freedom does in a step; it slides one way or the other at 1 or −1."""
