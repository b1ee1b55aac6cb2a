"""The Program of a system: its loop as frozen CasADi Functions, one per binding time.

    run(p) -> r                       once per run
    start(t, d, p, r) -> x            the initial state, t being the beginning
    signals(t, d, p, r) -> w          once per time: reference and base motion
    time(w, p, r) -> s                once per time: what else depends on time only
    error(w, s, x, p, r) -> e, sigma
    control(w, s, x, p, r) -> u, e, sigma, wished, a_law   (u and the law as they were before their limits)
    plant(w, s, x, u, p, r) -> dx

and where the controller has states, which error and control then take after x,

    rates(w, s, x, z, p, r) -> dz
    update(w, s, x, z, h, p, r) -> z_next   (one sample of h seconds later)

and where sensors are noisy, which control, rates and update then take behind these states (and where sensors show
anything but the state, control gives that too, as its last output)

    noise   standard normal numbers of the sample, one for each entry of x

and where the controller makes out rates by itself, which is once a sample alone, so that there is no `rates`

    h       s to the next sample, which control then takes too

and where motors are not driven by the command as it is

    actuate(arrived, m, step, p) -> acting, m_next   (once a step: forces at its nodes, what motors remember)

and where the arm has a tip, for the rows of a trajectory, so that it is computed nowhere else

    tip(t, d, x, p) -> tip

Every parameter is symbolic, common subexpressions are shared, and nothing is rewritten after this point: every engine
prints these instruction lists, which is why every engine computes the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from springline.codegen.program.staging import split
from springline.model.quantities import entries
from springline.model.structure import Structure
from springline.model.symbolic import as_written, derivation
from springline.model.system import System, system_of


@dataclass(frozen=True, slots=True)
class Program:
    """Frozen Functions by name ("run", "start", …) and the system they come from."""

    system: System
    functions: dict[str, ca.Function]

    def size(self, name: str) -> int:
        """Number of entries of a vector of the loop: t, d, p, r, w, s, x, z, u, e, noise, measured."""
        sizes: dict[str, int] = {
            "p": self.system.p.numel(),
            "d": self.system.d.numel(),
            "w": self.system.w.numel(),
            "x": self.system.x.numel(),
            "z": self.system.z.numel(),
            "m": self.system.m.numel(),
            "commanded": self.system.n if self.system.commanded else 0,
            "noise": self.system.noise.numel(),
            "measured": len(entries(self.system.measured, self.system.joints)),
            "u": self.system.n,
            "e": self.system.n,
            "t": 1,
            "r": self.functions["run"].numel_out(0),
            "s": self.functions["time"].numel_out(0),
        }
        return sizes[name]

    @property
    def operations(self) -> dict[str, int]:
        """Arithmetic operations per call of each Function (inputs, outputs and constants not counted)."""
        return {name: count_operations(f) for name, f in self.functions.items()}


def count_operations(function: ca.Function) -> int:
    """Number of arithmetic instructions of an SX Function."""
    free = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_PARAMETER}
    return sum(function.instruction_id(k) not in free for k in range(function.n_instructions()))


@derivation
@lru_cache(maxsize=64)
def program(structure: Structure) -> Program:
    """Build, stage and freeze the Program of a structure."""
    system = system_of(structure)
    t, d, w, x, u, p = system.t, system.d, system.w, system.x, system.u, system.p
    z = [system.z] if system.memory else []
    noise = [system.noise] if system.noise.numel() else []
    period = [system.h] if system.structure.differenced else []
    later = [name for name in ("rates", "update") if f"loop_{name}" in system.functions]
    loop = {name: system.function(f"loop_{name}") for name in ("error", "control", "plant", *later)}
    sources = {"signals": system.function("signals"), "start": system.function("start"), **loop}
    inputs = {
        "signals": [t, d, p],
        "start": [t, d, p],
        "error": [w, x, *z, p],
        "control": [w, x, *z, *noise, *period, p],
        "plant": [w, x, u, p],
        "rates": [w, x, *z, *noise, p],
        "update": [w, x, *z, *noise, system.h, p],
    }

    with as_written():
        expressions = {
            name: [f(*inputs[name])] if f.n_out() == 1 else list(f(*inputs[name])) for name, f in sources.items()
        }
        names = list(expressions)
        flat = [e for name in names for e in expressions[name]]
        (run,), rest = split(flat, [("r", p)])
        staged: dict[str, list[ca.SX]] = {}
        for name in names:
            count = len(expressions[name])
            staged[name], rest = rest[:count], rest[count:]
        known = ca.vertcat(p, run.symbols)
        late = [e for name in loop for e in staged[name]]
        (time,), late = split(late, [("s", ca.vertcat(known, w))])
        for name in loop:
            count = len(staged[name])
            staged[name], late = late[:count], late[count:]
        r, s = run.symbols, time.symbols
        at, names_at = [w, s, x, *z], ["w", "s", "x", *(["z"] if z else [])]
        sampling, names_sampling = [*at, *noise], [*names_at, *(["noise"] if noise else [])]
        measured = ["measured"] if system.measured else []
        signature = {
            "run": ([p], [run.values], ["p"], ["r"]),
            "start": ([t, d, p, r], staged["start"], ["t", "d", "p", "r"], ["x"]),
            "signals": ([t, d, p, r], staged["signals"], ["t", "d", "p", "r"], ["w"]),
            "time": ([w, p, r], [time.values], ["w", "p", "r"], ["s"]),
            "error": ([*at, p, r], staged["error"], [*names_at, "p", "r"], ["e", "sigma"]),
            "control": (
                [*sampling, *period, p, r],
                staged["control"],
                [*names_sampling, *["h" for _ in period], "p", "r"],
                ["u", "e", "sigma", "wished", "a_law", *measured],
            ),
            "plant": ([w, s, x, u, p, r], staged["plant"], ["w", "s", "x", "u", "p", "r"], ["dx"]),
        }
        if "rates" in later:
            signature["rates"] = ([*sampling, p, r], staged["rates"], [*names_sampling, "p", "r"], ["dz"])
        if "update" in later:
            updating = [*sampling, system.h, p, r]
            signature["update"] = (updating, staged["update"], [*names_sampling, "h", "p", "r"], ["z_next"])
        observed = {"tip": system.function("loop_tip")} if system.tip is not None else {}
        observed |= {"actuate": system.function("loop_actuate")} if system.commanded else {}
        functions = {
            name: ca.Function(f"loop_{name}", ins, ca.cse([ca.densify(o) for o in outs]), names_in, names_out)
            for name, (ins, outs, names_in, names_out) in signature.items()
        } | observed
    return Program(system, functions)
