# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""ARK4(3)6L[2]SA, a pair of Runge–Kutta methods of order 4 with one set of weights (Kennedy and Carpenter 2003).

One is explicit, the other implicit, L-stable and stiffly accurate. Applied Numerical Mathematics 44.
"""

import numpy as np

STAGES = 6
GAMMA = 0.25

EXPLICIT = np.zeros((STAGES, STAGES))
EXPLICIT[1, :1] = [1 / 2]
EXPLICIT[2, :2] = [13861 / 62500, 6889 / 62500]
EXPLICIT[3, :3] = [
    -116923316275 / 2393684061468,
    -2731218467317 / 15368042101831,
    9408046702089 / 11113171139209,
]
EXPLICIT[4, :4] = [
    -451086348788 / 2902428689909,
    -2682348792572 / 7519795681897,
    12662868775082 / 11960479115383,
    3355817975965 / 11060851509271,
]
EXPLICIT[5, :5] = [
    647845179188 / 3216320057751,
    73281519250 / 8382639484533,
    552539513391 / 3454668386233,
    3354512671639 / 8306763924573,
    4040 / 17871,
]

WEIGHTS = np.array([82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4])

IMPLICIT = np.zeros((STAGES, STAGES))
IMPLICIT[1, :2] = [1 / 4, GAMMA]
IMPLICIT[2, :3] = [8611 / 62500, -1743 / 31250, GAMMA]
IMPLICIT[3, :4] = [5012029 / 34652500, -654441 / 2922500, 174375 / 388108, GAMMA]
IMPLICIT[4, :5] = [
    15267082809 / 155376265600,
    -71443401 / 120774400,
    730878875 / 902184768,
    2285395 / 8070912,
    GAMMA,
]
IMPLICIT[5] = WEIGHTS

for _table in (EXPLICIT, IMPLICIT, WEIGHTS):
    _table.flags.writeable = False
