# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion between ROS messages and YAML."""

import re
from importlib import import_module

import yaml

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.names import nearest


def find_type(name):
    """Return the class of a type such as ``std_msgs/msg/Float64``."""
    try:
        package, kind, short = name.split("/")
        return getattr(import_module(f"{package}.{kind}"), short)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"type is '{name}'; expected package/msg/Name: {error}.") from error


def read_field(message, path):
    """Return the field of a message at a path such as ``header.stamp`` or ``position[0]``."""
    value = message
    for part in path.replace("[", ".[").split("."):
        try:
            value = value[int(part[1:-1])] if part.startswith("[") else getattr(value, part)
        except (AttributeError, IndexError, TypeError, ValueError):
            fields = _expected(part, getattr(value, "get_fields_and_field_types", dict)())
            raise InputError(f"field '{path}' has no part '{part}'{fields}") from None
    return value


def to_yaml(message):
    """Return a message or a field as YAML; a string alone is not quoted."""
    values = _to_values(message)
    if isinstance(values, str):
        return f"{values}\n"
    options = {"sort_keys": False, "default_flow_style": None, "width": 1000, "allow_unicode": True}
    return yaml.safe_dump(values, **options).removesuffix("...\n")


def _to_values(message):
    if names := getattr(message, "get_fields_and_field_types", dict)():
        return {name: _to_values(getattr(message, name)) for name in names}
    if hasattr(message, "tolist"):
        return message.tolist()
    return [_to_values(one) for one in message] if isinstance(message, (bytes, list)) else message


def from_yaml(kind, text):
    """Return a message of a class from YAML; fields that the text lacks keep their defaults."""
    try:
        return _message(kind, yaml.safe_load(text) if text else {}, "request")
    except yaml.YAMLError as error:
        raise InputError(f"request is no YAML: {' '.join(str(error).split())}.") from error


def _message(kind, values, path):
    message, types = kind(), kind.get_fields_and_field_types()
    if not isinstance(values, dict):
        raise InputError(f"{path} is {values!r}; expected {{field: value}} of {', '.join(types)}.")
    for name, value in values.items():
        if name not in types:
            raise InputError(f"{path} has no field '{name}'{_expected(str(name), types)}")
        converted = _convert(types[name], value, f"{path}.{name}")
        try:
            setattr(message, name, converted)
        except (AssertionError, OverflowError) as error:
            raise InputError(f"{path}.{name} is {value!r}; expected {types[name]}.") from error
    return message


def _convert(type_name, value, path):
    """Return a value of YAML as the type of a field."""
    entries = re.fullmatch(r"sequence<([^,]*).*>|(.*)\[\d+\]", type_name)
    if "/" in type_name and not entries:
        return _message(find_type(type_name.replace("/", "/msg/")), value, path)
    kinds = {"double": (float, int), "float": (float, int), "boolean": (bool,), "string": (str,)}
    allowed = (list,) if entries else kinds.get(type_name.split("<")[0], (int,))
    if type(value) not in allowed:
        raise InputError(f"{path} is {value!r}; expected {type_name}.")
    if entries:
        return [_convert(entries[1] or entries[2], one, path) for one in value]
    return bytes([value]) if type_name == "octet" else allowed[0](value)


def _expected(name, names):
    if near := nearest(name, names):
        return f". Did you mean '{near}'?"
    return f"; expected one of {', '.join(names)}." if names else "."
