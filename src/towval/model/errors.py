"""The errors of the package: each names the thing, the value received, what is allowed and the way out."""


class TowvalError(Exception):
    """Base of every error that is the input's fault and not the program's.

    Parameters
    ----------
    what : str
        The thing that is wrong, by the name its user knows (a key, a file, a stage).
    got : object, optional
        The value received.
    allowed : str, optional
        What would have been accepted.
    remedy : str, optional
        What to do about it.
    """

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


class RefusedError(TowvalError):
    """A stage could compute a number but does not vouch for it, and says why."""
