"""Trigger conditions: their text, the signals that they name, and their truth frame by frame.

`trigger` and `conditions` import nothing else, so that recording can begin; `resolution` and `evaluation` need a vehicle.
"""
