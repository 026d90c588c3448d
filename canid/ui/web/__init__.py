"""The live page: a small web server in a process of its own, and the observer of a session that feeds it."""
