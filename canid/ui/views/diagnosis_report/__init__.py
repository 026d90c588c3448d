"""A diagnosis as text, page, notebook fragment and JSON, and the figures of its page."""
