"""Playback of a log at the pace of a session, and the tables of its signals meanwhile."""
