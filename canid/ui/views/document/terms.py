"""Terms of docs/glossary.md that results use, a sentence each, and where a text uses them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from markupsafe import Markup, escape

# as in docs/glossary.md, to the letter
TERMS = {
    "adequacy test": "does the fitted model leave any structure in its residual",
    "baseline": "the model without any effect: two FOPDT responses, an offset, the pedal's floor",
    "candidate": "an effect that is fitted to a drive",
    "closed loop": "driver and car simulated behind the recorded lead, each answering the other",
    "coherence": "share of the residual's variance at one frequency that an input explains, 0 to 1",
    "dead time": "pure delay, s",
    "delay margin": "additional delay at which the loop of driver and car becomes unstable, s",
    "evidence": "2 Δ log likelihood over the model without the cause, over the variance inflation of the score; no unit",
    "extended model": "the baseline with the causes that were named",
    "headway error": "headway − desired headway, s",
    "held-out data": "data that neither chose nor fitted a model",
    "innovation": "the whitened residual: what the past does not predict",
    "lag": "time constant of a first-order lag, s",
    "log score": "log density that a model gave the next sample before it came; nats (natural logarithms) per minute",
    "masked": "left out of every fit: no person drives there, or an input is invalid",
    "NRMSE": "rms error in closed loop over the rms of what was measured",
    "null": "what the same effects gain on simulated drives that have none of them: the driver's own noise in the loop",
    "p-value": "the chance of so much structure by noise alone; no unit",
    "phase margin": "additional phase lag at which the loop of driver and car becomes unstable, °",
    "range rate": "lead speed − own speed, m/s; positive: the gap opens",
    "remnant": "the part of the driver's output that no input explains",
    "residual": "measured − simulated output",
    "rival": "an effect that explains the same data as well",
    "surrogate": "an effect that helps while the model is still not adequate",
    "threshold": "the evidence that chance alone reaches in 0.5 % of drives, all candidates counted",
}
# what is written for a term besides its plural
_SHORT = {"nats/min": "log score"}
_NAMES = {name.lower(): name for name in TERMS} | _SHORT
_ANY = re.compile(rf"(?<![\w-])({'|'.join(sorted(_NAMES, key=len, reverse=True))})s?(?![\w-])", re.IGNORECASE)
# tags, and what is no text of its own
_TAG = re.compile(r"(<code>.*?</code>|<[^>]*>)")


def used(texts: Iterable[str]) -> list[str]:
    """Terms in texts with their sentences, in the order of the alphabet.

    Example:
        >>> used(["evidence 96", "two rivals"])[1]
        'rival: an effect that explains the same data as well'
    """
    names = {_NAMES[mention[1].lower()] for text in texts for mention in _ANY.finditer(text)}
    return [f"{name}: {sentence}" for name, sentence in TERMS.items() if name in names]


class TermLinks:
    """Links from the terms of one page to their sentences at its end."""

    def __init__(self) -> None:
        """No term yet."""
        self._names: set[str] = set()

    def linked(self, text: str) -> Markup:
        """Text in which each term is a link where it first stands.

        Example:
            >>> TermLinks().linked("its rivals")[:44]
            Markup('its <a class="term" href="#term-rival" title')
        """
        here: set[str] = set()

        def link(mention: re.Match[str]) -> str:
            name = _NAMES[mention[1].lower()]
            if name in here:
                return mention[0]
            here.add(name)
            return f'<a class="term" href="#{_id(name)}" title="{escape(TERMS[name])}">{mention[0]}</a>'

        pieces = _TAG.split(str(escape(text)))
        pieces[::2] = [_ANY.sub(link, piece) for piece in pieces[::2]]
        self._names |= here
        return Markup("".join(pieces))

    def listed(self) -> list[tuple[str, str, str]]:
        """Id, name and sentence of each term that was linked."""
        return [(_id(name), name, sentence) for name, sentence in TERMS.items() if name in self._names]


def _id(name: str) -> str:
    return f"term-{name.lower().replace(' ', '-')}"
