# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is said of a push: delays, bounds and spans as they are, and every reason why a demonstration has failed."""

import matplotlib.image
import numpy as np
import pytest

from diag_dynamics.views.push_history import Moment, PushHistory, Seen

ONSET, END, STEP = 1.0, 2.0, 2e-3


def history(delay=0.02, late=0.05, energy=0.25, limited=True):
    """Return a push of one second, seen `delay` after it began and until `late` after its end."""
    made = PushHistory(30.0, 0.25, 8.0, 4.0)
    made.onset, made.end = ONSET, END
    for t in np.arange(0.0, 4.0, STEP):
        pushed = ONSET <= t <= END
        made.moments.append(Moment(t, energy if pushed else 0.0, limited and pushed, 0.1 if pushed else 1e-3))
        seen = delay is not None and ONSET + delay <= t <= END + late
        made.seen.append(Seen(t, 20.0 if seen else 0.5, seen))
    return made


def test_summary():
    made = history(delay=0.021, late=0.05)
    assert not made.failures()
    push, norm, energy, limiter, hand = made.summary()
    assert push == "push of 30 N for 1.00 s: collision seen after 22 ms, over 52 ms after its end"
    assert norm == "|r| at most 20.0 J^½/s, before the push 0.5, threshold 8"
    assert energy == "K at most 0.2500 J, its bound 0.25 J (+0.0 %)"
    assert limiter == "while pushed the limiter acted on 100 % of the commands"
    assert max(map(len, made.summary())) < 80
    assert hand == "hand moved by 100 mm, and back to within 1.0 mm"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"delay": None}, "not seen"),
        ({"delay": 1.01}, "not seen"),
        ({"delay": -0.1}, "100 ms before there was a push"),
        ({"late": 10.0}, "never over"),
        ({"energy": 0.27}, "K rose to 0.27 J, beyond its bound"),
        ({"limited": False}, "limiter had nothing to do"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_failures(options, reason):
    (line,) = history(**options).failures()
    assert reason in line


def test_a_little_beyond_the_bound_is_none():
    assert not history(energy=0.255).failures()


def test_no_push():
    made = history()
    made.end = None
    assert made.failures() and PushHistory(30.0, 0.25, 8.0, 4.0).failures()


def test_picture(tmp_path):
    """The spans of push, collision and limiter are where they belong: a strip's colour has the width of its time."""
    made = history(delay=0.5, late=0.5)
    made.picture(tmp_path / "push.png", "a push")
    image = (matplotlib.image.imread(tmp_path / "push.png")[..., :3] * 255).astype(int)
    widths = {}
    for name, color in {"collision": "e8998d", "limiter": "5fb3ce"}.items():
        wanted = [int(color[k : k + 2], 16) for k in (0, 2, 4)]
        rows = (np.abs(image - wanted).max(axis=2) < 4).sum(axis=1)
        widths[name] = rows.max()
    # Both last one second here, as far as sampling goes: the strips are equally long.
    assert widths["collision"] > 100
    assert widths["limiter"] == pytest.approx(widths["collision"], abs=3)
