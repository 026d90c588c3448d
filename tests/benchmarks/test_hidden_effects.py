"""The table says of its outcomes what is true of them, a cut run goes on where it was, and peers are asked fairly."""

from __future__ import annotations

import doctest
import importlib
import importlib.util
import json
import math
import pkgutil
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

import benchmarks.hidden_effects as folder
from benchmarks.hidden_effects import __main__ as command
from benchmarks.hidden_effects import ablation, drives, hiding, outcomes, shares, table
from benchmarks.hidden_effects.drives import CLEAN, FAINT, FOREIGN, ONE, REMOVED, TWO, Drive, drive
from benchmarks.hidden_effects.expected import Price
from benchmarks.hidden_effects.hiding import FAINT_LR, hide
from benchmarks.hidden_effects.outcomes import Comparison, Outcome
from benchmarks.hidden_effects.peers import frols, naive, stlsq
from benchmarks.hidden_effects.peers.answer import ADEQUATE, BROKE, NAMED, UNEXPLAINED, Answer
from benchmarks.hidden_effects.peers.library import fitted, library
from benchmarks.hidden_effects.peers.methods import PEERS, ask_naive, ask_stlsq
from canid.models.effects import CATALOGUE
from canid.values.types import Channel, Identifiable, Interval
from tests.plants.measurement import trace
from tests.plants.plant_one import plant
from tests.plants.planted_drive import NOISES, OUTSIDE

MODULES = sorted(m.name for m in pkgutil.walk_packages(folder.__path__, "benchmarks.hidden_effects."))
NAN = math.nan
# their docstrings' example is a drive: the tests below plant their own
SLOW = {"benchmarks.hidden_effects.outcomes"}


# --- made-up outcomes ---------------------------------------------------------------------------------


def made(
    kind: str,
    says: str = ADEQUATE,
    *sets: tuple[str, ...],
    effects: dict[str, tuple[float, float]] | None = None,
    simulator: str = "one",
    noise: str = "white",
    minutes: float = 10.0,
    seconds: float = 1.0,
    parameters: tuple[Comparison, ...] = (),
    driver: tuple[Comparison, ...] = (),
    gain: Interval = Interval(),  # noqa: B008 - a NamedTuple
    peer: Answer | None = None,
) -> Outcome:
    hidden = effects or {}
    answers = {"canid": Answer(sets, says, seconds)} | ({"peer": peer} if peer else {})
    return Outcome(
        Drive(made.seed, kind, simulator, noise, "mixed", minutes, tuple(hidden)),  # type: ignore[attr-defined]
        {name: {"share": 0.5} for name in hidden},
        {name: Price(*price) for name, price in hidden.items()},
        answers,
        parameters,
        driver,
        gain,
        "state",
    )


made.seed = 0  # type: ignore[attr-defined]


def cell(name: str, of: list[Outcome], method: str = "canid", nth: int = 0) -> str:
    """The cell of the nth row of that name."""
    return [row for row in table.ROWS if row.name == name][nth].cell(of, method)


A = ("asymmetric_gain",)
STRONG = {"asymmetric_gain": (80.0, 0.3)}


# --- claims: figures ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("k", "n"), [(0, 7), (1, 20), (13, 40), (39, 40), (200, 200)])
def test_bounds_are_those_beyond_which_the_count_is_a_rare_chance(k: int, n: int) -> None:
    """Clopper and Pearson by their definition: each tail of the binomial holds 2.5 %, the one-sided bound's 5 %."""
    low, high = shares.bounds(k, n)
    if k:
        assert binom.sf(k - 1, n, low) == pytest.approx(0.025)
    else:
        assert low == 0.0
    if k < n:
        assert binom.cdf(k, n, high) == pytest.approx(0.025)
        assert binom.cdf(k, n, shares.upper(k, n)) == pytest.approx(0.05)
    else:
        assert high == shares.upper(k, n) == 1.0


