# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What others are given: sdist and wheel are complete, the sdist's tests run, and files for the project's hosts are whole."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ET
import zipfile
from email import message_from_string
from pathlib import Path

import pytest
import yaml

import diag_dynamics as dd

pytestmark = [pytest.mark.full]

tomllib = pytest.importorskip("tomllib", reason="Python 3.10 has no tomllib")

ROOT = Path(__file__).parents[2]
NAME = f"diag_dynamics-{dd.__version__}"

BUILT = ("build", ".git", "*.egg-info", "__pycache__", ".*_cache", ".hypothesis", ".benchmarks", "node_modules")
"""What is in a checkout beside what belongs to it."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Make sdist, and from it the wheel, of a copy of the checkout."""
    pytest.importorskip("build", reason="build is not installed")
    pytest.importorskip("setuptools", minversion="77", reason="setuptools 77 is not installed")
    folder = tmp_path_factory.mktemp("packaging")
    shutil.copytree(ROOT, folder / "checkout", ignore=shutil.ignore_patterns(*BUILT))
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(folder / "checkout")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_the_sdist_is_the_checkout(made):
    """Every file that git knows of, or, where there is no git, every one that was there."""
    with tarfile.open(made / f"{NAME}.tar.gz") as archive:
        inside = {member.name.removeprefix(f"{NAME}/") for member in archive.getmembers() if member.isfile()}
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    checkout = made / "checkout"
    wanted = listed.stdout.split("\n")[:-1] if listed.returncode == 0 else []
    wanted = wanted or [str(path.relative_to(checkout)) for path in checkout.rglob("*") if path.is_file()]
    there = {name for name in wanted if (ROOT / name).is_file() and "egg-info" not in name}
    assert len(there) > 600 and there - inside == set()
    built = {"build", "node_modules", "__pycache__", ".git"}
    assert [name for name in inside if built & set(name.split("/"))] == []


def test_the_wheel_is_the_library(made):
    """Modules, definitions of messages, py.typed and the licence; no test and no page."""
    (wheel,) = made.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
        metadata = message_from_string(archive.read(f"{NAME}.dist-info/METADATA").decode())
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "diag_dynamics").rglob("*.py")}
    assert modules <= inside and "diag_dynamics/py.typed" in inside
    assert {f"diag_dynamics/definitions/{path.name}" for path in (ROOT / "msg").glob("*.msg")} <= inside
    assert {name.split("/")[0] for name in inside} == {"diag_dynamics", f"{NAME}.dist-info"}
    assert {f"{NAME}.dist-info/licenses/{name}" for name in ("LICENSE", "LICENSES/MIT.txt")} <= inside
    assert metadata["License-Expression"] == "Apache-2.0 AND MIT" and metadata["Requires-Python"] == ">=3.10"
    assert metadata["Maintainer-email"] and len(metadata.get_all("Classifier")) > 8
    assert not [line for line in metadata.get_all("Classifier") if line.startswith("License ::")]


def test_tests_run_from_the_tarball(made):
    """Of the library and of the package as a whole, by what was unpacked and by nothing of the checkout."""
    with tarfile.open(made / f"{NAME}.tar.gz") as archive:
        archive.extractall(made, filter="data")
    unpacked = made / NAME
    apart = [place for place in os.environ.get("PYTHONPATH", "").split(os.pathsep) if place and Path(place) != ROOT]
    tests = ["test/library/test_text.py", "test/library/test_checks.py", "test/project/test_package.py"]
    chosen = "downward or private_state or cmake_lists or map_of_the_paper or text or checks"
    script = "import diag_dynamics, sys, pytest; print(diag_dynamics.__file__); sys.exit(pytest.main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", script, "-q", "-p", "no:cacheprovider", "-k", chosen, *tests],
        cwd=unpacked,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(unpacked), *apart])},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[0] == str(unpacked / "diag_dynamics" / "__init__.py")
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) > 10


def test_names_and_versions_agree():
    """package.xml, pyproject.toml and CITATION.cff."""
    package = ET.parse(ROOT / "package.xml").getroot()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert package.findtext("version") == citation["version"] == dd.__version__
    licences = [one.text for one in package.iterfind("license")]
    assert project["license"] == " AND ".join(licences) == "Apache-2.0 AND MIT"  # the page has parts by others
    assert citation["license"] == licences[0] and all(
        (ROOT / one.get("file")).is_file() for one in package.iterfind("license")
    )
    (maintainer,) = project["maintainers"]
    assert (package.findtext("maintainer"), package.find("maintainer").get("email")) == tuple(maintainer.values())
    assert package.findtext("author") == project["authors"][0]["name"] == citation["authors"][0]["name"]
    addresses = [url.text for url in package.iterfind("url")]
    assert sorted(addresses) == sorted(project["urls"].values()) and all(re.match("https://", url) for url in addresses)
    assert {"cff-version", "message", "title"} <= set(citation)


