# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics identify`: friction, rotor inertias, payloads and inertias of a robot, from recordings without contact."""

import argparse
import json
import sys
from pathlib import Path

from diag_dynamics.cli import given
from diag_dynamics.cli.interrupted import orderly
from diag_dynamics.cli.robot_argument import parsed, robot_of
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.identification.identify import identify
from diag_dynamics.identification.quality import residual_curves
from diag_dynamics.identification.result import without_impossible_links
from diag_dynamics.model import Parameters
from diag_dynamics.model.mjcf import is_mjcf
from diag_dynamics.model.rewriting import urdf_with
from diag_dynamics.model.robot_source import read_source
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.recordings.sources import open_source
from diag_dynamics.text import plain
from diag_dynamics.views.identified import picture

DONE, DOUBTFUL = range(2)
"""Exit statuses: identified; nothing was gained, or the unit of the efforts is not known."""

EPILOG = """exit status: 0 identified; 1 nothing of it makes the model better on the part held out, so that it stays as it
was, the motion does not show whether efforts are torques, or the effort of a light joint is doubtful; 2 it could not be
identified, as where efforts have another unit, sign or order than the model. docs/identify.md says which motions and
recordings it takes."""


@given.reported
def run(name, arguments):
    """Identify; returns the exit status."""
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}", description=__doc__, epilog=EPILOG)
    parser.add_argument("recording", nargs="+", help="as of diag-dynamics analyse, without contact")
    given.add_arguments(parser)
    parser.add_argument(
        "--what",
        default="friction,rotors",
        metavar="WHAT",
        help="some of friction, rotors, inertias, payload:LINK, separated by commas (default: friction,rotors; efforts that "
        "are measured behind the gears know of no rotors)",
    )
    parser.add_argument(
        "--reference", metavar="RECORDING", nargs="+", default=[], help="of the same robot without the payload"
    )
    parser.add_argument("-o", "--output", metavar="ARM.yaml", help="the parameters, for every node and for load_urdf")
    parser.add_argument(
        "--json", metavar="QUALITY.json", help="how far they can be trusted, for programs; - for stdout"
    )
    parser.add_argument(
        "--plots", metavar="PAGE.png", help="efforts that the model leaves unexplained, before and after"
    )
    parser.add_argument(
        "--write-urdf",
        metavar="NEW.urdf",
        help="a copy of the URDF with inertias, payloads, damping and friction in it; it has no place for the rest",
    )
    parser.add_argument("--quiet", action="store_true", help="no summary")
    chosen = parsed(parser, arguments)
    with orderly(name, [chosen.output, chosen.json, chosen.plots, chosen.write_urdf]):
        return _identify(chosen)


def _identify(chosen):
    read = [*chosen.recording, *chosen.reference, chosen.urdf, chosen.columns, *chosen.parameters]
    written = {"-o": chosen.output, "--json": chosen.json, "--plots": chosen.plots, "--write-urdf": chosen.write_urdf}
    given.refuse_outputs(read, written)
    parameters, robot = parameters_of(chosen.parameters, chosen.set), robot_of(chosen.urdf, chosen.xacro_args)
    if parameters.get("floating_base"):
        raise UnsupportedError(
            "floating_base is true: a floating base is not identified, for nothing measures its support."
        )
    if chosen.write_urdf and is_mjcf(robot):
        raise InputError(f"--write-urdf writes a URDF, but '{robot}' is an MJCF. -o ARM.yaml keeps all parameters.")
    recordings = given.streamed(chosen, chosen.recording, parameters, robot)
    model = recordings[0].model
    if model.floating_base:
        raise UnsupportedError(f"robot '{model.name}' has a floating base, which identify does not support.")
    reference = given.streamed(chosen, chosen.reference, parameters, model)
    shared = []
    loaded, unloaded = ([one.pieces for one in some] for some in (recordings, reference))
    found = identify(loaded, model, chosen.what.split(","), reference=unloaded or None)
    everything, earlier = found.parameters, parameters.get("parameters_file")
    if earlier:  # which the model has, and what is found stands beside it
        everything = Parameters.load(earlier).followed_by(everything)
    if chosen.output:
        everything.save(chosen.output)
    if chosen.write_urdf:
        text = open_source(chosen.recording[0], chosen.columns, chosen.topic).description() if robot is None else robot
        possible, shared = without_impossible_links(found.model, everything)
        written = urdf_with(read_source(text).text, possible)
        Path(chosen.write_urdf).write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{written}\n', encoding="utf-8")
    if chosen.plots:
        _draw(chosen.plots, recordings[-1], model, found)
    told = json.dumps(found.quality | {"shared": shared}, indent=1, allow_nan=False)
    if chosen.json == "-":
        print(told)
    elif chosen.json:
        Path(chosen.json).write_text(told, encoding="utf-8")
    if not chosen.quiet and chosen.json != "-":
        print(plain_lines(summary(found, found.parameters.origin["recordings"][len(recordings) - 1]["start"])))
        for what, path in (
            ("parameters", chosen.output),
            ("URDF", chosen.write_urdf),
            ("plots", chosen.plots),
            ("quality", chosen.json),
        ):
            if path:
                print(plain(f"Wrote {path}: {what}."), file=sys.stderr)
        if shared:
            print(
                plain(
                    f"In {chosen.write_urdf} {', '.join(shared)} share what is left of them together: no link by itself has "
                    "what the payload takes off."
                ),
                file=sys.stderr,
            )
        if not chosen.output:
            print("Nothing is kept: -o arm.yaml would write the parameters.", file=sys.stderr)
    return DONE if found.quality["taken"] and found.quality["efforts_judged"] else DOUBTFUL