def test_false_names_are_counted_on_clean_logs_by_noise() -> None:
    of = [made(CLEAN) for _ in range(7)]
    of += [made(CLEAN, NAMED, A, noise="state"), made(CLEAN, UNEXPLAINED, noise="state")]
    of += [made(ONE, NAMED, ("backlash",), effects=STRONG)]
    assert cell("false names on clean logs", of).startswith("11.1 % (1/9), ≤ 42.9 %")
    assert cell("· state", of).startswith("50.0 % (1/2)")
    assert cell("· white", of).startswith("0.0 % (0/7)")
    assert cell("· mix", of) == "–"
    assert cell("“unexplained” on clean logs", of).startswith("11.1 % (1/9)")


def test_a_name_is_right_where_the_truth_is_it_or_its_rival() -> None:
    of = [
        made(ONE, NAMED, A, effects=STRONG),
        made(ONE, NAMED, ("pedal_map", "asymmetric_gain"), effects=STRONG),
        made(FAINT, NAMED, ("backlash",), A, effects=STRONG),
        made(ONE, NAMED, ("backlash",), effects=STRONG),
        made(ONE, UNEXPLAINED, effects=STRONG),
        # too weak, not in the catalogue, or without a price: not counted
        made(ONE, NAMED, ("backlash",), effects={"asymmetric_gain": (49.0, 0.3)}),
        made(REMOVED, NAMED, ("backlash",), effects=STRONG),
        made(ONE, effects={"asymmetric_gain": (NAN, NAN)}),
    ]
    assert "(3/5)" in cell("right name or among its rivals, LR ≥ 50", of)
    assert "(2/5)" in cell("· one finding, and no other", of)
    assert "(1/5)" in cell("· first name is the truth", of)
    assert cell("· attention_gap", of) == "–"
    assert "(0/1)" in cell("· attention_gap", [made(ONE, effects={"attention_gap": (70.0, 0.1)})])
    # those of LR 30 and more that were named: the five's four, and the one of LR 49
    assert "(3/5)" in cell("truth in cause + rivals, where named, LR ≥ 30", of)
    assert cell("· mean size of cause + rivals", of) == "1.17 (6)"
    assert cell("· mean number of findings", of) == "1.20 (5)"


def test_the_edge_is_from_30_to_50() -> None:
    of = [
        made(FAINT, NAMED, A, effects={"asymmetric_gain": (30.0, 0.02)}),
        made(FAINT, UNEXPLAINED, effects={"asymmetric_gain": (49.9, 0.02)}),
        made(FAINT, ADEQUATE, effects={"asymmetric_gain": (40.0, 0.02)}),
        made(FAINT, ADEQUATE, effects={"asymmetric_gain": (29.9, 0.02)}),
        made(FAINT, ADEQUATE, effects={"asymmetric_gain": (50.0, 0.02)}),
    ]
    assert "(2/3)" in cell("LR 30–50: detected (named or unexplained)", of)
    assert "(1/3)" in cell("LR 30–50: right", of)


def test_what_no_catalogue_holds_must_be_declined() -> None:
    of = [
        made(FOREIGN, UNEXPLAINED, effects={"pedal_steps": (300.0, 0.2)}),
        made(FOREIGN, NAMED, A, effects={"pedal_steps": (300.0, 0.1)}),
        made(FOREIGN, ADEQUATE, effects={"pedal_steps": (300.0, 0.09)}),
        made(REMOVED, UNEXPLAINED, effects=STRONG),
        made(REMOVED, ADEQUATE, effects=STRONG),
    ]
    assert "(2/4)" in cell("outside the catalogue, share ≥ 10 %: unexplained or surrogate", of)
    assert "(1/2)" in cell("· in nobody's catalogue", of)
    assert "(1/2)" in cell("· taken out of the catalogue", of)
    assert "(1/4)" in cell("· a wrong name instead", of)


