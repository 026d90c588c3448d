"""A recorded log as columns through the steps of the live pipeline: the same samples and events, in a fraction of the time.

What looks at single numbers is done for thousands of frames at once; what goes on from state to state (the lead, the
gate, a clock that was set) is done by the live step itself, only where it has something to do.
"""
