"""The command ``towval``, and ``python -m towval``."""

import importlib
import os
import signal


def main() -> None:
    """Run the command line of :mod:`towval.cli`; Ctrl-C ends it without a traceback, also while it is imported."""
    # Our matrices are small: more threads of BLAS only wait for each other, for a fifth of some stages' CPU time. It
    # reads the variable when NumPy is imported; the workflow sets it for its jobs.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    command_line = importlib.import_module("towval.cli")
    signal.signal(signal.SIGINT, before)
    try:
        command_line.main()
    except KeyboardInterrupt:  # before or after a stage, which reports its own
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
