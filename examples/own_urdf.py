# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Your own URDF: what is in it, and what is wrong with it (python own_urdf.py my.urdf)."""

import sys
import warnings

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

path = sys.argv[1] if len(sys.argv) > 1 else find_urdf("kinova")
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    try:
        model = dd.load_urdf(path)
    except dd.MasslessLinkError as error:  # joints that move nothing: hold them
        print(error)
        model = dd.load_urdf(path, massless="lock")
for warning in told:
    print(warning.message)
print(model)
for name, lower, upper, effort in zip(
    model.dof_names, model.lower, model.upper, model.effort_limit, strict=False
):
    print(f"  {name:28}[{lower:7.2f}, {upper:7.2f}]  effort up to {effort:g}")
