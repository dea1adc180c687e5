# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an identification has found, and how far it can be trusted."""

from __future__ import annotations

import os
from typing import Any

from diag_dynamics.model import Parameters, RobotModel


class Identification:
    """Identified parameters, and how far they can be trusted.

    Attributes
    ----------
    model : RobotModel
        With the parameters.
    parameters : Parameters
    quality : dict
        Plain values, in SI units. Pairs are before and after, on the part held out, for parameters fitted to the rest:

        * ``held_out``: begin and end of that part, in times of the last recording [s]
        * ``held_out_duration``: from the one to the other, where stamps went back one run behind the other [s]
        * ``torque_rms``: by joint, root mean square of the effort's error below 5 Hz [N m, N]
        * ``explained``, ``explained_total``: explained shares of dK/dt and of d(K + U)/dt, None of less than two seconds
        * ``row_residual``: by joint, of the filtered rows that were fitted [N m, N]
        * ``observer_spread``: by joint, standard deviation of the observed external torque, at a gain of 25/s [N m, N]
        * ``kinetic_energy``: mean [J]

        And of the fit: ``taken``, the steps that were; ``ladder``, each step that was tried, its score (geometric mean of
        the joints' row residuals) and whether it was taken; ``kept``, by step and joint that keeps the model's numbers, what
        is left of blocks of the fitted rows that were left out in turn, with these and with its own [N m, N];
        ``velocity_delay`` of each recording [s]; ``effective_parameters`` by link, of ten each, that the rows tell;
        ``payload`` with standard deviations; ``warnings`` and ``findings``, texts.
    """

    def __init__(self, model: RobotModel, parameters: Parameters, quality: dict[str, Any]) -> None:
        self.model, self.parameters, self.quality = model, parameters, quality

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the parameters into a YAML file, which :meth:`RobotModel.with_parameters` and the nodes read.

        Raises
        ------
        InputError
            It cannot be written.
        """
        self.parameters.save(path)

    def __repr__(self) -> str:
        shares = self.quality["explained_total"]  # not that of dK/dt, which is less than noise of a slow robot
        before, after = ("-" if share is None else f"{share:.2f}" for share in shares)
        return (
            f"<Identification of '{self.model.name}': {', '.join(self.quality['taken']) or 'nothing'}; of d(K + U)/dt "
            f"explained {before} before, {after} after>"
        )
