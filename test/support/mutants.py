# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mutants of the rules for joint states: whether the tests notice when a rule is wrong.

As a program: ``python test/support/mutants.py`` copies the package once for each mutant, changes one line of the copy and
runs the tests of the rules on it. It names every mutant that no test notices, and ends with status 1 if there is one.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

TESTS = ("test_inputs.py", "test_joint_states.py")

MUTANTS = {
    "a late stamp is taken after four": ("stamps", "count + 1 < LATE_COUNT", "count + 1 < LATE_COUNT - 1"),
    "a clock that is apart is believed at once": (
        "stamps",
        "now - self._refused[0] < PATIENCE",
        "now < self._refused[0]",
    ),
    "a stamp exactly at max_age is far": ("stamps", "far = abs(apart) > most", "far = abs(apart) >= most"),
    "a foreign stamp just within the bound is in step": ("stamps", "2 * abs(now - stamp) <=", "abs(now - stamp) <="),
    "positions are held to the bare limits": ("bounds", "dtype=float) + slack, most)", "dtype=float), most)"),
    "an infinite velocity is refused as absurd": ("bounds", " & np.isfinite(velocity)", ""),
    "a velocity limit of 0 is a limit": ("bounds", "& (limit > 0.0)", "& (limit >= 0.0)"),
    "a jump is believed one state too early": ("jumps", ">= STATES).all()", ">= STATES - 1).all()"),
    "a step of an angle is the longer way": ("jumps", "np.minimum(turned, 2.0 * np.pi - turned)", "turned"),
    "a step is explained by once the velocity": ("jumps", "2.0 * np.fmax(", "1.0 * np.fmax("),
    "an absurd effort is kept": (
        "efforts",
        "np.where(absurd | np.isinf(effort), np.nan, effort), True",
        "effort, True",
    ),
    "an unavailable effort is used": (
        "efforts",
        "if available.get(n, True) else np.nan for",
        "if True else np.nan for",
    ),
    "efforts of followers act unreflected": (
        "followers",
        "self.multipliers * np.where(np.isfinite(own)",
        "np.where(np.isfinite(own)",
    ),
    "a gap counts its own period": ("gaps", "return int(counts.sum()) - len(counts)", "return int(counts.sum())"),
    "an estimate goes on after a pause": (
        "velocities",
        "& (elapsed <= np.maximum(longest",
        "| (elapsed <= np.maximum(longest",
    ),
    "an estimate is handed out too early": ("velocities", "/ SECOND >= time)", "/ SECOND >= 0.5 * time)"),
    "odometry of any age goes with any joints": ("odometry", "if timeout and apart >", "if timeout and -apart >"),
    "the oldest stamp is the joints'": ("odometry", "oldest=min(state.oldest, self.stamp)", "oldest=state.oldest"),
    "a held position with a velocity is never frozen": (
        "frozen",
        ">= self._timeout)\n\n    def _told",
        ">= 1e18)\n\n    def _told",
    ),
    "stale joints are used": ("assembler", "        if stale:\n", "        if stale and False:\n"),
}
"""Of each mutant the module, what is right in it, and what is put in its place."""


def unnoticed(name):
    """Return the output of the tests on a mutant, if all of them pass; else None."""
    module, right, wrong = MUTANTS[name]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "diag_dynamics")
        shutil.copytree(ROOT / "diag_dynamics", copy, ignore=shutil.ignore_patterns("__pycache__"))
        path = copy / "assembly" / f"{module}.py"
        source = path.read_text(encoding="utf-8")
        if source.count(right) != 1:
            raise ValueError(f"{path.name} has changed: mutate it anew ({name})")
        path.write_text(source.replace(right, wrong), encoding="utf-8")
        tests = [str(ROOT / "test" / "nodes" / file) for file in TESTS]
        paths = os.pathsep.join(filter(None, (folder, os.environ.get("PYTHONPATH"))))
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "pytest",
                "-x",
                "-q",
                "-p",
                "no:cacheprovider",
                "-o",
                f"pythonpath={folder}",
                *tests,
                "--import-mode=prepend",
                "-o",
                f"pythonpath={folder} {ROOT / 'test' / 'support'}",
            ],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": paths, "PYTEST_ADDOPTS": ""},
            capture_output=True,
            text=True,
        )
        # 1: tests have failed. Anything else but 0 says that they did not run.
        if done.returncode not in (0, 1):
            raise RuntimeError(f"{name}: {done.stdout}{done.stderr}")
        return done.stdout if done.returncode == 0 else None


def main():
    """Run all mutants, or those whose names hold a text that is given."""
    wanted = [name for name in MUTANTS if all(text in name for text in sys.argv[1:])]
    survivors = []
    for name in wanted:
        noticed = unnoticed(name) is None
        survivors += [] if noticed else [name]
        print(f"{'noticed  ' if noticed else 'UNNOTICED'}  {name}", flush=True)
    print(f"{len(wanted) - len(survivors)} of {len(wanted)} mutants are noticed")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
