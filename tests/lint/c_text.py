"""C source with its comments or its literals blanked out, line by line, so that rules can be checked by search."""

import re

TOKEN = re.compile(r"""/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'""", re.DOTALL)


def _blank(text):
    return re.sub(r"[^\n]", " ", text)


def code(source):
    """The source without comments and literals; positions and lines stay."""
    return TOKEN.sub(lambda token: _blank(token[0]), source)


def comments(source):
    """Only the comments; positions and lines stay."""
    kept, end = [], 0
    for token in TOKEN.finditer(source):
        kept.append(_blank(source[end:token.start()]))
        kept.append(token[0] if token[0].startswith(("/*", "//")) else _blank(token[0]))
        end = token.end()
    kept.append(_blank(source[end:]))
    return "".join(kept)


def report(number, claim, faults):
    """One TAP result; every fault as a comment line."""
    print("%sok %d - %s" % ("not " if faults else "", number, claim))
    for fault in faults:
        print("# " + fault)
    return not faults
