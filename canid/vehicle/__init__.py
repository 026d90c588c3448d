"""A vehicle: its DBC files and its TOML file. Decoding of frames to readings by role, in SI, and encoding."""

from canid.vehicle.decoding import Decoding, decoder, is_mapped, mapped_ids, missing
from canid.vehicle.encoding import encoder
from canid.vehicle.mapping import LeadConfig, RoleMap, SignalMap, TrackMap, Vehicle
from canid.vehicle.roles import ROLES
from canid.vehicle.vehicle_file import locate, read_vehicle

__all__ = [
    "ROLES",
    "Decoding",
    "LeadConfig",
    "RoleMap",
    "SignalMap",
    "TrackMap",
    "Vehicle",
    "decoder",
    "encoder",
    "is_mapped",
    "locate",
    "mapped_ids",
    "missing",
    "read_vehicle",
]
