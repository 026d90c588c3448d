"""A vehicle: its DBC files and its TOML file. Decoding of frames to readings by role, in SI, and encoding."""

from canid.values.roles import ROLES
from canid.vehicle.decoding import decoder, is_mapped, mapped_ids
from canid.vehicle.decoding_state import Decoding, missing
from canid.vehicle.encoding import encoder
from canid.vehicle.mapping import LeadConfig, RoleMap, SignalMap, TrackMap, Vehicle
from canid.vehicle.vehicle_buses import on_buses
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
    "on_buses",
    "read_vehicle",
]
