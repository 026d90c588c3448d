"""DBC text that the format's grammar refuses, read where it has one meaning; each repair with its line."""

from canid.dbc_text.content import Container, Content, Message, Repair, Signal
from canid.dbc_text.text_encoding import decoded
from canid.dbc_text.tolerant_reader import read_tolerantly

__all__ = ["Container", "Content", "Message", "Repair", "Signal", "decoded", "read_tolerantly"]
