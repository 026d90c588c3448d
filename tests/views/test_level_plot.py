"""The plot of parameters over a drive is valid SVG that shows every parameter, its band and the changes."""

from xml.etree import ElementTree

import numpy as np

from canid.analysis.drive.drive_parameters import Identified
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.fopdt_whole_drive import Constancy, OverTime, Segment, with_changes
from canid.mathematics.identification import local_level
from canid.ui.views import identification_text
from canid.ui.views.drive_report import level_plot
from canid.values.types import Channel, GainChange, Identifiable, Interval
from tests.seeds import mostly

SVG = "{http://www.w3.org/2000/svg}"


def identified(seed, changed):
    """A drive of 20 min with or without a change."""
    t = 40.0 * np.arange(30.0) + 20.0
    level = local_level.fit(t, 5.0 + 0.3 * np.random.default_rng(seed).normal(size=30), np.full(30, 0.3))
    assert level is not None
    K = {"range_rate": Interval(5.6, 5.2, 6.0)}, {"range_rate": Interval(8.4, 7.9, 8.9)}
    channels = [{"range_rate": Channel(of["range_rate"], status=Identifiable.GAIN_ONLY)} for of in K]
    change = GainChange(Interval(312.0, 308.0, 315.0), *K, 30.0)
    found = OverTime(
        (change,) if changed else (),
        (Segment(0.0, 312.0, channels[0]), Segment(312.0, 1200.0, channels[1])) if changed else (),
        (Constancy("range_rate", "K", 40.0, level),),
    )
    whole = {"range_rate": Channel(Interval(7.1, 6.9, 7.3), status=Identifiable.GAIN_ONLY)}
    return Identified(1200.0, 1200.0, (), {"fopdt": with_changes(WholeDrive(whole), found)}, ())


@mostly(0.95)
def test_the_plot_is_valid_and_shows_what_was_found(seed):
    """One panel with a dot per window, a band, and a line per change; names are escaped."""
    root = ElementTree.fromstring(level_plot.svg(identified(seed, True), "<drive>.blf", "car & trailer"))
    text = " ".join("".join(e.itertext()) for e in root.iter(f"{SVG}text"))
    assert "<drive>.blf: car & trailer" in text
    assert "range rate K" in text
    assert "312 s" in text
    assert len(list(root.iter(f"{SVG}circle"))) == 30
    assert len(list(root.iter(f"{SVG}polygon"))) == 1


def test_a_drive_too_short_for_a_level_says_so():
    """No panel, one sentence."""
    drive = Identified(60.0, 60.0, (), {"fopdt": None}, ())
    assert "too short" in level_plot.svg(drive, "a.blf", "car")


@mostly(0.95)
def test_where_the_gains_changed_no_gain_of_the_whole_drive_may_be_quoted(seed):
    """The text gives those of the stretches, the status of the whole drive's is `not_identifiable`."""
    drive = identified(seed, True)
    assert drive.channels["range_rate"].status is Identifiable.NOT
    text = "\n".join(identification_text.text(drive, "a.blf", "car"))
    assert "no gain holds for the whole drive" in text
    assert "312–1200 s: range rate K 8.40 [7.90, 8.90]" in text
    assert "7.10" not in text
    assert "no gain holds" not in "\n".join(identification_text.text(identified(seed, False), "a.blf", "car"))