def test_two_effects_need_two_findings_of_their_own() -> None:
    both = {"asymmetric_gain": (80.0, 0.2), "gain_drift": (60.0, 0.1)}
    of = [
        made(TWO, NAMED, ("gain_drift",), A, effects=both),
        made(TWO, NAMED, ("gain_change", "gain_drift"), A, effects=both),
        made(TWO, NAMED, ("asymmetric_gain", "gain_drift"), effects=both),
        made(TWO, NAMED, ("asymmetric_gain", "gain_drift"), ("backlash",), effects=both),
        made(TWO, NAMED, A, ("gain_drift",), ("backlash",), effects=both),
        made(TWO, UNEXPLAINED, effects=both),
        made(TWO, ADEQUATE, effects={"asymmetric_gain": (80.0, 0.2), "gain_drift": (59.0, 0.1)}),
    ]
    assert "(2/6)" in cell("two effects, both LR ≥ 60: exactly both", of)
    assert "(3/6)" in cell("· both, and perhaps others", of)
    assert "(5/6)" in cell("· at least one", of)


def test_parameters_and_the_drivers_numbers_are_held_against_the_truth() -> None:
    def comparisons(*values: tuple[float, float, float, float]) -> tuple[Comparison, ...]:
        names = ("K2", "tau2", "dead_time2")
        return tuple(Comparison("", name, *v) for name, v in zip(names, values, strict=False))

    hit, miss = (5.0, 5.5, 4.0, 6.0), (0.4, 0.6, 0.5, 0.7)
    wide = Comparison("asymmetric_gain", "share", -0.5, -0.6, -0.7, -0.4)
    narrow = Comparison("asymmetric_gain", "share", 0.5, 0.4, 0.39, 0.41)
    of = [
        made(ONE, NAMED, A, effects=STRONG, parameters=(wide, narrow), driver=comparisons(hit, miss, hit)),
        made(ONE, NAMED, A, effects=STRONG, driver=comparisons(hit, hit, hit)),
        # an extra finding, a rival, and a clean drive: the extended model is not the planted one
        made(ONE, NAMED, A, ("backlash",), effects=STRONG, driver=comparisons(miss, miss, miss)),
        made(ONE, NAMED, ("pedal_map", *A), effects=STRONG, driver=comparisons(miss, miss, miss)),
        made(CLEAN, driver=comparisons(miss, hit, hit)),
        # no name, or a log that was not enough
        made(ONE, UNEXPLAINED, effects=STRONG, parameters=(narrow,), driver=comparisons(miss, miss, miss)),
        made(CLEAN, "not_enough_data"),
    ]
    assert cell("parameters: median of estimate / truth", of) == "1.00 (2)"
    assert "(1/2)" in cell("parameters: interval holds the truth", of)
    assert "(2/2)" in cell("K2 in its interval after the extension", of)
    assert "(1/2)" in cell("tau2", of)
    assert "(2/2)" in cell("theta2", of)
    assert "(1/2)" in cell("· all three at once", of)
    assert cell("· K2, median of estimate / truth", of) == "1.10 (2)"
    assert "(0/1)" in cell("· K2 on clean logs", of)
    assert "(1/1)" in cell("· tau2 on clean logs", of)
    assert table.by_parameter(of)[2:] == [
        "| asymmetric_gain.share | 1.00 (2) | 50.0 % [1, 99] (1/2) |",
    ]


def test_a_gain_must_show_where_the_effect_is_large_and_not_on_clean_logs() -> None:
    good, bad, none = Interval(0.3, 0.1, 0.4), Interval(0.3, -0.1, 0.4), Interval()
    large, small = {"asymmetric_gain": (80.0, 0.2)}, {"asymmetric_gain": (80.0, 0.19)}
    of = [
        made(ONE, NAMED, A, effects=large, gain=good),
        made(ONE, NAMED, A, effects=large, gain=bad),
        made(ONE, effects=large, gain=none),
        made(ONE, NAMED, A, effects=small, gain=bad),
        made(CLEAN, gain=none),
        made(CLEAN, NAMED, A, gain=bad),
        made(CLEAN, NAMED, A, gain=good),
        made(CLEAN, NAMED, A, gain=Interval(-0.3, -0.4, -0.1)),
    ]
    assert "(1/3)" in cell("gain's interval above 0, share ≥ 20 %", of)
    assert "(1/2)" in cell("· where the right cause is named", of)
    assert "(2/4)" in cell("gain's interval holds 0 on clean logs, or none is claimed", of)


