#!/usr/bin/env python3
"""Runs the notebook of the Python package, and makes its page of the book.

    python3 book/notebook.py            # runs the cells, stores their outputs in the notebook, and writes the page
    python3 book/notebook.py --check    # runs nothing: fails if the page differs from the notebook

Needs the package `syntable`, and no Jupyter. Outputs are text and, if the last expression of a cell has one, its image.
"""

import argparse
import ast
import base64
import contextlib
import io
import json
import os
import pathlib
import sys
import tempfile
import types

ROOT = pathlib.Path(__file__).resolve().parent.parent
NOTEBOOK = ROOT / "plugins/python/examples/first_dataset.ipynb"
PAGE = ROOT / "book/src/notebook.md"
IMAGES = "images/notebook-{}.png"
LINK = "https://github.com/syntable/syntable/blob/main/"


def lines(text):
    """Text as a notebook stores it: a list of lines, with their ends."""
    return text.splitlines(keepends=True)


def run(cells):
    """Runs cells of code in an empty folder, in order. Returns the outputs of each cell."""
    module = types.ModuleType("notebook")
    sys.modules[module.__name__] = module
    before = os.getcwd()
    outputs = []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for number, cell in enumerate(cells, 1):
                outputs.append(run_cell(ast.parse("".join(cell["source"])), f"<cell {number}>", number, vars(module)))
        finally:
            os.chdir(before)
            del sys.modules[module.__name__]
    return outputs


def run_cell(tree, name, number, names):
    """Outputs of a cell: what it prints, and its last expression."""
    shown = ast.Expression(tree.body.pop().value) if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, name, "exec"), names)
        if shown is not None:
            value = eval(compile(shown, name, "eval"), names)
    outputs = []
    if printed.getvalue():
        outputs.append({"name": "stdout", "output_type": "stream", "text": lines(printed.getvalue())})
    if value is not None:
        data = {"text/plain": lines(repr(value))}
        png = getattr(value, "_repr_png_", lambda: None)()
        if png is not None:
            data["image/png"] = base64.b64encode(png).decode() + "\n"
        outputs.append({"data": data, "execution_count": number, "metadata": {}, "output_type": "execute_result"})
    return outputs


def refreshed(notebook):
    """The notebook with the outputs of a run."""
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, (cell, outputs) in enumerate(zip(code, run(code)), 1):
        cell.update(execution_count=number, outputs=outputs)
    return notebook


def page(notebook):
    """The page of a notebook as Markdown, and its images by path."""
    parts, images = [], {}
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "image/png" in data:
                path = IMAGES.format(len(images) + 1)
                images[path] = base64.b64decode(data["image/png"])
                parts.append(f"![Output of the code above.]({path})")
            else:
                text = "".join(output["text"] if "text" in output else data["text/plain"])
                parts.append(f"```text\n{text.rstrip()}\n```")
    name = NOTEBOOK.relative_to(ROOT).as_posix()
    made = f"<!-- Made from {name} by book/notebook.py -->"
    parts.insert(1, f"This page is the notebook [{NOTEBOOK.name}]({LINK}{name}) with its outputs.")
    return "\n\n".join([made, *parts]) + "\n", images


def differences(notebook):
    """Files of the page that differ from the notebook."""
    text, images = page(notebook)
    wanted = {PAGE: text.encode(), **{PAGE.parent / path: image for path, image in images.items()}}
    stored = {PAGE, *PAGE.parent.glob(IMAGES.format("*"))}
    return sorted(
        path for path in stored | set(wanted) if not path.exists() or path.read_bytes() != wanted.get(path)
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="fail if the page differs from the notebook")
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    if parser.parse_args().check:
        if changed := differences(notebook):
            names = ", ".join(path.relative_to(ROOT).as_posix() for path in changed)
            sys.exit(f"{names}: not as in the notebook; run python3 book/notebook.py")
        return
    notebook = refreshed(notebook)
    NOTEBOOK.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    text, images = page(notebook)
    for path in PAGE.parent.glob(IMAGES.format("*")):
        path.unlink()
    PAGE.write_text(text, encoding="utf-8")
    for path, image in images.items():
        (PAGE.parent / path).write_bytes(image)


if __name__ == "__main__":
    main()
