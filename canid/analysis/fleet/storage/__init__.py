"""The folder of a fleet: journal, Parquet files, locks, and DuckDB's views of them."""
