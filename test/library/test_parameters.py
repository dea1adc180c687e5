# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters beside a URDF: against the same numbers written into the URDF, against Pinocchio, and in every error."""

import math
import pickle
import warnings
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.model.options import not_physical
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.parameters.shared import PARAMETERS
from robots import description, joint, link, robot_path

PANDA = robot_path("panda_description/urdf/panda.urdf")

JOINTS = {
    "panda_joint1": {"damping": 0.7, "friction": 1.1, "effort_offset": -0.3, "armature": 0.21},
    "panda_joint4": {"friction": 0.4},
    "panda_joint7": {"armature": 0.04, "effort_offset": 0.11},
}

LINKS = {
    "panda_link3": {
        "mass": 3.1,
        "com": [0.03, -0.02, -0.05],
        "inertia": [[0.04, 0.001, 0.002], [0.001, 0.05, -0.003], [0.002, -0.003, 0.03]],
    }
}

PARAMETERS_OF_PANDA = {
    "joints": JOINTS,
    "links": LINKS,
    "payloads": {"panda_link7": {"mass": 1.3, "com": [0.0, 0.01, 0.12]}},
    "friction_velocity": 0.02,
    "origin": {"recordings": ["monday.mcap"], "date": "2026-11-24", "quality": {"explained": [0.3, 0.97]}},
}


def state(model, seed=0):
    rng = np.random.default_rng(seed)
    return model.random(rng), rng.normal(size=model.nv), rng.normal(size=model.nv)


def written(urdf, joints=None, links=None):
    """The URDF with these numbers in it: what parameters beside it have to equal."""
    root = ET.fromstring(urdf.read_text())
    for element in root.findall("joint"):
        for name in ("damping", "friction"):
            if name in (joints or {}).get(element.get("name"), {}):
                if element.find("dynamics") is None:
                    ET.SubElement(element, "dynamics")
                element.find("dynamics").set(name, repr(joints[element.get("name")][name]))
    for element in root.findall("link"):
        given = (links or {}).get(element.get("name"))
        if given is None:
            continue
        if element.find("inertial") is not None:
            element.remove(element.find("inertial"))
        if given:
            inertial = ET.SubElement(element, "inertial")
            ET.SubElement(inertial, "origin", xyz=" ".join(map(repr, given["com"])))
            ET.SubElement(inertial, "mass", value=repr(given["mass"]))
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = given["inertia"]
            entries = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
            ET.SubElement(inertial, "inertia", {key: repr(value) for key, value in entries.items()})
    return ET.tostring(root, encoding="unicode")


def same(one, other):
    """Whether both models give the same bits."""
    q, qd, tau = state(one)
    a, b = (dd.DiagonalDynamics(model).evaluate(q, qd, tau, friction=True) for model in (one, other))
    names = ("nu", "epsilon", "coriolis", "friction", "articulated_inertia")
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names) and np.array_equal(
        one.effort_offset, other.effort_offset
    )


def near(one, other):
    """Whether both models give the same but for rounding."""
    q, qd, tau = state(one)
    a, b = (dd.DiagonalDynamics(model).evaluate(q, qd, tau) for model in (one, other))
    return all(np.allclose(getattr(a, name), getattr(b, name), rtol=1e-10) for name in ("nu", "epsilon", "coriolis"))


def test_equals_what_the_urdf_would_say():
    armature = {name: entry["armature"] for name, entry in JOINTS.items() if "armature" in entry}
    text = written(PANDA, JOINTS, LINKS)
    expected = dd.load_urdf(text, armature=armature, payloads={"panda_link7": (1.3, (0.0, 0.01, 0.12))})
    own = {key: value for key, value in PARAMETERS_OF_PANDA.items() if key != "friction_velocity"}
    own["joints"] = {name: {k: v for k, v in e.items() if k != "effort_offset"} for name, e in JOINTS.items()}
    model = dd.load_urdf(PANDA, parameters=own)
    q, qd, tau = state(model)
    a, b = (dd.DiagonalDynamics(one).evaluate(q, qd, tau, friction=True) for one in (model, expected))
    for name in ("nu", "epsilon", "coriolis", "friction", "articulated_inertia", "link_energy"):
        found, wanted = getattr(a, name), getattr(b, name)
        assert np.abs(found - wanted).max() <= 1e-13 * np.abs(wanted).max(), name
    assert model.total_mass == pytest.approx(expected.total_mass, rel=1e-15)
    assert not model.payloads  # a part of the robot: what a hand grips comes on top of it
    assert model.with_payload("panda_link7", 1.0).total_mass == pytest.approx(model.total_mass + 1.0, rel=1e-15)


