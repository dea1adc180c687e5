# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Your own URDF: python own_urdf.py my.urdf; warnings say what is wrong with it."""

import sys

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

path = sys.argv[1] if len(sys.argv) > 1 else find_urdf("kinova")
try:
    model = dd.load_urdf(path)
except dd.MasslessLinkError:  # joints that move nothing: hold them
    model = dd.load_urdf(path, massless="lock")
print(model)
