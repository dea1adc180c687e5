# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of an identification: curves, parameters with intervals, steps and base parameters in one HTML file."""

from importlib import resources

import numpy as np

import diag_dynamics
from diag_dynamics.atomic_file import write_text
from diag_dynamics.identification.regressors import COLUMNS
from diag_dynamics.optional import require

WIDTH, HEIGHT = 1000.0, 100.0  # of a drawing, which the page stretches
UNITS = {"damping": "N m s/rad", "friction": "N m", "effort_offset": "N m", "armature": "kg m²"}
UNITS |= {"load_friction": "1", "root_friction": "N m √(s/rad)"}
SIGMAS = 2.0  # of an interval


def write_report(path, found):
    """Write the report of an :class:`~diag_dynamics.identification.result.Identification` into an HTML file."""
    jinja2 = require("jinja2", f"'{path}'")
    text = (
        resources.files("diag_dynamics.identification")
        .joinpath("report.html.j2")
        .read_text(encoding="utf-8")
    )
    template = jinja2.Template(text, autoescape=True, undefined=jinja2.StrictUndefined)
    quality = found.quality
    page = template.render(
        robot=found.model.name,
        quality=quality,
        curves=[_draw_joint(found, name, k) for k, name in enumerate(found.model.dof_names)],
        units=UNITS,
        joints={name: _parameters(found, name) for name in found.model.dof_names},
        links=found.parameters.links,
        base=[_base_parameter(parameter) for parameter in quality["base_parameters"]["parameters"]],
        version=diag_dynamics.__version__,
    )
    write_text(path, page)


def _draw_joint(found, name, k):
    """Return the drawings of a joint: paths of efforts and of errors, with their ranges."""
    curves, t = found.curves, found.curves.t
    drawings = {}
    for key, columns in (
        ("effort", (curves.measured, curves.before, curves.after)),
        ("error", (curves.error_before, curves.error_after)),
    ):
        values = [column[:, k] for column in columns]
        finite = np.concatenate([value[np.isfinite(value)] for value in values])
        low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
        margin = 0.04 * (high - low) or 1.0
        span = low - margin, high + margin
        paths = [_path(t, value, float(np.nanmax(t, initial=1e-9)), span) for value in values]
        zero = HEIGHT * span[1] / (span[1] - span[0])
        drawings[key] = {
            "paths": paths,
            "low": low,
            "high": high,
            "zero": round(float(np.clip(zero, 0.0, HEIGHT)), 1),
        }
    rms = found.quality["torque_rms"][name]
    return drawings | {"name": name, "rms": rms, "duration": float(np.nanmax(t, initial=0.0))}


def _path(t, values, end, span):
    """Return the path of a curve, which is interrupted where it is NaN."""
    x, y = WIDTH * t / end, HEIGHT * (span[1] - values) / (span[1] - span[0])
    begins, parts = True, []
    for point in zip(x.round(1).tolist(), y.round(1).tolist(), strict=True):
        is_finite = all(np.isfinite(point))
        if is_finite:
            parts.append(f"{'M' if begins else 'L'}{point[0]:g} {point[1]:g}")
        begins = not is_finite
    return "".join(parts)


def _parameters(found, name):
    """Return value, half of its interval and whether it was fitted of each parameter of a joint."""
    fitted = found.parameters.joints.get(name)
    deviations = found.quality["deviations"].get(name, {})
    k, cells = found.model.dof_names.index(name), {}
    for key in COLUMNS:
        identified = None if fitted is None else getattr(fitted, key)
        value = float(getattr(found.model, key)[k]) if identified is None else identified
        half = SIGMAS * deviations[key] if key in deviations else None
        cells[key] = {
            "value": value,
            "half": half,
            "fitted": identified is not None,
            "weak": half is not None and half > abs(value),
        }
    return cells


def _base_parameter(parameter):
    """Return a base parameter with its interval and whether the recordings show it."""
    half = None if parameter["deviation"] is None else SIGMAS * parameter["deviation"]
    data = parameter["from_data"]
    return parameter | {
        "half": half,
        "weak": data is None or SIGMAS * data > abs(parameter["value"]),
    }
