"""The confidence level of every interval that canid states, 95 % two-sided, and the quantiles that belong to it."""

from __future__ import annotations

# share of intervals that miss the truth; of each side one half
MISS = 0.05
LEVEL = 1.0 - MISS
TAIL = 0.5 * MISS
# of a bootstrap or a posterior, the ends of the interval
QUANTILES = (TAIL, 1.0 - TAIL)
# standard normal: half the interval's width in standard deviations
NORMAL_QUANTILE = 1.959964
# the same to two decimals, as the diagnosis states its intervals: a report of the same drive keeps its last digits
SIGMAS = 1.96
# chi-squared with one degree of freedom, to two decimals: the fall of 2 log likelihood from its maximum to the ends of a
# profile interval (Wilks 1938)
CHI_SQUARED_QUANTILE = 3.84
