"""The pages of the book that tables and images go to."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BOOK = ROOT / "book" / "src"


def publish(table: str, name: str, script: str, book: bool, page: str = "comparison.md") -> None:
    """Prints a table, and puts it into its place in a page of the book."""
    print(table, flush=True)
    if book:
        path = BOOK / page
        begin, end = f"<!-- {name}: made by {script} -->", f"<!-- end of {name} -->"
        before, rest = path.read_text().split(begin)
        path.write_text(f"{before}{begin}\n\n{table.strip()}\n\n{end}{rest.split(end)[1]}")


def save(image, path: Path) -> None:
    """An image of few colors, small enough for a repository."""
    image.quantize(256).save(path, optimize=True)
