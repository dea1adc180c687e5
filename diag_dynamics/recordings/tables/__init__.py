# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of joint states: CSV and the like, Parquet, and npz. Here is what needs no pyarrow."""

import os
import re


def is_dataset(path):
    """Return whether a path is a dataset of LeRobot, or an episode ``FOLDER#3`` of one."""
    return os.path.isfile(os.path.join(re.sub(r"#\d+$", "", path), "meta", "info.json"))


def split_paths(path):
    """Return the paths of ``a.csv+b.csv``, tables side by side; a file of that name is one path."""
    path = os.path.expanduser(path)
    return [path] if os.path.exists(path) else list(map(os.path.expanduser, path.split("+")))
