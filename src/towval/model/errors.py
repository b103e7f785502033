"""The errors of the package: each names the thing, the value received, what is allowed and the remedy."""

from collections.abc import Callable, Iterable
from typing import TypeVar

Result = TypeVar("Result")


def shortened(text: str) -> str:
    """A text in at most 80 characters, for a message."""
    return text if len(text) <= 80 else text[:77] + "..."


class TowvalError(Exception):
    """Base of every error that is the input's fault and not the program's.

    ``what`` is wrong, by the name its user knows (a key, a file, a stage); ``got`` the value received, ``allowed`` what
    would have been accepted, ``remedy`` what to do about it; ``key`` that of the input that it is about, where that is
    known (``runs.a.video``).
    """

    key = ""

    def __init__(self, what: str, *, got: object = None, allowed: str | None = None, remedy: str | None = None):
        self.what, self.got, self.allowed, self.remedy = what, got, allowed, remedy
        parts = [what]
        if got is not None:
            parts.append(f"got: {got}")
        if allowed is not None:
            parts.append(f"allowed: {allowed}")
        if remedy is not None:
            parts.append(f"what to do: {remedy}")
        super().__init__("\n  ".join(parts))


class InputError(TowvalError):
    """A value, a key or a file that cannot be used as it is."""


class InputErrors(InputError):
    """Several faults of one input; ``faults`` are the errors, in the input's order."""

    def __init__(self, where: str, faults: Iterable[TowvalError]):
        self.faults = tuple(faults)
        texts = [str(fault).removeprefix(f"{where}: ").replace("\n", "\n  ") for fault in self.faults]
        super().__init__(f"{where} has {len(texts)} faults:\n  - " + "\n  - ".join(texts))


class Faults(list[TowvalError]):
    """Errors of an input, collected in order to be reported all at once."""

    def attempt(self, function: Callable[..., Result], *arguments: object) -> Result | None:
        """The result of a call, or None where it raises an error of the input, which is kept."""
        try:
            return function(*arguments)
        except InputErrors as error:
            self.extend(error.faults)
        except TowvalError as error:
            if str(error) not in map(str, self):
                self.append(error)
        return None

    def raise_any(self, where: str) -> None:
        """Raise what was collected: one error as it is, several as one :class:`InputErrors`."""
        if len(self) > 1:
            raise InputErrors(where, self)
        if self:
            raise self[0]


class RefusedError(TowvalError):
    """A stage could compute a number but does not vouch for it, and says why."""