def test_mass_matrix_is_that_of_pinocchio():
    """With an oracle that reads the numbers from the dict, not from our URDF."""
    model = dd.load_urdf(PANDA, parameters=PARAMETERS_OF_PANDA, mimic="free")
    reference = pin.buildModelFromUrdf(str(PANDA))
    given, body = LINKS["panda_link3"], reference.getJointId("panda_joint3")
    reference.inertias[body] = pin.Inertia(given["mass"], np.array(given["com"]), np.array(given["inertia"]))
    last = reference.getJointId("panda_joint7")
    reference.inertias[last] += pin.Inertia(1.3, np.array([0.0, 0.01, 0.12]), np.zeros((3, 3)))
    for name, entry in JOINTS.items():
        at = reference.joints[reference.getJointId(name)].idx_v
        reference.armature[at] = entry.get("armature", 0.0)
    assert tuple(reference.names[1:]) == model.dof_names
    q, _, _ = state(model)
    wanted = pin.crba(reference, reference.createData(), q)
    wanted = np.triu(wanted) + np.triu(wanted, 1).T
    found = dd.DiagonalDynamics(model).mass_matrix(q)
    assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max()


@pytest.mark.parametrize("options", [{}, {"floating_base": True}, {"locked_joints": {"panda_joint2": 0.3}}])
def test_three_ways_to_give_them(tmp_path, options):
    """A dict, a file and a model that is there already come to the same, pickled too."""
    path = tmp_path / "arm.yaml"
    dd.Parameters.of(PARAMETERS_OF_PANDA).save(path)
    models = [
        dd.load_urdf(PANDA, parameters=PARAMETERS_OF_PANDA, **options),
        dd.load_urdf(PANDA, parameters=path, **options),
        dd.load_urdf(PANDA, **options).with_parameters(str(path)),
        dd.load_urdf(PANDA, **options).with_parameters(dd.Parameters.load(path)),
    ]
    models += [pickle.loads(pickle.dumps(models[0])), models[0].with_locked_joints(options.get("locked_joints", {}))]
    for model in models[1:]:
        assert same(models[0], model)
        assert model.friction_velocity == 0.02
    assert not same(models[0], dd.load_urdf(PANDA, **options))


def test_file_keeps_every_bit(tmp_path):
    rng = np.random.default_rng(3)
    joints = {f"joint {k}": dd.JointParameters(*np.exp(rng.normal(-5, 5, 4).clip(-40, 20)).tolist()) for k in range(50)}
    given = dd.Parameters(joints=joints, payloads={"tool": dd.Payload(-0.7, (0.1, 1e-17, 0.3))}, origin={"a": [1, "b"]})
    given.save(tmp_path / "arm.yaml")
    read = dd.Parameters.load(tmp_path / "arm.yaml")
    assert dict(read.joints) == joints
    assert read.to_dict() == given.to_dict()
    assert dict(read.origin) == {"a": [1, "b"]}


def test_numbers_as_people_write_them(tmp_path):
    """YAML takes 1e-3 for text, and an entry without a value for null: neither is an error."""
    (tmp_path / "arm.yaml").write_text("joints:\n  panda_joint1: {damping: 1e-3, friction:}\nlinks:\n")
    read = dd.Parameters.load(tmp_path / "arm.yaml")
    assert dict(read.joints) == {"panda_joint1": dd.JointParameters(damping=1e-3)}


