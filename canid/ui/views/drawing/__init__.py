"""Drawings: SVG without scripts, and figures for plotly; the panels that several pages show."""
