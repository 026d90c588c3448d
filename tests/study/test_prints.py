"""`canid study prints`: the committed result is complete and shown as asked for, and its main numbers follow by hand."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.stats import norm

from canid_study import prints
from canid_study.artifact import ClaimVerdict
from canid_study.chen_ulsoy import one_track_car
from canid_study.grover import miso_bound
from canid_study.printed_numbers import EQ_2_4, EQ_2_5, EQ_2_9, STEERING_INTERVAL_S, STEERING_TABLES


def test_every_equation_table_and_figure_has_a_row() -> None:
    """Grover: eq. 2.1 to 2.9, Tables 1 and 2, Fig. 1 to 20; Chen & Ulsoy: eq. 1 to 5, Tables 1 and 2, Fig. 1 to 14."""
    names = [a.name for a in prints.study().artifacts]
    assert len(set(names)) == len(names)
    for paper, equations, figures in (
        ("Grover 2021", [f"2.{k}" for k in range(1, 10)], 20),
        ("Chen & Ulsoy 2001", [str(k) for k in range(1, 6)], 14),
    ):
        rows = [n.removeprefix(f"{paper}, ") for n in names if n.startswith(paper)]
        listed = [e for n in rows if n.startswith("eq. ") for e in n.removeprefix("eq. ").split(", ")]
        assert sorted(listed) == sorted(equations)
        assert [n for n in rows if n.startswith("Fig. ")] == [f"Fig. {k}" for k in range(1, figures + 1)]
        assert [n for n in rows if n.startswith("Table ")] == ["Table 1", "Table 2"]


def test_every_row_says_why_and_every_file_is_made() -> None:
    """Files of a row exist among tables and figures; tables are rectangular; a verdict that fails has a number."""
    study = prints.study()
    made = {f"tables/{t.name}.csv" for t in study.tables} | {f"figures/{f.name}.svg" for f in study.figures}
    for a in study.artifacts:
        assert a.why, a.name
        if a.verdict in (ClaimVerdict.FAILS, ClaimVerdict.IMPOSSIBLE):
            assert re.search(r"\d", a.reproduced), a.name
    assert made == {file for a in study.artifacts for file in a.files}
    for t in study.tables:
        assert all(len(row) == len(t.columns) for row in t.rows), t.name
        assert len(set(t.columns)) == len(t.columns), t.name
    for curve in (c for figure in study.figures for panel in figure.panels for c in panel.curves):
        assert len(curve.x) == len(curve.y) > 0
        assert np.isfinite(curve.x).all()


def test_the_page_begins_with_the_main_results() -> None:
    """Three sentences: the count, six unstable poles and -1034 next to 6.654 with 13.55 %, and 30 % unstable drivers."""
    counts, grover, chen_ulsoy = prints.study().says
    assert "32 claims" in counts
    assert "fails 13" in counts
    for number in ("6 unstable poles", "-1034", f"{EQ_2_9.K:g}", "13.55 %", "96.36 %"):
        assert number in grover
    assert "30 %" in chen_ulsoy


@pytest.mark.parametrize(
    ("paper", "prefix", "claims"), [("grover", "grover_", 18), ("chen-ulsoy", "chen_ulsoy_", 14)]
)
def test_one_paper_alone(paper: str, prefix: str, claims: int) -> None:
    """Rows carry the paper's name only where there are two."""
    study, both = prints.study(paper), prints.study()
    assert study.paper == prints.PAPERS[paper]
    assert {f"{study.paper}, {a.name}" for a in study.artifacts} < {a.name for a in both.artifacts}
    assert study.says[0].startswith(f"{claims} claims")
    assert study.says[1] in both.says
    assert all(t.name.startswith(prefix) for t in study.tables)


def test_the_deep_scan_changes_one_row_and_its_setting() -> None:
    """Four misprinted exponents at a time; no stable denominator without those of s^4 and s^1."""
    plain, deep = prints.study("grover"), prints.study("grover", deep=True)
    changed = [(a, b) for a, b in zip(plain.artifacts, deep.artifacts, strict=True) if a != b]
    assert [(a.name, a.verdict) for a, _ in changed] == [("claim G3", changed[0][1].verdict)]
    assert dict(deep.settings)["exponents scanned"] == "up to four at a time"
    assert [name for name, _ in plain.settings] == [name for name, _ in deep.settings]
    assert prints.study("chen-ulsoy", deep=True).artifacts == prints.study("chen-ulsoy").artifacts


