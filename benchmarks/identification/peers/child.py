"""The other end of `peer.call`: answers requests on stdin until it closes."""

from __future__ import annotations

import contextlib
import importlib
import pickle
import sys
from typing import Any


def main() -> None:
    requests, answers = sys.stdin.buffer, sys.stdout.buffer
    # a peer that prints would otherwise print into the answers
    sys.stdout = sys.stderr
    with contextlib.suppress(EOFError):
        while True:
            module, name, args = pickle.load(requests)
            answer: Any
            try:
                answer = getattr(importlib.import_module(module), name)(*args)
            except Exception as error:
                answer = RuntimeError(f"{type(error).__name__}: {error}")
            pickle.dump(answer, answers)
            answers.flush()


if __name__ == "__main__":
    main()
