"""The exported C where int, double or the byte order are not this machine's: the same bits, or no program at all."""

import re
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.files import write_tree
from springline.runner import load_scenario

STRICT = [
    "-std=c99",
    "-O2",
    "-ffp-contract=off",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wshadow",
    "-Werror",
]
Tool = Callable[..., str]


@pytest.fixture(scope="module")
def folder(once: Callable[[str, Callable[[Path], object]], Path]) -> Callable[[Any], Path]:
    """The folder of the nominal system's export in double or float."""
    scenario = load_scenario("paper/nominal")

    def exported(real: Any) -> Path:
        def make(path: Path) -> None:
            write_tree(path, *generate_files(bind(scenario.structure(), scenario.values(), real=real)))

        return once(f"exports/nominal_{real}", make)

    return exported


def compiled(compiler: str, export: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [compiler, f"-I{export / 'include'}", f"-I{export / 'src'}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def output(*command: str | Path) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def sources(export: Path) -> list[Path]:
    return [export / "src" / "springline.c", export / "src" / "springline_model.c", export / "self_check.c"]


@pytest.mark.parametrize(("real", "more"), [("double", []), ("float", ["-fexcess-precision=fast"])])
def test_s390x_gives_this_machines_bits(
    real: str, more: list[str], folder: Callable[[Any], Path], tmp_path: Path, require_tool: Tool
) -> None:
    """Big-endian, and float expressions evaluated as double (FLT_EVAL_METHOD 1), which does double no harm."""
    compiler = require_tool("s390x-linux-gnu-gcc", "apt-get install gcc-s390x-linux-gnu libc6-dev-s390x-cross")
    emulator = require_tool("qemu-s390x", "apt-get install qemu-user")
    export = folder(real)
    done = compiled(compiler, export, *STRICT, *more, "-static", *sources(export), "-o", tmp_path / "check")
    assert done.returncode == 0, done.stderr
    assert "all bits as expected" in output(emulator, tmp_path / "check", export / "test_vectors.txt")


def test_floats_evaluated_as_double_are_refused_with_the_option_that_helps(
    folder: Callable[[Any], Path], require_tool: Tool
) -> None:
    compiler = require_tool("s390x-linux-gnu-gcc", "apt-get install gcc-s390x-linux-gnu libc6-dev-s390x-cross")
    export = folder("float")
    done = compiled(compiler, export, "-std=c99", "-c", export / "src" / "springline.c", "-o", "/dev/null")
    assert done.returncode != 0
    assert "on s390x -fexcess-precision=fast" in done.stderr


@pytest.mark.parametrize(("real", "library"), [("double", "sl_math.h"), ("float", "sl_mathf.h")])
def test_x87_is_refused(real: str, library: str, folder: Callable[[Any], Path], require_tool: Tool) -> None:
    export = folder(real)
    x87 = ["-std=c99", "-mfpmath=387", "-c", export / "src" / "springline.c", "-o", "/dev/null"]
    done = compiled(require_tool("gcc"), export, *x87)
    assert done.returncode != 0
    assert re.search(rf"{re.escape(library)} needs .* on x86 .*-msse2 -mfpmath=sse", done.stderr)


def test_a_double_of_32_bits_is_refused(folder: Callable[[Any], Path], require_tool: Tool) -> None:
    compiler = require_tool("avr-gcc", "apt-get install gcc-avr avr-libc")
    export = folder("double")
    for source in sources(export)[:2]:
        done = compiled(compiler, export, "-std=c99", "-mmcu=atmega2560", "-c", source, "-o", "/dev/null")
        assert done.returncode != 0
        assert "needs 64-bit IEEE doubles" in done.stderr
        assert "--real float" in done.stderr


def test_an_int_of_16_bits_gives_this_machines_bits(
    folder: Callable[[Any], Path], tmp_path: Path, require_tool: Tool
) -> None:
    """The float export on an ATmega2560 (int of 16 bits, software arithmetic) under simavr: forty control steps."""
    hint = "apt-get install gcc-avr avr-libc simavr"
    compiler, simulator = require_tool("avr-gcc", hint), require_tool("simavr", hint)
    export = folder("float")
    (tmp_path / "firmware.c").write_text(firmware((export / "test_vectors.txt").read_text(), 40))
    board = [*STRICT, "-mmcu=atmega2560", export / "src" / "springline.c", tmp_path / "firmware.c"]
    done = compiled(compiler, export, *board, "-o", tmp_path / "firmware.elf")
    assert done.returncode == 0, done.stderr
    assert "wrong: 000 of 40" in output(simulator, "-m", "atmega2560", "-f", "16000000", tmp_path / "firmware.elf")


def firmware(vectors: str, count: int) -> str:
    """A program for the board that replays `count` control vectors and says over its serial port how many differ."""
    lines = vectors.splitlines()
    [start] = (i for i, line in enumerate(lines) if line.startswith("# control:"))
    inputs, outputs = lines[start].split(":")[1].split(), lines[start + 1].split("->")[1].split()
    rows = [line.split()[1:] for line in lines if line.startswith("control")][:count]

    def bits(word: str) -> str:
        return f"0x{struct.unpack('<I', struct.pack('<f', float.fromhex(word)))[0]:08x}"

    def owner(name: str) -> str:
        return "command" if name in ("U_lift", "U_rotation") else "diagnostics"

    table = ",\n".join("  {" + ", ".join(map(bits, row)) + "}" for row in rows)
    reads = "\n".join(
        f"    {'reference' if 'q1d_' in name else 'measurement'}.{name} = real_of(in[{k}]);"
        for k, name in enumerate(inputs)
    )
    checks = "\n".join(
        f"    differs |= bits_of((float){owner(name)}.{name}) != out[{k}];" for k, name in enumerate(outputs)
    )
    return f"""
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdint.h>
#include "springline.h"
static const uint32_t vectors[{count}][{len(inputs) + len(outputs)}] = {{
{table}
}};
typedef union {{
  float real;
  uint32_t bits;
}} pun;
static float real_of(uint32_t b) {{
  pun p;
  p.bits = b;
  return p.real;
}}
static uint32_t bits_of(float x) {{
  pun p;
  p.real = x;
  return p.bits;
}}
static void put(char c) {{
  while (!(UCSR0A & (1 << UDRE0))) continue;
  UDR0 = (uint8_t)c;
}}
static void say(const char *text) {{
  for (; *text != 0; text++) put(*text);
}}
int main(void) {{
  springline_controller controller;
  springline_reference reference;
  springline_measurement measurement;
  springline_command command;
  springline_diagnostics diagnostics;
  int wrong = 0, k;
  UCSR0B = 1 << TXEN0;
  if (springline_init(&controller, &springline_default_config) != SPRINGLINE_OK) wrong = {count};
  for (k = 0; k < {count}; k++) {{
    const uint32_t *in = vectors[k], *out = in + {len(inputs)};
    int differs = 0;
{reads}
    differs |= springline_step(&controller, &reference, &measurement, &command, &diagnostics) != SPRINGLINE_OK;
{checks}
    wrong += differs;
  }}
  say("wrong: ");
  for (k = 100; k > 0; k /= 10) put((char)('0' + wrong / k % 10));
  say(" of {count}\\n");
  cli();
  sleep_enable();
  sleep_cpu();
  return 0;
}}
"""


def test_nothing_needs_an_int_of_more_than_16_bits_in_double(
    folder: Callable[[Any], Path], tmp_path: Path, require_tool: Tool
) -> None:
    """No compiler here has such ints beside 64-bit doubles, so every int of the export is made a short."""
    export, gcc = folder("double"), require_tool("gcc")
    program = tmp_path / "short.c"
    headers = ["float.h", "stddef.h", "stdint.h", "stdio.h", "stdlib.h", "string.h"]
    program.write_text(
        "".join(f"#include <{name}>\n" for name in headers)
        + '#include "springline_model.h"\n#define SL_SOFT_SQRT\n#define int short\n'
        + f'#include "{export / "src" / "springline.c"}"\n#include "{export / "self_check.c"}"\n'
    )
    flags = ["-std=c99", "-O1", "-ffp-contract=off", "-w"]
    model = [*flags, "-c", export / "src" / "springline_model.c", "-o", tmp_path / "model.o"]
    assert compiled(gcc, export, *model).returncode == 0
    done = compiled(gcc, export, *flags, program, tmp_path / "model.o", "-o", tmp_path / "check")
    assert done.returncode == 0, done.stderr
    assert "all bits as expected" in output(tmp_path / "check", export / "test_vectors.txt")


def test_no_field_of_the_interface_is_a_plain_int(folder: Callable[[Any], Path]) -> None:
    """Whoever exchanges structures between two machines finds the same layout on both."""
    for real in ("double", "float"):
        header = (folder(real) / "include" / "springline.h").read_text()
        members = "".join(re.findall(r"typedef struct \w+ \{(.*?)\} \w+;", header, re.DOTALL))
        kinds = set(re.findall(r"^  (\w+) \w+(?:\[\d+\])?;", members, re.MULTILINE))
        assert kinds == {"springline_real", "int32_t", "springline_config", "springline_command"}
