"""False alarms, delay and cost of the change monitor."""
