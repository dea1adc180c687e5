# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Opening of bags, whatever they are."""

from pathlib import Path

from diag_dynamics.bags.files import open_file
from diag_dynamics.bags.folder import BagFolder


def open_bag(path):
    """Open a file or a folder of messages.

    Parameters
    ----------
    path : path

    Returns
    -------
    Bag

    Raises
    ------
    InputError
        There is none, it is of a kind that is not known, or a package that it needs is not installed.
    """
    path = Path(path)
    return BagFolder(path) if path.is_dir() else open_file(path)
