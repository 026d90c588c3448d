"""Differences between groups of drives, such as settings of the ACC or cars: a mixed model with drivers as random effects.

The means of groups are fixed effects of the hierarchical model of `gibbs` (Laird & Ware 1982), fitted anew with them: a
spread between drivers that holds the groups' differences would hide them. Where two or more drivers drive both groups, each
driver's own drives are compared, and the error is the scatter of the drivers' differences (`driver_contrasts`); where each
drives one, the spread between drivers is the error: given B and W the means are then normal, and p-values and intervals are
those of the mixture over draws.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from canid.mathematics.population import normal_mixture, scaling
from canid.mathematics.population.drive_table import DriveTable, Flags, Index, known
from canid.mathematics.population.driver_contrasts import MeanContrast, mean_contrast
from canid.mathematics.population.false_discovery import RATE, adjusted
from canid.mathematics.population.gibbs import Data, Draws
from canid.mathematics.population.hierarchical import run
from canid.mathematics.population.spread import wide
from canid.values.types import NAN, Array

# drives below which a group is left out: of one drive there is no repetition
MIN_DRIVES = 2
# groups with the most drives that are compared: 66 pairs
MAX_GROUPS = 12
# draws that a p-value is averaged over
DRAWS = 500
# drivers of one group below which a comparison between drivers says little
FEW_DRIVERS = 4


class Contrasts(NamedTuple):
    """Of m pairs of groups. NaN: not known of both."""

    groups: tuple[str, ...]
    a: Index  # (m,) places in `groups`
    b: Index
    difference: Array  # (m, p) b - a
    low: Array  # of the 95 % interval
    high: Array
    each: Array  # (m, p) p-value of one parameter
    each_adjusted: Array  # (m, p) for the false discovery rate over all pairs and parameters
    p_value: Array  # (m,) of all parameters together
    adjusted: Array  # (m,)
    different: Flags  # (m,)
    both: Array  # (m,) drivers who drive both groups
    drivers: Array  # (m, 2) drivers of each
    status: tuple[str, ...]  # (m,)
    says: tuple[str, ...]


def contrasts(table: DriveTable, labels: tuple[str, ...], *, rate: float = RATE, seed: int = 0) -> Contrasts:
    """Compare groups of drives, each pair of them.

    Args:
        table: n drives.
        labels: (n,) group of each, such as `table.group` or `table.car`; "": left out.
        rate: false discovery rate.
        seed: of the sampler.

    Raises:
        ValueError: as many labels as drives are needed.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> rng = np.random.default_rng(1)
        >>> setting = np.tile([0.0, 1.0], 15)
        >>> gain = np.repeat(rng.normal(5.0, 1.0, 5), 6) + 0.6 * setting + 0.2 * rng.standard_normal(30)
        >>> names = tuple(np.repeat(list("abcde"), 6))
        >>> table = drive_table(("K",), gain[:, None], np.full((30, 1), 0.01), names)
        >>> pair = contrasts(table, tuple(np.where(setting > 0.0, "long", "short")))
        >>> pair.groups, bool(pair.different[0]), bool(-0.9 < pair.difference[0, 0] < -0.3), int(pair.both[0])
        (('long', 'short'), True, True, 5)
    """
    if len(labels) != len(table.driver):
        raise ValueError(f"{len(labels)} labels of {len(table.driver)} drives: give one per drive")
    p = len(table.names)
    has = known(table)
    names, says = _groups(
        [str(x) for x, some in zip(labels, np.any(has, axis=1).tolist(), strict=True) if some and x]
    )
    group = np.array([names.index(x) if x in names else -1 for x in labels], dtype=np.intp)
    has[group < 0] = False
    first, second = np.triu_indices(len(names), 1)
    a, b = first.astype(np.intp), second.astype(np.intp)
    if not len(a):
        none, each = np.zeros(0), np.zeros((0, p))
        says = (*says, "fewer than two groups of two or more drives: nothing to compare")
        return Contrasts(
            names,
            a,
            b,
            each,
            each,
            each,
            each,
            each,
            none,
            none,
            none > 0.0,
            none,
            np.zeros((0, 2)),
            (),
            says,
        )
    column = np.flatnonzero(has.any(axis=0)).astype(np.intp)
    row = np.flatnonzero(has.any(axis=1)).astype(np.intp)
    order = row[np.lexsort((group[row], table.driver[row]))]
    units = scaling.units(table, has)
    data, _ = scaling.data(table, has, order, column, units)
    data = data._replace(group=group[order])
    draws, reduction = run(data, seed)
    if reduction > 1.1:
        says = (*says, f"the sampler did not converge (potential scale reduction {reduction:.2f})")
    hat = draws.mean_hat.reshape(-1, len(names), len(column))
    covariance = draws.mean_covariance.reshape(-1, len(names), len(column), len(names), len(column))
    thin = np.linspace(0, len(hat) - 1, min(DRAWS, len(hat))).astype(np.intp)
    hat, covariance = hat[thin], covariance[thin]

    # drivers by group and parameter: both sides of a contrast need a driver who knows it
    cells = np.zeros((len(table.drivers), len(names), len(column)), dtype=bool)
    np.logical_or.at(cells, (table.driver[order], group[order]), has[order][:, column])
    m, k = len(a), len(column)
    value, low, high, each = (np.full((m, k), NAN) for _ in range(4))
    joint = np.full(m, NAN)
    for pair in range(m):
        g, h = a[pair], b[pair]
        common: Flags = np.asarray(cells[:, g].any(axis=0)) & np.asarray(cells[:, h].any(axis=0))
        if not common.any():
            continue
        d = (hat[:, h] - hat[:, g])[:, common]
        c = covariance[:, g, :, g] + covariance[:, h, :, h] - covariance[:, g, :, h] - covariance[:, h, :, g]
        c = c[:, common][:, :, common]
        sd = np.sqrt(np.einsum("dkk->dk", c))
        each[pair, common] = np.mean(chdtrc(1.0, (d / sd) ** 2), axis=0)
        for x, found_ in zip((value, low, high), normal_mixture.interval(d, sd), strict=True):
            x[pair, common] = found_ * units.size[column][common]
        crossed = _within_drivers(data, draws, g, h)
        for place in np.flatnonzero([contrast.drivers > 1 for contrast in crossed]):
            iv = crossed[place].difference
            for x, end in zip((value, low, high), iv, strict=True):
                x[pair, place] = end * units.size[column][place]
            each[pair, place] = crossed[place].p_value
        # of parameters that are correlated: Bonferroni's of the clearest one holds whatever their dependence. The distance
        # in all of them together does not, where B is known from few drivers: of five parameters without any difference
        # it had p < 5 % in 15 to 18 % of 120 fleets of 4 to 30 drivers
        tested = each[pair, np.isfinite(each[pair])]
        if len(tested):
            joint[pair] = min(1.0, len(tested) * float(tested.min()))
    drives: Flags = np.asarray(cells.any(axis=2))
    of_both = np.array(
        [int((drives[:, g] & drives[:, h]).sum()) for g, h in zip(a, b, strict=True)], dtype=np.float64
    )
    sides = np.array(
        [[drives[:, g].sum(), drives[:, h].sum()] for g, h in zip(a, b, strict=True)], dtype=np.float64
    )
    fdr = adjusted(joint, dependent=m > 1)
    return Contrasts(
        names,
        a,
        b,
        wide(value, column, p, 1),
        wide(low, column, p, 1),
        wide(high, column, p, 1),
        wide(each, column, p, 1),
        # pairs share groups, and parameters of a drive are correlated
        wide(adjusted(each, dependent=True), column, p, 1),
        joint,
        fdr,
        np.nan_to_num(fdr, nan=1.0) <= rate,
        of_both,
        sides,
        tuple(_status(int(x), int(y.min())) for x, y in zip(of_both, sides, strict=True)),
        says,
    )


def _within_drivers(data: Data, draws: Draws, g: int, h: int) -> list[MeanContrast]:
    """Contrasts of two groups within drivers, of each parameter."""
    within = np.einsum("dckk->dck", draws.within).mean(axis=(0, 1))
    weight = np.maximum(draws.drive_weight.mean(axis=0), 1e-9)
    here: Flags = np.asarray((data.group == g) | (data.group == h))
    second: Flags = np.asarray(data.group == h)
    return [
        mean_contrast(
            data.y[k, 0], (data.s[k, k, 0] + within[k]) / weight, data.known[k, 0], data.driver, second, here
        )
        for k in range(len(data.y))
    ]


def _groups(labels: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Groups with enough drives, in the order of their names; and what is left out."""
    counts = {name: labels.count(name) for name in sorted(set(labels))}
    enough = [name for name, count in counts.items() if count >= MIN_DRIVES]
    few = [name for name in counts if name not in enough]
    says = [f"groups of one drive are left out: {', '.join(few)}"] if few else []
    if len(enough) > MAX_GROUPS:
        says.append(f"the {MAX_GROUPS} groups with the most drives of {len(enough)} are compared")
        enough = sorted(sorted(enough, key=lambda name: -counts[name])[:MAX_GROUPS])
    return tuple(enough), tuple(says)


def _status(both: int, fewest: int) -> str:
    if both >= 2:
        return f"{both} drivers drive both groups"
    who = "one driver drives" if both else "no driver drives"
    said = f"{who} both groups: the spread between drivers is the error"
    if fewest < FEW_DRIVERS:
        said += f", and {fewest} driver{'s' * (fewest != 1)} of one group say little; let drivers drive both"
    return said