def test_times_are_told_per_ten_minutes() -> None:
    of = [made(CLEAN, seconds=s) for s in (1.0, 2.0, 3.0)] + [made(CLEAN, seconds=12.0, minutes=60.0)]
    of += [made(CLEAN, seconds=4.0, minutes=20.0)]
    assert cell("CPU time of 10 min logs: median / p95 / worst", of) == "2.0 / 2.9 / 3.0 s (3)"
    assert cell("· of all, per 10 min", of) == "2.0 / 2.8 / 3.0 s (5)"


def test_the_table_has_a_column_for_each_simulator_and_each_peer() -> None:
    eager, dead = Answer((A,), NAMED, 0.5), Answer((), BROKE, 0.0, "no")
    of = [made(CLEAN, peer=eager), made(CLEAN, NAMED, A, simulator="two", peer=dead)]
    text = table.lines(of, ["peer"])
    width = {line.count("|") for line in text[: 2 + len(table.ROWS)]}
    assert width == {8 - 1}
    false = next(line for line in text if line.startswith("| false names"))
    cells = [part.split(",")[0].strip() for part in false.split("|")[3:-1]]
    assert cells == ["50.0 % (1/2)", "0.0 % (0/1)", "100.0 % (1/1)", "50.0 % (1/2)"]
    unexplained = next(line for line in text if line.startswith("| “unexplained” on clean"))
    assert unexplained.endswith("| – |")
    assert "50.0 % (1/2)" in next(line for line in text if line.startswith("| broke")).split("|")[-2]
    assert text[-1] == "2 drives: 2 clean, 0 one, 0 faint, 0 two, 0 removed, 0 foreign. canid state."
    mixed = table.lines([of[0], of[1]._replace(code="other")])
    assert "nobody's" in mixed[-1]


def test_the_confusion_says_what_was_said_of_what() -> None:
    of = [
        made(CLEAN),
        made(CLEAN, NAMED, ("delay_drift", "clock_skew")),
        made(ONE, NAMED, A, effects=STRONG),
        made(ONE, NAMED, ("pedal_map", *A), effects=STRONG),
        made(ONE, effects={"asymmetric_gain": (10.0, 0.3)}),
        made(REMOVED, UNEXPLAINED, effects=STRONG),
    ]
    assert table.confusion(of)[2:] == [
        "| clean | 2 | adequate 1, delay_drift 1 |",
        "| asymmetric_gain | 2 | asymmetric_gain 1, pedal_map (rival) 1 |",
        "| asymmetric_gain (removed) | 1 | unexplained 1 |",
    ]
    listed = table.wrong(of)
    assert len(listed) == 1
    assert "clean" in listed[0]
    assert "delay_drift/clock_skew" in listed[0]


# --- claims: drives -----------------------------------------------------------------------------------


def test_a_drive_depends_on_its_seed_alone_and_all_come_equally_often() -> None:
    many = drives.drives(640, 90_000)
    assert drives.drives(40, 90_300) == many[300:340]
    assert Counter(d.kind for d in many) == {
        CLEAN: 256,
        ONE: 160,
        FAINT: 64,
        TWO: 64,
        REMOVED: 32,
        FOREIGN: 64,
    }
    for kind in (CLEAN, ONE, FAINT, TWO, REMOVED, FOREIGN):
        these = [d for d in many if d.kind == kind]
        assert sum(d.simulator == "one" for d in these) * 2 == len(these)
        for field, values in (("noise", NOISES), ("minutes", set(drives.MINUTES))):
            assert {getattr(d, field) for d in these} == set(values)
    for simulator in ("one", "two"):
        # a window over laps in which each comes once cuts two of them
        effects = Counter(d.effects[0] for d in many if d.kind == ONE and d.simulator == simulator)
        assert set(effects) == set(drives.IDS)
        assert max(effects.values()) - min(effects.values()) <= 2
        clean = Counter(d.noise for d in many if d.kind == CLEAN and d.simulator == simulator)
        assert max(clean.values()) - min(clean.values()) <= 2
    assert all(len(set(d.effects)) == 2 for d in many if d.kind == TWO)
    assert {d.effects[0] for d in many if d.kind == FOREIGN} == set(OUTSIDE)


