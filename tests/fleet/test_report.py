"""The page of a fleet: its numbers are those of the tables, it loads nothing, and it holds 500 drivers and hostile names."""

from __future__ import annotations

import argparse
import re
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.fleet.answers import data_quality
from canid.analysis.fleet.answers.labels import label
from canid.analysis.fleet.answers.pooled import on_its_scale
from canid.analysis.fleet.answers.sentences import sentences
from canid.analysis.fleet.answers.summary import current, summarise
from canid.analysis.fleet.storage.columns import POOLED, natural
from canid.analysis.fleet.storage.database import opened, rows
from canid.ui.cli import Parser
from canid.ui.cli.commands import fleet_report
from canid.ui.views.fleet_report.fleet_document import page, text
from canid.values.errors import ConfigError, OutputError
from canid.values.findings import Provenance
from canid.values.fleet_summary import (
    Answer,
    Cause,
    Counted,
    Counts,
    Driver,
    Excluded,
    FleetSummary,
    Kind,
    Next,
    Parameter,
    Population,
    Questions,
)
from canid.values.text.numbers import interval
from canid.values.types import Interval
from tests.fixtures.fleet_folder import Planted, made, write

HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)> \u202e {{ 7 * 7 }} </style>"
VOID = {"meta", "link", "br", "circle", "line", "rect", "path", "polyline", "polygon", "img"}


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Planted:
    """Ten drivers, of whom one changes, and one has a hostile name, as have his car and logs."""
    folder = tmp_path_factory.mktemp("fleet") / "fleet"
    of = made(folder, seed=7, drivers=10, drives=5, change={"driver 003": 1.5})
    for row in of.rows:
        row["car"] = "car A"
        if row["driver"] == "driver 009":
            row |= {"driver": HOSTILE, "car": HOSTILE, "log": HOSTILE + row["log"], "vehicle": HOSTILE}
            row |= {"signal_findings": [HOSTILE]}
    of.rows[-1] |= {"log": HOSTILE, "reason": HOSTILE, "failure": HOSTILE}
    write(folder, of.rows)
    return of._replace(
        drivers={HOSTILE if name == "driver 009" else name: x for name, x in of.drivers.items()}
    )


@pytest.fixture(scope="module")
def summary(planted: Planted) -> FleetSummary:
    return summarise(planted.folder)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_planted_population_comes_back(planted: Planted, summary: FleetSummary) -> None:
    """Counts, and each driver's shrunken estimate, which is nearer to the truth than the driver's own on average."""
    assert summary.counts[:4] == (52, 50, 0, 2)
    assert summary.counts.drivers == 10
    (of,) = summary.populations
    assert of.kind == Kind("accel", "m/s²")
    inside, count, error = 0, 0, {"shrunken": 0.0, "own": 0.0}
    for driver in of.drivers:
        if driver.name == "driver 003":  # who changed
            assert next(t for q in of.questions for t in q.tests).subject == "driver 003"
            continue
        for k, name in enumerate(POOLED):
            truth = on_its_scale(name, Interval(*[planted.drivers[driver.name][k]] * 3)).value
            iv = driver.shrunken[name]
            inside += iv.low <= truth <= iv.high
            count += 1
            scale = abs(truth)
            error["shrunken"] += ((iv.value - truth) / scale) ** 2
            error["own"] += ((driver.own[name].value - truth) / scale) ** 2
    assert count == 72
    # of 72 correlated intervals of 95 % (effectively some 30): fewer than 84 % has a chance of 1 in 1,000
    assert inside >= 60
    assert error["shrunken"] < error["own"]
    for one in of.parameters:
        assert (one.drivers, one.drives) == (10, 50)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_tables_hold_what_the_summary_says(planted: Planted, summary: FleetSummary) -> None:
    (of,) = summary.populations
    with opened(planted.folder) as db:
        drivers = {row["driver"]: row for row in rows(db, "SELECT * FROM drivers")}
        population = {row["parameter"]: row for row in rows(db, "SELECT * FROM population")}
    assert set(drivers) == set(planted.drivers)
    for driver in of.drivers:
        for name, iv in driver.shrunken.items():
            column = natural(name)[0]
            assert drivers[driver.name][f"{column}_high"] == iv.high
            assert drivers[driver.name][f"{column}_own_low"] == driver.own[name].low
    assert len(population) == len(of.parameters)
    for one in of.parameters:
        row = population[natural(one.name)[0]]
        assert (row["mean"], row["between_low"], row["drivers"]) == (
            one.mean.value,
            one.between.low,
            one.drivers,
        )
        assert row["relative"] is one.log
    assert current(planted.folder)


