"""The page of the book that tables and images go to."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BOOK = ROOT / "book" / "src"


def publish(table: str, name: str, script: str, book: bool) -> None:
    """Prints a table, and puts it into its place in the book."""
    print(table, flush=True)
    if book:
        page = BOOK / "comparison.md"
        begin, end = f"<!-- {name}: made by {script} -->", f"<!-- end of {name} -->"
        before, rest = page.read_text().split(begin)
        page.write_text(f"{before}{begin}\n\n{table.strip()}\n\n{end}{rest.split(end)[1]}")


def save(image, path: Path) -> None:
    """An image of few colors, small enough for a repository."""
    image.quantize(256).save(path, optimize=True)