def test_a_faint_effect_is_planted_near_the_edge_and_a_pair_above_its_own() -> None:
    faint = hide(Drive(11, FAINT, "one", "ar1", "mixed", 4.0, ("looming_gain",)))
    assert FAINT_LR[0] <= faint.prices["looming_gain"].lr <= FAINT_LR[1]
    pair = hide(Drive(12, TWO, "two", "white", "urban", 4.0, ("asymmetric_gain", "periodic_task")))
    assert len(pair.prices) == 2
    assert min(p.lr for p in pair.prices.values()) >= 60.0
    foreign = hide(Drive(13, FOREIGN, "two", "white", "mixed", 4.0, ("felt_acceleration",)))
    assert list(foreign.prices) == ["felt_acceleration"]


# --- claims: outcomes ---------------------------------------------------------------------------------


def test_an_outcome_comes_back_from_its_line() -> None:
    of = made(
        ONE, NAMED, ("a", "b"), ("c",), effects={"a": (NAN, 0.1)}, gain=Interval(0.1, 0.0, 0.2),
        parameters=(Comparison("a", "width", 1.0, 1.1, 0.9, 1.3),), driver=(Comparison("", "K2", 5.0, 5.0, 4.0, 6.0),),
        peer=Answer((), BROKE, 0.1, "TypeError: no"),
    )  # fmt: skip
    back = outcomes.parsed(outcomes.line(of))
    # NaN is not itself
    assert json.dumps(back) == json.dumps(of)
    assert back.drive == of.drive
    assert isinstance(back.answers["canid"], Answer)
    with pytest.raises(ValueError, match="not an outcome"):
        outcomes.parsed("{}")


def test_what_is_in_the_file_is_not_run_again_and_what_broke_is(tmp_path: Path) -> None:
    a, b, c, d = (drive(seed) for seed in range(4))
    said, broken = Answer((), ADEQUATE, 1.0), Answer((), BROKE, 1.0, "why")
    wanted = [a, b, c, d]

    def came(of: Drive, **answers: Answer) -> str:
        return outcomes.line(made(CLEAN)._replace(drive=of, answers=answers))

    path = tmp_path / "out.jsonl"
    half = came(c, canid=said)[:50]
    path.write_text("\n".join([came(a, canid=said), came(b, canid=broken), half]))
    command.appended(path, came(d, canid=said, peer=said))
    kept = list(outcomes.stored(path))
    assert [o.drive for o in kept] == [a, b, d]
    assert set(outcomes.fresh(kept, wanted, {"canid"})) == {a, d}
    assert set(outcomes.fresh(kept, wanted, {"canid", "peer"})) == {d}
    assert set(outcomes.fresh(kept, [a], {"canid"})) == {a}
    assert list(outcomes.stored(tmp_path / "none")) == []


def test_an_adequacy_test_is_worth_the_answers_that_it_alone_keeps_back() -> None:
    tests = ("line", "one side", "unsteady")

    def failing(kind: str, failed: tuple[str, ...], **more: Any) -> Outcome:
        suspected = more.pop("suspected", ())
        o = made(kind, UNEXPLAINED, **more)
        return o._replace(tests=tests, failed=failed, suspected=suspected)

    effects = {"gain_change": (80.0, 0.5)}
    one_alone = failing(CLEAN, ("unsteady",))
    two_together = failing(CLEAN, ("unsteady", "line"))
    withheld = failing(ONE, ("unsteady",), effects=effects, suspected=(("gain_change",),))
    foreign = failing(FOREIGN, ("unsteady",), effects={"nobody": (80.0, 0.5)}, suspected=(("backlash",),))
    worse = failing(FOREIGN, ("unsteady",), effects={"nobody": (80.0, 0.5)}, suspected=(("backlash",),))
    worse = worse._replace(gain=Interval(-0.1, -0.2, -0.05))
    drives_ = [made(CLEAN)._replace(tests=tests), one_alone, two_together, withheld, foreign, worse]
    c = ablation.changed(drives_, frozenset(["unsteady"]))
    assert (c.fails, c.alone, c.better, c.worse) == (5, 3, 2, 1)
    assert ablation.changed(drives_, frozenset(["one side"])) == ablation.Changed(0, 0, 0, 0, ())
    assert ablation.changed(drives_, frozenset(["line", "unsteady"])).alone == 4
    assert any(line.startswith("| unsteady | 5 | 3 | 2 | 1 |") for line in ablation.lines(drives_))