def _draw(path, recording, model, found):
    """A page of plots of the last recording."""
    shares = ["-" if share is None else f"{share:.2f}" for share in found.quality["explained_total"]]
    title = (
        f"{model.name}: {', '.join(found.quality['taken']) or 'nothing taken'}. Effort that the model leaves unexplained, by "
        f"the observer at {given.GAIN:g}/s; shaded: held out.\n"
        f"Of d(K + U)/dt the efforts explain {shares[0]} before, {shares[1]} after."
    )
    time, torques = residual_curves((model, found.model), recording.pieces, given.GAIN)
    held_out = time[-1] - found.quality["held_out_duration"], time[-1]
    picture(path, title, time, torques, found.quality["torque_rms"], held_out)


def plain_lines(text):
    """The text with what would act on a terminal made visible, line by line."""
    return "\n".join(plain(line) for line in text.splitlines())


def summary(found, first):
    """What was identified, and how well it does on the part held out, in words; times after that of the first state [s]."""
    quality, model = found.quality, found.model
    lines = [f"{model.name}: {', '.join(quality['taken']) or 'nothing of it makes the model better'}"]
    begin, end = (time - first for time in quality["held_out"])
    lasts = quality["held_out_duration"]
    until = f"{end:.1f} s" if end >= begin else f"{end:.1f} s of the run after it"  # its stamps begin anew
    lines += ["", f"From {begin:.1f} to {until}, {lasts:.1f} s that this was not fitted to, before and after:", ""]
    wide = max(len(name) for name in ("joint", *quality["torque_rms"]))
    lines.append(
        f"  {'joint':{wide}}  {'effort, rms':>17}  {'observer, spread':>17}   damping  friction    offset  armature"
    )
    lines.append(f"  {'SI units':{wide}}  {'N m':>17}  {'N m':>17}   N m s/rad     N m       N m     kg m²")
    for name in quality["torque_rms"]:
        columns = (_arrow(quality[key][name]) for key in ("torque_rms", "observer_spread"))
        lines.append(f"  {name:{wide}}  {'  '.join(columns)}  {_numbers(found.parameters.joints.get(name))}")
    for key, what in (("explained", "dK/dt"), ("explained_total", "d(K + U)/dt")):
        if None not in quality[key]:
            lines.append(f"  of {what} the efforts explain {quality[key][0]:.3f}, then {quality[key][1]:.3f}")
    before, after = quality["kinetic_energy"]
    lines.append(f"  kinetic energy, mean: {before:.4g} J, then {after:.4g} J")
    if quality["payload"]:
        lines += ["", _payload(quality["payload"])]
    for title, texts in (("warnings", quality["warnings"]), ("about the recordings", quality["findings"])):
        if texts:
            lines += ["", f"{title}:", *(f"  {text}" for text in texts)]
    return "\n".join(lines)


def _arrow(pair):
    return " → ".join(f"{'-' if value is None else f'{value:.3g}':>7}" for value in pair)


def _numbers(joint):
    values = ((None,) * 4) if joint is None else (joint.damping, joint.friction, joint.effort_offset, joint.armature)
    return "".join(f"{'' if value is None else f'{value:.3g}':>10}" for value in values)


def _payload(payload):
    com = zip(payload["com"], payload["com_deviation"], strict=True)
    mass = f"{payload['mass']:.4g} ± {payload['mass_deviation']:.1g} kg"
    return f"payload of {payload['link']}: {mass} at {', '.join(f'{x:.4g} ± {off:.1g}' for x, off in com)} m"
