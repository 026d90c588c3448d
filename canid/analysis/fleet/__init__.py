"""Many drives of many drivers: what is to be analysed, the analysis of one log, who runs it, where results are stored."""