def test_only_numbers_that_truth_and_finding_share_are_compared() -> None:
    interval = Interval(1.0, 0.9, 1.1)
    finding = SimpleNamespace(
        effect="gain_change", parameters={"share": interval, "time": interval, "phase": interval}
    )
    other = SimpleNamespace(effect="backlash", parameters={"width": interval})
    report: Any = SimpleNamespace(findings=(finding, other))
    found = outcomes.parameters(report, {"gain_change": {"share": 0.3, "time": 100.0, "soft": 1.0}})
    assert [(b.effect, b.name, b.truth) for b in found] == [
        ("gain_change", "share", 0.3),
        ("gain_change", "time", 100.0),
    ]


def test_the_dead_time_of_a_drifting_one_is_that_of_the_middle() -> None:
    channel = Channel(status=Identifiable.OK)
    report: Any = SimpleNamespace(extended=SimpleNamespace(channels={"range_rate": channel}))
    effects = {"delay_drift": {"rate": 0.4}}
    truths = {}
    for simulator, make in drives.SIMULATORS.items():
        planted = make(effects, seed=1, minutes=1, noise="white", profile="mixed")
        # one's dead time grows from its value at first, two's passes through it in the middle
        cells = {b.name: b.truth for b in outcomes.driver(report, planted)}
        truths[simulator] = cells["dead_time2"] - planted.truth["driver"]["dead_time2"]
    assert truths == pytest.approx({"one": 0.2, "two": 0.0})


