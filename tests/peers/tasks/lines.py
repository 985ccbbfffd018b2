#!/usr/bin/env python3
"""Counts the lines of code of the ten tasks, without blank lines, comments and docstrings: `lines.py [FILE…]`."""

import ast
import io
import pathlib
import sys
import tokenize


def count(path: pathlib.Path) -> int:
    """Number of lines of code of a file."""
    text = path.read_text(encoding="utf-8")
    documentation = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            documentation.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    skipped = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in skipped:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - documentation)


if __name__ == "__main__":
    folder = pathlib.Path(__file__).parent
    for file in map(pathlib.Path, sys.argv[1:] or sorted(folder.glob("*/*.py"))):
        print(f"{count(file):4}  {file}")
