"""What `--help` of a node says: its topics, its services and its parameters."""

import argparse
from textwrap import fill

INTERFACES = {
    "monitor": """listens to   joint_states, robot_description; odom with floating_base; /clock with use_sim_time
publishes    ~/state, ~/kinetic_energy, ~/total_joint_rates, ~/working_moments, ~/coriolis, ~/mass_matrix_factors,
             ~/joint_space_dynamics; ~/external_torque with external_torque.gain; /diagnostics
services     ~/forward_dynamics, ~/inverse_dynamics, ~/diagonalize, ~/set_payload""",
    "simulator": """listens to   effort_controller/commands, external_wrench; /clock with use_sim_time
publishes    joint_states, robot_description, ~/ground_truth, ~/energy_audit; odom with floating_base;
             /clock with publish_clock; /diagnostics
services     ~/pause, ~/step, ~/reset, ~/set_state""",
    "controller": """listens to   joint_states, robot_description, target, trajectory, set_point; /clock with use_sim_time
publishes    effort_controller/commands, ~/status, /diagnostics
services     ~/mode/gravity_compensation, ~/mode/damping, ~/mode/pose, ~/mode/tracking""",
}
"""Topics and services of each node; ~ is its name."""


def parser_of(executable, description, specs, required=None):
    """Parser of what is no ROS argument: there is none but --help.

    Parameters
    ----------
    executable : str
    description : str
        What the node is.
    specs : dict
        Its table of parameters.
    required : dict, optional
        Description of parameters without default, by name.

    Returns
    -------
    argparse.ArgumentParser
    """
    lines = [INTERFACES[executable], "", "parameters, each with its default:"]
    for name, text in (required or {}).items():
        lines += [f"  {name}", _indented(f"Required: {text}.")]
    for name, spec in specs.items():
        lines += [f"  {name}: {_yaml(spec.default)}", _indented(spec.description)]
    return argparse.ArgumentParser(
        prog=executable,
        usage=f"{executable} [--help] [--ros-args [-p NAME:=VALUE] [--params-file FILE] [-r FROM:=TO] ...]",
        description=description,
        epilog="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def _indented(text):
    return fill(text, 100, initial_indent=" " * 6, subsequent_indent=" " * 6)


def _yaml(value):
    if isinstance(value, list):
        return "[" + ", ".join(_yaml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) or '""'
