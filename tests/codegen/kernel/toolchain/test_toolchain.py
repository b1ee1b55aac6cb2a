"""The toolchain: which compiler is taken, what decides the cache key, and that the cache cannot be broken."""

import ctypes
import errno
import fcntl
import hashlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from springline.codegen.kernel import ToolchainError, checks
from springline.codegen.kernel.toolchain import (
    Compiler,
    build_library,
    find_compiler,
    load,
    native_flags,
    native_instruction_set,
    native_vector_width,
    probe_compiler,
)
from springline.codegen.kernel.toolchain import compiler as compilers
from springline.codegen.kernel.toolchain.compiler import _find_compiler, predefined_macros
from springline.codegen.kernel.toolchain.errors import cache_root

SOURCES = {
    "main.c": '#include "inner/value.h"\nint value(void);\nint value(void) { return VALUE; }\n',
    "inner/value.h": "#define VALUE 7\n",
}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for each test, for these tests look into it and damage it."""
    root = tmp_path / "cache"
    monkeypatch.setenv("SPRINGLINE_CACHE", str(root))
    return root


@pytest.fixture
def wrap(tmp_path: Path) -> Callable[[str, str], Compiler]:
    """Makes a compiler that is the real one behind a few lines of shell; "$@" are its arguments."""
    real = find_compiler()

    def make(name: str, script: str) -> Compiler:
        path = tmp_path / name
        path.write_text(f'#!/bin/sh\n{script}\nexec {" ".join(real.argv)} "$@"\n')
        path.chmod(0o755)
        wrapped = probe_compiler([str(path)])
        assert wrapped is not None
        return wrapped

    return make


@pytest.fixture
def counted(tmp_path: Path, wrap: Callable[[str, str], Compiler]) -> tuple[Compiler, Callable[[], int]]:
    """A compiler that takes half a second, and how often it has been asked for a library."""
    log = tmp_path / "builds.log"
    log.touch()
    compiler = wrap("counting-cc", f'case "$*" in *library.so*) echo build >> "{log}"; sleep 0.5;; esac')
    return compiler, lambda: len(log.read_text().splitlines())


def entry_of(library: Path) -> Path:
    return library.parent


# --- which compiler --------------------------------------------------------------------------------------


def test_cc_may_carry_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    real = find_compiler()
    monkeypatch.setenv("CC", " ".join([*real.argv, "-DVALUE=41"]))
    compiler = find_compiler()
    assert compiler.argv == (*real.argv, "-DVALUE=41")
    source = "int value(void);\nint value(void) { return VALUE; }\n"
    assert load(build_library({"main.c": source}, main="main.c")).value() == 41


def test_broken_cc_is_named_and_no_other_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(ToolchainError, match="CC is 'no-such-compiler -m64'"):
        find_compiler()


def test_compiler_without_library_headers_is_passed_over(tmp_path: Path) -> None:
    headless = tmp_path / "headless-cc"
    headless.write_text('#!/bin/sh\necho "math.h: No such file or directory" >&2\nexit 1\n')
    headless.chmod(0o755)
    assert probe_compiler([str(headless)]) is None


def test_without_any_compiler_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "/nonexistent")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ToolchainError) as caught:
        build_library(SOURCES, main="main.c")
    message = str(caught.value)
    assert message.startswith("no C compiler found: install one")
    assert "apt-get install gcc" in message
    assert "pip install 'springline[compiler]'" in message
    assert "\n" not in message
    assert [row.ok for row in checks() if row.name == "C compiler"] == [False]


def test_ziglang_is_the_last_resort(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in for the package: what counts is how it is found and called."""
    real = find_compiler()
    package = tmp_path / "packages" / "ziglang"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(
        "import subprocess, sys\n"
        "assert sys.argv.pop(1) == 'cc'\n"
        "arguments = [a for a in sys.argv[1:] if a != '-fno-sanitize=undefined']\n"
        f"sys.exit(subprocess.run([*{real.argv!r}, *arguments]).returncode)\n"
    )
    monkeypatch.syspath_prepend(str(package.parent))
    monkeypatch.setenv("PYTHONPATH", str(package.parent))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: name if name == sys.executable else None)
    _find_compiler.cache_clear()
    compiler = find_compiler()
    _find_compiler.cache_clear()
    assert compiler.family == "zig"
    assert compiler.argv == (sys.executable, "-m", "ziglang", "cc")
    assert load(build_library(SOURCES, main="main.c", compiler=compiler)).value() == 7


