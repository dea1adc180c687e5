# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters beside a URDF: equal to the same numbers in the URDF, equal to Pinocchio, and named in
every error.
"""

import math
import pickle
import warnings

import numpy as np
import pinocchio as pin
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.robot_models import model_of
from diag_dynamics.parameters.shared import PARAMETERS
from robots import description, joint, link, robot_path

PANDA = robot_path("panda_description/urdf/panda.urdf")

JOINTS = {
    "panda_joint1": {"damping": 0.7, "friction": 1.1, "effort_offset": -0.3, "armature": 0.21},
    "panda_joint4": {"friction": 0.4},
    "panda_joint7": {"armature": 0.04, "effort_offset": 0.11},
}

INERTIA = [[0.04, 0.001, 0.002], [0.001, 0.05, -0.003], [0.002, -0.003, 0.03]]
LINKS = {"panda_link3": {"mass": 3.1, "com": [0.03, -0.02, -0.05], "inertia": INERTIA}}

ALL = {
    "joints": JOINTS,
    "links": LINKS,
    "payloads": {"panda_link7": {"mass": 1.3, "com": [0.0, 0.01, 0.12]}},
    "friction_velocity": 0.02,
    "origin": {
        "recordings": ["monday.mcap"],
        "date": "2026-11-24",
        "quality": {"explained": [0.3, 0.97]},
    },
}


@pytest.fixture(scope="module")
def panda():
    return dd.load_urdf(PANDA)


def state(model, seed=0):
    rng = np.random.default_rng(seed)
    return model.random(rng), rng.normal(size=model.nv), rng.normal(size=model.nv)


def evaluation(model, friction=True):
    return dd.DiagonalDynamics(model).evaluate(*state(model), friction=friction)


QUANTITIES = ("nu", "epsilon", "coriolis", "friction", "articulated_inertia")


def same(one, other):
    """Return whether both models give the same bits."""
    a = evaluation(one)
    b = evaluation(other)
    return all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in QUANTITIES
    ) and np.array_equal(one.effort_offset, other.effort_offset)


# --- Numbers


def test_mass_matrix_against_pinocchio():
    """The reference reads the numbers from the dict."""
    model = dd.load_urdf(PANDA, parameters=ALL, mimic="free")
    reference = pin.buildModelFromUrdf(str(PANDA))
    inertias = LINKS["panda_link3"]
    inertia = pin.Inertia(
        inertias["mass"], np.array(inertias["com"]), np.array(inertias["inertia"])
    )
    reference.inertias[reference.getJointId("panda_joint3")] = inertia
    payload = pin.Inertia(1.3, np.array([0.0, 0.01, 0.12]), np.zeros((3, 3)))
    reference.inertias[reference.getJointId("panda_joint7")] += payload
    for name, entry in JOINTS.items():
        at = reference.joints[reference.getJointId(name)].idx_v
        reference.armature[at] = entry.get("armature", 0.0)
    assert tuple(reference.names[1:]) == model.dof_names
    q, _, _ = state(model)
    wanted = pin.crba(reference, reference.createData(), q)
    wanted = np.triu(wanted) + np.triu(wanted, 1).T
    assert (
        np.abs(dd.DiagonalDynamics(model).mass_matrix(q) - wanted).max()
        <= 1e-12 * np.abs(wanted).max()
    )
    assert not model.payloads  # a payload of the robot; payloads of the caller add to it
    assert model.with_payload("panda_link7", 1.0).total_mass == pytest.approx(
        model.total_mass + 1.0, rel=1e-15
    )


@pytest.mark.parametrize(
    "options", [{}, {"floating_base": True}, {"locked_joints": {"panda_joint2": 0.3}}]
)
def test_sources(tmp_path, options):
    """A dict, a file and `with_parameters` give the same model; pickles keep it."""
    path = tmp_path / "arm.yaml"
    dd.Parameters.from_dict(ALL).save(path)
    plain = dd.load_urdf(PANDA, **options)
    model = dd.load_urdf(PANDA, parameters=ALL, **options)
    others = [dd.load_urdf(PANDA, parameters=path, **options)]
    others += [plain.with_parameters(str(path)), plain.with_parameters(dd.Parameters.load(path))]
    others += [
        pickle.loads(pickle.dumps(model)),
        model.with_locked_joints(options.get("locked_joints", {})),
    ]
    assert all(same(model, other) and other.friction_velocity == 0.02 for other in others)
    assert not same(model, plain)


def test_unnamed_entries_stay():
    model = dd.load_urdf(
        PANDA, armature=0.1, parameters={"joints": {"panda_joint2": {"damping": 2.0}}}
    )
    more = model.with_parameters({"joints": {"panda_joint2": {"armature": 0.5}}})
    np.testing.assert_array_equal(more.damping, model.damping)
    assert model.damping[1] == 2.0
    assert more.armature[:7].tolist() == [0.1, 0.5, 0.1, 0.1, 0.1, 0.1, 0.1]
    parameters = {"joints": {"panda_joint1": {"armature": 0.3}}, "friction_velocity": 0.1}
    options = dd.load_urdf(
        PANDA, armature={"panda_joint1": 0.2}, friction_velocity=0.0, parameters=parameters
    )
    assert options.armature[0] == 0.2 and options.friction_velocity == 0.0


def test_later_parameters():
    """A model with these and then those equals one that is loaded with `merged_with`."""
    first, second = (dd.Payload(mass, (0.0, 0.0, 0.1), 2e-3 * np.eye(3)) for mass in (0.5, 1.0))
    inertias = {"panda_link2": dd.Payload(2.0, (0.0, -0.1, 0.0), 0.02 * np.eye(3))}
    joints = {"panda_joint1": dd.JointParameters(damping=0.5, armature=0.2)}
    payloads = {"panda_link4": first, "panda_link7": second}
    earlier = dd.Parameters(
        joints=joints,
        links=inertias,
        payloads=payloads,
        friction_velocity=0.02,
        origin={"date": "before"},
    )
    later = dd.Parameters(
        joints={"panda_joint1": dd.JointParameters(damping=0.3)},
        payloads={"panda_link7": dd.Payload(-0.8, (0.0, 0.02, 0.12), -1e-3 * np.eye(3))},
        origin={"date": "after"},
    )
    both = earlier.merged_with(later)
    assert both.joints["panda_joint1"] == dd.JointParameters(damping=0.3, armature=0.2)
    assert both.payloads["panda_link7"].mass == pytest.approx(0.2)
    assert (both.friction_velocity, both.origin) == (0.02, {"date": "after"})
    twice = dd.load_urdf(PANDA, parameters=earlier).with_parameters(later)
    once = dd.load_urdf(PANDA, parameters=both)
    a = evaluation(twice)
    b = evaluation(once)
    np.testing.assert_allclose(a.coriolis, b.coriolis, atol=1e-12)
    np.testing.assert_array_equal(twice.damping, once.damping)
    replaced = earlier.merged_with(dd.Parameters(links={"panda_link4": dd.Payload(3.0)}))
    assert set(replaced.payloads) == {
        "panda_link7"
    }  # the later inertia of a link contains its payload
    with pytest.raises(dd.InputError, match="link 'panda_link4' without mass"):
        earlier.merged_with(dd.Parameters(payloads={"panda_link4": dd.Payload(-0.5)}))


# --- Friction and offsets


def test_friction_includes_the_offset(panda):
    model = dd.load_urdf(PANDA, parameters={"joints": JOINTS, "friction_velocity": 0.02})
    dynamics = dd.DiagonalDynamics(model)
    q, qd, tau = state(model)
    damping = panda.damping.copy()
    coulomb = panda.friction.copy()
    offset = np.zeros(model.nv)
    damping[0] = 0.7
    coulomb[[0, 3]] = (1.1, 0.4)
    offset[[0, 6]] = (-0.3, 0.11)
    resisting = damping * qd + coulomb * np.tanh(qd / 0.02) + offset
    np.testing.assert_array_equal(dynamics.friction_torque(np.zeros(model.nv)), offset)
    np.testing.assert_allclose(dynamics.friction_torque(qd), resisting, rtol=1e-14)
    qdd = dynamics.forward_dynamics(q, qd, tau, friction=True)
    np.testing.assert_allclose(qdd, dynamics.forward_dynamics(q, qd, tau - resisting), rtol=1e-12)


def test_mimic_joint_reflects_its_parameters():
    """It moves by -0.5 times its source."""
    inertia = (1e-2, 0, 0, 1e-2, 0, 1e-2)
    links = [link(name, 1.0, inertia=inertia) for name in ("palm", "left", "right")]
    mimic = joint("follow", "revolute", "palm", "right")
    mimic = mimic.replace("</joint>", '<mimic joint="lead" multiplier="-0.5"/></joint>')
    urdf = description("gripper", *links, joint("lead", "revolute", "palm", "left"), mimic)
    entry = {"effort_offset": 0.2, "damping": 0.8, "friction": 0.4, "armature": 0.04}
    model = dd.load_urdf(urdf, parameters={"joints": {"follow": entry}})
    assert model.dof_names == ("lead",) and model.effort_offset == pytest.approx([-0.1])
    assert (*model.damping, *model.friction, *model.armature) == pytest.approx((0.2, 0.2, 0.01))


# --- Negative payloads

LOCKED = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}


def test_payload_of_negative_mass():
    """A payload and its negative cancel, on a link that is no rigid body by itself, too."""
    plain = dd.load_urdf(PANDA, locked_joints=LOCKED)
    mass = 0.7
    com = (0.0, 0.01, 0.05)
    inertia = 2e-3 * np.eye(3)
    loaded = plain.with_payload("panda_link8", mass, com, inertia)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        payload = {"mass": -mass, "com": list(com), "inertia": (-inertia).tolist()}
        model = dd.load_urdf(PANDA, locked_joints=LOCKED).with_parameters(
            {"payloads": {"panda_link8": payload}}
        )
    assert model.total_mass == pytest.approx(plain.total_mass - mass)
    assert loaded.total_mass > plain.total_mass
    both = model.with_payload("panda_link8", mass, com, inertia)
    a = evaluation(both)
    b = evaluation(plain)
    assert a.kinetic_energy == pytest.approx(b.kinetic_energy, rel=1e-13)
    np.testing.assert_allclose(
        a.coriolis, b.coriolis, rtol=1e-5, atol=1e-12 * np.abs(b.coriolis).max()
    )


def test_mass_that_moves_with_a_link():
    """It includes links behind locked joints, not links behind free joints."""
    free = dd.load_urdf(PANDA, mimic="free")
    locked = dd.load_urdf(PANDA, locked_joints=LOCKED)
    mass = {locked.link_names[index]: mass for index, mass in locked.links[["index", "mass"]]}
    taken = mass["panda_hand"] + mass["panda_link7"] + mass["panda_leftfinger"]
    parameters = {"payloads": {"panda_hand": {"mass": -float(taken)}}}
    with pytest.raises(dd.InputError, match="on link 'panda_hand', which leaves -"):
        free.with_parameters(parameters)
    with pytest.raises(
        dd.InputError, match=r"on link 'panda_hand', which leaves 0.* principal moments"
    ):
        locked.with_parameters(parameters)


# --- Files and errors


def test_file_keeps_every_bit(tmp_path):
    rng = np.random.default_rng(3)
    joints = {
        f"joint {k}": dd.JointParameters(*np.exp(rng.normal(-5, 5, 4).clip(-40, 20)).tolist())
        for k in range(50)
    }
    saved = dd.Parameters(
        joints=joints,
        payloads={"tool": dd.Payload(-0.7, (0.1, 1e-17, 0.3))},
        origin={"a": [1, "b"]},
    )
    saved.save(tmp_path / "arm.yaml")
    read = dd.Parameters.load(tmp_path / "arm.yaml")
    assert dict(read.joints) == joints
    assert read.to_dict() == saved.to_dict()
    assert dict(read.origin) == {"a": [1, "b"]}
    (tmp_path / "arm.yaml").write_text(
        "joints:\n  panda_joint1: {damping: 1e-3, friction:}\nlinks:\n"
    )
    read = dd.Parameters.load(
        tmp_path / "arm.yaml"
    )  # YAML reads 1e-3 as text, and no value as null
    assert dict(read.joints) == {"panda_joint1": dd.JointParameters(damping=1e-3)}


def of_joint(**entry):
    return {"joints": {"panda_joint1": entry}}


def of_link(**entry):
    return {"links": {"panda_link1": entry}}


TOO_HEAVY = {"payloads": {"panda_hand": {"mass": -3.0}}}

WRONG = [
    ([], r"^parameters is \[\]; expected a dict"),
    ({"joint": {}}, "^parameters has 'joint'; expected one of joints"),
    ({"joints": {"panda_joint_1": {}}}, "'panda_joint_1'; expected"),
    ({"joints": {"panda_joint8": {"damping": 1.0}}}, "joint 'panda_joint8' is fixed"),
    (of_joint(dampign=1.0), "joint 'panda_joint1' has 'dampign'; expected one of damping"),
    (of_joint(damping=-1.0), "damping is -1.0"),
    (of_joint(friction=math.nan), "friction is nan"),
    (of_joint(armature="much"), "armature is 'much'"),
    ({"links": {"elbow": {"mass": 1.0}}}, "'elbow'; expected .* panda_link0"),
    (of_link(com=[0, 0, 1]), "link 'panda_link1' has no mass"),
    (of_link(mass=1.0, com=[0, 1]), "link 'panda_link1': com is"),
    (
        of_link(mass=1.0, inertia=[[1, 0, 0], [0, 1, 0], [0, 0, 3]]),
        "link 'panda_link1': inertia is .* triangle",
    ),
    (TOO_HEAVY, "on link 'panda_hand', which leaves -"),
    (
        {"payloads": {"panda_hand": {"mass": -0.7, "com": [0, 0, 1]}}},
        "on link 'panda_hand', .* principal moments",
    ),
    ({"friction_velocity": -1.0}, "friction_velocity is -1.0"),
    ({"origin": 3}, "origin is 3"),
]


@pytest.mark.parametrize(("parameters", "key"), WRONG)
def test_errors_name_the_entry(panda, parameters, key):
    with pytest.raises(dd.InputError, match=key):
        panda.with_parameters(parameters)


def test_errors_name_the_file(panda, tmp_path):
    path = tmp_path / "arm.yaml"
    for text, key in (
        ("", "cannot be read"),
        ("joints: {panda_joint1: {damping: -1}}", "damping is -1"),
        ("a: {", "YAML"),
    ):
        if text:
            path.write_text(text)
        with pytest.raises(dd.InputError, match=rf"arm\.yaml'.* {key}"):
            panda.with_parameters(path)
    with pytest.raises(dd.InputError, match=r"'/nowhere/arm\.yaml'"):
        dd.Parameters().save("/nowhere/arm.yaml")


# --- Parameters of the nodes


def test_parameters_file_of_a_node(tmp_path):
    """The node's own parameters precede those of the file."""
    path = tmp_path / "arm.yaml"
    dd.Parameters.from_dict(ALL).save(path)
    values = {name: spec.default for name, spec in PARAMETERS.items()} | {
        "parameters_file": str(path)
    }
    model = model_of(str(PANDA), values)
    assert same(model, dd.load_urdf(PANDA, parameters=path)) and model.friction_velocity == 0.02
    model = model_of(str(PANDA), values | {"armature": ["panda_joint1=0.5"]})
    assert model.armature[[0, 6]].tolist() == [0.5, 0.04]