def test_package_xml_is_valid():
    """By the validator of catkin_pkg, which colcon, rosdep and bloom read it with; without a warning."""
    packages = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg is not installed")
    warnings = []
    package = packages.parse_package(str(ROOT / "package.xml"), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == [] and package.urls and package.authors and package.get_build_type() == "ament_cmake"


RIGHTS = ("SPDX-FileCopyrightText: diag_dynamics maintainers", "SPDX-License-Identifier: Apache-2.0")
"""How a source begins, in a comment: after a line that has to be the first, if there is one."""


def glob(pattern):
    """A pattern of REUSE.toml as a regular expression: two stars match anything, one no slash."""
    parts = {"**": ".*", "*": "[^/]*"}
    return re.compile("".join(parts.get(part) or re.escape(part) for part in re.split(r"(\*\*|\*)", pattern)))


def files_of_the_project():
    """Paths of all that git knows of, or, where there is no git, of all that was not built."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode == 0:
        return [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    built = {"build", "node_modules", "__pycache__", "PKG-INFO", "setup.cfg"}
    paths = [path.relative_to(ROOT) for path in ROOT.rglob("*") if path.is_file()]
    hidden = [
        part for part in ROOT.iterdir() if part.name.endswith((".egg-info", "_cache", ".hypothesis", ".benchmarks"))
    ]
    return [str(p) for p in paths if not built & set(p.parts) and ROOT / p.parts[0] not in hidden]


def annotations():
    """Patterns of REUSE.toml, and the licences of each."""
    reuse = tomllib.loads((ROOT / "REUSE.toml").read_text(encoding="utf-8"))
    for one in reuse["annotations"]:
        patterns = [one["path"]] if isinstance(one["path"], str) else one["path"]
        yield [glob(pattern) for pattern in patterns], set(one["SPDX-License-Identifier"].split(" AND "))


def test_every_source_says_who_holds_the_rights():
    """In two lines at its beginning; REUSE.toml says it of what cannot, and of nothing that says it itself."""
    declared = [pattern for patterns, _ in annotations() for pattern in patterns]
    names = [name for name in files_of_the_project() if name != "LICENSE"]
    names = [name for name in names if not name.startswith("LICENSES/")]
    assert len(names) > 600
    for name in names:
        by_pattern = any(pattern.fullmatch(name) for pattern in declared)
        if by_pattern and Path(name).suffix in (".png", ".jpg"):
            continue
        head = "\n".join((ROOT / name).read_text(encoding="utf-8").split("\n", 4)[:3])
        own = all(line in head for line in RIGHTS)
        assert own or by_pattern, f"{name} does not begin with {RIGHTS[0]!r} and {RIGHTS[1]!r}, in a comment"
        assert not (own and by_pattern), f"{name} says who holds its rights, and so does REUSE.toml"
    for pattern in declared:
        assert any(pattern.fullmatch(name) for name in names), f"REUSE.toml: {pattern.pattern} is nothing"


def test_licences_are_there():
    """The text of each that is declared, by one of its name, and no other."""
    used = {"Apache-2.0"}.union(*(licences for _, licences in annotations()))
    assert {path.stem for path in (ROOT / "LICENSES").iterdir()} == used == {"Apache-2.0", "MIT"}
    assert (ROOT / "LICENSES" / "Apache-2.0.txt").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_reuse_is_content():
    """By REUSE's own tool, where it is installed."""
    reuse = shutil.which("reuse")
    if reuse is None:
        pytest.skip("reuse is not installed")
    done = subprocess.run([reuse, "lint"], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout


WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_name_what_is_there(path):
    """They parse, say that they were not run, and call targets of the Makefile and files that exist."""
    text = path.read_text(encoding="utf-8")
    assert "\n# NOT RUN HERE" in text[:300]
    uses = re.findall(r"uses: (.*)", text)
    assert uses and all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}  # v\d+\.\d+\.\d+", use) for use in uses), uses
    assert yaml.safe_load(text)["permissions"] == {"contents": "read"}  # more is a job's own
    jobs = yaml.safe_load(text)["jobs"]
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    for name, job in jobs.items():
        assert {"runs-on", "steps"} <= set(job), name
        assert set([job["needs"]] if "needs" in job else []) <= set(jobs)
        for step in job["steps"]:
            assert ("uses" in step) != ("run" in step)
            assert set(re.findall(r"(?:^|&& )make ([a-z-]+)", step.get("run", ""), re.M)) <= targets
            assert all(
                (ROOT / file).exists() for file in re.findall(r"(?:^|\s)((?:\.ci|test)/\w+)", step.get("run", ""))
            )


def test_forms_and_hooks_parse():
    """Of issues, with an id for each field; hooks with their commands."""
    for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        form = yaml.safe_load(path.read_text(encoding="utf-8"))
        if path.name != "config.yml":
            assert {"name", "description", "body"} <= set(form)
            assert all(part["attributes"]["label"] and part["id"] for part in form["body"])
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0]["hooks"]
    assert {"ruff", "ruff-format", "mypy", "reuse"} <= {hook["id"] for hook in hooks}
