"""Explained share of the change of energy, and what it says in words: of recordings, and of a monitor's last minute."""

WINDOW = 0.1
"""Length of a window [s]: shorter ones have the noise of velocities in dK/dt, longer ones average what is wrong away."""

MAX_GAP = 0.1
"""Time without states beyond which a window begins anew [s]."""

LEAST = 20
"""Windows without which nothing is said."""

NOTHING, PART = 0.3, 0.8
"""Explained shares below which the balance explains nothing, and only a part."""


def explained_share(residual, change, count):
    """1 − var(residual) / var(change) of so many windows, from the two variances; None without windows enough."""
    return float(1.0 - residual / change) if count >= LEAST and change > 0.0 else None


def judgement(explained, total, culprits=()):
    """What the balance says, in words.

    Parameters
    ----------
    explained, total : float or None
        Explained share of dK/dt, and of d(K + U)/dt; None without windows enough.
    culprits : sequence of str
        Joints at which most of the residual is.

    Returns
    -------
    str
        Empty without windows enough.
    """
    if explained is None:
        return ""
    where = f"; most of what is missing is at {', '.join(culprits)}" if culprits else ""
    if explained >= PART:
        return f"the efforts explain {explained:.0%} of the change of kinetic energy"
    remedy = "check the unit of efforts, friction, rotor inertias, payload (docs/recordings.md)"
    if total is not None and total >= PART and explained < NOTHING:
        return (
            f"kinetic energy changes less than what is not explained; of kinetic and potential energy together the "
            f"efforts explain {total:.0%}: for more, {remedy}"
        )
    if explained >= NOTHING:
        return f"the efforts explain only {explained:.0%} of the change of kinetic energy: {remedy}{where}"
    return f"the balance explains nothing ({explained:.2g}): {remedy}{where}"
