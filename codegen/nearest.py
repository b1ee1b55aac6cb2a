"""What somebody who mistyped a name may have meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: str, valid: Iterable[str], alike: float = 0.5) -> str:
    """The one of `valid` that is most like `name`, whatever the case of their letters.

    alike  how much, from 0 (anything will do) to 1 (equal)
    Returns "" if none is alike enough, or there is none.
    """
    by_case = {other.casefold(): other for other in valid}
    close = get_close_matches(name.casefold(), by_case, n=1, cutoff=alike)
    return by_case[close[0]] if close else ""
