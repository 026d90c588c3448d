"""The page: complete in every verdict, loads nothing, escapes what it is given, and its plots are plotly's."""

import json
import math
import re
from collections.abc import Callable
from html.parser import HTMLParser

import numpy as np
import plotly.graph_objects as go
import pytest

from canid.ui.views import closed_loop
from canid.ui.views.diagnosis_report import diagnosis_json, diagnosis_text
from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.ui.views.diagnosis_report.evidence_plot import SYMBOLS, decisive, evidence_plot, order, outcome
from canid.ui.views.diagnosis_report.spectra import spectra
from canid.ui.views.diagnosis_report.time_series import whole_drive
from canid.ui.views.drawing import plotly_package
from canid.ui.views.drawing.decimation import MAX_POINTS, min_max_indices
from canid.ui.views.drawing.figure import Figure, script
from canid.values.findings import Report, Verdict
from canid.values.text import json_values, numbers
from canid.values.types import Interval

ReportOf = Callable[..., Report]
# the order in which an engineer asks
SECTIONS = [
    "verdict",
    "time",
    "where",
    "evidence",
    "undecided",
    "parameters",
    "checks",
    "loop",
    "steps",
    "terms",
    "provenance",
]
FIGURES = {"whole-drive", "worst-windows", "map-1", "map-2", "spectra", "evidence-plot", "closed-loop"}
# attributes with which an element loads or leads somewhere
LOADING = ("src", "href", "srcset", "data", "action", "poster", "background", "xlink:href")
# elements without an end
VOID = {"meta", "link", "br"}


def unspanned(html: str) -> str:
    """A page without the spans that keep numbers in one line, and without links to terms."""
    return re.sub(
        r'<span class="whole">([^<]*)</span>', r"\1", re.sub(r'<a class="term"[^>]*>([^<]*)</a>', r"\1", html)
    )


class Read(HTMLParser):
    """Content of a page: tags, attributes, text by element."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text: list[tuple[str, str]] = []
        self.unclosed: list[str] = []
        self.feed(unspanned(html))
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.unclosed.append(tag)

    def handle_data(self, data: str) -> None:
        self.text.append((self.open[-1] if self.open else "", data))

    def words(self) -> str:
        words = " ".join(data for tag, data in self.text if tag not in ("script", "style"))
        return " ".join(words.split())

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.tags if name == tag]


def figures(html: str) -> dict:
    """The specifications of the plots in the page."""
    return json.loads(
        re.search(r'<script type="application/json" id="figures">(.*?)</script>', html, re.S)[1]
    )


@pytest.fixture(scope="module")
def html(named: Report) -> str:
    return page(named)


@pytest.mark.slow("pages in a browser")
@pytest.mark.parametrize("verdict", Verdict)
def test_every_section_is_there_in_order(report_of: ReportOf, verdict: Verdict) -> None:
    """Whatever the verdict: ten sections, each with a heading that names it, and the verdict's sentence at the top."""
    report = report_of(verdict)
    read = Read(page(report))
    sections = read.of("section")
    assert [attrs["id"] for attrs in sections] == SECTIONS
    headings = {attrs["id"] for attrs in read.of("h2")}
    assert {attrs["aria-labelledby"] for attrs in sections} == headings
    assert len(read.of("h1")) == 1
    assert report.says in read.words()
    assert read.unclosed == []
    assert read.open == []
    ids = [attrs["id"] for _, attrs in read.tags if attrs.get("id")]
    assert len(ids) == len(set(ids))
    # every link inside the page leads to something
    assert {attrs["href"][1:] for attrs in read.of("a")} <= set(ids)


def test_the_page_loads_nothing(html: str) -> None:
    """No element names a file or a host: the page is the same on a machine without any network."""
    read = Read(html)
    for tag, attrs in read.tags:
        for name in LOADING:
            value = attrs.get(name)
            assert value is None or value.startswith("#") or (tag, value) == ("link", "data:,"), (
                tag,
                name,
                value,
            )
    css = " ".join(data for tag, data in read.text if tag == "style")
    assert "url(" not in css
    assert "@import" not in css
    own = [data for tag, data in read.text if tag == "script"][-1]
    assert "http" not in own
    assert "fetch" not in own