def test_the_page_shows_its_numbers_and_loads_nothing(planted: Planted, summary: FleetSummary) -> None:
    """Every driver, every parameter with its interval; no script, no address but anchors of the page itself."""
    html = page(summary, Provenance(command="canid fleet report fleet"))
    seen = _read(html)
    text = " ".join(" ".join(seen.text).split())
    for driver in set(planted.drivers) - {HOSTILE}:
        assert driver in text
    (of,) = summary.populations
    for one in of.parameters:
        assert f"{label(one.name)} {interval(one.mean)} {one.unit}" in text
    for sentence in summary.sentences:
        assert sentence.split(";")[0][1:60] in text
    assert "0 bytes" in text
    assert "canid fleet report fleet" in text
    assert seen.addresses <= {"data:,"} | {f"#{name}" for name in seen.ids}
    assert "<script" not in html
    assert "url(" not in html
    assert "@import" not in html


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("drives", ["none", "failed", "one", "unknown"])
def test_little_data_is_a_page_as_well(tmp_path: Path, planted: Planted, drives: str) -> None:
    """No log, failed logs alone, one drive, drives of which nothing is known: sentences, no exception, no NaN."""
    good, bad = planted.rows[0], planted.rows[-1]
    nothing = {
        **good,
        **dict.fromkeys(k for k in good if k.startswith(("range_rate", "headway_error", "noise", "wanted"))),
    }
    chosen = {
        "none": [],
        "failed": [bad],
        "one": [good],
        "unknown": [{**nothing, "names": None, "estimate": None}],
    }
    folder = tmp_path / "fleet"
    write(folder, chosen[drives])
    of = summarise(folder)
    html = page(of, Provenance())
    _read(html)
    assert not re.search(r"\b(nan|inf|none)\b", html.split("<main>")[1], flags=re.IGNORECASE)
    assert of.verdict == ("1 driver, 1 drive" if drives == "one" else "no drive has an estimate")
    assert page(summarise(folder), Provenance()) == html
    if drives == "unknown":
        assert of.excluded[0].number == 1


def test_one_log_is_counted_in_the_singular(summary: FleetSummary) -> None:
    counts = summary.counts._replace(logs=5, ok=1, damaged=1, failed=1, duplicates=1, open=1)
    one = summary._replace(
        counts=counts, excluded=data_quality.excluded([Excluded("a", "anna", "too short")])
    )
    first, second, *_ = sentences(one)
    assert "1 is damaged and was read in part, 1 more is a copy, 1 is not analysed yet" in first
    assert second == "1 drive with results does not count for the population; too short"
    several = one._replace(
        counts=counts._replace(damaged=2, duplicates=2, open=2),
        excluded=data_quality.excluded([Excluded(log, "anna", log) for log in "ab"]),
    )
    first, second, *_ = sentences(several)
    assert "2 are damaged and were read in part, 2 more are copies, 2 are not analysed yet" in first
    assert second == "2 drives with results do not count for the population; most often: a"


def test_hostile_names_are_inert(summary: FleetSummary) -> None:
    """Names of drivers, cars, logs, faults and reasons, through the tables to the page: text, and nothing else."""
    html = page(summary, Provenance(command=HOSTILE, log=HOSTILE))
    seen = _read(html)
    assert "script" not in seen.tags
    assert "img" not in seen.tags
    assert "{{ 7 * 7 }}" in " ".join(seen.text)
    assert not [name for name in seen.attributes if name.startswith("on")]
    assert html.count("</style>") == 1


@pytest.mark.parametrize("drivers", [3, 4, 26])
def test_drivers_of_whom_nothing_is_known_are_a_table(drivers: int) -> None:
    """Where the sentence cannot name them all: each as it is called, inert, with its reason and some drives."""
    name = "<img src=x onerror=alert(2)> of_two_words"
    left = [
        Excluded(f"{k}_a.blf", f"{name} {k:02d}", "signals are wrong: frozen gap") for k in range(drivers)
    ]
    html = page(
        _summary(2)._replace(excluded=(), drivers_excluded=data_quality.drivers_excluded(left, ())),
        Provenance(),
    )
    seen = _read(html)
    text = " ".join(" ".join(seen.text).split())
    assert ("Drivers of whom nothing is known" in text) is (drivers > 3)
    assert sum(f"{name} {k:02d}" in text for k in range(drivers)) == (min(drivers, 25) if drivers > 3 else 0)
    assert ("signals are wrong: frozen gap 0_a.blf" in text) is (drivers > 3)
    assert ("1 more in the tables" in text) is (drivers > 25)
    assert not seen.tags & {"script", "img"}


