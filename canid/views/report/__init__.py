"""The diagnosis as one self-contained HTML page, and what all pages share: style sheet, script, templates."""
