"""A fleet as text and as a page: answer, population, drivers, tests, causes, what is wrong with the data, what to drive."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from markupsafe import Markup

from canid.analysis.fleet.answers.labels import hours, label, short, spread, unit
from canid.analysis.fleet.answers.sentences import MAX_NAMES
from canid.ui.views.document import document as doc
from canid.ui.views.document.document_page import page as html
from canid.ui.views.document.document_text import WIDTH, wrapped
from canid.ui.views.fleet_report.driver_plot import (
    AT_EACH_END,
    MAX_DRIVERS,
    distribution,
    driver_plot,
    ranked,
)
from canid.values.findings import Provenance
from canid.values.fleet_summary import (
    Answer,
    Cause,
    Counted,
    Driver,
    FleetSummary,
    Parameter,
    Population,
    Questions,
)
from canid.values.interval_text import DASH
from canid.values.text.names import readable
from canid.values.text.numbers import chance, interval, number, percent
from canid.values.types import Interval

# rows of a table; the Parquet files have all
MAX_ROWS = 25
# kinds of output that are shown in full: a fleet of pedals has one for each car
MAX_KINDS = 4
# parameters of a table of drivers: what fits next to each other
MAX_COLUMNS = 4
# characters of a log's name, of what a fault is, and of a kind in the table of contents
MAX_LOG_NAME, MAX_SAYS, MAX_CONTENTS = 80, 200, 40


def text(summary: FleetSummary) -> list[str]:
    """What `canid fleet report` prints."""
    says = [line for sentence in _answer(summary) for line in wrapped(f"  {sentence}", WIDTH, hang="    ")]
    return [summary.verdict, *says]


def page(summary: FleetSummary, provenance: Provenance) -> str:
    """The page, to be stored as UTF-8.

    Args:
        summary: the fleet.
        provenance: of its folder, and the command.
    """
    counts = summary.counts
    whole = {
        "logs": counts.logs,
        "good": counts.ok,
        "damaged": counts.damaged,
        "failed": counts.failed,
        "copies": counts.duplicates,
        "drivers": counts.drivers,
        "cars": counts.cars,
    }
    driving = ", ".join(map(hours, (counts.duration, counts.behind_lead, counts.usable)))
    kinds = [_kind(population, k) for k, population in enumerate(summary.populations[:MAX_KINDS])]
    if kinds and (more := summary.populations[MAX_KINDS:]):
        kinds[-1] = kinds[-1]._replace(blocks=[*kinds[-1].blocks, _further_kinds(more)])
    sections = [
        *kinds,
        doc.Section("causes", "Causes, by car", _causes(summary), "Causes"),
        doc.Section("data", "Worst data", _data(summary)),
        doc.Section("next", "What to drive next", _next(summary)),
    ]
    return html(
        doc.Document(
            "canid fleet",
            "fleet",
            _sentence(summary.verdict).rstrip("."),
            _answer(summary),
            sections,
            doc.Source(provenance),
            "Fleet",
            key=[
                *((name, f"{n:,}") for name, n in whole.items()),
                ("driving, behind a lead, usable", driving),
            ],
        )
    )


def _answer(summary: FleetSummary) -> list[str]:
    return [_sentence(sentence) for sentence in summary.sentences]


# --- drivers ---


def _kind(population: Population, number_of_kind: int) -> doc.Section:
    """One kind of output: the population, its drivers, and what was asked of them."""
    name = population.kind.text()
    parameters = [parameter for parameter in population.parameters if parameter.drives]
    blocks: list[doc.Block] = ["No drive has a known parameter."]
    if parameters:
        blocks = [
            _table_of_population(population, parameters),
            *_lacking(parameters),
            *(_hint(_sentence(says)) for says in population.says),
            _outliers(population),
            *_drivers(population, parameters),
        ]
    for questions in population.questions:
        if questions.asked or questions.says:
            blocks += _questions(questions)
    return doc.Section(f"kind-{number_of_kind + 1}", f"Drivers: {name}", blocks, short(name, MAX_CONTENTS))


def _table_of_population(population: Population, parameters: Sequence[Parameter]) -> doc.Table:
    rows = [
        {
            "parameter": label(row.name),
            ">mean": interval(row.mean),
            "unit": unit(row.name, population.kind),
            ">spread between drivers": spread(row, row.between),
            ">spread within a driver": spread(row, row.within),
            ">a new driver": interval(row.new_driver),
            ">drivers": f"{row.drivers:,}",
            ">drives": f"{row.drives:,}",
        }
        for row in parameters
    ]
    return doc.chosen(tuple(rows[0]), rows, caption=_POPULATION, kind="cards population")


_POPULATION = (
    "The population, with 95 % intervals. Spread: standard deviation of the true parameters, without the errors of the "
    "estimates; of times and noise in percent."
)


def _lacking(parameters: Sequence[Parameter]) -> list[doc.Sentence]:
    """What the drives do not show, and of which parameters."""
    names: dict[str, list[str]] = {}
    for parameter in parameters:
        if parameter.says:
            names.setdefault(parameter.says, []).append(label(parameter.name))
    return [_hint(f"{', '.join(labels)}: {says}.") for says, labels in names.items()]


def _outliers(population: Population) -> doc.Sentence | None:
    if not population.outliers:
        return None
    names = ", ".join(short(name, MAX_LOG_NAME) for name in population.outliers[:MAX_ROWS])
    more = " …" if len(population.outliers) > MAX_ROWS else ""
    return _hint(f"Do not fit the rest, and weigh less: {names}{more}.")


def _drivers(population: Population, parameters: Sequence[Parameter]) -> list[doc.Block]:
    """Drivers side by side, and as a table; of many those at both ends."""
    main = [parameter for parameter in parameters if not _is_apart(parameter.name)]
    apart = [parameter for parameter in parameters if _is_apart(parameter.name)]
    order = ranked(population, main[0].name if len(main) < 2 else main[1].name) if main else []
    names = {driver.name for driver in order}
    order += [driver for driver in population.drivers if driver.name not in names]
    left_out = 0
    if len(order) > MAX_DRIVERS:
        left_out = len(order) - 2 * AT_EACH_END
        order = order[:AT_EACH_END] + order[-AT_EACH_END:]
    blocks: list[doc.Block] = []
    if main:
        ends = f" The {AT_EACH_END} largest and smallest of each parameter; drivers.parquet has all."
        says = _DRAWN + ends if left_out else _DRAWN
        blocks.append(doc.Drawing(_drawn(population, main), "Drivers side by side", says))
    if apart:
        drawing = doc.Drawing(_drawn(population, apart), caption=_APART)
        blocks.append(doc.Fold("Lag and dead time apart", [drawing]))
    if main and order:
        blocks.append(
            doc.Fold("Table of drivers", [_table_of_drivers(population, main[:MAX_COLUMNS], order, left_out)])
        )
    return blocks


_DRAWN = Markup(
    'Each with its 95 % interval: upper, <span class="key-after">shrunken towards the population</span>; lower, '
    '<span class="key-before">from the driver\'s own drives alone</span>. Vertical line: mean of the population; grey: '
    "where a new drive of a new driver lies (95 %). An arrow: it goes on outside."
)
_APART = "Only drives from which the two can be separated."


def _is_apart(name: str) -> bool:
    """Lag or dead time alone: known from few drives, and in their sum already."""
    return name.rpartition(".")[2] in ("log_tau", "dead_time")


def _drawn(population: Population, parameters: Sequence[Parameter]) -> Markup:
    """The drivers of several parameters next to each other."""
    figure = Markup('<figure class="drivers"><figcaption>{}</figcaption>{}{}</figure>')
    return Markup("\n").join(
        figure.format(
            _with_unit(population, parameter),
            distribution(population, parameter),
            driver_plot(population, parameter),
        )
        for parameter in parameters
    )


def _with_unit(population: Population, parameter: Parameter) -> str:
    named = unit(parameter.name, population.kind)
    return label(parameter.name) + (f", {named}" if named else "")


def _table_of_drivers(
    population: Population, columns: Sequence[Parameter], drivers: Sequence[Driver], left_out: int
) -> doc.Table:
    rows = [
        (
            short(driver.name, MAX_LOG_NAME),
            str(driver.drives),
            hours(driver.usable),
            *(
                interval(driver.shrunken[parameter.name]) if parameter.name in driver.shrunken else DASH
                for parameter in columns
            ),
        )
        for driver in drivers
    ]
    more = f"; {left_out:,} drivers between are in drivers.parquet" if left_out else ""
    head = (
        "driver",
        ">drives",
        ">usable",
        *(f">{_with_unit(population, parameter)}" for parameter in columns),
    )
    return doc.Table(head, rows, caption=f"Estimates shrunken towards the population{more}", kind="cards")


def _questions(asked: Questions) -> list[doc.Block]:
    """One question, how often the answer is yes, and the tests."""
    says = []
    if asked.asked:
        answer = f"{asked.found:,} of {asked.asked:,} {asked.finding}"
        rate = number(100 * asked.rate, "%")
        sure = f", with a false discovery rate of at most {rate}: of those found so few are expected to be chance"
        says.append(f"{answer}{sure if asked.found else ''}.")
    if asked.says:
        says.append(_sentence(asked.says))
    head = ("who", "parameter", ">difference", "unit", ">p", ">q", "verdict")
    return [
        doc.Listing(says, asked.question),
        doc.Table(head, [_test(test) for test in asked.tests[:MAX_ROWS]], kind="cards tests"),
        _more(len(asked.tests), "{} more are not listed."),
    ]


def _test(test: Answer) -> tuple[str, ...]:
    known = math.isfinite(test.effect.value)
    verdict = ("failed", "found") if test.found else ("unmade", "not shown")
    return (
        short(test.subject, MAX_LOG_NAME),
        label(test.parameter) if test.parameter else "all together",
        interval(test.effect) if known else "",
        test.unit if known else "",
        chance(test.p, 2),
        chance(test.q, 2),
        Markup('<span class="{}">{}</span> {}').format(*verdict, test.says),
    )


def _further_kinds(more: Sequence[Population]) -> doc.Sentence:
    names = ", ".join(short(population.kind.text(), MAX_LOG_NAME) for population in more[:MAX_ROWS])
    return _hint(
        f"{len(more):,} further kinds of output are in population.parquet and drivers.parquet: {names}."
    )


# --- causes, data, what to drive next ---


def _causes(summary: FleetSummary) -> list[doc.Block]:
    head = ("effect", "car", "block", ">drives", ">drivers", ">share", ">gain", ">q", "all drives together")
    return [
        doc.Table(head, list(map(_cause, summary.causes[:MAX_ROWS])), caption=_CAUSES, kind="cards"),
        _more(len(summary.causes), "{} more: `canid fleet query DIR causes`."),
        _sentence(summary.no_causes),
    ]


_CAUSES = (
    "What the diagnoses name, with the evidence of all drives. Share: of the drives in which it could have been named. "
    "Gain: relative reduction of the simulation's error variance on held-out data. q: adjusted for the false discovery "
    "rate."
)


def _cause(cause: Cause) -> tuple[str, ...]:
    together = Markup("{} <small>{}</small>").format(cause.joint, cause.says) if cause.says else cause.joint
    return (
        readable(cause.effect),
        cause.car,
        cause.where,
        f"{cause.drives} of {cause.diagnosed}" if cause.diagnosed else "",
        str(cause.drivers) if cause.diagnosed else "",
        _share(cause.share),
        _share(cause.gain),
        chance(cause.q, 2) if math.isfinite(cause.q) else "",
        together,
    )


def _share(iv: Interval) -> str:
    return percent(iv) if math.isfinite(iv.value) else ""


def _data(summary: FleetSummary) -> list[doc.Block]:
    said = (
        ("Logs without results", summary.failures, "why", "logs"),
        ("Damaged logs: the results rest on what could be read", summary.damaged, "what", "logs"),
        ("Faults of signals", summary.signals, "fault", "drives"),
        ("Drives whose model stopped fitting, as the monitor saw it", summary.misfits, "block", "drives"),
        ("Drives that are no part of the population, and why", summary.excluded, "why", "drives"),
    )
    blocks = [block for about in said if about[1] for block in _counted(*about)]
    # as many as the sentence names are there already
    if len(summary.drivers_excluded) > MAX_NAMES:
        title, why = "Drivers of whom nothing is known", "why, most often"
        blocks += _counted(title, summary.drivers_excluded, "driver", "drives", why, of_names=True)
    return blocks or ["Nothing: every log was read, no signal has a fault, and every drive counts."]


def _counted(
    title: str,
    items: Sequence[Counted],
    head: str,
    what: str,
    says: str = "what it is",
    of_names: bool = False,
) -> list[doc.Block]:
    rows = [
        (
            short(counted.what, MAX_LOG_NAME) if of_names else readable(counted.what),
            f"{counted.number:,}",
            textwrap.shorten(counted.says, MAX_SAYS, placeholder="..."),
            ", ".join(short(name, MAX_LOG_NAME) for name in counted.examples),
        )
        for counted in items[:MAX_ROWS]
    ]
    return [
        doc.Table((head, f">{what}", says, "examples"), rows, title, kind="cards counted"),
        _more(len(items), "{} more in the tables."),
    ]


def _next(summary: FleetSummary) -> list[doc.Block]:
    item = Markup("<b>{}</b>: {} <small>{}</small>")
    drives = [
        item.format(short(drive.driver, MAX_LOG_NAME), drive.what, drive.why)
        for drive in summary.next_drives[:MAX_ROWS]
    ]
    return [
        doc.Listing(drives, bullet="1.") if drives else _NO_NEXT,
        doc.Table(
            ("what", "value"),
            [(key, str(value)) for key, value in summary.provenance.items()],
            "What these numbers rest on",
            kind="provenance",
        ),
    ]


_NO_NEXT = (
    "No single drive would narrow what is known of one driver by a tenth of the spread between drivers."
)


# --- words ---


def _hint(words: str) -> doc.Sentence:
    return doc.Sentence(words, "hint")


def _more(n: int, words: str) -> doc.Sentence | None:
    """That a table has more rows than are shown."""
    return _hint(words.format(f"{n - MAX_ROWS:,}")) if n > MAX_ROWS else None


def _sentence(words: str) -> str:
    """With a capital and a full stop; "" of nothing."""
    words = words.strip()
    end = "" if not words or words.endswith((".", "!", "?")) else "."
    return words[:1].upper() + words[1:] + end
