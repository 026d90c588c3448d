"""A line among the rows that names other columns, or in another order, is no row: what follows means something else."""

from __future__ import annotations

from pathlib import Path

import pytest

from canid.analysis.tables.table import open_table
from canid.values.errors import ConfigError

HEADER = "time,speed [km/h],pedal [%],gap [m],range_rate [m/s]"
OTHER_LINES = {
    "other order": "time,pedal [%],speed [km/h],range_rate [m/s],gap [m]",
    "other unit": "time,speed [m/s],pedal [%],gap [m],range_rate [m/s]",
    "one column more": "time,temperature,speed [km/h],pedal [%],gap [m],range_rate [m/s]",
    "quoted": '"time","pedal [%]","speed [km/h]","range_rate [m/s]","gap [m]"',
    "quoted, another name first": '"pedal [%]","time","speed [km/h]","range_rate [m/s]","gap [m]"',
    "in German": "Zeit,Fahrpedal [%],Geschwindigkeit [km/h],Relativgeschwindigkeit [m/s],Abstand [m]",
    "units alone": "s,m/s,%,m,m/s",
}


def _rows(first: int, mark: str = ",") -> list[str]:
    return [
        mark.join((f"{0.1 * k:.1f}", f"{72 + k % 7}.25", "20.5", "30.125", "0.5"))
        for k in range(first, first + 300)
    ]


def _written(path: Path, between: str, header: str = HEADER, more: str = "") -> Path:
    path.write_text("\n".join([header, *_rows(0), between, *(row + more for row in _rows(300))]) + "\n")
    return path


@pytest.mark.parametrize("line", OTHER_LINES.values(), ids=OTHER_LINES)
def test_columns_that_change_are_refused(line: str, tmp_path: Path) -> None:
    header = HEADER if not line.startswith('"') else ",".join(f'"{name}"' for name in HEADER.split(","))
    with pytest.raises(
        ConfigError, match="line 302 names columns otherwise than the header: cut the file there"
    ):
        open_table(_written(tmp_path / "x.csv", line, header))


@pytest.mark.parametrize(
    "line",
    [
        HEADER,
        HEADER.upper().replace("KM/H", "km/h"),
        "Time, speed (km/h), pedal (%), gap (m), range_rate (m/s)",
    ],
)
def test_the_same_names_again_are_no_row(line: str, tmp_path: Path) -> None:
    table = open_table(_written(tmp_path / "x.csv", line))
    assert (table.log.span[1], table.damaged) == (pytest.approx(59.9), 0)


def test_a_pedal_that_cannot_be_in_percent_is_refused(tmp_path: Path) -> None:
    """Counts up to 255 with decimals; a few values above, as of a sensor that fails, do no harm."""
    rows = [f"{0.1 * k:.1f},{72 + k % 7}.25,{k % 255}.5,30.125,0.5" for k in range(600)]
    path = tmp_path / "x.csv"
    path.write_text("\n".join(["time,speed [km/h],pedal,gap,range_rate", *rows]) + "\n")
    with pytest.raises(ConfigError, match="1 % of its values are above 251"):
        open_table(path)
    path.write_text(
        "\n".join(["time,speed [km/h],pedal,gap,range_rate", *_rows(0), "30.0,72.25,255.5,30.125,0.5"]) + "\n"
    )
    assert open_table(path).damaged == 0
