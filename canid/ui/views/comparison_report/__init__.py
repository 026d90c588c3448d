"""A comparison of two drivers as text, page, notebook fragment and JSON, and the figures of its page."""