def test_what_is_not_named_stays():
    model = dd.load_urdf(PANDA, armature=0.1, parameters={"joints": {"panda_joint2": {"damping": 2.0}}})
    more = model.with_parameters({"joints": {"panda_joint2": {"armature": 0.5}}})
    assert more.damping.tolist() == model.damping.tolist()
    assert model.damping[1] == 2.0
    assert more.armature[:7].tolist() == [0.1, 0.5, 0.1, 0.1, 0.1, 0.1, 0.1]
    given = {"joints": {"panda_joint1": {"armature": 0.3}}, "friction_velocity": 0.1}
    assert dd.load_urdf(PANDA, armature={"panda_joint1": 0.2}, parameters=given).armature[0] == 0.2
    assert dd.load_urdf(PANDA, friction_velocity=0.0, parameters=given).friction_velocity == 0.0


def test_offset_is_part_of_friction():
    """In every function that knows friction, of one state and of many."""
    model = dd.load_urdf(PANDA, parameters={"joints": JOINTS, "friction_velocity": 0.02})
    plain, dynamics = dd.DiagonalDynamics(dd.load_urdf(PANDA)), dd.DiagonalDynamics(model)
    assert model.has_friction
    assert dd.load_urdf(PANDA, parameters={"joints": {"panda_joint1": {"effort_offset": 1.0}}}).has_friction
    offset = np.zeros(model.nv)
    offset[0], offset[6] = -0.3, 0.11
    assert np.array_equal(dynamics.friction_torque(np.zeros(model.nv)), offset)
    q, qd, tau = state(model)
    own = plain.model.damping.copy()
    own[0] = 0.7
    coulomb = plain.model.friction.copy()
    coulomb[0], coulomb[3] = 1.1, 0.4
    resisting = own * qd + coulomb * np.tanh(qd / 0.02) + offset
    assert np.allclose(dynamics.friction_torque(qd), resisting, rtol=1e-14)
    assert np.allclose(dynamics.friction_torque_batch([qd, -qd])[0], resisting, rtol=1e-14)
    qdd = dynamics.forward_dynamics(q, qd, tau, friction=True)
    assert np.allclose(qdd, dynamics.forward_dynamics(q, qd, tau - resisting), rtol=1e-12)
    s, many = dynamics.evaluate(q, qd, tau, friction=True), dynamics.evaluate_batch([q], [qd], [tau], friction=True)
    assert np.allclose(s.friction @ s.nu, resisting @ qd, rtol=1e-12)
    assert np.array_equal(many.friction[0], s.friction)


def test_follower_reflects_its_offset():
    """A gripper's second finger moves by −0.5 times the first: so does what its effort is off by."""
    urdf = description(
        "gripper",
        link("palm", 1.0, inertia=(1, 0, 0, 1, 0, 1)),
        link("left", 0.1, inertia=(1e-4, 0, 0, 1e-4, 0, 1e-4)),
        link("right", 0.1, inertia=(1e-4, 0, 0, 1e-4, 0, 1e-4)),
        joint("lead", "revolute", "palm", "left"),
        joint("follow", "revolute", "palm", "right").replace(
            "</joint>", '<mimic joint="lead" multiplier="-0.5"/></joint>'
        ),
    )
    given = {"follow": {"effort_offset": 0.2, "damping": 0.8, "friction": 0.4, "armature": 0.04}}
    model = dd.load_urdf(urdf, parameters={"joints": given})
    assert model.dof_names == ("lead",)
    assert model.effort_offset == pytest.approx([-0.1])
    assert model.damping == pytest.approx([0.2])
    assert model.friction == pytest.approx([0.2])
    assert model.armature == pytest.approx([0.01])


