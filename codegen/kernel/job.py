"""What Python asks of the compiled loop: the job, declared once, for C (simulate.h) and for ctypes."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from springline.codegen.numbers import shown

_LINE = 120  # characters
_Kind = type[ctypes.c_int64 | ctypes.c_double | ctypes.c_void_p]
_KINDS: dict[str, _Kind] = {"int64_t": ctypes.c_int64, "double": ctypes.c_double, "*": ctypes.c_void_p}


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a C structure: name, C type ("double", "int64_t", or a pointer, which ends in "*"), and meaning."""

    name: str
    kind: str
    meaning: str

    @property
    def ctype(self) -> _Kind:
        """The same for ctypes. Raises KeyError for a type that is none of these."""
        return _KINDS["*" if self.kind.endswith("*") else self.kind]

    @property
    def declaration(self) -> str:
        """In C, without its comment."""
        return f"{self.kind}{'' if self.kind.endswith('*') else ' '}{self.name};"


JOB = (
    Member("first", "int64_t", "the first run of this call"),
    Member("last", "int64_t", "the run after its last one"),
    Member("steps", "int64_t", "N, number of steps of every run"),
    Member("start_time", "double", "s"),
    Member("step", "double", "h, s"),
    Member("bound", "double", "a run stops when any |x_i| or |z_i| leaves it"),
    Member("limits", "const double *", "SL_NJ x 2, least and greatest q1 of each joint; NULL: none"),
    Member("hold", "int64_t", "sampled control: steps per sample, >= 1; continuous control ignores it"),
    Member("delay", "int64_t", "steps from a command to when it arrives, 1 to SL_DELAY where that is not 0"),
    Member("output_every", "int64_t", "a trajectory row every so many steps, and at the end; 0: no trajectory"),
    Member("seed", "int64_t", "32 bits, of the noise"),
    Member("numbers", "const int64_t *", "runs, the number that the noise of each goes by; NULL: 0"),
    Member("parameters", "const double *", "runs x SL_NP"),
    Member("bands", "const double *", "runs x SL_NBANDS, what the metrics of each take for settled: enum sl_band"),
    Member("tables", "const sl_table *", "SL_NTABLES tables"),
    Member("metrics", "double *", "runs x SL_NMETRICS"),
    Member("final_state", "double *", "runs x SL_NX"),
    Member("end_time", "double *", "runs, s: time of the final state"),
    Member("status", "int32_t *", "runs, enum sl_status"),
    Member("quantity", "int32_t *", "runs, what left its bound: its place in a row without t, then a_law, or -1"),
    Member("trajectory", "double *", "runs x rows x SL_NCOLUMNS, or NULL; a stopped run leaves later rows untouched"),
    Member("rows", "int64_t *", "runs, trajectory rows written, or NULL"),
    Member("capacity", "int64_t", "rows that `trajectory` has room for, per run"),
    Member("progress", "volatile int64_t *", "steps x runs done so far are added here, or NULL"),
    Member("stop", "const volatile int32_t *", "nonzero ends the call early, or NULL"),
)
"""One call of the loop."""

STATUSES = {
    "ok": "",
    "diverged": "the state, or what the control computed from it, left the finite numbers",
    "out_of_bounds": "the state left the bound of the job",
    "stopped": "the caller asked to stop",
    "out_of_limits": "a joint left the limits of the job",
}
"""How a run ends, in the order of their numbers: name -> meaning."""

_HEADER = """\
/*
 * simulate.h - the one interface between the compiled loop and whoever drives it; printed from codegen/kernel/job.py.
 *
 * One call simulates runs `first` .. `last`-1 of a batch. Calls share nothing that is written but their own rows, so
 * threads may each take a range. SI units; arrays are row-major, one row a run.
 */
#ifndef SL_SIMULATE_H
#define SL_SIMULATE_H

#include <stdint.h>

#include "sl_tables.h"

typedef struct {{
{members}
}} sl_job;

enum sl_status {{
{statuses}
  SL_STATUSES
}};

#endif
"""


def job_header() -> str:
    """simulate.h."""
    width = max(len(member.declaration) for member in JOB)
    members = [f"  {member.declaration:{width}} /* {member.meaning} */" for member in JOB]
    assert max(map(len, members)) <= _LINE
    statuses = [
        f"  SL_{name.upper()} = {value}," + (f" /* {meaning} */" if meaning else "")
        for value, (name, meaning) in enumerate(STATUSES.items())
    ]
    return _HEADER.format(members="\n".join(members), statuses="\n".join(statuses))


class Struct(ctypes.Structure):
    """A C struct made of named values. Raises ValueError for one that C would hold as another, as ctypes does not."""

    def __init__(self, **values: object) -> None:
        super().__init__(**values)
        for name, *_ in self._fields_:
            given = values.pop(name)
            held = getattr(self, name)
            if held != given:
                raise ValueError(f"{name} is {shown(given)}, which C would take for {held!r}")
        if values:
            raise TypeError(f"{type(self).__name__} has no {', '.join(values)}")


class Job(Struct):
    """The job for ctypes; pointers are addresses, or None."""

    _fields_ = [(member.name, member.ctype) for member in JOB]
