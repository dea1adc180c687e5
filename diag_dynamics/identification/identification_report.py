# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of an identification in one HTML file.

It has curves, parameters with intervals, steps and base parameters.
"""

import numpy as np

import diag_dynamics
from diag_dynamics.atomic_file import write_text
from diag_dynamics.identification.normal_equations import COLUMNS
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.optional import require
from diag_dynamics.recordings.balance import MIN_EXPLAINED

WIDTH, HEIGHT = 1000.0, 100.0  # of a drawing, which the page stretches
UNITS = {"damping": "N m s/rad", "friction": "N m", "effort_offset": "N m", "armature": "kg m²"}
UNITS |= {"load_friction": "1", "root_friction": "N m √(s/rad)"}
SIGMAS = 2.0  # of an interval
GOOD, POOR = 0.05, 0.15  # error of the effort over its measured range
TICKS = 5.0  # of the time axis, about


def write_report(path, identification):
    """Write the report of an identification into an HTML file.

    It is an :class:`~diag_dynamics.identification.result.Identification`.
    """
    jinja2 = require("jinja2", f"'{path}'")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("diag_dynamics", "identification"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    quality = identification.quality
    page = environment.get_template("report.html.j2").render(
        found=identification,
        quality=quality,
        curves=[
            _draw_joint(identification, k, slides)
            for k, slides in enumerate(sliding_dofs(identification.model))
        ],
        axis=_time_axis(identification.curves.t),
        good=(GOOD, POOR, MIN_EXPLAINED),
        units=UNITS,
        joints={
            name: _parameters(identification, k, name)
            for k, name in enumerate(identification.model.dof_names)
        },
        base=[_base_parameter(parameter) for parameter in quality["base_parameters"]["parameters"]],
        version=diag_dynamics.__version__,
    )
    write_text(path, page)


def _time_axis(t):
    """Return the duration of the curves and the ticks of their axis [s]."""
    duration = float(np.nanmax(t, initial=1e-9))
    step = float(f"{duration / TICKS:.0e}")
    return {"duration": duration, "ticks": np.arange(0.0, duration, step).tolist()}


def _draw_joint(identification, k, slides):
    """Return drawings of a joint's efforts and errors, and its error by the range of its effort."""
    curves = identification.curves
    name = identification.model.dof_names[k]
    error = identification.quality["torque_rms"][name][1]
    measured = curves.measured[:, k]
    extent = np.nanmax(measured, initial=-np.inf) - np.nanmin(measured, initial=np.inf)
    return {
        "name": name,
        "unit": "N" if slides else "N m",
        "share": error / extent if error is not None and extent > 0.0 else None,
        "effort": _draw(curves, k, "before", "after", "measured"),
        "error": _draw(curves, k, "error_before", "error_after"),
    }


def _draw(curves, k, *names):
    """Return the paths of a joint's curves, the last one on top, and their range with zero."""
    t = curves.t
    values = np.array([getattr(curves, name)[:, k] for name in names])
    low = float(np.nanmin(values, initial=0.0))
    high = float(np.nanmax(values, initial=0.0))
    scale = HEIGHT / (high - low or 1.0)
    x = WIDTH * t / np.nanmax(t, initial=1e-9)
    y = scale * (high - values)
    paths = {name: _path(x, row) for name, row in zip(names, y, strict=True)}
    return {"paths": paths, "low": low, "high": high, "zero": round(scale * high, 1)}


def _path(x, y):
    """Return the path of a curve, which is interrupted where it is NaN."""
    begins = True
    parts = []
    for point in zip(x.round(1).tolist(), y.round(1).tolist(), strict=True):
        is_finite = all(np.isfinite(point))
        if is_finite:
            parts.append(f"{'M' if begins else 'L'}{point[0]:g} {point[1]:g}")
        begins = not is_finite
    return "".join(parts)


def _parameters(identification, k, name):
    """Return value, half of its interval and whether it was fitted of each parameter of a joint."""
    fitted = identification.parameters.joints.get(name)
    cells = {}
    deviations = identification.quality["deviations"].get(name, {})
    for key in COLUMNS:
        value = float(getattr(identification.model, key)[k])
        half = SIGMAS * deviations[key] if key in deviations else None
        cells[key] = {
            "value": value,
            "half": half,
            "fitted": getattr(fitted, key, None) is not None,
            "weak": half is not None and half > abs(value),
        }
    return cells


def _base_parameter(parameter):
    """Return a base parameter with half of its interval."""
    deviation = parameter["deviation"]
    return parameter | {"half": None if deviation is None else SIGMAS * deviation}