def test_hand_that_is_not_mounted():
    """A payload of negative mass takes off the hand that the URDF has: the same robot as from a URDF without it."""
    root = ET.fromstring(PANDA.read_text())
    hand = next(element for element in root.findall("link") if element.get("name") == "panda_hand")
    inertial = hand.find("inertial")
    mass = float(inertial.find("mass").get("value"))
    com = [float(x) for x in inertial.find("origin").get("xyz").split()]
    entries = inertial.find("inertia").attrib
    about = [[float(entries["i" + "".join(sorted(a + b))]) for b in "xyz"] for a in "xyz"]
    fixed = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    without = dd.load_urdf(written(PANDA, links={"panda_hand": {}}), locked_joints=fixed)
    # It was found as what another link of the same body carries.
    model = dd.load_urdf(PANDA, locked_joints=fixed)
    body, of_hand = model.placement_in_body("panda_hand")
    same_body, of_link = model.placement_in_body("panda_link8")
    assert body == same_body
    place = np.linalg.inv(of_link) @ of_hand
    turned = place[:3, :3] @ np.array(about) @ place[:3, :3].T
    payload = {"mass": -mass, "com": (place[:3, :3] @ com + place[:3, 3]).tolist(), "inertia": (-turned).tolist()}
    with warnings.catch_warnings():  # that panda_link8 alone is no rigid body is as it should be
        warnings.simplefilter("error")
        loaded = dd.load_urdf(PANDA, locked_joints=fixed, parameters={"payloads": {"panda_link8": payload}})
    model = model.with_parameters({"payloads": {"panda_link8": payload}})
    np.testing.assert_array_equal(loaded.bodies, model.bodies)
    q, qd, tau = state(model)
    a, b = (dd.DiagonalDynamics(one).evaluate(q, qd, tau) for one in (model, without))
    assert a.kinetic_energy == pytest.approx(b.kinetic_energy, rel=1e-13)
    assert np.allclose(a.coriolis, b.coriolis, atol=1e-12 * np.abs(b.coriolis).max())
    assert model.total_mass == pytest.approx(without.total_mass, rel=1e-14)


