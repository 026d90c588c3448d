"""A car: its DBC files and its TOML. Frames → readings by role, in SI, and back for the simulator."""

from canid.vehicle.decoding import Decoding, decoder, missing, seen
from canid.vehicle.encoding import encoder
from canid.vehicle.mapping import LeadConfig, RoleMap, SignalMap, TrackMap, Vehicle
from canid.vehicle.proposing import propose
from canid.vehicle.reading import locate, read_vehicle
from canid.vehicle.roles import ROLES

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
    "locate",
    "missing",
    "propose",
    "read_vehicle",
    "seen",
]
