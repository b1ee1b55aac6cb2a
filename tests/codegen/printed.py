"""Reading generated C."""

import re


def with_whole_comments(text: str) -> str:
    """C whose comments behind statements, where they go on below themselves, stand on one line."""
    return re.sub(r"\n {20,}", " ", text)