def test_500_drivers_and_many_tests_stay_one_short_page() -> None:
    """Less than 350 kB: the ends of each parameter, the distribution of all, and counts of what is left out."""
    html = page(_summary(500), Provenance())
    assert len(html) < 350_000
    seen = _read(html)
    text = " ".join("".join(seen.text).split())
    assert "476 drivers between" in text
    assert "largest and smallest" in text
    assert "975 more are not listed" in text
    assert html.count("<svg") == 2 * len(_summary(500).populations[0].parameters)


def test_text_and_page_say_the_same_sentences(summary: FleetSummary) -> None:
    """The verdict and what follows it, word for word; on a phone every number of a table has its name."""
    for of in (summary, _summary(20)):
        html = page(of, Provenance())
        verdict = html.split('<div class="verdict fleet">')[1].split("</div>")[0]
        shown = [" ".join(re.sub(r"<[^>]*>", "", part).split()) for part in re.split("</h1>|</p>", verdict)]
        title, *sentences = text(of)
        printed = "\n".join(sentences).replace("\n    ", " ").replace("  ", "").split("\n")
        assert [unescape(part) for part in shown if part] == [title[:1].upper() + title[1:], *printed]
        assert len(printed) == len(of.sentences)
        cells = re.findall(r'<td class="n"[^>]*>', html)
        assert cells
        assert all("data-label=" in cell for cell in cells)


