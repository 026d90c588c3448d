"""The list of published models."""

from __future__ import annotations

from canid.models.diagnosis.rivals.fvdm import FVDM
from canid.models.diagnosis.rivals.gipps import GIPPS
from canid.models.diagnosis.rivals.idm import IDM
from canid.models.diagnosis.rivals.ovrv import OVRV

MODELS = (IDM, FVDM, OVRV, GIPPS)