@pytest.mark.parametrize("family", ["gcc", "clang"])
def test_family_and_version(family: str, require_tool: Callable[..., str]) -> None:
    path = require_tool(family, f"apt-get install {family}")
    compiler = probe_compiler([family])
    assert compiler is not None
    assert compiler.argv == (path,)
    assert compiler.family == family
    banner = subprocess.run([path, "--version"], capture_output=True, text=True, check=True).stdout
    assert compiler.version.removeprefix("Debian Clang ") in banner
    assert "-" in compiler.target
    assert load(build_library(SOURCES, main="main.c", flags=["-O3"], compiler=compiler)).value() == 7


# --- vector width ----------------------------------------------------------------------------------------


def test_vector_width_is_the_machines() -> None:
    if not Path("/proc/cpuinfo").exists():
        pytest.skip("/proc/cpuinfo is Linux's")
    words = set(Path("/proc/cpuinfo").read_text().split())
    expected = 8 if "avx512f" in words else 4 if "avx" in words else 2
    assert native_vector_width() == expected


@pytest.mark.parametrize(
    ("flags", "width"), [("-march=x86-64", 2), ("-march=haswell", 4), ("-march=skylake-avx512", 8)]
)
def test_vector_width_follows_the_compilers_macros(
    flags: str, width: int, wrap: Callable[[str, str], Compiler]
) -> None:
    if not find_compiler().target.startswith("x86_64"):
        pytest.skip("names x86-64 machines")
    script = f'case "$*" in *-march=native*) shift; set -- {flags} "$@";; esac'
    assert native_vector_width(wrap("other-machine-cc", script)) == width


def test_a_compiler_that_knows_no_native_machine(wrap: Callable[[str, str], Compiler]) -> None:
    script = 'case "$*" in *=native*) echo "unknown machine: native" >&2; exit 1;; esac'
    compiler = wrap("foreign-cc", script)
    assert native_flags(compiler) == ()
    assert native_vector_width(compiler) == 2


# --- building --------------------------------------------------------------------------------------------


def test_built_once(counted: tuple[Compiler, Callable[[], int]]) -> None:
    compiler, builds = counted
    first = build_library(SOURCES, main="main.c", compiler=compiler)
    second = build_library(dict(reversed(SOURCES.items())), main="main.c", compiler=compiler)
    assert first == second
    assert builds() == 1
    assert load(first).value() == 7


def test_everything_that_matters_is_in_the_key(wrap: Callable[[str, str], Compiler]) -> None:
    newer = wrap("newer-cc", 'set -- "$@" -U__VERSION__ "-D__VERSION__=\\"99\\""')
    libraries = [
        build_library(SOURCES, main="main.c"),
        build_library(SOURCES | {"inner/value.h": "#define VALUE 8\n"}, main="main.c"),
        build_library(SOURCES | {"unused.h": ""}, main="main.c"),
        build_library(SOURCES, main="main.c", flags=["-O3"]),
        build_library(SOURCES, main="main.c", flags=["-O3", "-std=gnu99"]),
        build_library(SOURCES, main="main.c", compiler=newer),
    ]
    assert len(set(libraries)) == len(libraries)
    assert [load(library).value() for library in libraries] == [7, 8, 7, 7, 7, 7]


def test_shared_cache_keeps_machines_apart(wrap: Callable[[str, str], Compiler]) -> None:
    """A second machine is played by a compiler whose -march=native finds one CPU feature more."""
    here = find_compiler()
    there = wrap("other-machine-cc", 'case "$*" in *-march=native*) set -- "$@" -D__AVX9000F__;; esac')
    native = {"main": "main.c", "flags": ["-O2", "-march=native"]}
    portable = {"main": "main.c", "flags": ["-O2"]}
    assert "__AVX9000F__" in predefined_macros(there, ["-march=native"])
    assert build_library(SOURCES, compiler=here, **native) != build_library(SOURCES, compiler=there, **native)
    assert build_library(SOURCES, compiler=here, **portable) == build_library(SOURCES, compiler=there, **portable)


