"""The analysis of logs, one after the other in child processes, on this machine or on Dask."""
