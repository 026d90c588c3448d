"""A study as files: page, JSON, CSV tables and SVG figures."""
