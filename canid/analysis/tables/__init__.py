"""Drives as tables: named columns of a CSV or Parquet file, or of arrays, through the pipeline of CAN logs."""
