"""A session on a bus: the recorder here, the estimators in a process of their own; the listener behind python-can."""
