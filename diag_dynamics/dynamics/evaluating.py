# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluation with all options: arguments of any kind, wrenches, friction, many states, memory of the caller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, Frame, ManyWrenches
from diag_dynamics.dynamics.arguments import check_frame, check_power, has_wrenches
from diag_dynamics.dynamics.calls import ZEROS, States, SweepCaller, friction_of
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.results import BatchEvaluation, BatchMemory, Evaluation, add_power, memory_of, read_only, write_rates
from diag_dynamics.sweeps import batch, evaluation
from diag_dynamics.sweeps import workspace as ws


def evaluate_one(
    caller: SweepCaller,
    q: Any,
    qd: Any,
    tau: Any,
    f_ext: ManyWrenches | None,
    frame: Frame,
    friction: bool,
    state: Array,
    out: Evaluation | None,
) -> Evaluation:
    """Evaluate one state into `state`, the memory of `out` if that is given."""
    nv, external, resisting = caller.nv, None, None
    try:
        check_frame(frame)
        at = caller.one(q, qd=qd, tau=ZEROS if tau is None else tau)
        # Before `state` is written: wrenches may lie in `out`.
        pushing = caller.wrench_effort(at, f_ext, frame) if has_wrenches(f_ext) else None
        caller.check(evaluation.evaluate(caller.robot, at.q, *at.vectors.values(), state), at.q, **at.vectors)
        rows, power = state[:, :nv], state[ws.POWER, :1]
        if pushing is not None:
            external = caller.epsilon(at, pushing, "f_ext is")
        if friction:
            resisting = caller.epsilon(at, friction_of(caller.model, at.vectors["qd"]), "friction or qd are")
        write_rates(rows, external, resisting)
        add_power(rows[ws.NU], power, external, resisting)
        if not np.isfinite(power[0]):
            raise InputError("qd, f_ext or friction are too large: the power overflows.")
    except Exception:
        if out is not None:
            state.fill(np.nan)
            out.set_terms(tau is not None)
        raise
    if out is None:
        return Evaluation(caller.model, read_only(state), state[:, :nv], tau is not None, external, resisting)
    out.set_terms(tau is not None, external, resisting)
    return out


def evaluate_many(
    caller: SweepCaller,
    Q: Any,
    QD: Any,
    TAU: Any,
    f_ext: ManyWrenches | None,
    frame: Frame,
    friction: bool,
    threads: int | None,
    out: BatchEvaluation | None,
    single: Callable[..., Any],
) -> BatchEvaluation:
    """Evaluate many states; `single` evaluates one of them to raise its error."""
    at = caller.many(Q, threads, qd=QD, tau=ZEROS if TAU is None else TAU)
    memory = BatchMemory.allocate(caller.model, len(at.q)) if out is None else _memory_of_batch(out, caller.model, at)
    if out is not None:
        at = States(memory.detach(at.q), {name: memory.detach(x) for name, x in at.vectors.items()}, at.threads)
    try:
        # Before `memory` is written: wrenches may lie in `out`.
        pushing = caller.wrench_effort(at, f_ext, frame) if has_wrenches(f_ext) else None
        _fill(caller, at, TAU is not None, memory, single)
        external = None if pushing is None else caller.epsilon(at, pushing, "f_ext is")
        resisting = None
        if friction:
            resisting = caller.epsilon(at, friction_of(caller.model, at.vectors["qd"]), "friction or QD are")
        power = memory.numbers[ws.POWER - ws.KINETIC_ENERGY]
        add_power(memory.results[ws.NU], power, external, resisting)
        check_power(power)
    except BaseException:  # a Ctrl-C, too
        if out is not None:
            for part in memory:
                part.fill(np.nan)
            out.set_terms(TAU is not None)
        raise
    if out is None:
        return BatchEvaluation(caller.model, memory, TAU is not None, external, resisting)
    out.set_terms(TAU is not None, external, resisting)
    return out


def _fill(caller: SweepCaller, at: States, with_tau: bool, memory: BatchMemory, single: Callable[..., Any]) -> None:
    """Evaluate all states into memory, or raise the error of the first that fails."""
    Q, (QD, TAU) = at.q, at.vectors.values()

    def sweep(robot: int, first: int, last: int) -> int:
        return batch.evaluate_many(robot, Q, QD, TAU, first, last, *memory)

    def evaluate_again(t: int) -> None:
        single(Q[t], QD[t], TAU[t] if with_tau else None)

    caller.run_chunks(sweep, len(Q), at.threads, evaluate_again, ws.WIDTH)


def _memory_of_batch(out: BatchEvaluation, model: RobotModel, at: States) -> Any:
    memory = memory_of(out, BatchEvaluation, model, "new_batch(T)")
    if len(out) != len(at.q):
        raise InputError(f"out has room for {len(out)} states, expected {len(at.q)}: a row for each state of Q.")
    return memory
