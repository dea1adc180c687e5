"""Rows of the arrays that compiled steps work on."""

DAMPING, FRICTION, STIFFNESS, LIMIT_DAMPING = range(4)
"""Rows of joint properties, one entry for each degree of freedom. A stiffness of inf is a hard limit."""

LOWER, UPPER = range(2)
"""Rows of position limits, one entry for each position coordinate."""

EFFORT_WORK, DAMPING_WORK, FRICTION_WORK, LIMIT_WORK, WRENCH_WORK, TAKEN, WORKS = range(7)
"""Entries of the work done on the robot [J], that of limits without what they store; then the number of steps taken."""

FREE, HELD = 0.0, 2.0
"""Modes of a degree of freedom in a step. 1 and −1 are sliding, one way and the other."""
