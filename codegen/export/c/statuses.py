"""What the functions of an export's C interface return."""

from __future__ import annotations

STATUS = (
    ("OK", "done"),
    ("NULL_ARGUMENT", "a pointer was NULL that may not be: pass the structures that {prefix}.h names"),
    ("NOT_INITIALIZED", "the controller is not ready: call {prefix}_init first and check what it returns"),
    ("BAD_FALLBACK", "config.fallback is neither {PREFIX}_FALLBACK_ZERO nor {PREFIX}_FALLBACK_LAST: set it"),
    ("BAD_PARAMETER", "a parameter is out of its range ({prefix}.h): correct it and pass the configuration again"),
    ("BAD_REFERENCE", "a reference is not a finite number: check the trajectory generator; the fallback is commanded"),
    ("BAD_MEASUREMENT", "a measurement is not a finite number: check the sensors; the fallback is commanded"),
    ("OVERFLOW", "the law left the finite numbers: check its gains and the reference; the fallback is commanded"),
    ("BAD_PLANT_INPUT", "state, command, base motion or step not finite, or step not positive: the state was kept"),
    ("DIVERGED", "the plant left the finite numbers: take a smaller step or check the commands; the state was kept"),
    ("BAD_TIME", "the time is not a finite number: correct it"),
)
"""In the order of their values: name, and what happened and what to do about it; {prefix} is the export's."""


def statuses(prefix: str) -> list[tuple[str, str]]:
    """Name and sentence of every status of an export with this prefix."""
    return [(name, text.format(prefix=prefix, PREFIX=prefix.upper())) for name, text in STATUS]
