"""Tables of the exported drivers: for docs/evidence/sumo.md, and as a page of its own."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

QUANTITIES = {"gap": "m", "time_gap": "s", "speed": "m/s", "accel": "m/s²"}
# px of a small figure
WIDTH, HEIGHT = 150, 90


def table(rows: Sequence[dict[str, Any]], seed: int) -> str:
    """Markdown: drives one by one, then figures over all."""
    names = list(QUANTITIES)
    heads = ["drive", "min", "model", "gap error", *(f"KS {name}: SUMO / halves / default" for name in names)]
    heads += [
        "Wasserstein: gap m, time gap s, speed m/s, accel m/s²",
        "independent gaps",
        "gap sd, m: log / SUMO",
        "second half, model of the first: KS gap, time gap",
    ]
    out = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for one in rows:
        if "reason" in one:
            out.append(
                f"| {one['drive']} | {one['minutes']:.0f} | – | {one['reason']} |{' |' * (len(heads) - 4)}"
            )
            continue
        cells = [one["drive"], f"{one['minutes']:.0f}", one["model"], f"{one['nrmse']['gap']:.3f}"]
        cells += [" / ".join(f"{x:.2f}" for x in _ks(one, name)) for name in names]
        cells += [", ".join(f"{one['exported'][name]['simulated']['wasserstein']:.2f}" for name in names)]
        gap = one["exported"]["gap"]
        cells += [f"{gap['independent']:.0f}", f"{gap['measured'][1]:.1f} / {gap['got'][1]:.1f}"]
        half = one["second_half"]
        cells += [
            "–"
            if half is None
            else ", ".join(f"{half[name]['simulated']['ks']:.2f}" for name in ("gap", "time_gap"))
        ]
        out.append(f"| {' | '.join(cells)} |")
    return "\n".join([*out, "", *figures(rows, seed)])


def _ks(one: dict[str, Any], name: str) -> tuple[float, float, float]:
    exported, default = one["exported"][name], one["default"][name]
    return exported["simulated"]["ks"], exported["halves"]["ks"], default["simulated"]["ks"]


def figures(rows: Sequence[dict[str, Any]], seed: int) -> list[str]:
    """Figures over all drives."""
    known = [one for one in rows if "reason" not in one]
    out = [
        "| figure | |",
        "|---|---|",
        f"| drives with a vehicle type | {len(known)}/{len(rows)}, first seed {seed} |",
    ]
    for name in QUANTITIES:
        ks = np.array([_ks(one, name) for one in known])
        chance = np.array([one["exported"][name]["chance_ks"] for one in known])
        out.append(
            f"| KS of {name}, median: SUMO / halves of the drive / SUMO's default type | "
            f"{' / '.join(f'{x:.2f}' for x in np.median(ks, axis=0))} |"
        )
        out.append(
            f"| {name}: nearer than the halves; nearer than the default type; within chance | "
            f"{np.sum(ks[:, 0] <= ks[:, 1])}, {np.sum(ks[:, 0] < ks[:, 2])}, {np.sum(ks[:, 0] <= chance)} of {len(known)} |"
        )
    both = [one for one in known if one["second_half"] is not None]
    for name in QUANTITIES if both else ():
        ks = np.array([(one["second_half"][name]["simulated"]["ks"], _ks(one, name)[1]) for one in both])
        out.append(
            f"| KS of {name} in the second half by a model of the first, median; nearer than the first half itself | "
            f"{np.median(ks[:, 0]):.2f} / {np.median(ks[:, 1]):.2f}; {np.sum(ks[:, 0] <= ks[:, 1])} of {len(both)} |"
        )
    out.append(f"| steps with a collision | {sum(one['collisions'] for one in known)} |")
    planted = [(key, *x) for one in known for key, x in one["planted"].items()]
    for key in dict.fromkeys(x[0] for x in planted):
        held = [low <= true <= high for k, true, _, low, high in planted if k == key]
        ratio = [value / true for k, true, value, _, _ in planted if k == key]
        out.append(
            f"| planted {key}: interval holds it; ratio to it, median and range | {sum(held)}/{len(held)}; "
            f"{np.median(ratio):.2f}, {min(ratio):.2f} to {max(ratio):.2f} |"
        )
    cpu = [one["cpu_s"] / max(one["minutes"] / 10, 1.0) for one in known]
    return [
        *out,
        f"| CPU s of the calibration per 10 min, median and largest | {np.median(cpu):.1f}, {max(cpu):.1f} |",
    ]


def page(rows: Sequence[dict[str, Any]], seed: int) -> str:
    """A page with the distribution functions."""
    out = [
        '<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>Exported drivers in SUMO</title>',
        "<style>body{font:14px sans-serif;margin:2em}table{border-collapse:collapse}td,th{padding:.3em .6em;"
        "border-bottom:1px solid #ccc;text-align:left;vertical-align:top}</style>",
        f"<h1>Exported drivers in SUMO</h1><p>Distribution functions: log (grey), vehicle type in SUMO (blue). KS: largest "
        f"difference; in brackets that of the drive's halves. First seed {seed}.</p><table><tr><th>drive</th>",
        *(f"<th>{name.replace('_', ' ')}, {unit}</th>" for name, unit in QUANTITIES.items()),
        "</tr>",
    ]
    for one in rows:
        if "reason" in one:
            out.append(f"<tr><td>{escape(one['drive'])}</td><td colspan=4>{escape(one['reason'])}</td></tr>")
            continue
        out.append(
            f"<tr><td>{escape(one['drive'])}<br>{one['model']}, gap error {one['nrmse']['gap']:.3f}</td>"
        )
        for name in QUANTITIES:
            exported, halves, _ = _ks(one, name)
            out.append(f"<td>{_figure(one['percentiles'][name])}<br>KS {exported:.2f} ({halves:.2f})</td>")
        out.append("</tr>")
    return "\n".join([*out, "</table></html>", ""])


def _figure(of: dict[str, list[float]]) -> str:
    both = of["measured"] + of["exported"]
    low, high = min(both), max(both)
    lines = []
    for key, stroke in (("measured", "#888"), ("exported", "#06c")):
        points = " ".join(
            f"{(x - low) / max(high - low, 1e-9) * WIDTH:.1f},{HEIGHT - k * HEIGHT / 98:.1f}"
            for k, x in enumerate(of[key])
        )
        lines.append(f'<polyline fill="none" stroke="{stroke}" stroke-width="1.5" points="{points}"/>')
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT + 14}" role="img">{"".join(lines)}<text x="0" y="{HEIGHT + 12}" '
        f'font-size="10">{low:.1f}</text><text x="{WIDTH}" y="{HEIGHT + 12}" font-size="10" text-anchor="end">'
        f"{high:.1f}</text></svg>"
    )
