# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands that are called in the test's process."""

import pytest

from diag_dynamics.numerics import progress


@pytest.fixture(autouse=True, scope="module")
def quiet_compiler():
    """Have the compiler say nothing on stderr, whatever is not compiled yet."""
    progress.set_progress_callback(lambda text: None)
    yield
    progress.set_progress_callback()
