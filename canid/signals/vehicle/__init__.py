"""A vehicle: its DBC files and its TOML file. Decoding of frames to readings by role, in SI, and encoding."""

from canid.signals.vehicle.decoding import decoder, is_mapped, mapped_ids
from canid.signals.vehicle.decoding_state import Decoding, missing
from canid.signals.vehicle.encoding import encoder
from canid.signals.vehicle.mapping import LeadConfig, RoleMap, SignalMap, TrackMap, Vehicle
from canid.signals.vehicle.vehicle_buses import on_buses
from canid.signals.vehicle.vehicle_file import locate, read_vehicle
from canid.values.roles import ROLES

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
