"""The list of published models."""

from __future__ import annotations

from canid.diagnosis.rivals.fvdm import FVDM
from canid.diagnosis.rivals.gipps import GIPPS
from canid.diagnosis.rivals.idm import IDM
from canid.diagnosis.rivals.ovrv import OVRV

MODELS = (IDM, FVDM, OVRV, GIPPS)