def test_all_plots_are_there_and_each_has_words(html: str) -> None:
    """Every figure has data, an alternative text and a sentence on what to see; none is drawn twice or left over."""
    read = Read(html)
    plots = [attrs for attrs in read.of("div") if attrs.get("class") == "plot"]
    assert [attrs["data-figure"] for attrs in plots] == list(figures(html))
    assert set(figures(html)) == FIGURES
    assert all(attrs["role"] == "img" and len(attrs["aria-label"]) > 20 for attrs in plots)
    captions = [data for tag, data in Read(unspanned(html)).text if tag == "figcaption" and data.strip()]
    assert len(captions) == len(plots)
    assert all(len(caption) > 60 for caption in captions)


def test_plotly_knows_every_property(html: str) -> None:
    """plotly's own schema accepts data and layout, once colors replace their names."""

    def colored(value: object) -> object:
        if isinstance(value, str):
            return "#123456" if value.startswith("@") else value
        if isinstance(value, list):
            return [colored(x) for x in value]
        return {key: colored(x) for key, x in value.items()} if isinstance(value, dict) else value

    for name, spec in figures(html).items():
        drawn = go.Figure(colored({"data": spec["data"], "layout": spec["layout"]}))
        assert len(drawn.data) == len(spec["data"]) > 0, name


def test_every_color_is_in_the_style_sheet(html: str) -> None:
    """A color that the style sheet does not have would be drawn black, on black in dark mode."""
    wanted = set(re.findall(r'"@([\w-]+)"', json.dumps(figures(html))))
    assert len(wanted) > 8
    css = next(data for tag, data in Read(html).text if tag == "style")
    light, dark = css.split("prefers-color-scheme: dark")
    for scheme in (light, dark):
        assert wanted <= set(re.findall(r"--([\w-]+):", scheme))


def test_what_the_log_says_is_escaped(named: Report) -> None:
    """No name of a file or a signal becomes markup or ends a script."""
    evil = '</script><img src=x onerror="alert(1)">&{{ 7*7 }}'
    finding = named.findings[0]._replace(
        effect=evil, says=evil, parameters={evil: Interval(1, 0, 2)}, units={evil: evil}, rivals=(evil,)
    )
    report = named._replace(
        says=evil,
        findings=(finding,),
        tried=tuple(row._replace(effect=evil, why=evil) for row in named.tried[:1]),
        steps=(evil,),
        advice=(evil,),
        checks=tuple(check._replace(name=evil, says=evil, unit=evil) for check in named.checks),
        masked=tuple(mask._replace(effect=evil) for mask in named.masked),
        provenance=named.provenance._replace(log=evil, command=evil, versions={evil: evil}),
    )  # fmt: skip
    html = page(report)
    read = Read(html)
    assert read.of("img") == []
    assert read.words().count("{{ 7*7 }}") >= 10
    assert [attrs["id"] for attrs in read.of("section")] == SECTIONS
    assert evil in json.dumps(figures(html), ensure_ascii=False).replace('\\"', '"')


@pytest.mark.slow("pages in a browser")
@pytest.mark.parametrize("verdict", Verdict)
def test_no_word_of_a_programmer_is_shown(report_of: ReportOf, verdict: Verdict) -> None:
    """No NaN, None or array in what is read, and no NaN in what is drawn."""
    html = page(report_of(verdict))
    words = re.findall(r"\w+", Read(html).words())
    assert {"nan", "NaN", "None", "True", "False", "inf", "array", "Undefined"} & set(words) == set()
    if 'id="figures"' in html:
        json.loads(json.dumps(figures(html)), parse_constant=lambda word: pytest.fail(word))


def test_a_surrogate_is_not_the_title(report_of: ReportOf) -> None:
    """The verdict `unexplained` names no cause in its heading, and calls what helped a surrogate."""
    read = Read(page(report_of(Verdict.UNEXPLAINED)))
    title = next(data for tag, data in read.text if tag == "h1")
    assert title.strip() == "Unexplained"
    assert "surrogate" in read.words()
    assert "headway dead zone" in next(data for tag, data in Read(page(report_of())).text if tag == "h1")


def test_unused_models_and_empty_reports_say_so(report_of: ReportOf) -> None:
    """Nothing was fitted: no plot, no empty table, a sentence in every section."""
    html = page(report_of(Verdict.NOT_ENOUGH_DATA))
    read = Read(html)
    assert read.of("figure") == []
    assert 'id="figures"' not in html
    assert len(html) < 100_000  # plotly.js is left out where there is nothing to draw
    for words in (
        "No cause was found",
        "Nothing could be simulated",
        "No cause was tried",
        "No parameter could be estimated",
    ):
        assert words in read.words()
    assert "drive 5 min" in read.words()


