# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages without ROS, by the library rosbags: types, definitions, and decoding of plain CDR."""

import os
from functools import cache
from pathlib import Path
from types import SimpleNamespace

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

IDL = {"bool": "boolean", "byte": "octet", "float32": "float", "float64": "double"}
"""Names in IDL of primitives that have another name in a definition."""

DEFAULTS = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
"""Values of primitives in a new message other than 0."""


@cache
def typestore():
    """Return the types of ROS 2 and of this package, a Typestore of rosbags."""
    typesys = require("rosbags.typesys", "messages without ROS")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for kind, text in our_definitions().items():
        store.register(typesys.get_types_from_msg(text, kind))
    return store


@cache
def message_type(kind):
    """Return the class of messages of a type such as ``sensor_msgs/msg/JointState``."""
    fields = dict(typestore().get_msgdef(kind).fields)

    class Message(SimpleNamespace):
        __doc__ = kind

        def __init__(self, **values):
            defaults = {name: _default(*field) for name, field in fields.items()}
            super().__init__(**defaults | values)

        @classmethod
        def get_fields_and_field_types(cls):
            """Return types by field, as classes of rosidl."""
            return {name: _idl(*field) for name, field in fields.items()}

    Message.__name__ = kind.split("/")[-1]
    return Message


def _default(node, content):
    """Return the value of a field in a new message, of a field that rosbags has parsed."""
    if node.name == "BASE":
        return DEFAULTS.get(content[0], 0)
    if node.name == "NAME":
        return message_type(content)()
    element, count = content
    return [_default(*element)] * count  # a sequence counts 0


def _idl(node, content):
    """Return the name of the type of a field in IDL."""
    if node.name == "BASE":
        return IDL.get(content[0], content[0])
    if node.name == "NAME":
        return content.replace("/msg/", "/")
    name = _idl(*content[0])
    return f"{name}[{content[1]}]" if node.name == "ARRAY" else f"sequence<{name}>"


def read_message(raw, kind):
    """Return the message in bytes; an error of any class if they are no such message."""
    if bytes(raw[:1]) != b"\0" or raw[1] > 1:
        raise ValueError("the encapsulation is not that of plain CDR")
    return typestore().deserialize_cdr(raw, kind)


def definition_with_parts(kind):
    """Return the definitions of a type and of all types in it, in the format ``ros2msg``."""
    return typestore().generate_msgdef(kind, ros_version=2)[0]


# --- Messages of this package

PACKAGE = Path(__file__).resolve().parents[1]


def _folders():
    """Yield possible folders: of a wheel, of a checkout, of an installed workspace."""
    yield PACKAGE / "definitions"
    yield PACKAGE.parent / "msg"
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share" / "diag_dynamics" / "msg"


@cache
def our_definitions():
    """Return the definitions of this package's messages by type."""
    for folder in _folders():
        if paths := sorted(folder.glob("*.msg")):
            return {
                f"diag_dynamics/msg/{path.stem}": path.read_text(encoding="utf-8") for path in paths
            }
    folders = ", ".join(map(str, _folders()))
    raise InputError(f"the definitions of this package's messages are in none of {folders}.")