GAIN = {"external_torque": {"gain": 30.0}}
QOS = "qos_overrides./joint_states.subscription.depth"


def node_file(folder, sections):
    path = folder / "monitor.yaml"
    path.write_text(
        yaml.safe_dump({name: {"ros__parameters": inertias} for name, inertias in sections.items()})
    )
    return [path]


@pytest.mark.parametrize("section", ["/**", "diag_dynamics", "/robot1/diag_dynamics"])
def test_parameters_of_every_node_are_ignored(tmp_path, section):
    """Connections and clocks have no effect without a node."""
    nested = {
        "qos_overrides": {
            "/joint_states": {"subscription": {"depth": 50, "reliability": "reliable"}}
        }
    }
    for ignored in (
        nested,
        {QOS: 50},
        {"use_sim_time": True, "start_type_description_service": False},
    ):
        assert parameters_of(node_file(tmp_path, {section: GAIN | ignored})) == {
            "external_torque.gain": 30.0
        }
    assert parameters_of((), [f"{QOS}=50", "external_torque.gain=30"]) == {
        "external_torque.gain": 30.0
    }


def test_parameters_of_other_nodes(tmp_path):
    """The package ignores them in a section that may be another node's."""
    others = {
        "robot_compensates_gravity": False,
        "tracking_gain": ["*=20.0"],
        "motion": "wave",
        "port": 8421,
    }
    assert parameters_of(node_file(tmp_path, {"/**": GAIN | others})) == {
        "external_torque.gain": 30.0
    }
    unknown = [("diag_dynamics", "motion")]
    unknown += [
        (s, n)
        for s in ("/**", "diag_dynamics")
        for n in (QOS.replace("overrides", "override"), "use_sim_tim")
    ]
    for section, name in unknown:
        with pytest.raises(dd.InputError, match=f"no parameter '{name}'"):
            parameters_of(node_file(tmp_path, {section: {name: 1}}))


