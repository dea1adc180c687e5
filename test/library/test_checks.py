# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that are wrong are refused by name and value; those that are right come back as plain numbers."""

import numpy as np
import pytest

from diag_dynamics import checks
from diag_dynamics.exceptions import InputError

NAMES = ("shoulder", "elbow")

NO_NUMBERS = (None, "1", b"1", True, [1.0, "2"], [[1.0], [2.0, 3.0]], {}, 1j, object)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_what_is_no_number_is_refused_everywhere(value):
    assert checks.array_of(value) is None
    for check in (
        lambda: checks.number("x", value, "a number"),
        lambda: checks.numbers("x", value, (2,), "two numbers"),
        lambda: checks.vector("x", value, NAMES),
        lambda: checks.per_name("x", value, NAMES),
    ):
        with pytest.raises(InputError, match=r"^x (is .*, expected |has nothing for )"):
            check()


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2.0), np.int64(2), np.array(2.0)], ids=repr)
def test_a_number_of_any_kind_is_a_float(value):
    for x in (checks.number("x", value, "a number"), checks.positive("x", value, "[s]")):
        assert type(x) is float and x == 2.0
    assert checks.per_name("x", value, NAMES).tolist() == [2.0, 2.0]


@pytest.mark.parametrize(
    ("check", "said"),
    [
        (lambda: checks.positive("rate", 0.0, "[1/s]"), "rate is 0.0, expected a finite number > 0 [1/s]."),
        (lambda: checks.positive("rate", np.inf, "[1/s]"), "rate is inf, expected a finite number > 0 [1/s]."),
        (lambda: checks.positive("rate", [1.0], "[1/s]"), "rate is [1.0], expected a finite number > 0 [1/s]."),
        (lambda: checks.not_negative("dt", -1, "[s]"), "dt is -1, expected a finite number >= 0 [s]."),
        (lambda: checks.number("step", "0", "a number", unit=" s"), "step is '0' s, expected a number."),
        (lambda: checks.choice("frame", "x", ("a", "b")), "frame is 'x', expected one of 'a', 'b'."),
        (lambda: checks.whole("size", True), "size is True, expected a whole number >= 1."),
        (lambda: checks.whole("size", 0), "size is 0, expected a whole number >= 1."),
        (lambda: checks.mapping("f_ext", 1), "f_ext is 1, expected a dict by name."),
        (lambda: checks.instance("x", 1, str), "x is 1, expected a str."),
        (lambda: checks.numbers("p", [1, np.nan], (2,), "two"), "p is [1, nan], expected two."),
        (lambda: checks.numbers("p", [1, -9], (2,), "two", 5.0), "p is [1, -9], expected two, none beyond ±5."),
        (lambda: checks.vector("q", [1.0, np.nan], NAMES), "q of joint 'elbow' is nan, expected a finite number."),
        (
            lambda: checks.vector("q", [1.0], NAMES),
            "q is [1.0], expected 2 finite numbers, one for each degree of freedom.",
        ),
        (lambda: checks.per_name("k", [1, -2], NAMES), "k of 'elbow' is -2.0, expected a finite number > 0."),
        (
            lambda: checks.per_name("k", [1, 2, 3], NAMES),
            "k is [1, 2, 3], expected a finite number > 0, or 2 such: one for each of shoulder, elbow.",
        ),
    ],
)
def test_what_is_said_of_wrong_ones(check, said):
    with pytest.raises(InputError) as caught:
        check()
    assert str(caught.value) == said


def test_what_comes_back_is_a_copy():
    given = np.array([1.0, 2.0])
    copies = (
        checks.numbers("p", given, (2,), "two"),
        checks.vector("q", given, NAMES),
        checks.per_name("k", given, NAMES),
    )
    assert not any(np.shares_memory(given, copy) for copy in copies)
    assert not copies[2].flags.writeable
