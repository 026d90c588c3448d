"""What the rows that have left a window know of gains, lags and dead times: their inner products, forgotten with time.

A step of the gains is a difference: how well it is seen depends as much on what is known of the gains before it as after.
The products are of the answers of all nodes of the basis, whitened and weighed as they leave, so that they serve for any
later reference. Their offset is their own: the level of minutes ago says nothing of the level now.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.identification.fopdt import answer_columns
from canid.mathematics.identification.fopdt.answer_columns import Columns, Reference
from canid.mathematics.identification.fopdt.regression_rows import Layout
from canid.mathematics.identification.output_filter import equalizer
from canid.values.state_constraints import FINITE, TIME
from canid.values.types import NAN, Array, OutputFilter

# s; drivers change slowly besides by steps, so what is longer ago counts less
MEMORY_S = 120.0


class Earlier(NamedTuple):
    """What is known of the rows until a time."""

    products: Annotated[Array, FINITE] = np.zeros(
        (0, 0)
    )  # (c, c) answers of all nodes, one, output; (0, 0): none
    until: Annotated[float, TIME] = NAN  # s, of the last row


def absorb(
    earlier: Earlier,
    layout: Layout,
    rows: Array,
    made: Columns,
    at: Reference,
    part: slice,
    until: float,
    output_filter: OutputFilter | None,
) -> Earlier:
    """Take in some rows of a window.

    Args:
        earlier: so far.
        layout: of the rows.
        rows: (n, width), the window.
        made: its columns: their weights are taken.
        at: the point of the columns.
        part: of the rows.
        until: s, time of the last of them.
        output_filter: that the output has passed.
    """
    read = part.stop + answer_columns.rows_read(equalizer(output_filter, layout.step))
    basis, usable = answer_columns.basis_columns(layout, rows[:read])
    values, known = answer_columns.white(basis, usable, at, output_filter, layout.step)
    values, weight = values[:, part], made.weight[part] * known[part]
    products = (values * weight) @ values.T
    if earlier.products.size:
        products += math.exp(-(until - earlier.until) / MEMORY_S) * earlier.products
    products.setflags(write=False)
    return Earlier(products, until)


def products(earlier: Earlier, layout: Layout, at: Reference) -> Array:
    """Inner products (c, c) of the columns at a reference, without the rows' own offset."""
    by = answer_columns.turn(layout, at)
    if not earlier.products.size:
        return np.zeros((len(by), len(by)))
    out: Array = by @ earlier.products @ by.T
    constant = layout.inputs
    if out[constant, constant] > 0.0:
        out -= np.outer(out[:, constant], out[constant]) / out[constant, constant]
    return out
