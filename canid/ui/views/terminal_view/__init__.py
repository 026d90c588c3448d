"""The terminal view: what a session or a replay shows on a terminal of 40x15 to 200x60 characters.

`state.update` takes the outputs of the pipeline into a `state.View`; `picture.render` draws it as lines of a given size.
"""
