"""Exceptions of the package."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

__all__ = ["Diagnostic", "RecipeError", "SyntableError"]


class SyntableError(Exception):
    """Work that failed. The text names the file, the place, the value and a remedy.

    Attributes:
        message: The fault alone.
        file: The file at fault, if any.
        line: Its line, from 1, if known.
        help: The remedy, if known.
        temporary: Whether the same call may succeed later, as after a failure of the network or a full disk: the command would
            end with exit code 1. False for mistakes in the call, the recipe or the dataset.
    """

    def __init__(
        self,
        text: str,
        *,
        message: str | None = None,
        file: str | None = None,
        line: int | None = None,
        help: str | None = None,
        temporary: bool = False,
    ) -> None:
        super().__init__(text)
        self.message = text if message is None else message
        self.file = file
        self.line = line
        self.help = help
        self.temporary = temporary

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, (type(self), self.args, self.__dict__.copy()))


@dataclass(frozen=True)
class Diagnostic:
    """One mistake in a recipe.

    Attributes:
        code: Kind of mistake, such as ``D0003``; the book lists all.
        severity: ``error`` or ``warning``.
        message: The mistake: lower case, no full stop.
        file: The recipe's file or name; None if the mistake has no place.
        line: Line of the mistake, from 1.
        column: Column of the mistake, from 1.
        help: Notes and remedies.
        text: The whole message, with the line underlined, as the command prints it.
    """

    code: str
    severity: str
    message: str
    file: str | None
    line: int | None
    column: int | None
    help: list[str] = field(default_factory=list)
    text: str = ""

    def __str__(self) -> str:
        return self.text


class RecipeError(SyntableError):
    """All mistakes of a recipe that cannot run.

    Attributes:
        diagnostics: The mistakes and the warnings, in reading order.
    """

    def __init__(self, text: str, *, diagnostics: list[Diagnostic]) -> None:
        first = next((one for one in diagnostics if one.severity == "error"), diagnostics[0])
        super().__init__(
            text,
            message=first.message,
            file=first.file,
            line=first.line,
            help="; ".join(first.help) or None,
        )
        self.diagnostics = diagnostics

    @property
    def code(self) -> str:
        """Code of the first error."""
        errors = [one for one in self.diagnostics if one.severity == "error"]
        return (errors or self.diagnostics)[0].code


def _again(kind: type[SyntableError], args: tuple[Any, ...], fields: dict[str, Any]) -> SyntableError:
    """The exception that pickle stored."""
    error = kind.__new__(kind)
    Exception.__init__(error, *args)
    error.__dict__.update(fields)
    return error
