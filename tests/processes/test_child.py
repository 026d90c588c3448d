"""A child that hangs, dies, answers nonsense, prints or takes memory is its parent's `NoAnswerError`, and nothing else."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from canid.values.processes.child import EXIT_S, Child, EndedError, NoAnswerError
from canid.values.processes.memory_victim import OOM_SCORE
from tests.fixtures.ended import PATIENCE_S, gone

ANSWERS = """
import ctypes, os, signal, subprocess, sys, time
from canid.values.processes import limits
from canid.values.processes.memory_victim import OOM_SCORE
from canid.values.processes.serve import connect
parent = connect()
def started():
    # a process of the child's own, which holds its output open
    return subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], pass_fds=[parent.sink.fileno()]).pid
def memory():
    limits.limit_more_data(50_000_000)
    try:
        return len(bytearray(200_000_000))
    except MemoryError:
        return "no memory"
    finally:
        limits.limit_data(None)
def busy():
    limits.limit_cpu(0.2)
    while True:
        pass
for message in parent.messages():
    parent.answer(eval(message))
"""


@pytest.fixture
def child() -> Iterator[Child]:
    with Child([sys.executable, "-c", ANSWERS]) as made:
        yield made


def test_what_is_printed_gets_not_between_the_answers(child: Child) -> None:
    """By Python, by a process of its own, and by C."""
    assert child.ask("print('a' * 100_000, flush=True)") is None
    assert child.ask("os.system('echo b')") == 0
    assert child.ask("ctypes.CDLL(None).puts(b'c'), ctypes.CDLL(None).fflush(None)")[1] == 0
    assert child.ask("'answer'") == "answer"


def test_an_interruption_is_for_the_parent(child: Child) -> None:
    """SIGINT and SIGHUP to the child's group end nothing."""
    assert child.ask("os.getpgrp()") == child.pid
    for number in (signal.SIGINT, signal.SIGHUP):
        os.killpg(child.pid, number)
        assert child.ask("'lives'") == "lives"


def test_memory_has_a_limit_that_can_be_lifted(child: Child) -> None:
    """What is refused once is given afterwards; the system ends the child before its parent."""
    assert child.ask("memory()") == "no memory"
    assert child.ask("len(bytearray(200_000_000))") == 200_000_000
    assert Path(f"/proc/{child.pid}/oom_score_adj").read_text(encoding="ascii").strip() == str(OOM_SCORE)


def test_a_child_that_hangs_is_ended_with_what_it_started(child: Child) -> None:
    """After the limit, although another process holds its output open."""
    grandchild = child.ask("started()")
    with pytest.raises(NoAnswerError) as caught:
        child.ask("time.sleep(600)", 0.3)
    assert caught.value.late
    assert child.killed
    assert child.end() == -signal.SIGKILL
    assert gone(grandchild)
    with pytest.raises(NoAnswerError):
        child.ask("1")


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ("os._exit(7)", 7),
        ("os.kill(os.getpid(), 11)", -signal.SIGSEGV),
        ("busy()", -signal.SIGPROF),
        ("1 / 0", 1),
    ],
)
def test_a_child_that_dies_keeps_its_code(child: Child, message: str, code: int) -> None:
    """An exit, a crash, the limit of processor time, an exception."""
    with pytest.raises(EndedError) as caught:
        child.ask(message)
    assert not caught.value.late
    assert child.end(PATIENCE_S) == code
    assert child.peak_bytes > 1_000_000
    assert child.end(EXIT_S) == code


@pytest.mark.parametrize(
    "answer", [b"nonsense", b"\x80\x05cno_such_module\nname\n.", b"\x80\x05K", b"(lp0\n0"]
)
def test_an_answer_that_is_none(child: Child, answer: bytes) -> None:
    """Whatever pickle makes of it."""
    with pytest.raises(NoAnswerError):
        child.ask(f"parent.sink.write({answer!r}), parent.sink.flush(), os._exit(0)")


def test_it_can_be_ended_from_another_thread(child: Child) -> None:
    """In the middle of a question, which then has no answer."""
    caught: list[NoAnswerError] = []

    def ask() -> None:
        try:
            child.ask("time.sleep(600)")
        except NoAnswerError as error:
            caught.append(error)

    assert child.ask("1") == 1
    thread = threading.Thread(target=ask)
    thread.start()
    child.end()
    thread.join(PATIENCE_S)
    assert len(caught) == 1
    assert not caught[0].late


def test_a_child_ends_with_its_parent() -> None:
    """Its input has ended."""
    with Child([sys.executable, "-c", ANSWERS]) as child:
        assert child.ask("1") == 1
        child.stdin.close()
        assert child.wait(PATIENCE_S) == 0