def test_numbers_of_simulated_drives_carry_their_error() -> None:
    """Each of C3, C4 and C13 is from eight drives; the bias is three standard errors or more where c1 is not negative."""
    rows = {a.name: a for a in prints.study("chen-ulsoy").artifacts}
    for name in ("claim C3", "claim C4", "claim C13"):
        assert rows[name].reproduced.count("±") >= 3, name
        assert "8 drives each" in rows[name].reproduced
    pairs = re.findall(r"([\d.]+) ± ([\d.]+)", rows["claim C13"].reproduced)
    assert [float(mean) > 3.0 * float(error) for mean, error in pairs] == [False, True, True]
    seeds = next(t for t in prints.study("chen-ulsoy").tables if t.name == "chen_ulsoy_constant_driver")
    at = seeds.columns.index("seed")
    assert len({row[at] for row in seeds.rows}) == 24


def test_what_the_papers_say_is_quoted_as_they_say_it() -> None:
    """Case 3 is compared within itself; the limit of selection is of the models of high order; Fig. 10 is not claimed."""
    rows = {a.name: a.verdict.value for a in prints.study("grover").artifacts}
    assert [rows[f"claim {k}"] for k in ("G9", "G12", "G13")] == ["holds", "shown", "holds"]


def test_no_string_gain_is_below_that_of_standing_still() -> None:
    """A car follows its lead exactly at 0 Hz, below the grid."""
    table = next(t for t in prints.study("grover").tables if t.name == "grover_margins")
    assert min(float(row[table.columns.index("max |v/v_lead|")]) for row in table.rows) >= 1.0


def test_another_paper_is_refused() -> None:
    """With the choices."""
    with pytest.raises(ValueError, match="choose grover, chen-ulsoy or both"):
        prints.study("helly")


# --- the main numbers by a second route ------------------------------------------------------------------------------


def test_six_unstable_poles_and_the_gain_of_eq_2_5() -> None:
    """Sign changes in the first column of Routh's array; the ratio of the last coefficients."""
    den = EQ_2_5.den
    width = len(den) // 2 + 1
    rows = [np.pad(np.array(den[k::2]), (0, width - len(den[k::2]))) for k in (0, 1)]
    while len(rows) < len(den):
        above, below = rows[-2], rows[-1]
        rows.append(np.append(above[1:] - above[0] / below[0] * below[1:], 0.0))
    assert np.count_nonzero(np.diff(np.sign([row[0] for row in rows]))) == 6
    assert round(EQ_2_5.num[-1] / EQ_2_5.den[-1]) == -1034


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_bound_of_the_sum_is_reached(direction: float, seed: int) -> None:
    """Two responses whose errors point along the output reach either end, any others stay between."""
    rng = np.random.default_rng(seed)
    y = rng.normal(size=400)
    y -= y.mean()

    def fit(model: np.ndarray) -> float:
        return 100.0 * (1.0 - float(np.linalg.norm(y - model) / np.linalg.norm(y)))

    errors = [1.0 - printed.fit_percent / 100.0 for printed in (EQ_2_4, EQ_2_5)]
    first, second = (y * (1.0 + direction * error) for error in errors)
    low, high = miso_bound.bound(fit(first), fit(second))
    assert fit(first + second) == pytest.approx(low if direction > 0 else high, abs=1e-6)
    assert round(high, 2) == 13.55
    e1, e2 = (rng.normal(size=400) for _ in range(2))
    first, second = (y - s * e / np.linalg.norm(e) * np.linalg.norm(y) for s, e in ((0.3, e1), (0.5, e2)))
    low, high = miso_bound.bound(fit(first), fit(second))
    assert low <= fit(first + second) <= high


def test_the_share_of_unstable_drivers_by_integration() -> None:
    """Over a1, of normal distribution functions of a2 within the stability triangle."""
    table = STEERING_TABLES[0]
    (m1, m2), (s1, s2) = table.mean[:2], table.sd[:2]
    a1 = np.linspace(m1 - 8.0 * s1, m1 + 8.0 * s1, 20_001)
    inside = np.maximum(norm.cdf(1.0, m2, s2) - norm.cdf(np.abs(a1) - 1.0, m2, s2), 0.0)
    assert 1.0 - np.trapezoid(norm.pdf(a1, m1, s1) * inside, a1) == pytest.approx(0.30, abs=0.005)


def test_the_sampled_car_is_the_continuous_one_at_low_frequency() -> None:
    """With the half sample of delay of a hold, up to 1 rad/s."""
    car, speed, omega = one_track_car.OneTrackCar(), 25.0, np.array([0.05, 0.3, 1.0])
    A, B = one_track_car.matrices(car, speed)
    continuous = np.array([np.linalg.solve(1j * w * np.eye(4) - A, B)[3] for w in omega])
    delayed = continuous * np.exp(-0.5j * omega * STEERING_INTERVAL_S)
    assert one_track_car.lateral_response(car, speed, omega) == pytest.approx(delayed, rel=2e-3)