def test_without_plotly_the_page_says_how_to_get_it(named: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    """No plots, every table, and one line on what to install."""
    monkeypatch.setattr(plotly_package, "find_spec", lambda name: None)
    read = Read(page(named))
    assert read.of("script") == []
    assert [attrs for attrs in read.of("div") if attrs.get("class") == "plot"] == []
    assert "pip install 'canid[report]'" in read.words()
    assert len(read.of("table")) >= 5
    assert [attrs["id"] for attrs in read.of("section")] == SECTIONS


def test_the_same_report_is_the_same_page(named: Report, html: str) -> None:
    assert page(named) == html


# --- the plots --------------------------------------------------------------------------------------------


def test_ten_minutes_are_drawn_sample_by_sample(named: Report) -> None:
    """6,000 samples are all in the plot, with the log's own times and values to five digits."""
    figure = whole_drive(named)
    measured = next(trace for trace in figure.data if trace["name"] == "measured")
    assert len(measured["x"]) == len(named.t) == 6000
    assert np.allclose(measured["x"], named.t, atol=1e-3)
    assert np.allclose(measured["y"], named.measured, rtol=1e-4)
    assert "thinned" not in figure.caption


def test_an_hour_is_thinned_and_says_so(report_of: ReportOf) -> None:
    """About MAX_POINTS points per line, all of them in the worst windows, both extremes of the drive kept."""
    report = report_of(Verdict.NAMED, minutes=60)
    figure = whole_drive(report)
    worst = np.zeros(len(report.t), dtype=bool)
    for window in report.worst:
        worst |= (report.t >= window.start) & (report.t <= window.stop)
    for trace in figure.data:
        assert len(trace["x"]) < 1.2 * MAX_POINTS + worst.sum(), trace["name"]
    measured = next(trace for trace in figure.data if trace["name"] == "measured")
    assert np.isin(np.round(report.t[worst], 3), measured["x"]).all()
    assert max(measured["y"]) == pytest.approx(report.measured.max(), rel=1e-4)
    assert "thinned to the minimum and the maximum of every 12 samples" in figure.caption
    # an hour's page is no more than twice that of ten minutes, without plotly.js
    specs = [len(script([whole_drive(r)])) for r in (report, report_of())]
    assert specs[0] < 2 * specs[1]


def test_thinning_loses_no_peak_and_closes_no_gap() -> None:
    """Compared with a plain loop: the extremes of every bucket are kept, and gaps remain gaps."""
    rng = np.random.default_rng(3)
    for n in (6001, 20_000, 36_007):
        y = rng.standard_normal(n).cumsum()
        y[rng.random(n) < 0.02] = np.nan
        y[n // 3 : n // 2] = np.nan
        at = min_max_indices(y, np.zeros(n, dtype=bool), most=2000)
        assert (np.diff(at) > 0).all()
        size = math.ceil(2 * n / 2000)
        for start in range(0, n, size):
            bucket = y[start : start + size]
            here = y[at[(at >= start) & (at < start + size)]]
            if np.isfinite(bucket).any():
                assert np.nanmin(here) == np.nanmin(bucket)
                assert np.nanmax(here) == np.nanmax(bucket)
        # neighbours that are drawn as a line had nothing unmeasured between them
        drawn = np.isfinite(y[at])
        for a, b in zip(at[:-1][drawn[:-1] & drawn[1:]], at[1:][drawn[:-1] & drawn[1:]], strict=True):
            assert np.isfinite(y[a : b + 1]).all()


def test_masked_and_unused_stretches_and_worst_windows_are_shaded(named: Report) -> None:
    """Every masked range and every worst window is shaded; masked ranges are not shaded twice."""
    used = named.used.copy()
    used[100:150] = False
    figure = whole_drive(named._replace(used=used))
    shades = {shape["name"]: shape["path"] for shape in figure.layout["shapes"]}
    assert shades["left out: masked"].count("Z") == len(named.masked)
    assert shades["worst windows"].count("Z") == len(named.worst)
    assert shades["left out: not fitted"] == "M10.000,0V1H14.900V0Z"
    for window in named.worst:
        assert f"M{window.start:.3f},0V1H{window.stop:.3f}V0Z" in shades["worst windows"]


def test_the_evidence_plot_has_one_symbol_per_candidate_on_a_logarithmic_axis(report_of: ReportOf) -> None:
    """Every candidate has one symbol at its evidence of the step that decided on it; none or less is at the left end."""
    report = report_of(Verdict.ONE_OF)
    figure = evidence_plot(report)
    rows = decisive(report)
    names = order(report, rows)
    assert sorted(names) == sorted({row.effect for row in report.tried})
    assert names[:2] == ["headway_dead_zone", "speed_gain"]  # found, followed by its rival
    assert figure.layout["xaxis"]["type"] == "log"
    labels = {of.label: key for key, of in SYMBOLS.items()}
    at = {y: (x, labels[trace["name"]]) for trace in figure.data if trace.get("name") in labels
          for x, y in zip(trace["x"], trace["y"], strict=True)}  # fmt: skip
    assert (
        len(at) == sum(len(trace["y"]) for trace in figure.data if trace.get("name") in labels) == len(names)
    )
    for name in names:
        last = max(
            report.tried, key=lambda row: (row.effect == name, row.outcome in ("accepted", "rival"), row.step)
        )
        evidence = max(last.evidence, 1.0) if math.isfinite(last.evidence) else 1.0
        assert at[len(names) - 1 - names.index(name)] == (pytest.approx(evidence), outcome(last, report))
    # the threshold is a line through all rows, with its value
    line = next(trace for trace in figure.data if trace.get("name") == "threshold")
    assert {x for x in line["x"] if x is not None} == {row.needed for row in rows.values()}
    assert max(line["y"]) - min(line["y"]) == len(names)
    assert any("threshold 15.8" in note["text"] for note in figure.layout["annotations"])
    # the bracket joins the two, and there is none where nobody rivals
    ends = {y for shape in brackets(figure) for y in (shape["y0"], shape["y1"])}
    assert ends == {len(names) - 1 + 0.35, len(names) - 2 - 0.35}
    assert brackets(evidence_plot(report_of())) == []


def brackets(figure: Figure) -> list[dict]:
    return [shape for shape in figure.layout["shapes"] if shape.get("xsizemode") == "pixel"]


def test_accepted_candidates_differ_by_shape_and_words(report_of: ReportOf) -> None:
    """A named cause, a surrogate, one accepted at an ordinary size and a rejected one: four symbols, four names."""
    report = report_of(Verdict.NAMED)
    usual = report.tried[1]._replace(effect="road_grade", outcome="accepted", evidence=80.0)
    surrogate = report.findings[0]._replace(effect="speed_gain", surrogate=True)
    helped = usual._replace(effect="speed_gain")
    tried = (report.tried[0], usual, helped, report.tried[5])
    report = report._replace(tried=tried, findings=(*report.findings, surrogate))
    figure = evidence_plot(report)
    drawn = [t for t in figure.data if t.get("mode") == "markers" and t["name"] != "expected if typical"]
    assert [trace["name"] for trace in drawn] == [
        SYMBOLS[key].label for key in ("named", "surrogate", "ordinary", "below")
    ]
    assert len({trace["marker"]["symbol"] for trace in drawn}) == 4
    assert [text for text in figure.layout["yaxis"]["ticktext"] if "✓" in text] == [
        "✓ <b>headway dead zone</b>"
    ]
    words = Read(page(report)).words()
    assert "accepted, ordinary size" in words
    assert "accepted, not the cause" in words


# --- what must not look like an ordinary result ---------------------------------------------------------


def worse_in_closed_loop(report: Report) -> Report:
    """The gap's error doubles with the extended model; that of the speed shrinks."""
    gap, speed = report.closed_loop
    off = gap.before - gap.measured
    lost = gap._replace(after=gap.measured + 2 * off, gain=Interval(-3.0, -4.5, -1.8))
    return report._replace(closed_loop=(lost, speed))


def test_a_closed_loop_that_gets_worse_stands_in_the_verdict(named: Report) -> None:
    """With both errors and the interval, in page, text and JSON; nothing is said where it gets better."""
    report = worse_in_closed_loop(named)
    before = numbers.number(closed_loop.rms_error(report.closed_loop[0], report.closed_loop[0].before))
    after = numbers.number(closed_loop.rms_error(report.closed_loop[0], report.closed_loop[0].after))
    says = (
        f"In closed loop the extended model is worse: error of the gap {before} → {after} m rms, "
        "error variance +300 [+180, +450] %."
    )
    html = unspanned(page(report))
    verdict = html[html.index('<div class="verdict') : html.index('<dl class="key">')]
    assert says in verdict
    assert says in diagnosis_text.text(report, "a.blf", "car")[0]
    json = json_values.plain(diagnosis_json.document(report, "a.blf", "car"))
    assert json["remarks"] == [says]
    assert json["says"].endswith(says)
    assert [of["worse"] for of in json["closed_loop"]] == [True, False]
    assert "worse with the extended model" in html
    # an interval that holds 0 is no proof
    gap, speed = report.closed_loop
    unsure = report._replace(closed_loop=(gap._replace(gain=Interval(-0.1, -0.4, 0.2)), speed))
    assert "may be chance" in diagnosis_text.text(unsure, "a.blf", "car")[0]
    # too few stretches for an interval: worse all the same
    few = report._replace(closed_loop=(gap._replace(gain=Interval()), speed))
    assert "+300 % (too few stretches for an interval)" in diagnosis_text.text(few, "a.blf", "car")[0]
    assert json_values.plain(diagnosis_json.document(named, "a.blf", "car"))["remarks"] == []
    assert "is worse" not in page(named)


def test_an_estimate_at_a_bound_is_marked_and_has_no_interval(named: Report) -> None:
    """A lag of the driver and a cause's parameter at the ends of their ranges, in page, text and JSON."""
    late = Interval(3.0, 1.94, 3.0)
    of = named.extended.channels["range_rate"]._replace(tau=late)
    shifts = dict(named.shifts) | {"range_rate tau": (named.shifts["range_rate tau"][0], late)}
    wide = named.findings[0]._replace(
        parameters={"width": Interval(1.5, 0.0, 1.5)}, says="Within ±1.5 [0.0, 1.5] s."
    )
    report = named._replace(
        extended=named.extended._replace(channels=dict(named.extended.channels) | {"range_rate": of}),
        shifts=shifts,
        findings=(wide,),
        says="In the driver: Within ±1.5 [0.0, 1.5] s.",
    )
    marked = "at its upper bound, 3 s (95 %: above 1.94 s)"
    html = unspanned(page(report))
    words = Read(html).words()
    assert f"⚠ {marked}" in words
    assert "⚠ at its upper bound, 1.5 s" in words
    text = "\n".join(diagnosis_text.text(report, "a.blf", "car"))
    assert marked in text
    assert "width at its upper bound, 1.5 s" in text
    for shown in (words, text):
        assert "[1.94, 3.00]" not in shown
        assert "[0.00, 1.50]" not in shown
        assert "[0.0, 1.5]" not in shown
        assert "Within ±1.5 (the upper bound of what is searched) s." in shown
    # the verdict says it as well
    remark = "Width of headway dead zone is at the upper bound of what is searched, 1.5 s: not an estimate."
    assert remark in html[: html.index('<dl class="key">')]
    json = json_values.plain(diagnosis_json.document(report, "a.blf", "car"))
    assert json["extended"]["at_bound"] == {
        "range_rate tau": {"side": "upper", "range": [0.0, 3.0], "unit": "s"}
    }
    assert json["baseline"]["at_bound"] == {}
    assert json["findings"][0]["at_bound"]["width"]["side"] == "upper"
    assert "⚠" not in page(named)


def test_the_caption_of_the_coherence_says_what_is_drawn(named: Report) -> None:
    """Bands in the caption are those in which the plotted lines pass the dashed one, and coherence proves no error."""
    f = np.linspace(0.02, 2.0, 100)
    high = np.where((f > 0.1) & (f < 0.3), 0.5, 0.01)
    none = np.full(100, 0.01)
    of = named.spectra._replace(
        frequency=f, before=np.ones(100), after=np.ones(100), level=0.2,
        coherence_before={"headway_error": high}, coherence_after={"headway_error": none},
    )  # fmt: skip
    figure = spectra(named._replace(spectra=of))
    before, after = (trace for trace in figure.data if trace["xaxis"] == "x2")
    above = [x for x, y in zip(before["x"], before["y"], strict=True) if y > 0.2]
    assert (
        f"Headway error: above it at {above[0]:.2g}–{above[-1]:.2g} Hz; with the extended model nowhere"
        in figure.caption
    )
    assert max(after["y"]) < 0.2
    (dashed,) = figure.layout["shapes"]
    assert dashed["y0"] == 0.2
    assert "Dashed: 0.2" in figure.caption
    assert "residual (measured − simulated) of the baseline and of the extended model" in figure.caption
    assert "feedback loop" in figure.caption
    assert "has 1.41 % → 1.41 % rms" in figure.caption  # a density of 1 %²/Hz over 1.98 Hz
