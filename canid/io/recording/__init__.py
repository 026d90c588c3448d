"""The recorder: from the buses' queues to files that are complete on disk at any time."""
