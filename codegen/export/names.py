"""What the prefix of an export may be: it begins every public name, and names files that others find by theirs.

`float`, `stdio` and `math` are C identifiers too, but a folder with a math.h in it takes the place of the system's.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from springline.codegen.program import KEYWORDS

LONGEST = 63
"""Characters of a prefix: by so many C99 promises to tell the names inside a program apart (5.2.4.1)."""

LONGEST_LINKED = 26
"""Characters of a prefix whose names other files call: C99 promises that a linker tells names apart by 31, and
<prefix>_start and <prefix>_status_text differ in the fifth behind the prefix."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Of C, C++, POSIX, and what a compiler brings along (the elementary functions include one of these).
_HEADERS = _words("""
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg stdatomic
    stdbit stdbool stdckdint stddef stdint stdio stdlib stdmchar stdnoreturn string tgmath threads time uchar wchar
    wctype
    algorithm any array atomic barrier bit bitset cassert ccomplex cctype cerrno cfenv cfloat charconv chrono cinttypes
    ciso646 climits clocale cmath codecvt compare concepts condition_variable contracts coroutine csetjmp csignal
    cstdalign cstdarg cstdbool cstddef cstdint cstdio cstdlib cstring ctgmath ctime cuchar cwchar cwctype debugging
    deque exception execution expected filesystem flat_map flat_set format forward_list fstream functional future
    generator hash_map hash_set hazard_pointer hive initializer_list inplace_vector iomanip ios iosfwd iostream istream
    iterator
    latch linalg list map mdspan memory memory_resource meta mutex new numbers numeric optional ostream print queue
    random ranges ratio rcu regex scoped_allocator semaphore set shared_mutex simd source_location span spanstream
    sstream stack stacktrace std stdexcept stdfloat stop_token streambuf string_view strstream syncstream system_error
    text_encoding thread tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray variant
    vector version
    aio alloca byteswap cpio dirent dlfcn elf endian err fcntl features fmtmsg fnmatch ftw getopt glob grp iconv io
    langinfo libgen malloc memory monetary mqueue ndbm netdb nl_types paths poll pthread pwd sched search spawn
    strings stropts syslog tar termios ucontext ulimit unistd utime utmpx values windows winsock2 wordexp
    arm_acle arm_neon arm_sve cpuid emmintrin immintrin intrin mm_malloc nmmintrin pmmintrin smmintrin tmmintrin unwind
    wmmintrin x86intrin xmmintrin
    bzlib curses expat lzma ncurses zlib
""")

_DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(10))})
_TARGETS = _words("""
    all all_build clean depend edit_cache help install list_install_components package package_source preinstall
    rebuild_cache run_tests test zero_check
""")
_LIBRARIES = _words("""
    asan atomic bz2 c crypt crypto curl dl expat gcc gcc_s gomp lzma m ncurses nsl pthread readline resolv rt ssl stdc
    stdcxx tinfo util z
""")

# <prefix>_init is a function of <stdatomic.h>, <threads.h>, <semaphore.h>, <pthread.h>; FE_OVERFLOW is a macro of
# <fenv.h>; SIG_, LC_ and so on are kept for macros to come.
_FAMILIES = re.compile(r"call|cnd|fe|lc|mtx|sem|sig|thrd|tss|(atomic|posix|pthread)(_.*)?")
_OURS = re.compile(r"fmu|(slf?|slv|casadi)(_.*)?")  # fmu_state and fmu_reset are names inside an FMU


def check_prefix(prefix: str) -> None:
    """Raise ValueError, with the reason and what to do, for a prefix whose names or files would mean something else.

    Letter case does not count: files that differ by it alone are one file on some systems.
    """
    lower = prefix.lower()
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", prefix):
        raise ValueError(f"prefix {prefix!r} is no C identifier: letters, digits and _, a letter first")
    _expect_length(prefix, LONGEST, "by so many C99 tells names apart")
    if "__" in prefix or prefix.endswith("_"):
        raise ValueError(
            f"prefix {prefix!r} would make names with two _ in a row, which C++ keeps: one _ inside is fine"
        )
    reasons = (
        (lower in KEYWORDS, "is a keyword of C or C++"),
        (lower in _HEADERS, f"would make a {lower}.h, which takes the place of a header that others include"),
        (lower in _LIBRARIES, f"would make a lib{lower}, which takes the place of a library that others link"),
        (lower in _DEVICES, "is the name of a device on Windows: no file can have it"),
        (lower in _TARGETS, "is a target that build tools have already"),
        (_FAMILIES.fullmatch(lower), "begins names that C, C++ or POSIX keep"),
        (_OURS.fullmatch(lower), "belongs to the library inside the C"),
    )
    for applies, reason in reasons:
        if applies:
            raise ValueError(f"prefix {prefix!r} {reason}: choose another, such as {'arm_' + prefix!r}")


def check_linked(prefix: str) -> None:
    """Raise ValueError for a prefix that leaves a linker too few characters to tell the interface's functions apart."""
    _expect_length(
        prefix,
        LONGEST_LINKED,
        "C99 promises that a linker tells names apart by their first 31, and the functions' names need the rest",
    )


def _expect_length(prefix: str, longest: int, why: str) -> None:
    if len(prefix) > longest:
        raise ValueError(f"prefix {prefix[:20]!r}… has {len(prefix)} characters, expected {longest} at most: {why}")


def check_files(prefix: str, own: Iterable[str], others: Iterable[str]) -> None:
    """Raise ValueError if a file named after the prefix is one of the others, whatever the letter case."""
    taken = {path.lower() for path in others}
    for path in own:
        if path.lower() in taken:
            raise ValueError(f"prefix {prefix!r} would make a second {path}: choose another")
