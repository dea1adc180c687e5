# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of URDFs: encodings, comments and leftovers of xacro that ROS reads, and kinds of files
that are no URDF.
"""

import io
import struct
import zipfile

import pytest

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.description import urdf_text as sources
from diag_dynamics.description.urdf_writer import urdf_with
from diag_dynamics.inspection import inspect_robot
from robots import BOX, description, joint, link

ARM = description(
    "arm", link("base"), link("upper", **BOX), joint("shoulder", "revolute", "base", "upper")
)
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def test_size(monkeypatch, tmp_path):
    """A file that is larger than accepted is rejected, as a path and as text."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    monkeypatch.setattr(sources, "MAX_BYTES", len(ARM) - 1)
    for source in (path, ARM, ARM.encode(), io.StringIO(ARM)):
        with pytest.raises(dd.UrdfError, match=f"more than the {len(ARM) - 1} bytes"):
            dd.load_urdf(source)


def with_comment(text, source=ARM):
    return source.replace("<link", f"<!--{text}--><link", 1)


def declaring(encoding, text):
    return f'<?xml version="1.0" encoding="{encoding}"?>\n{text}'


def assert_same_model(source, names=("shoulder",)):
    model = dd.load_urdf(source)
    expected = dd.load_urdf(ARM)
    assert model.bodies.tobytes() == expected.bodies.tobytes()
    assert model.dof_names == names
    assert inspect_robot(source).checks["loading"] == "ok"


# --- Encodings

CHINESE = "机器人的手臂"

ENCODED = {
    "Latin-1, undeclared": with_comment(" Gehäuse ").encode("latin-1"),
    "Latin-1, declared UTF-8": declaring("utf-8", with_comment(" Gehäuse ")).encode("latin-1"),
    "GBK, undeclared": with_comment(CHINESE).encode("gbk"),
    "ISO-2022-JP": declaring("iso-2022-jp", with_comment("表")).encode("iso2022_jp"),
    "UTF-8 with a mark": b"\xef\xbb\xbf" + declaring("gb2312", with_comment(CHINESE)).encode(),
    "UTF-16, big end first": ("\ufeff" + declaring("utf-16", with_comment(CHINESE))).encode(
        "utf-16-be"
    ),
    "unknown encoding": declaring("x-editor", with_comment(" ä ")).encode(),
}


@pytest.mark.parametrize("case", ENCODED)
def test_encodings(case, tmp_path):
    """All that URDF defines is ASCII: comments may be in any encoding, declared or not."""
    data = ENCODED[case]
    file = tmp_path / "arm.urdf"
    file.write_bytes(data)
    sources = [data, file, str(file), io.BytesIO(data)]
    if b"robot" in data:  # text, as the topic brings it
        sources.append(data.decode("utf-8", "replace"))
    expected = dd.load_urdf(ARM)
    for source in sources:
        assert dd.load_urdf(source).bodies.tobytes() == expected.bodies.tobytes()


def test_names_in_other_encodings():
    """They are those of the encoding; UTF-8 is recognized despite another declaration."""
    for name, encoding in (
        ("Schläger", "latin-1"),
        ("関節ソ", "shift_jis"),
    ):
        text = ARM.replace("shoulder", name)
        assert_same_model(declaring(encoding, text).encode(encoding), (name,))
        assert_same_model(declaring("iso-8859-1", text).encode(), (name,))
    assert_same_model(ARM.replace("shoulder", "Schläger").encode("latin-1"), ("Schläger",))


# --- Comments

COMMENTS = (
    " gripper -- 2023 ",
    "--",
    "-",
    "-- arm --",
    " a > b < c & d ",
    "->",
    "\x0b\x1b\x07",
)


@pytest.mark.parametrize("comment", COMMENTS)
def test_comments(comment):
    """A comment ends at the next -->, as in tinyxml2, and means nothing; a rewritten URDF keeps
    it.
    """
    text = with_comment(comment)
    assert_same_model(text)
    assert_same_model(text.encode())
    assert_same_model(f"<!--{comment}-->\n{text}<!--{comment}-->")
    heavy = urdf_with(sources.urdf_text(text), dd.Parameters(links={"base": dd.Payload(1000.0)}))
    assert dd.load_urdf(heavy).total_mass > 1000.0


def test_many_comments():
    """Reading takes time in proportion to their number."""
    assert_same_model("<!-- -- -->\n" * 20_000 + ARM)
    assert_same_model("\n" * 20_000 + ARM)
    with pytest.raises(dd.UrdfError, match="not well-formed XML"):
        dd.load_urdf(ARM.replace("</robot>", "<!-- " * 100_000))


def test_markup_in_comments_and_text():
    """Neither hides elements nor shows those of a comment."""
    assert_same_model(with_comment(' <link name="no"/> -- <![CDATA[ '))
    assert_same_model(
        ARM.replace(
            "</robot>",
            "<gazebo><plugin><![CDATA[ <!-- -- ]]></plugin></gazebo><?pi <!-- ?></robot>",
        )
    )
    assert dd.load_urdf(
        with_comment("-- a --").replace(
            "</robot>", f"{link('l')}{joint('w', 'fixed', 'upper', 'l')}</robot>"
        )
    )
    for text in ("<!-- -- " + ARM, ARM.replace("</robot>", "<!-- -- </robot>")):
        with pytest.raises(dd.UrdfError, match="not well-formed XML"):
            dd.load_urdf(text)


