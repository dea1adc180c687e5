# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces in frames of the page, by Pinocchio's Jacobians and least squares."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.page.forces import Forces
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import CAUSES

TOUCHED = "wrist_2_link"


class Pushed:
    """A UR5 with noisy external torque of a force, and the estimates that Pinocchio's Jacobians
    give.
    """

    def __init__(self):
        rng = np.random.default_rng(3)
        self.model = dd.load_robot("ur5")
        self.dyn = dd.DiagonalDynamics(self.model)
        self.robot = pin.buildModelFromUrdf(str(find_urdf("ur5")))
        self.data = self.robot.createData()
        self.q = rng.uniform(-1.5, 1.5, 6)
        pin.computeJointJacobians(self.robot, self.data, self.q)
        factor = 0.1 * rng.normal(size=(6, 6))
        self.covariance = factor @ factor.T + 0.01 * np.eye(6)
        self.tau = self.jacobian().T @ (8.0, -20.0, 5.0) + rng.multivariate_normal(
            np.zeros(6), self.covariance
        )

    def jacobian(self, joint=5):
        """Return the Jacobian of the centre of mass of a joint's body, in the world's axes."""
        J = pin.getJointJacobian(self.robot, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
        lever = self.data.oMi[joint].rotation @ self.robot.inertias[joint].lever
        return J[:3] - pin.skew(lever) @ J[3:]

    def frame(self, link, covariance, **others):
        """Return fields of a frame by name, as doubles."""
        maker = FrameMaker(self.dyn, (), covariance)
        zero = np.zeros(6)
        index = self.model.link_names.index(link) if link else -1
        observed = {"external_torque": self.tau[None], "residual": zero[None], "norm": np.ones(1)}
        state = States.of(
            0.0, self.q, zero, zero, self.dyn.evaluate(self.q, zero, zero), **observed, **others
        )
        (entry,) = maker.frames(state._replace(touched_link=index))
        return {
            name: entry["numbers"][place].astype(float)
            for name, place in maker.layout.places.items()
        }


@pytest.fixture(scope="module")
def pushed():
    return Pushed()


def test_force_at_the_centre_of_mass_of_the_touched_link(pushed):
    frame = pushed.frame(TOUCHED, pushed.covariance, contact=True)
    J = pushed.jacobian()
    weighted = np.linalg.solve(pushed.covariance, J.T).T
    force = np.linalg.solve(weighted @ J.T, weighted @ pushed.tau)
    np.testing.assert_allclose(frame["touch_force"], force, rtol=1e-5)
    assert int(frame["flags"][0]) & CAUSES["contact"]
    np.testing.assert_allclose(force, (8.0, -20.0, 5.0), atol=4.0)  # the numbers make sense
    low, high = frame["touch_interval"]
    assert low < np.linalg.norm((8.0, -20.0, 5.0)) < high < 2.0 * low


def test_forces_that_are_unknown(pushed):
    """One joint moves the first link: two directions of a force on it are not observed."""
    assert np.isnan(pushed.frame("shoulder_link", pushed.covariance)["touch_force"]).all()
    for frame in (pushed.frame("", pushed.covariance), pushed.frame(TOUCHED, None)):
        assert np.isnan([*frame["touch_force"], *frame["touch_interval"]]).all()


def test_the_touched_link_of_states_in_contact(pushed):
    """They are those of dyn.touched_link above 20 %; none without contact or without a result."""
    count = 4
    zero = np.zeros((4, 6))
    observed = {
        "external_torque": np.tile(pushed.tau, (count, 1)),
        "norm": np.array([1.0, 1.0, np.nan, 1.0]),
    }
    observed["external_torque"][3] = 1e-3
    batch = pushed.dyn.evaluate(q := np.tile(pushed.q, (count, 1)), zero, zero)
    states = States.of(np.arange(4.0), q, zero, zero, batch, residual=zero, **observed)
    states = states._replace(
        contact=np.array([True, False, True, False]), collision=np.array([False] * 3 + [True])
    )
    states = Forces(pushed.dyn, pushed.covariance).with_touched_links(states)
    result = pushed.dyn.touched_link(pushed.q, pushed.tau, pushed.covariance)
    order = np.argsort(-result.probability)[:2]
    assert result.probability[order[1]] >= 0.2 > np.sort(result.probability)[-3]
    expected = np.full((2, 4, 3), np.nan)
    index = [pushed.model.link_names.index(result.links[k]) for k in order]
    expected[:, 0, :2] = index, result.probability[order]
    expected[:, 3, 0] = -1.0, 0.0
    np.testing.assert_array_equal((states.touched_link, states.touched_probability), expected)
