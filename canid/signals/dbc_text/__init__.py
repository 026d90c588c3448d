"""DBC text that the format's grammar refuses, read where it has one meaning; each repair with its line."""

from canid.signals.dbc_text.content import Container, Content, Message, Repair, Signal
from canid.signals.dbc_text.text_encoding import decoded
from canid.signals.dbc_text.tolerant_reader import read_tolerantly

__all__ = ["Container", "Content", "Message", "Repair", "Signal", "decoded", "read_tolerantly"]