def test_ampersands():
    """One that begins no entity is itself, as in tinyxml2; entities stay what they are."""
    for written, name in (
        ("a & b", "a & b"),
        ("a&b", "a&b"),
        ("a&amp;b&lt;", "a&b<"),
        ("&#65;&#x42;", "AB"),
        ("&", "&"),
    ):
        assert_same_model(ARM.replace("shoulder", written), (name,))
    with pytest.raises(dd.UrdfError, match="'base' not defined"):
        dd.load_urdf(ARM.replace("shoulder", "&base;"))


def test_line_numbers():
    """Errors name the line of the file."""
    broken = with_comment("\n -- \n--\n").replace("</link>", "</lonk>", 1)
    line = broken[: broken.index("</lonk>")].count("\n") + 1
    for before in (
        "",
        '<?xml version="1.0"?>\n',
        '\n\n<?xml version="1.0"?>\n\n',
        '<?xml version="1.0" encoding="gb2312"?>\n\n',
    ):
        text = before + broken
        with pytest.raises(dd.UrdfError, match=rf"\(line {line + before.count(chr(10))}\)"):
            dd.load_urdf(text.encode())
        nameless = before + with_comment("\n--\n").replace(' name="base"', "", 1)
        with pytest.raises(dd.UrdfError, match=rf"line {3 + before.count(chr(10))} has no name"):
            dd.load_urdf(nameless)


# --- Leftovers of xacro

LEFTOVERS = {
    "property": '<xacro:property name="width" value=".2"/>',
    "property with an expression": '<xacro:property name="width" value="${2 * 3}"/>',
    "property with a block": (
        '<xacro:property name="origin"><origin xyz="${x} 0 0" quat_xyzw="a"/></xacro:property>'
    ),
    "argument": '<xacro:arg name="hand" default="false"/>',
    "macro": (
        '<xacro:macro name="m" params="a *b"><link name="${a}"/><xacro:m a="1"/>'
        '<xacro:if value="${a}"/></xacro:macro>'
    ),
    "unused text": (
        '<link name="l"><visual><geometry><mesh filename="$(find p)/${a}.stl"/></geometry>'
        "</visual></link>"
    )
    + joint("w", "fixed", "upper", "l"),
}


@pytest.mark.parametrize("case", LEFTOVERS)
@pytest.mark.parametrize(
    "namespace", [XACRO, 'xmlns:xacro="http://ros.org/wiki/xacro"', 'xmlns:xacro="urn:x"', ""]
)
def test_leftovers_of_xacro(case, namespace):
    """Definitions that nothing uses say nothing of the robot."""
    text = ARM.replace("<robot", f"<robot {namespace}").replace(
        "<link", LEFTOVERS[case] + "<link", 1
    )
    assert_same_model(text)
    assert_same_model(text.encode())


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ('<xacro:arm prefix="a"/>', "<xacro:arm>"),
        ('<xacro:include filename="a.xacro"/>', "<xacro:include>"),
        ('<xacro:if value="1"><link name="l"/></xacro:if>', "<xacro:if>"),
        ('<link name="l"><xacro:inertia/></link>', "<xacro:inertia>"),
        ('<link name="${p}l"/>', "a name with $"),
    ],
)
def test_unexpanded_xacro(content, named):
    more = f'<xacro:property name="a" value="1"/>{content}</robot>'
    with pytest.raises(dd.UrdfError, match="unexpanded xacro") as caught:
        dd.load_urdf(ARM.replace("<robot", f"<robot {XACRO}").replace("</robot>", more))
    assert named in str(caught.value)


# --- What is no URDF


def zipped(text):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("arm.urdf", text)
    return buffer.getvalue()


OTHERS = {
    "Git LFS": (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n",
        "Git LFS. Run git lfs pull",
    ),
    "HTML 5": (b"<!DOCTYPE html>\n<html><body>404</body></html>", "HTML, a page of the web"),
    "SDF": (b'<?xml version="1.0"?><sdf version="1.7"><model name="m"/></sdf>', "an SDF of Gazebo"),
    "SRDF": (b'<robot name="x"><group name="arm"><chain/></group></robot>', "an SRDF of MoveIt"),
    "STL": (b"solid part\n facet normal 0 0 1\n", "begins with 'solid part'; expected <robot>"),
    "binary STL": (b"\0" * 80 + struct.pack("<I", 2) + b"\1" * 100, "it is binary"),
    "zip": (zipped(ARM), "it is binary"),
    "empty": (b"", "The URDF is empty"),
    "macro of xacro": (
        f'<robot {XACRO}><xacro:macro name="m"/></robot>'.encode(),
        "it defines macros and calls none",
    ),
}


def test_mjcf():
    """Commands read it; load_urdf names the function that does."""
    with pytest.raises(dd.UrdfError, match=r"MJCF of MuJoCo\. Load it with load_mjcf"):
        dd.load_urdf("<mujoco><worldbody/></mujoco>")


@pytest.mark.parametrize("case", OTHERS)
def test_other_files(case, tmp_path, capsys):
    """The library and inspect say what the file is, in one line."""
    data, named = OTHERS[case]
    file = tmp_path / "arm.urdf"
    file.write_bytes(data)
    for source in (data, file, str(file), io.BytesIO(data)):
        with pytest.raises(dd.UrdfError) as caught:
            dd.load_urdf(source)
        assert named in str(caught.value)
    assert main(["inspect", str(file)]) == 2
    printed = capsys.readouterr()
    assert named in " ".join((printed.out + printed.err).split()).replace("│", "")