def test_columns_of_which_no_test_knows_anything_are_left_out() -> None:
    of = _summary(20)
    (population,) = of.populations
    unknown = tuple(
        asked._replace(tests=tuple(test._replace(effect=Interval()) for test in asked.tests))
        for asked in population.questions
    )
    without = page(of._replace(populations=(population._replace(questions=unknown),)), Provenance())
    assert ">difference</th>" in page(of, Provenance())
    assert ">difference</th>" not in without


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_command_writes_a_page_and_no_other_file(
    planted: Planted, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It replaces its own page only; a folder that is none is one line."""
    target, folder = tmp_path / "fleet.html", tmp_path / "fleet"
    write(folder, planted.rows[:1])
    assert _run(folder, "-o", target) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0] == "1 driver, 1 drive"
    assert max(map(len, out.splitlines())) <= 80
    target.write_text("<!doctype html><title>mine</title>")
    with pytest.raises(OutputError, match=r"fleet\.html"):
        _run(folder, "-o", target)
    assert target.read_text() == "<!doctype html><title>mine</title>"
    with pytest.raises(ConfigError, match="is no folder of canid fleet"):
        _run(tmp_path, "-o", tmp_path / "other.html")
    with pytest.raises(ConfigError, match=r"not an \.html file"):
        _run(folder, "-o", folder / "drives.parquet")
    assert sorted(path.suffix for path in folder.iterdir()) == [".lock", *[".parquet"] * 8]


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1180, "light"), (703, "light")])
def test_it_fits_screens_and_paper(
    browser: Any,
    tmp_path: Path,
    width: int,
    scheme: str,
) -> None:
    """In a real browser: no sideways scroll, no error, no request; all details open; the colors are those of the scheme."""
    path = tmp_path / "page.html"
    path.write_text(page(_summary(60, hostile=True), Provenance(command="c" * 400)), encoding="utf-8")
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, java_script_enabled=True
    )
    seen = context.new_page()
    wrong: list[str] = []
    asked: list[str] = []
    seen.on("console", lambda m: wrong.append(m.text))
    seen.on("pageerror", lambda error: wrong.append(str(error)))
    seen.on("request", lambda request: asked.append(request.url))
    seen.goto(path.as_uri())
    seen.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    assert seen.evaluate("document.documentElement.scrollWidth") <= width
    clipped = """[...document.querySelectorAll('svg, table, h1, h2, h3, p')].filter(e => {
      const box = e.closest('.wide'), right = e.getBoundingClientRect().right;
      const scrolls = box && box.scrollWidth > box.clientWidth
        && ['auto', 'scroll'].includes(getComputedStyle(box).overflowX);
      return right > window.innerWidth + 1 && !scrolls; }).map(e => e.outerHTML.slice(0, 80))"""
    assert seen.evaluate(clipped) == []
    if width == 390:  # nothing is hidden behind a scroll of its own
        assert (
            seen.evaluate(
                "[...document.querySelectorAll('.wide')].filter(b => b.scrollWidth > b.clientWidth).length"
            )
            == 0
        )
    ground = seen.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    bar = seen.evaluate("getComputedStyle(document.querySelector('line.shrunken')).stroke")
    bright = [sum(int(x) for x in c[c.index("(") + 1 :].rstrip(")").split(",")[:3]) for c in (ground, bar)]
    assert (bright[0] < bright[1]) is (scheme == "dark")
    paper = int((210 - 2 * 12) / 25.4 * 96)
    seen.set_viewport_size({"width": paper, "height": 900})
    seen.emulate_media(media="print", color_scheme="light")
    assert seen.evaluate("document.documentElement.scrollWidth") <= paper
    right = seen.evaluate(
        "Math.max(...[...document.querySelectorAll('table, svg')].map(e => e.getBoundingClientRect().right))"
    )
    assert right <= paper
    assert wrong == []
    assert asked == [path.as_uri()]
    context.close()


class _Page(HTMLParser):
    """Tags, attributes and text; refuses tags that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.addresses: set[str] = set()
        self.ids: set[str] = set()
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            self.attributes.add(name)
            if name in ("src", "href", "xlink:href", "action", "poster", "data"):
                self.addresses.add(value or "")
            if name == "id":
                assert value not in self.ids, value
                self.ids.add(value or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["style"], ["script"]):
            self.text.append(data)


def _read(html: str) -> _Page:
    of = _Page()
    of.feed(html)
    of.close()
    assert of.open == []
    return of


def _run(*words: str | Path) -> int:
    parser = Parser(prog="canid fleet report")
    fleet_report.arguments(parser)
    args: argparse.Namespace = parser.parse_args([str(word) for word in words])
    return fleet_report.run(args)


def _summary(drivers: int, *, hostile: bool = False) -> FleetSummary:
    """A summary of made-up numbers; nothing is pooled."""
    rng = np.random.default_rng(5)

    def around(value: float, half: float) -> Interval:
        return Interval(value, value - half, value + half)

    names = ("headway_error.K", "range_rate.K", "range_rate.log_tau_plus_dead_time", "range_rate.log_tau")
    parameters = tuple(
        Parameter(
            name, "s", ".log" in name, drivers, 4 * drivers, around(1.0, 0.05), around(0.2, 0.02), around(0.1, 0.02),
            around(1.0, 0.5), "",
        )
        for name in names
    )  # fmt: skip
    people = tuple(
        Driver(
            f"{'driver with a long name/' if hostile else 'driver '}{k}{HOSTILE if hostile and k == 0 else ''}", 4, 3600.0,
            {name: around(float(x), 0.1) for name, x in zip(names, rng.normal(1.0, 0.2, 4), strict=True)},
            {name: around(float(x), 0.4) for name, x in zip(names, rng.normal(1.0, 0.4, 4), strict=True)},
        )
        for k in range(drivers)
    )  # fmt: skip
    tests = tuple(
        Answer(
            f"driver {k}",
            names[1],
            around(0.1, 0.05),
            "m/s² per m/s per week",
            1e-5 * k,
            1e-3 * k,
            k < 20,
            "over 9 weeks",
        )
        for k in range(1000)
    )
    asked = Questions(
        "did a driver change over the weeks?", "drivers changed", 1000, 20, 0.05, tests, "", "20 changed"
    )
    long = "/mnt/a/very/long/path/of/a/fleet/without/any/blank/in/it" * 3 if hostile else "a.blf"
    counted = (Counted("frozen_gap", 12, "gap is frozen " * 10, (long, long)),)
    share, gain = Interval(0.3, 0.2, 0.4), Interval(0.2, 0.1, 0.3)
    cause = Cause(
        "car A", "headway_dead_zone", "driver", 12, 40, 6, share, gain, Interval(), 1e-4, 1e-3, "named", ""
    )
    return FleetSummary(
        folder="fleet",
        verdict=f"{drivers} drivers: drivers differ",
        sentences=("it is so", "and so" * 3),
        counts=Counts(4 * drivers, 4 * drivers - 3, 2, 1, 0, 0, drivers, 3, 1e6, 9e5, 8e5),
        failures=counted,
        damaged=counted,
        signals=counted,
        excluded=counted,
        drivers_excluded=counted,
        misfits=counted,
        populations=(Population(Kind("accel", "m/s²"), parameters, people, (), (), (asked,)),),
        causes=(cause,) * 40,
        no_causes="",
        next_drives=tuple(Next(f"driver {k}", "drive", "because") for k in range(12)),
        provenance={"results": "f" * 64},
    )