@pytest.mark.parametrize(
    ("assignments", "expected"),
    [
        (["locked_joints=a=0, b=0.1"], {"locked_joints": ["a=0", "b=0.1"]}),
        (
            ["locked_joints=a=0", "armature=c=1", "locked_joints=[b=0.1]"],
            {"locked_joints": ["a=0", "b=0.1"]},
        ),
        (["locked_joints=*=0,b=0.1"], {"locked_joints": ["*=0", "b=0.1"]}),
        (["locked_joints=*"], {"locked_joints": ["*"]}),
        (["payloads=hand=1, 2"], {"payloads": ["hand=1, 2"]}),
        (["gravity=[0, 0, 1]", "gravity=[0, 0, 2]"], {"gravity": [0.0, 0.0, 2.0]}),
    ],
)
def test_lists_on_a_command_line(assignments, expected):
    """Commas separate entries, and repetitions of a list of entries add some."""
    result = parameters_of((), assignments)
    assert {name: result[name] for name in expected} == expected


@pytest.mark.parametrize("numbers", [{"damping": np.nan}, {"friction": -3.0}, {"armature": -5.0}])
def test_numbers_of_joints_in_programs_are_checked(numbers):
    with pytest.raises(
        dd.InputError, match=f"joint 'a': {next(iter(numbers))} is .* expected a finite number >= 0"
    ):
        dd.Parameters(joints={"a": dd.JointParameters(**numbers)})


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e6", 1e6), ("1.5e-3", 0.0015), ("-2E+2", -200.0), ("1e", None), ("e6", None)],
)
def test_numbers_with_exponents(text, value):
    """YAML 1.1 reads 1e6 as text."""
    entry = [f"max_age={text}"]
    if value is None:
        with pytest.raises(dd.InputError, match="expected float"):
            parameters_of([], entry)
    else:
        assert parameters_of([], entry) == {"max_age": value}
