"""What a C compiler sees of a source: its tokens, without the comments and white space that only people see.

Two texts with the same tokens are the same program: a hash of the tokens changes if and only if the program may.
"""

from __future__ import annotations

import re

# C99 6.4, in the order in which a reader has to try: a comment is no division, a marker inside a string no comment.
_TOKEN = re.compile(
    r"""
      (?P<space>   (?: [ \t\v\f\r] | /\*.*?\*/ | //[^\n]* )+ )
    | (?P<newline> \n )
    | (?P<word>    (?:L|u8|u|U)? "(?:[^"\\\n]|\\.)*"
                 | (?:L|u|U)?    '(?:[^'\\\n]|\\.)*'
                 | \.?[0-9] (?: [eEpP][+-] | [\w.] )*
                 | \w+
                 | %:%: | \.\.\. | <<= | >>=
                 | -> | \+\+ | -- | << | >> | [<>=!]= | && | \|\| | [*/%+\-&^|]= | \#\# | <: | :> | <% | %> | %:
                 | . )
    """,
    re.VERBOSE | re.DOTALL,
)


def tokens(text: str) -> list[str]:
    """The preprocessor's tokens of a C source.

    Lines count where they end a directive, which is closed by "\\n". White space counts before a parenthesis of a
    directive, which is then " (": it tells "#define f (x)" from "#define f(x)". (It would count too where a macro turns
    its argument into a string; no macro of springline's does.)
    """
    found: list[str] = []
    directive, fresh, spaced = False, True, False
    for match in _TOKEN.finditer(text.replace("\\\n", "") + "\n"):
        if match["newline"]:
            if directive:
                found.append("\n")
            directive, fresh, spaced = False, True, False
        elif match["space"]:
            spaced = True
        else:
            word = match["word"]
            directive = directive or (fresh and word in ("#", "%:"))
            found.append(" (" if directive and spaced and word == "(" else word)
            fresh = spaced = False
    return found
