"""C by CasADi's own code generator, on springline's elementary functions."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from springline.codegen.program.frozen import Program
from springline.codegen.program.literals import literal


def print_functions(
    functions: Sequence[ca.Function],
    stem: str,
    *,
    includes: Sequence[str] = ("sl_casadi.h",),
    integer: str = "int",
) -> str:
    """CasADi's C source of SX Functions, for a file named stem.c.

    includes  the last has to be "sl_casadi.h": the mathematics come from there, nothing from the host's <math.h>
    integer   C type of sizes and sparsity patterns; casadi.external expects "long long int"
    """
    generator = ca.CodeGenerator(
        f"{stem}.c", {"with_header": False, "include_math": False, "casadi_int": integer, "static_aux": True}
    )
    for include in includes:
        generator.add_include(include, True)
    for function in functions:
        generator.add(function)
    text: str = generator.dump()
    return text


def kernel_header(program: Program, preamble: str) -> dict[str, str]:
    """Sources "kernel.h" and "functions.c" of the loop's kernel: one run at a time, every parameter tunable.

    preamble  the macros and types that every engine's kernel starts with
    """
    functions = program.functions

    def call(name: str, *arguments: str, results: Sequence[str]) -> str:
        function = functions[name]
        lines = [
            "  {",
            f"  const double *arg[{max(function.sz_arg(), 1)}] = {{{', '.join(arguments)}}};",
            f"  double *res[{max(function.sz_res(), 1)}] = {{{', '.join(results)}}};",
            f"  double work[{max(function.sz_w(), 1)}];",
            f"  int integers[{max(function.sz_iw(), 1)}];",
            f"  (void){function.name()}(arg, res, integers, work, 0);",
            "  }",
        ]
        return "\n".join(lines)

    flat = "(const double *)"
    w, s = f"{flat}now.varying", f"{flat}now.varying + SL_NUMBER_W"
    x, p, r = f"{flat}x", f"{flat}p", f"{flat}r"
    states, memory = program.size("x"), program.size("z")
    at = (x, f"{flat}(x + {states})") if memory else (x,)  # z stands behind the plant's state
    state = "sl_time now, const sl_group *x, const sl_group *p, const sl_group *r"
    computed = "sl_group *u, sl_group *e, sl_group *sigma, sl_group *wished, sl_group *a_law"
    results = [f"(double *){name}" for name in ("u", "e", "sigma", "wished", "a_law")]
    begin = "".join(
        f"\n  x[{states + k}][0] = slv_set({literal(value)});" for k, value in enumerate(program.system.z_start)
    )
    measured, noisy = program.size("measured"), program.size("noise")
    noise = (f"{flat}noise",) if noisy else ()
    shown = ["(double *)measured"] if measured else []
    differenced = program.system.structure.differenced
    control = call("control", w, s, *at, *noise, *["&period"] * differenced, p, r, results=[*results, *shown])
    sampling, sampled, sample = state, computed, control
    if measured:
        sampling, sampled = state.replace("*x,", "*x, const sl_group *noise,"), f"{computed}, sl_group *measured"
    closed = "  kernel_control(now, x, p, r, u, e, sigma, wished, a_law);"
    if memory:
        before = "*noise," if measured else "*x,"
        sampling, sampled = sampling.replace(before, f"{before} double period,"), f"{sampled}, sl_group *ahead"
        update = call("update", w, s, *at, *noise, "&period", p, r, results=["(double *)ahead"])
        sample = f"{control}\n{update}"
    if "rates" in functions:
        rates = call("rates", w, s, *at, *noise, p, r, results=[f"(double *)(dx + {states})"])
        closed = f"{control}\n{rates}"
    actuated, actuate = "actuate" in functions, ""
    told = "double step, " * actuated + "double period, " * differenced
    if actuated:
        given = "double step, const sl_group *arrived, const sl_group *m, const sl_group *p, const sl_group *r"
        called = call("actuate", f"{flat}arrived", f"{flat}m", "&step", p, results=["(double *)acting", "after"])
        copied = "memcpy(ahead, after, SL_NM * sizeof(double)); /* which may be m */"
        body = f"  double after[SL_NM + 1];\n{called}\n  {copied}"
        actuate = f"static inline void kernel_actuate({given}, sl_group *acting, sl_group *ahead) {{\n{body}\n}}\n\n"
    if not (measured or actuated or differenced):  # continuous control has no samples, and so none of these
        closed = f"""static inline void kernel_closed({state}, sl_group *dx, {computed}) {{
{closed}
  kernel_plant(now, x, (const sl_group *)u, p, r, dx);
}}
"""
    else:
        closed = ""
    tip = ""
    if "tip" in functions:
        given = "double t, const double *d, const sl_group *x, const sl_group *p, const sl_group *r, sl_group *tip"
        body = call("tip", "&t", "d", x, p, results=["(double *)tip"])
        tip = f"static inline void kernel_tip({given}) {{\n{body}\n}}\n\n"
    text = f"""{preamble}
enum {{ SL_NUMBER_W = {program.size("w")} }};

#define CASADI_SYMBOL_EXPORT __attribute__((visibility("hidden")))
#include "functions.c"

static inline void kernel_run(const sl_group *p, {told}sl_group *r) {{
{call("run", p, results=["(double *)r"])}
}}

static inline void kernel_start(double t, const double *d, const sl_group *p, const sl_group *r, sl_group *x) {{
{call("start", "&t", "d", p, r, results=["(double *)x"])}{begin}
}}

static inline void kernel_uniform(const double *t, const double *d, sl_v *uniform) {{}}

/* w and s behind each other: this engine binds every signal per run. */
static inline void kernel_varying(double t, const double *d, const double *uniform, const sl_group *p,
                                  const sl_group *r, sl_group *varying) {{
{call("signals", "&t", "d", p, r, results=["(double *)varying"])}
{call("time", flat + "varying", p, r, results=["(double *)(varying + SL_NUMBER_W)"])}
}}

static inline void kernel_signals(sl_time now, const sl_group *p, const sl_group *r, sl_group *q1d,
                                  sl_group *b) {{
  int i;
  for (i = 0; i < SL_NJ; i++) q1d[i][0] = now.varying[i][0];
  for (i = 0; i < SL_NB; i++) b[i][0] = now.varying[3 * SL_NJ + i][0];
  for (i = 0; i < SL_NF; i++) b[SL_NB + i][0] = now.varying[SL_NUMBER_W - SL_NF + i][0];
}}

{actuate}{tip}static inline void kernel_error({state}, sl_group *e, sl_group *sigma) {{
{call("error", w, s, *at, p, r, results=["(double *)e", "(double *)sigma"])}
}}

static inline void kernel_control({sampling}, {sampled}) {{
{sample}
}}

static inline void kernel_plant(sl_time now, const sl_group *x, const sl_group *u, const sl_group *p, const sl_group *r,
                                sl_group *dx) {{
{call("plant", w, s, x, flat + "u", p, r, results=["(double *)dx"])}
}}

{closed}"""
    return {"kernel.h": text, "functions.c": print_functions(list(functions.values()), "functions")}
