"""A run of a fleet: what is known is skipped, the rest analysed in child processes, on this machine or on Dask."""
