"""`canid export --to control|idtf|latex|fmu`: the driver's model as other programs take it."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path
from typing import Any

import control
import fmpy
import numpy as np
import pytest
from scipy.io import loadmat

import canid
from canid.ui.cli import main

LOG = Path(__file__).parents[2] / "replay_logs" / "following_mixed.blf"


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    capsys.readouterr()
    code = main([str(word) for word in words])
    return (code, *capsys.readouterr())


def module(path: Path) -> Any:
    """The file as Python runs it."""
    spec = importlib.util.spec_from_file_location("driver", path)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@pytest.mark.slow("identifies a drive four times")
def test_other_programs_answer_a_step_as_canid_does(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    # names that could end a comment or a string, or stand for no number
    log = tmp_path / 'a nan"""\\.blf'
    shutil.copy(LOG, log)
    found = canid.identify(canid.read_trace(log, "generic"), select_orders=False, sliding=False)
    words = ("export", log, "--vehicle", "generic", "-o", tmp_path / "d", "--to")
    for format in ("control", "idtf", "latex"):
        assert run(capsys, *words, format)[0] == 0
    driver, mat = module(tmp_path / "d.driver.py"), loadmat(tmp_path / "d.driver.mat", simplify_cells=True)
    table = (tmp_path / "d.driver.tex").read_text(encoding="utf-8")
    assert "nan" not in table.partition("\n")[2]
    for method, inputs in found.responses.methods.items():
        for name, of in inputs.items():
            system = getattr(driver, method)(name)
            if method == "armax":
                answer = control.step_response(system, of.time).outputs
                assert answer == pytest.approx(of.step.value, rel=1e-6, abs=1e-9)
            else:
                w = 2.0 * np.pi * of.frequency[of.frequency < 0.5]
                size = np.abs(control.frequency_response(system, w).complex)
                assert size == pytest.approx(of.magnitude.value[: len(w)], rel=1e-6)
            one, stated = mat[method][name], found.whole[method].channels[name].K
            num, den = np.atleast_1d(one["num"]), np.atleast_1d(one["den"])
            assert num.sum() / (den.sum() if one["Ts"] else den[-1]) == pytest.approx(stated.value, rel=1e-9)
            assert (one["K"]["low"], one["K"]["high"]) == (stated.low, stated.high)
            assert bool(one["tau"]["quotable"]) == ("tau" in canid_quotable(found, method, name))
    assert table.count(r"\\") > 6


@pytest.mark.slow("identifies a drive")
def test_a_simulator_steps_the_fmu_as_the_model_answers(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, seed: int
) -> None:
    """fmpy runs it with drawn inputs, steps and parameters; each change of an input is answered by
    K (1 - exp(-(t - θ) / τ)) from then on."""
    found = canid.identify(canid.read_trace(LOG, "generic"), select_orders=False, sliding=False)
    file = tmp_path / "d.driver.fmu"
    assert run(capsys, "export", LOG, "--vehicle", "generic", "--to", "fmu", "-o", file)[0] == 0
    assert fmpy.read_model_description(str(file), validate=True).fmiVersion == "3.0"
    rng = np.random.default_rng(seed)
    channels, whole = ("headway_error", "range_rate"), found.whole["fopdt"].channels
    for tuned in (False, True):
        stated = {
            name: [getattr(whole[name], field).value for field in ("K", "tau", "dead_time")]
            for name in channels
        }
        starts: dict[str, float] = {}
        if tuned:
            stated["range_rate"] = [rng.uniform(-9.0, 9.0), rng.uniform(0.05, 3.0), rng.uniform(0.0, 2.0)]
            starts = {"level": rng.uniform(0.0, 40.0)}
            for field, value in zip(("K", "tau", "dead_time"), stated["range_rate"], strict=True):
                starts[f"range_rate_model.{field}"] = value
        dt, n = rng.uniform(0.02, 0.3), 120
        t = dt * np.arange(n)
        held = {name: np.repeat(rng.standard_normal(n // 4), 4) for name in channels}
        signals = np.zeros(n, dtype=[("t", float), *((name, float) for name in channels)])
        signals["t"] = t
        for name in channels:
            signals[name] = held[name]
        got = fmpy.simulate_fmu(
            str(file), stop_time=float(t[-1]), step_size=dt, output_interval=dt, input=signals, output=["pedal"],
            start_values=starts,
        )  # fmt: skip
        want = np.full(len(got), starts.get("level", 0.0))
        for name in channels:
            K, tau, dead_time = stated[name]
            for at, change in zip(t, np.diff(held[name], prepend=0.0), strict=True):
                since = got["time"] - at - dead_time
                want += np.where(since > 0.0, K * change * -np.expm1(-np.maximum(since, 0.0) / tau), 0.0)
        assert got["pedal"][1:] == pytest.approx(want[1:], abs=1e-6)
    # replaced by its kind alone
    words = ("export", LOG, "--vehicle", "generic", "--to", "fmu", "-o", file)
    assert run(capsys, *words)[0] == 5
    assert run(capsys, *words, "--force")[0] == 0
    file.write_bytes(b"PK\x03\x04 of another program")
    assert run(capsys, *words, "--force")[0] == 5


def canid_quotable(found: Any, method: str, name: str) -> tuple[str, ...]:
    from canid.mathematics.identification.identifiability import QUOTABLE

    return QUOTABLE[found.whole[method].channels[name].status]


@pytest.mark.slow("identifies a drive")
def test_only_a_file_of_its_kind_is_replaced(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    own = tmp_path / "x.py"
    own.write_text("print('mine')\n", encoding="utf-8")
    words = ("export", LOG, "--vehicle", "generic", "--to", "control", "-o")
    code, _, err = run(capsys, *words, own, "--force")
    assert (code, err.count("\n")) == (5, 1)
    assert own.read_text(encoding="utf-8") == "print('mine')\n"
    code, out, _ = run(capsys, *words, tmp_path / "y.py", "--json", "-")
    assert code == 0
    assert json.loads(out)[0]["path"] == str(tmp_path / "y.py")
    assert run(capsys, *words, tmp_path / "y.py")[0] == 5
    assert run(capsys, *words, tmp_path / "y.py", "--force")[0] == 0


@pytest.mark.parametrize(
    ("words", "says", "code"),
    [
        (("--vehicle", "generic", "--stop", "8"), "no gain is known", 1),
        (("--vehicle", "generic", "--signals"), "has no --signals", 2),
        (("--dbc", "x.dbc"), "needs --vehicle", 2),
    ],
)
def test_what_cannot_be_exported_is_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...], says: str, code: int
) -> None:
    found, _, err = run(capsys, "export", LOG, *words, "--to", "idtf", "-o", tmp_path / "x")
    assert (found, says in err) == (code, True)
    assert not list(tmp_path.iterdir())
