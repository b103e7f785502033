"""One call in a process of its own, with limits of time and memory, and how it ended."""

import math
import os
import pickle
import resource
import select
import signal
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from towval.model.errors import TowvalError

SECONDS = 10
_PATIENCE = 6  # times that on the clock: a call that waits takes no time of the processor, one on a busy machine little
MEMORY_BYTES = 2**30
_PAGE = 4096


@dataclass(frozen=True)
class Outcome:
    """``kind``: "returned", "refused" (one message), "traceback", "hang", "memory" or "died"; ``text``: words."""

    kind: str
    text: str = ""
    value: Any = None

    @property
    def told(self) -> bool:
        """Whether the call ended as a call may: with a value or with one message."""
        return self.kind in ("returned", "refused")


def attempt(call: Callable[[], Any], seconds: float = SECONDS, memory_bytes: int = MEMORY_BYTES) -> Outcome:
    """The outcome of a call in a child process.

    Parameters
    ----------
    seconds : float
        Of the processor after which it counts as hanging, and by the clock several times that [s].
    memory_bytes : int
        Address space that it may take beyond that of this process.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds), math.ceil(seconds) + 1))
        _in_child(call, writing, memory_bytes)
    os.close(writing)
    data = _read(reading, child, _PATIENCE * seconds)
    _, status = os.waitpid(child, 0)
    if data is None or (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU):
        return Outcome("hang")
    try:
        outcome: Outcome = pickle.loads(data)  # our own child wrote it
    except (EOFError, pickle.UnpicklingError):
        return Outcome("died", f"status {status}")
    return outcome


def _in_child(call: Callable[[], Any], writing: int, memory_bytes: int) -> None:
    with open("/proc/self/statm", encoding="ascii") as stream:
        now = int(stream.read().split()[0]) * _PAGE
    resource.setrlimit(resource.RLIMIT_AS, (now + memory_bytes, now + memory_bytes))
    try:
        outcome = Outcome("returned", value=call())
    except TowvalError as error:
        outcome = Outcome("refused", str(error))
    except MemoryError:
        outcome = Outcome("memory")
    except BaseException:
        outcome = Outcome("traceback", traceback.format_exc())
    try:
        data = pickle.dumps(outcome)
    except Exception as error:
        data = pickle.dumps(Outcome("traceback", f"the result cannot be sent: {error}"))
    with os.fdopen(writing, "wb") as stream:
        stream.write(data)
    os._exit(0)


def _read(reading: int, child: int, seconds: float) -> bytes | None:
    """All that the child sends; None where it takes longer than it may, and is killed."""
    parts: list[bytes] = []
    with os.fdopen(reading, "rb", buffering=0) as stream:
        while True:
            ready, _, _ = select.select([stream], [], [], seconds)
            if not ready:
                os.kill(child, signal.SIGKILL)
                return None
            part = stream.read(1 << 20)
            if not part:
                return b"".join(parts)
            parts.append(part)