def test_a_short_run_ends_in_a_table_and_goes_on_from_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four drives of 3 min: two clean, one with one effect, one with two; then the same again, and none is run."""
    monkeypatch.setattr(drives, "MINUTES", (3.0,))
    monkeypatch.setattr(hiding, "ATTEMPTS", 1)
    path = tmp_path / "out.jsonl"
    args = ["--first-seed", "420", "--workers", "1", "--out", str(path)]
    assert command.main(["--logs", "3", *args]) == 0
    assert command.main(["--logs", "4", *args, "--confusion", "--parameters", "--wrong"]) == 0
    first = capsys.readouterr()
    assert "3 drives are in" in first.err
    assert "1 of 1 drives" in first.err
    kept = list(outcomes.stored(path))
    assert [o.drive for o in kept] == drives.drives(4, 420)
    assert [len(o.truth) for o in kept] == [0, 1, 0, 2]
    assert all(o.answers["canid"].says != BROKE and o.answers["canid"].seconds > 0 for o in kept)
    assert "4 drives: 2 clean, 1 one, 0 faint, 1 two" in first.out

    def run(*_: object, **__: object) -> None:
        raise AssertionError("nothing is left to run")

    monkeypatch.setattr(command, "run", run)
    command.main(["--logs", "4", *args])
    again = capsys.readouterr()
    assert again.out.splitlines()[:20] == first.out[first.out.rindex("| figure |") :].splitlines()[:20]


def test_what_is_taken_out_of_the_catalogue_cannot_be_named_by_anyone() -> None:
    hidden = Drive(21, REMOVED, "one", "white", "mixed", 4.0, ("asymmetric_gain",))
    asked = []

    def peer(measured: object, catalogue: Any) -> Answer:
        asked.append({effect.id for effect in catalogue})
        return Answer((), ADEQUATE, 0.0)

    o = outcomes.run(hidden, {"peer": peer})
    assert asked == [{e.id for e in CATALOGUE} - {"asymmetric_gain"}]
    assert not any("asymmetric_gain" in one for one in o.answers["canid"].sets)


def test_a_diagnosis_that_breaks_is_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("so it is")

    monkeypatch.setattr(outcomes, "diagnose", broken)
    o = outcomes.run(Drive(22, CLEAN, "one", "white", "mixed", 1.5, ()))
    assert o.answers["canid"].says == BROKE
    assert o.answers["canid"].why == "RuntimeError: so it is"
    assert "RuntimeError" in table.wrong([o])[0]


# --- claims: peers ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bent_drive() -> Any:
    """White noise and a strong effect: what peers are made for."""
    planted = plant(
        {"asymmetric_gain": {"share": 0.6}}, seed=31, minutes=5, noise="white", profile="mixed", noise_sd=1.0
    )
    return trace(planted)


def test_the_library_holds_the_planted_cause_as_its_best_column(bent_drive: Any) -> None:
    at = fitted(bent_drive)
    assert at is not None
    lib = library(at, CATALOGUE)
    assert set(lib.names) <= set(drives.IDS)
    assert lib.X.shape == (len(lib.y), len(lib.names))
    np.testing.assert_allclose(np.std(lib.X, axis=0), 1.0, rtol=1e-6)
    fit = np.abs(lib.X.T @ lib.y) / len(lib.y)
    assert lib.names[int(np.argmax(fit))] == "asymmetric_gain"
    assert "asymmetric_gain" not in library(at, [e for e in CATALOGUE if e.id != "asymmetric_gain"]).names


def test_every_peer_names_it_first(bent_drive: Any) -> None:
    assert ask_naive(bent_drive, CATALOGUE).sets[0] == ("asymmetric_gain",)
    if importlib.util.find_spec("pysindy"):
        assert ask_stlsq(bent_drive, CATALOGUE).sets[0] == ("asymmetric_gain",)


def test_a_log_without_enough_data_has_no_name_from_a_peer() -> None:
    short = trace(plant({}, seed=32, minutes=1, noise="white", profile="mixed"))
    for method in PEERS.values():
        answer = method.ask(short, CATALOGUE)
        assert answer.sets == ()
        assert answer.says == ADEQUATE


def columns() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(33)
    X = rng.standard_normal((2000, 5))
    return X, 0.8 * X[:, 3] - 0.4 * X[:, 1] + 0.1 * rng.standard_normal(2000)


def test_stlsq_keeps_the_columns_that_matter() -> None:
    pytest.importorskip("pysindy")
    X, y = columns()
    kept = dict(stlsq.select(X, y, 0.1, 0.05))
    assert kept == pytest.approx({3: 0.8, 1: 0.4}, abs=0.02)
    assert stlsq.select(X, y, 5.0, 0.05) == []
    assert stlsq.select(X[:, :0], y, 0.1, 0.05) == []


@pytest.mark.parametrize("criterion", ["", "bic"])
def test_frols_keeps_the_columns_that_matter(criterion: str) -> None:
    pytest.importorskip("sysidentpy")
    X, y = columns()
    kept = frols.select(X, y, 0.05, criterion, 4)
    assert [k for k, _ in kept] == [3, 1]
    assert dict(kept) == pytest.approx({3: 0.8, 1: 0.2}, abs=0.03)
    assert frols.select(X[:, :1], y, 0.05, criterion, 4) == []


def test_the_naive_way_stops_where_a_cause_is_not_worth_its_parameters(bent_drive: Any) -> None:
    at = fitted(bent_drive)
    assert at is not None
    steps = naive.select(at, CATALOGUE, 2)
    assert steps[0][0] == "asymmetric_gain"
    assert all(gain > 0 for _, gain in steps)
    assert len({name for name, _ in steps}) == len(steps)


@pytest.mark.parametrize("name", [m for m in MODULES if m not in SLOW and not m.endswith("__main__")])
def test_examples_are_true(name: str) -> None:
    module = importlib.import_module(name)
    assert doctest.testmod(module).failed == 0