def test_same_bytes_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    images = []
    for name in ("a", "a much longer folder name"):
        monkeypatch.setenv("SPRINGLINE_CACHE", str(tmp_path / name))
        images.append(build_library(SOURCES, main="main.c", flags=["-g", "-O1"]).read_bytes())
    assert images[0] == images[1]
    assert os.fsencode(tmp_path) not in images[0]


def test_warnings_are_errors_and_the_message_tells() -> None:
    lines = "".join(f"int f{i}(int x);\nint f{i}(int x) {{ return 0; }}\n" for i in range(40))
    with pytest.raises(ToolchainError) as caught:
        build_library({"bad.c": lines}, main="bad.c")
    message = str(caught.value)
    assert "-Werror" in message
    assert "bad.c:2" in message
    assert "unused parameter" in message
    assert len(message.splitlines()) <= 16
    assert "more lines" in message


def test_a_failed_build_leaves_nothing_behind(cache: Path) -> None:
    for _ in range(2):
        with pytest.raises(ToolchainError):
            build_library({"bad.c": "nonsense"}, main="bad.c")
    assert [path.name for path in cache.rglob("*") if path.is_file()] == ["lock"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the linker flag is ELF's")
def test_missing_symbol_fails_at_build_time() -> None:
    source = "int elsewhere(void);\nint here(void);\nint here(void) { return elsewhere(); }\n"
    with pytest.raises(ToolchainError, match="elsewhere"):
        build_library({"main.c": source}, main="main.c")


def test_libraries_go_behind_the_source() -> None:
    source = "#include <math.h>\ndouble f(double x);\ndouble f(double x) { return sin(x); }\n"
    f = load(build_library({"main.c": source}, main="main.c", flags=["-lm", "-O0", "-Wl,--as-needed"])).f
    f.argtypes, f.restype = [ctypes.c_double], ctypes.c_double
    assert f(1.0) == pytest.approx(0.8414709848078965, rel=1e-15)


@pytest.mark.parametrize("name", ["/etc/x.c", "../x.c", "a/../../x.c", ""])
def test_source_names_stay_inside(name: str) -> None:
    with pytest.raises(ValueError, match="must be relative"):
        build_library({name: ""}, main=name)


def test_main_must_be_among_the_sources() -> None:
    with pytest.raises(ValueError, match=r"'other\.c' is not among the sources: inner/value\.h, main\.c"):
        build_library(SOURCES, main="other.c")


# --- the cache holds -------------------------------------------------------------------------------------


def truncate(entry: Path) -> None:
    os.truncate(entry / "library.so", 100)


def flip_a_bit(entry: Path) -> None:
    image = bytearray((entry / "library.so").read_bytes())
    image[len(image) // 2] ^= 1
    (entry / "library.so").write_bytes(image)


def lose_the_library(entry: Path) -> None:
    (entry / "library.so").unlink()


def lose_the_checksum(entry: Path) -> None:
    (entry / "library.sha256").unlink()


def garble_the_checksum(entry: Path) -> None:
    (entry / "library.sha256").write_bytes(b"\xff\x00")


@pytest.mark.parametrize("damage", [truncate, flip_a_bit, lose_the_library, lose_the_checksum, garble_the_checksum])
def test_damaged_entry_is_rebuilt(damage: Callable[[Path], None]) -> None:
    library = build_library(SOURCES, main="main.c")
    image = library.read_bytes()
    damage(entry_of(library))
    assert build_library(SOURCES, main="main.c") == library
    assert library.read_bytes() == image
    assert load(library).value() == 7


def build_in_process(compiler: Compiler, without_locks: bool) -> int:
    if without_locks:

        def refuse(*_: object) -> None:
            raise OSError(errno.ENOLCK, "no locks available")

        fcntl.flock = refuse  # type: ignore[assignment]  # this process is ours alone
    return int(load(build_library(SOURCES, main="main.c", compiler=compiler)).value())


@pytest.mark.parametrize("without_locks", [False, True])
def test_processes_building_at_once(
    without_locks: bool, counted: tuple[Compiler, Callable[[], int]], cache: Path
) -> None:
    compiler, builds = counted
    with multiprocessing.get_context("fork").Pool(4) as pool:
        answers = pool.starmap(build_in_process, [(compiler, without_locks)] * 4, chunksize=1)
    assert answers == [7, 7, 7, 7]
    assert builds() > 1 if without_locks else builds() == 1
    assert not list(cache.rglob("build-*"))


def test_threads_building_at_once(counted: tuple[Compiler, Callable[[], int]]) -> None:
    compiler, builds = counted
    libraries: list[Path] = []
    threads = [
        threading.Thread(target=lambda: libraries.append(build_library(SOURCES, main="main.c", compiler=compiler)))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(libraries) == 4
    assert len(set(libraries)) == 1
    assert builds() == 1


def test_a_killed_build_does_no_harm(counted: tuple[Compiler, Callable[[], int]], cache: Path) -> None:
    compiler, builds = counted
    process = multiprocessing.get_context("fork").Process(target=build_in_process, args=(compiler, False))
    process.start()
    deadline = time.monotonic() + 30
    while builds() == 0:
        assert time.monotonic() < deadline, "the build did not start"
        time.sleep(0.01)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    assert list(cache.rglob("build-*")), "killed too late for this test to mean anything"
    assert load(build_library(SOURCES, main="main.c", compiler=compiler)).value() == 7
    assert not list(cache.rglob("build-*"))


def test_unusable_cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("SPRINGLINE_CACHE", str(tmp_path / "file"))
    with pytest.raises(ToolchainError, match=r"cache folder .*file.* set SPRINGLINE_CACHE"):
        build_library(SOURCES, main="main.c")


def test_cache_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPRINGLINE_CACHE", str(tmp_path / "own"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_root() == tmp_path / "own"
    monkeypatch.delenv("SPRINGLINE_CACHE")
    assert cache_root() == tmp_path / "xdg" / "springline"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_root() == tmp_path / "home" / ".cache" / "springline"


# --- what is loaded is trusted and works -----------------------------------------------------------------


@pytest.mark.parametrize("cc", ['gcc "x', "gcc 'x", "gcc \\", '"'])
def test_cc_that_is_no_command_line_is_named(cc: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", cc)
    with pytest.raises(ToolchainError, match=r"the environment variable CC is .* no command line") as caught:
        find_compiler()
    assert repr(cc) in str(caught.value)
    assert [row.ok for row in checks() if row.name == "C compiler"] == [False]


@pytest.mark.parametrize("cc", ['""', "'' -O1", "# gcc"])
def test_cc_that_names_no_program_is_named(cc: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", cc)
    with pytest.raises(ToolchainError, match="no working C compiler"):
        find_compiler()


@pytest.mark.parametrize("content", [b"", b"no library", b"\x7fELF" + bytes(400)])
def test_a_damaged_library_with_a_right_checksum_is_rebuilt(content: bytes) -> None:
    library = build_library(SOURCES, main="main.c")
    library.unlink()  # its bytes may be mapped here
    library.write_bytes(content)
    (library.parent / "library.sha256").write_text(hashlib.sha256(content).hexdigest())
    assert load(build_library(SOURCES, main="main.c")).value() == 7


def test_a_library_cut_short_or_of_another_entry_is_rebuilt_whatever_checksum_lies_beside_it() -> None:
    """To load it would kill the process, or load what computes something else."""
    library = build_library(SOURCES, main="main.c")
    other = build_library({"main.c": "int value(void);\nint value(void) { return 8; }\n"}, main="main.c")
    whole = library.read_bytes()
    for content, checksum in (
        (whole[: len(whole) // 2], hashlib.sha256(whole[: len(whole) // 2]).hexdigest()),
        (other.read_bytes(), (other.parent / "library.sha256").read_text()),
    ):
        library.unlink()
        library.write_bytes(content)
        (library.parent / "library.sha256").write_text(checksum)
        assert load(build_library(SOURCES, main="main.c")).value() == 7


@pytest.mark.parametrize("name", ["library.so", "library.sha256"])
def test_a_pipe_in_the_cache_is_not_waited_for(name: str) -> None:
    library = build_library(SOURCES, main="main.c")
    (library.parent / name).unlink()
    os.mkfifo(library.parent / name)
    assert load(build_library(SOURCES, main="main.c")).value() == 7


def test_a_folder_where_a_library_belongs_is_named() -> None:
    library = build_library(SOURCES, main="main.c")
    library.unlink()
    library.mkdir()
    with pytest.raises(ToolchainError, match=f"rm -r {library.parent}"):
        build_library(SOURCES, main="main.c")


CRASHING = "__attribute__((constructor)) static void crash(void) { *(volatile int *)0 = 1; }"

LYING = {
    "writes rubbish": "echo rubbish > library.so; exit 0",
    "writes nothing": "exit 0",
    "writes an empty file": ": > library.so; exit 0",
    "writes what crashes": f"echo '{CRASHING}' | REAL -x c -shared -fPIC - -o library.so; exit 0",
}


@pytest.mark.parametrize("script", LYING.values(), ids=LYING.keys())
def test_a_compiler_that_reports_success_wrongly_leaves_nothing_in_the_cache(
    script: str, wrap: Callable[[str, str], Compiler], cache: Path
) -> None:
    script = script.replace("REAL", " ".join(find_compiler().argv))
    liar = wrap("lying-cc", f'case "$*" in *library.so*) {script};; esac')
    with pytest.raises(ToolchainError, match=r"lying-cc reported success, but .*set CC to another compiler"):
        build_library(SOURCES, main="main.c", compiler=liar)
    assert [path.name for path in cache.rglob("*") if path.is_file()] == ["lock"]
    assert load(build_library(SOURCES, main="main.c", compiler=find_compiler())).value() == 7


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="writes into an ELF header")
@pytest.mark.parametrize(("offset", "byte"), [(4, 1), (5, 2), (18, 0xF3)], ids=["class", "byte order", "processor"])
def test_a_compiler_for_another_machine_is_named(
    offset: int, byte: int, tmp_path: Path, wrap: Callable[[str, str], Compiler]
) -> None:
    real = " ".join(find_compiler().argv)
    patch = f"printf '\\{byte:o}' | dd of=library.so bs=1 seek={offset} conv=notrunc status=none"
    cross = wrap("cross-cc", f'case "$*" in *library.so*) {real} "$@" && {patch}; exit;; esac')
    with pytest.raises(
        ToolchainError, match=r"cross-cc makes code for another machine .*set CC to a compiler for this"
    ):
        build_library(SOURCES, main="main.c", compiler=cross)


def test_a_cache_that_is_mounted_noexec_names_its_remedy(
    wrap: Callable[[str, str], Compiler], cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Played: mounting needs more rights than a test has. A library that does not load stands for the refusal."""
    real = os.statvfs

    class Mounted(NamedTuple):
        f_flag: int

    liar = wrap("lying-cc", 'case "$*" in *library.so*) echo rubbish > library.so; exit 0;; esac')
    monkeypatch.setattr(os, "statvfs", lambda path: Mounted(real(path).f_flag | os.ST_NOEXEC))
    with pytest.raises(ToolchainError, match=rf"{cache}.* mounted noexec: set SPRINGLINE_CACHE"):
        build_library(SOURCES, main="main.c", compiler=liar)


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o1777])
@pytest.mark.parametrize("which", ["root", "entry", "library"])
def test_a_cache_that_others_may_write_to_is_refused(mode: int, which: str, cache: Path) -> None:
    library = build_library(SOURCES, main="main.c")
    place = {"root": cache, "entry": library.parent, "library": library}[which]
    place.chmod(mode)
    with pytest.raises(ToolchainError, match=rf"{place} has mode {mode:04o}.* chmod -R go-w .*SPRINGLINE_CACHE"):
        build_library(SOURCES, main="main.c")
    subprocess.run(["chmod", "-R", "go-w", str(cache)], check=True)  # the remedy
    assert load(build_library(SOURCES, main="main.c")).value() == 7


def test_a_cache_of_another_user_is_refused_and_that_of_root_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    library = build_library(SOURCES, main="main.c")
    owner = library.stat().st_uid
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    if owner:
        with pytest.raises(ToolchainError, match=rf"belongs to user {owner}, and you are user 4711"):
            build_library(SOURCES, main="main.c")
    else:
        assert build_library(SOURCES, main="main.c") == library
        os.chown(library, 4712, -1)
        with pytest.raises(ToolchainError, match="belongs to user 4712, and you are user 4711"):
            build_library(SOURCES, main="main.c")


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o022, 0o077])
def test_any_umask_makes_a_cache_that_is_trusted(
    umask: int, counted: tuple[Compiler, Callable[[], int]], cache: Path
) -> None:
    compiler, builds = counted
    before = os.umask(umask)
    try:
        for _ in range(2):
            assert load(build_library(SOURCES, main="main.c", compiler=compiler)).value() == 7
    finally:
        os.umask(before)
    assert builds() == 1
    made = [cache, *(place for place in cache.rglob("*") if place.name != "lock")]
    assert not [place for place in made if place.stat().st_mode & 0o022]


def test_without_a_home_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    for name in ("SPRINGLINE_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ToolchainError, match=r"no home here .*set SPRINGLINE_CACHE"):
        build_library(SOURCES, main="main.c")
    assert [(row.name, row.ok) for row in checks()][-1] == ("cache", False)


# --- loading ---------------------------------------------------------------------------------------------


def test_calls_release_the_gil() -> None:
    """The C function waits, 10 s at most, for a flag that only another Python thread can set."""
    source = """
        #define _POSIX_C_SOURCE 199309L
        #include <time.h>
        int wait_for_answer(volatile int *started, volatile int *answer);
        int wait_for_answer(volatile int *started, volatile int *answer) {
            struct timespec pause = {0, 1000000};
            *started = 1;
            for (int i = 0; i < 10000 && !*answer; ++i) nanosleep(&pause, 0);
            return *answer;
        }
    """
    library = load(build_library({"main.c": source}, main="main.c"))
    started, answer = ctypes.c_int(0), ctypes.c_int(0)

    def reply() -> None:
        while not started.value:
            time.sleep(0.001)
        answer.value = 1

    thread = threading.Thread(target=reply)
    thread.start()
    result = library.wait_for_answer(ctypes.byref(started), ctypes.byref(answer))
    thread.join()
    assert result == 1


def test_a_library_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "broken.so").write_bytes(b"no library")
    with pytest.raises(ToolchainError, match=r"cannot load the compiled library: .*broken\.so"):
        load(tmp_path / "broken.so")


def test_checks_for_doctor(cache: Path) -> None:
    rows = {row.name: row for row in checks()}
    assert all(row.ok for row in rows.values())
    assert rows["cache"].value == str(cache)
    assert rows["build and load"].value == "works"
    assert rows["vector width"].value == f"{native_vector_width()} doubles"


@pytest.mark.parametrize(
    ("target", "features", "expected"),
    [
        ("x86_64-linux-gnu", "x86_64", "x86-64"),
        ("x86_64-linux-gnu", "x86_64 SSE3 SSSE3 SSE4_1 SSE4_2 POPCNT", "x86-64-v2"),
        ("x86_64-linux-gnu", "x86_64 SSE3 SSSE3 SSE4_1 SSE4_2 POPCNT AVX", "x86-64-v2"),
        ("aarch64-linux-gnu", "aarch64 ARM_NEON", "neon"),
        ("riscv64-linux-gnu", "riscv", "riscv64"),
    ],
)
def test_an_instruction_set_is_the_highest_whose_features_are_all_there(
    target: str, features: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    macros = {f"__{name}" if name == "ARM_NEON" else f"__{name}__": "1" for name in features.split()}
    monkeypatch.setattr(compilers, "native_flags", lambda compiler: ())
    monkeypatch.setattr(compilers, "predefined_macros", lambda compiler, flags: macros)
    assert native_instruction_set(Compiler(("cc",), "gcc", "1", target)) == expected


@pytest.mark.parametrize("level", ["x86-64", "x86-64-v2", "x86-64-v3", "x86-64-v4"])
def test_an_instruction_set_is_what_the_compiler_was_told(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler = find_compiler()
    if compiler.family != "gcc" or not compiler.target.startswith("x86_64"):
        pytest.skip("levels are told to gcc on x86-64")
    monkeypatch.setattr(compilers, "native_flags", lambda compiler: (f"-march={level}",))
    assert native_instruction_set(compiler) == level
