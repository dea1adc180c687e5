# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page that is committed is what its sources make."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]
STATIC = ROOT / "diag_dynamics" / "page" / "static"
FILES = {"index.html", "page.js", "page.css", "licences.txt"}


def test_a_build_from_the_lock_file_gives_the_same_bytes(tmp_path):
    missing = [tool for tool in ("node", "npm") if not shutil.which(tool)]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    web = tmp_path / "web"
    shutil.copytree(ROOT / "web", web, ignore=shutil.ignore_patterns("node_modules"))
    environment = {**os.environ, "npm_config_cache": str(tmp_path / "cache"), "npm_config_update_notifier": "false"}
    install = ["npm", "ci", "--no-audit", "--no-fund", "--ignore-scripts"]
    installed = subprocess.run(install, cwd=web, env=environment, capture_output=True, text=True, timeout=300)
    if any(word in installed.stderr for word in ("ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED", "ETIMEDOUT")):
        pytest.skip("npm's registry cannot be reached")
    assert installed.returncode == 0, installed.stderr
    built = tmp_path / "static"
    subprocess.run(["node", "build.js", str(built)], cwd=web, check=True, timeout=120)
    assert {path.name for path in built.iterdir()} == {path.name for path in STATIC.iterdir()} == FILES
    for name in FILES:
        same = (built / name).read_bytes() == (STATIC / name).read_bytes()
        assert same, f"{name} is not what web/ makes: make page, and commit what it writes"


def test_licences_of_all_that_is_in_the_bundle():
    text = (STATIC / "licences.txt").read_text(encoding="utf-8")
    assert "three 0." in text
    assert "uplot 1." in text
    assert text.count("Permission is hereby granted") == 2


def test_nothing_of_a_name_becomes_html():
    """No source has a way to make elements of text: names come from robots."""
    for path in sorted((ROOT / "web" / "src").glob("*.js")):
        source = path.read_text(encoding="utf-8")
        for word in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function"):
            assert word not in source, f"{path.name} has {word}"


def test_sources_are_short():
    for path in sorted((ROOT / "web" / "src").glob("*.js")):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 350, f"{path.name} is long: split it"
