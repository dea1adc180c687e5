# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as YAML, and back; types by their names."""

import array
from importlib import import_module

import numpy as np
import yaml

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.names import nearest

KINDS = ("msg", "srv")


def type_of(name):
    """The class of a message or service.

    Parameters
    ----------
    name : str
        As ``sensor_msgs/msg/JointState``.

    Raises
    ------
    InputError
        No such type is installed.
    """
    parts = name.split("/")
    if len(parts) != 3 or parts[1] not in KINDS:
        raise InputError(f"type '{name}' is not of the form package/msg/Name or package/srv/Name.")
    try:
        module = import_module(".".join(parts[:2]))
    except ImportError as error:
        raise InputError(f"type '{name}': {error}. Is the shell set up (source scripts/env.bash)?") from error
    found = getattr(module, parts[2], None)
    if found is None:
        raise InputError(f"type '{name}' is not in {'.'.join(parts[:2])}{_meant(parts[2], dir(module))}")
    return found


def as_values(message):
    """A message as dicts, lists and numbers."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: as_values(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, (bytes, bytearray)):
        return list(message)
    if isinstance(message, (np.ndarray, array.array)):
        return message.tolist()
    if isinstance(message, (list, tuple)):
        return [as_values(entry) for entry in message]
    return message


class _Dumper(yaml.SafeDumper):
    """Writes a list of numbers or texts in one line, everything else a line each."""

    def represent_sequence(self, tag, sequence, flow_style=None):
        plain = not any(isinstance(entry, (dict, list)) for entry in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain)


def as_yaml(values):
    """What :func:`as_values` gave, as text for people; a text alone as it is."""
    if isinstance(values, str):
        return f"{values}\n"
    text = yaml.dump(values, Dumper=_Dumper, sort_keys=False, default_flow_style=False, width=160, allow_unicode=True)
    return text.removesuffix("...\n")  # YAML's end of a document that is one number


def field(message, path):
    """A field of a message by a path such as ``header.stamp`` or ``position[0]``.

    Raises
    ------
    InputError
        The message has no such field.
    """
    here = message
    for part in path.replace("[", ".[").split("."):
        try:
            here = here[int(part[1:-1])] if part.startswith("[") else getattr(here, part)
        except (AttributeError, IndexError, TypeError, ValueError):
            names = list(getattr(here, "get_fields_and_field_types", dict)())
            raise InputError(f"field '{path}': there is no {part!r}{_meant(part, names)}") from None
    return here


def filled(kind, text):
    """A message of a type from YAML text; what is not said keeps its default.

    Raises
    ------
    InputError
        The text is no YAML, names a field that is not there, or has a value of the wrong type.
    """
    try:
        values = yaml.safe_load(text) if text else {}
    except yaml.YAMLError as error:
        raise InputError(f"{text!r} is no YAML: {' '.join(str(error).split())}") from error
    return _message(kind, {} if values is None else values, "")


def _message(kind, values, path):
    message = kind()
    types = message.get_fields_and_field_types()
    if not isinstance(values, dict):
        raise InputError(f"{path or kind.__name__} is {values!r}, expected {{field: value, …}} of {', '.join(types)}.")
    for name, value in values.items():
        if name not in types:
            raise InputError(f"{kind.__name__} has no field {name!r}{_meant(str(name), types)}")
        where = f"{path}.{name}" if path else name
        try:
            setattr(message, name, _value(types[name], value, getattr(message, name), where))
        except InputError:  # of a field within this one
            raise
        except (AssertionError, OverflowError, TypeError, ValueError) as error:
            raise InputError(f"field '{where}' is {value!r}, expected {types[name]}.") from error
    return message


def _value(type_name, value, now, where):
    """A value of a field, from YAML's, as the field wants it; `now` is what it has."""
    if type_name.startswith("sequence<") or type_name.endswith("]"):
        entry = type_name.removeprefix("sequence<").rstrip(">").split("[")[0].split(",")[0]
        if not isinstance(value, list):
            raise TypeError
        return [_value(entry, one, None, f"{where}[{k}]") for k, one in enumerate(value)]
    if "/" in type_name:
        package, name = type_name.split("/")
        return _message(type_of(f"{package}/msg/{name}"), value, where)
    if type_name in ("double", "float"):
        if isinstance(value, bool):
            raise TypeError
        return float(value)
    if type_name == "boolean" and not isinstance(value, bool):
        raise TypeError
    if "int" in type_name and (isinstance(value, bool) or not isinstance(value, int)):
        raise TypeError
    if type_name.startswith("string") and not isinstance(value, str):
        raise TypeError
    if type_name == "octet":
        return bytes([value])
    return value


def _meant(name, names):
    near = nearest(name, [one for one in names if not one.startswith("_")])
    if near:
        return f"; is '{near}' meant?"
    return f"; there are {', '.join(names)}." if 0 < len(names) <= 20 else "."
