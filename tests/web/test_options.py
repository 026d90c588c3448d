"""--web and --web-token: mistakes are one line and exit code 2, and nothing has begun."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from canid.ui.cli import main
from canid.ui.web import address

LOG = str(Path(__file__).parents[2] / "replay_logs/following_urban.blf")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--web", "0.0.0.0:8090"], "needs a token"),
        (["--web", "192.0.2.1", "--web-token", "a" * 15], "at least 16 characters"),
        (["--web", "--web-token", "a token with a blank"], "at least 16 characters"),
        (["--web", "127.0.0.1:99999"], "is not HOST:PORT"),
        (["--web", "192.0.2.1:8090", "--web-token", "a" * 16], "cannot listen on 192.0.2.1:8090"),
        (["--web-token", "a" * 16], "--web-token needs --web"),
        (["--web", LOG], "put it before --web"),
        (["--web", "--onto"], "leave out --web"),
    ],
)
def test_mistakes(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CANID_WEB_TOKEN", raising=False)
    assert main(["replay", LOG, "--vehicle", "generic", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert says in err


def test_without_the_extra(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """What is missing is named with the command that installs it."""
    monkeypatch.setattr("canid.ui.cli.options.web_options.PACKAGES", ("starlette", "no_such_package_here"))
    assert main(["record", "-i", "virtual", "-c", "none", "--web"]) == 2
    assert "needs no_such_package_here: pip install 'canid[web]'" in capsys.readouterr().err


def test_a_port_that_is_taken() -> None:
    """The next free one is used."""
    first, where = address.listening(address.parse(""))
    second, other = address.listening(where)
    with first, second:
        assert other.port > where.port
        with socket.create_connection((other.host, other.port)):
            pass