def test_what_is_locked_can_be_taken_off_with_its_link():
    """The hand with both fingers, where these are locked; where they move, the hand alone is too light for that."""
    free = dd.load_urdf(PANDA, mimic="free")
    held = dd.load_urdf(PANDA, locked_joints={"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0})
    hand, of_link = (
        held.links[held.links["index"] == held.link_names.index(name)][0] for name in ("panda_hand", "panda_link7")
    )
    both = 2.0 * held.links[held.links["index"] == held.link_names.index("panda_leftfinger")][0]["mass"]
    taken = {"payloads": {"panda_hand": {"mass": -(float(hand["mass"] + of_link["mass"]) + 0.5 * float(both))}}}
    with pytest.raises(dd.InputError, match="on link 'panda_hand', which leaves -"):
        free.with_parameters(taken)
    with pytest.raises(dd.InputError, match=r"on link 'panda_hand', which leaves 0.* principal moments"):
        held.with_parameters(taken)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"joint": {}}, "parameters has 'joint', expected 'joints'"),
        ({"joints": {"panda_joint1": {"dampign": 1.0}}}, "joint 'panda_joint1' has 'dampign', expected 'damping'"),
        ({"joints": {"panda_joint1": 3.0}}, "joint 'panda_joint1': 3.0 stands there, expected damping, friction"),
        ({"joints": {"panda_joint1": {"damping": -1.0}}}, "damping is -1.0, expected a finite number >= 0"),
        ({"joints": {"panda_joint1": {"friction": math.nan}}}, "friction is nan, expected a finite number >= 0"),
        ({"joints": {"panda_joint1": {"armature": "much"}}}, "armature is 'much', expected a finite number >= 0"),
        ({"joints": {"panda_joint1": {"effort_offset": math.inf}}}, "effort_offset is inf, expected a finite number"),
        (
            {"joints": {"panda_joint_1": {}}},
            "'panda_joint_1' is not a joint of robot 'panda'. Is 'panda_joint1' meant?",
        ),
        (
            {"joints": {"panda_joint8": {"damping": 1.0}}},
            "joint 'panda_joint8' is fixed, expected one degree of freedom",
        ),
        ({"links": {"elbow": {"mass": 1.0}}}, "'elbow' is not a link of robot 'panda'. Its links are panda_link0"),
        ({"links": {"panda_link1": {"com": [0, 0, 1]}}}, "link 'panda_link1' has no mass"),
        ({"links": {"panda_link1": {"mass": -1.0}}}, "link 'panda_link1': mass is -1.0, expected a finite number >= 0"),
        ({"links": {"panda_link1": {"mass": 1.0, "com": [0, 1]}}}, "com is .*, expected three finite numbers"),
        (
            {"links": {"panda_link1": {"mass": 1.0, "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 3]]}}},
            "link 'panda_link1': inertia is .* break the triangle inequality",
        ),
        ({"payloads": {"panda_hand": {"mass": -3.0}}}, "on link 'panda_hand', which leaves -.* more is taken off than"),
        (
            {"payloads": {"panda_hand": {"mass": -0.7, "com": [0, 0, 1]}}},
            "on link 'panda_hand', which leaves .* principal moments",
        ),
        (
            {"payloads": {"panda_hand": {"mass": -3.0}}, "origin": {"locked_joints": {"panda_finger_joint1": 0.04}}},
            "more is taken off .* It was identified with locked_joints panda_finger_joint1=0.04[.]",
        ),
        ({"friction_velocity": -1.0}, "friction_velocity is -1.0"),
        ({"origin": 3}, "origin: 3 stands there"),
        ([], r"parameters: \[\] stands there, expected joints, links"),
    ],
)
def test_errors_name_the_entry(given, message):
    with pytest.raises(dd.InputError, match=message):
        dd.load_urdf(PANDA, parameters=given)
    with pytest.raises(dd.InputError, match=message):
        dd.load_urdf(PANDA).with_parameters(given)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(dd.InputError, match=r"file of parameters '.*none.yaml' cannot be read: No such file"):
        dd.load_urdf(PANDA, parameters=tmp_path / "none.yaml")
    (tmp_path / "wrong.yaml").write_text("joints: {panda_joint1: {damping: -1}}")
    with pytest.raises(dd.InputError, match=r"'.*wrong.yaml': joint 'panda_joint1': damping is -1"):
        dd.load_urdf(PANDA, parameters=tmp_path / "wrong.yaml")
    (tmp_path / "no.yaml").write_text("joints: {")
    with pytest.raises(dd.InputError, match=r"'.*no.yaml' is no YAML"):
        dd.load_urdf(PANDA, parameters=tmp_path / "no.yaml")
    with pytest.raises(dd.InputError, match=r"Cannot write the file of parameters '/nowhere/arm\.yaml'"):
        dd.Parameters().save("/nowhere/arm.yaml")


def test_simulated_offset_has_no_effect_of_its_own():
    """A command of gravity's torque and the offset holds the arm; without the offset in the command the arm moves."""
    model = dd.load_urdf(PANDA, parameters={"joints": JOINTS})
    simulation = dd.Simulation(model, q=0.5 * (model.lower + model.upper), friction=np.zeros(model.nv))
    start, gravity = simulation.q, simulation.dynamics.gravity_torque(simulation.q)
    simulation.advance(gravity + model.effort_offset, steps=200)
    assert np.abs(simulation.q - start).max() < 1e-9
    assert np.array_equal(simulation.effort, gravity + model.effort_offset)
    free = dd.Simulation(model, q=start, friction=np.zeros(model.nv), effort_offset=np.zeros(model.nv))
    free.advance(gravity + model.effort_offset, steps=200)
    assert abs(free.qd[6]) > 1e-2
    with pytest.raises(dd.InputError, match="effort_offset is"):
        simulation.effort_offset = [0.0]


def test_perturbed_inertias_are_those_of_rigid_bodies():
    """And are off by what was asked for, and by nothing with 0; the seed decides."""
    model = dd.load_urdf(PANDA, armature=0.1, payloads={"panda_hand": (0.5, (0, 0, 0.1))})
    assert near(model, model.perturbed(0.0))
    one, again, other = model.perturbed(0.3, 1), model.perturbed(0.3, 1), model.perturbed(0.3, 2)
    assert same(one, again)
    assert not near(one, other)
    assert dict(one.payloads) == dict(model.payloads)
    assert one.armature.tolist() == model.armature.tolist()
    bare = [m.without_payload("panda_hand").links["mass"] for m in (model, one)]
    off = bare[1] / bare[0] - 1.0
    assert abs(off).max() <= 0.3
    assert abs(off).max() > 0.15
    for name in one.link_names:
        body = next(b for b in one._tree.robot.links if b.name == name).inertial
        assert body is None or not_physical(np.asarray(body.inertia), body.mass) is None
    with pytest.raises(dd.InputError, match=r"part is 1.0, expected a number from 0 to 0\.9"):
        model.perturbed(1.0)
    with pytest.raises(dd.InputError, match=r"seed is -1, expected a whole number >= 0"):
        model.perturbed(0.3, -1)


def test_parameter_of_the_nodes(tmp_path):
    """`parameters_file` of a node: the list `armature` has precedence, what it does not name comes from the file."""
    path = tmp_path / "arm.yaml"
    dd.Parameters.of(PARAMETERS_OF_PANDA).save(path)
    values = {name: spec.default for name, spec in PARAMETERS.items()} | {"parameters_file": str(path)}
    model = model_of(str(PANDA), values)
    assert same(model, dd.load_urdf(PANDA, parameters=path))
    assert model.friction_velocity == 0.02
    model = model_of(str(PANDA), values | {"armature": ["panda_joint1=0.5"], "friction_velocity": 0.3})
    assert model.armature[[0, 6]].tolist() == [0.5, 0.04]
    assert model.friction_velocity == 0.3


def test_parameters_that_were_found_beside_others_are_all_of_them(tmp_path):
    """A model with these and then those has the same dynamics as one that is loaded with both at once."""
    earlier = dd.Parameters(
        joints={
            "panda_joint1": dd.JointParameters(damping=0.5, armature=0.2),
            "panda_joint3": dd.JointParameters(friction=1.0),
        },
        links={"panda_link2": dd.Payload(2.0, (0.0, -0.1, 0.0), 0.02 * np.eye(3))},
        payloads={
            "panda_link4": dd.Payload(0.5, (0.0, 0.1, 0.0), 1e-3 * np.eye(3)),
            "panda_link7": dd.Payload(1.0, (0.0, 0.0, 0.1), 2e-3 * np.eye(3)),
        },
        friction_velocity=0.02,
        origin={"date": "before"},
    )
    later = dd.Parameters(
        joints={"panda_joint1": dd.JointParameters(damping=0.3)},
        payloads={"panda_link7": dd.Payload(-0.8, (0.0, 0.02, 0.12), -1e-3 * np.eye(3))},
        origin={"date": "after"},
    )
    both = earlier.followed_by(later)
    assert both.joints["panda_joint1"] == dd.JointParameters(damping=0.3, armature=0.2)
    assert both.payloads["panda_link7"].mass == pytest.approx(0.2)
    assert (both.friction_velocity, both.origin) == (0.02, {"date": "after"})
    twice, once = dd.load_urdf(PANDA, parameters=earlier).with_parameters(later), dd.load_urdf(PANDA, parameters=both)
    q = once.random(np.random.default_rng(0))
    masses, gravities = (
        [getattr(dd.DiagonalDynamics(model), name)(q) for model in (twice, once)]
        for name in ("mass_matrix", "gravity_torque")
    )
    np.testing.assert_allclose(*masses, atol=1e-12)
    np.testing.assert_allclose(*gravities, atol=1e-12)
    np.testing.assert_array_equal(twice.damping, once.damping)
    np.testing.assert_array_equal(twice.friction, once.friction)
    replaced = earlier.followed_by(dd.Parameters(links={"panda_link4": dd.Payload(3.0)}))
    assert set(replaced.payloads) == {"panda_link7"}  # what a link carried is in its later inertia
    with pytest.raises(dd.InputError, match="two payloads of link 'panda_link4' have no mass together"):
        earlier.followed_by(dd.Parameters(payloads={"panda_link4": dd.Payload(-0.5)}))
