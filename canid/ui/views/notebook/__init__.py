"""Results as fragments of HTML for Jupyter and VS Code: a small inline SVG and a table, without scripts."""
