"""A platoon with known positions, speeds and lengths, written in the layouts of public trajectory sets."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

METRES_PER_FT = 0.3048
# m/s² per s of headway error, m/s² per m/s; s
K1, K2, DELAY = 0.25, 0.6, 0.6
LENGTH = 4.5


class Platoon(NamedTuple):
    """Vehicles of a platoon; the first one leads."""

    t: np.ndarray  # (n,) s
    position: np.ndarray  # (n, vehicles) m, of the front
    speed: np.ndarray  # (n, vehicles) m/s
    accel: np.ndarray  # (n, vehicles) m/s²
    lead: np.ndarray  # (n, vehicles) index of the vehicle ahead; -1: none

    def gap(self, k: int) -> np.ndarray:
        """Bumper to bumper."""
        return self.position[:, k - 1] - LENGTH - self.position[:, k]


def platoon(seed: int, minutes: float = 4.0, rate: float = 10.0, vehicles: int = 3) -> Platoon:
    """Drivers that answer headway and relative speed after a delay, with noise; a lively leader."""
    rng = np.random.default_rng(seed)
    dt, n = 1.0 / rate, round(minutes * 60 * rate)
    t = np.arange(n) * dt
    lead = np.zeros(n)
    for period in (7.0, 11.0, 17.0, 29.0, 43.0):
        lead += rng.uniform(0.6, 1.0) * np.sin(2 * np.pi * t / period + rng.uniform(0, 6.28))
    speed = np.full((n, vehicles), 20.0)
    speed[:, 0] += lead
    position = np.zeros((n, vehicles))
    position[:, 0] = 1000.0 + np.concatenate([[0.0], np.cumsum(0.5 * dt * (speed[1:, 0] + speed[:-1, 0]))])
    accel = np.zeros((n, vehicles))
    accel[:, 0] = np.gradient(speed[:, 0], dt)
    late = round(DELAY / dt)
    for k in range(1, vehicles):
        position[0, k] = position[0, k - 1] - LENGTH - 40.0
        noise = 0.0
        for i in range(n):
            j = max(i - late, 0)
            gap = position[j, k - 1] - LENGTH - position[j, k]
            noise += dt / 2.0 * -noise + 0.12 * np.sqrt(dt) * rng.normal()
            accel[i, k] = K1 * (gap / speed[j, k] - 2.0) + K2 * (speed[j, k - 1] - speed[j, k]) + noise
            if i + 1 < n:
                speed[i + 1, k] = speed[i, k] + dt * accel[i, k]
                position[i + 1, k] = position[i, k] + dt * 0.5 * (speed[i, k] + speed[i + 1, k])
    ahead = np.tile(np.arange(-1, vehicles - 1), (n, 1))
    return Platoon(t, position, speed, accel, ahead)


def _written(path: Path, header: str, rows: list[list[object]], delimiter: str = ",") -> Path:
    lines = ([header] if header else []) + [delimiter.join(map(str, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def ngsim(path: Path, of: Platoon, header: bool = True) -> Path:
    """Feet, ms since 1970, headway from front to front; vehicles after each other, as the set is sorted."""
    names = (
        "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_Length,v_Width,v_Class,v_Vel,"
        "v_Acc,Lane_ID,Preceding,Following,Space_Headway,Time_Headway"
    )
    rows = []
    for k in range(of.speed.shape[1]):
        for i, t in enumerate(of.t):
            ahead = of.lead[i, k]
            spacing = (of.position[i, ahead] - of.position[i, k]) / METRES_PER_FT if ahead >= 0 else 0.0
            rows.append(
                [
                    k + 2,
                    i,
                    len(of.t),
                    1118846980200 + round(1000 * t),
                    16.5,
                    f"{of.position[i, k] / METRES_PER_FT:.6f}",
                    0,
                    0,
                    round(LENGTH / METRES_PER_FT, 9),
                    6,
                    2,
                    f"{of.speed[i, k] / METRES_PER_FT:.8f}",
                    f"{of.accel[i, k] / METRES_PER_FT:.8f}",
                    2,
                    ahead + 2 if ahead >= 0 else 0,
                    0,
                    f"{spacing:.8f}",
                    0,
                ]
            )
    return _written(path, names if header else "", rows, "," if header else "  ")


def highd(path: Path, of: Platoon, leftwards: bool = True) -> Path:
    """25 frames per s; the upper carriageway drives towards negative x."""
    header = (
        "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,backSightDistance,dhw,"
        "thw,ttc,precedingXVelocity,precedingId,followingId,laneId"
    )
    sign = -1 if leftwards else 1
    rows = []
    for k in range(of.speed.shape[1]):
        for i in range(len(of.t)):
            ahead = of.lead[i, k]
            gap = of.position[i, ahead] - LENGTH - of.position[i, k] if ahead >= 0 else 0.0
            rate = sign * of.speed[i, ahead] if ahead >= 0 else 0.0
            rows.append(
                [
                    i + 1,
                    k + 1,
                    0,
                    8,
                    LENGTH,
                    2,
                    f"{sign * of.speed[i, k]:.8f}",
                    0,
                    f"{sign * of.accel[i, k]:.8f}",
                    0,
                    0,
                    0,
                    f"{gap:.8f}",
                    0,
                    0,
                    f"{rate:.8f}",
                    ahead + 1 if ahead >= 0 else 0,
                    0,
                    2,
                ]
            )
    return _written(path, header, rows)


def openacc(path: Path, of: Platoon) -> Path:
    """Five lines of description, then numbered columns."""
    n = of.speed.shape[1]
    blank = "," * (3 * n)
    order = ",".join(f"Car{k}" for k in range(n))
    first = f"Date,04/07/2019{blank}\nVehicle_order,{order}{blank}\nACC,0,1,1{blank}\n"
    text = first + f"Distance_setting,,min{blank}\n,{blank}\n"
    header = ["Time"]
    for k in range(1, n + 1):
        header += [f"Speed{k}", f"E{k}", f"N{k}", *([f"Driver{k}"] if k > 1 else [])]
    header += [f"IVS{k}" for k in range(1, n)]
    lines = [",".join(header)]
    for i, t in enumerate(of.t):
        row = [f"{t:.1f}"]
        for k in range(n):
            row += [f"{of.speed[i, k]:.8f}", f"{of.position[i, k]:.6f}", "0", *(["Human"] if k else [])]
        lines.append(",".join(row + [f"{of.gap(k)[i]:.8f}" for k in range(1, n)]))
    path.write_text(text + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def positions(path: Path, of: Platoon) -> Path:
    """Positions alone, with lane, id and length; all vehicles of one time together."""
    rows = [
        [f"{t:.3f}", 10 + k, 1, f"{of.position[i, k]:.6f}", LENGTH]
        for i, t in enumerate(of.t)
        for k in range(of.speed.shape[1])
    ]
    return _written(path, "time [s],vehicle_id,lane,position [m],length [m]", rows)


def follownet(path: Path, of: Platoon, event: int = 7) -> Path:
    """Gap, own speed, relative speed, lead speed and the event."""
    rows = [
        [event, f"{g:.8f}", f"{v:.8f}", f"{lead - v:.8f}", f"{lead:.8f}"]
        for g, v, lead in zip(of.gap(1), of.speed[:, 1], of.speed[:, 0], strict=True)
    ]
    return _written(path, "event,spacing,self_speed,relative_speed,lead_speed", rows)


def openpilot(path: Path, of: Platoon, start: float = 1533224087.25) -> Path:
    """Each message at its own rate, cells between are empty: carState at the platoon's rate, radarState at half of it."""
    rows = []
    for i, t in enumerate(of.t):
        rows.append([f"{start + t:.6f}", f"{of.speed[i, 1]:.8f}", f"{of.accel[i, 1]:.8f}", "", "", ""])
        if i % 2 == 0:
            rate = of.speed[i, 0] - of.speed[i, 1]
            rows.append([f"{start + t + 0.003:.6f}", "", "", f"{of.gap(1)[i]:.8f}", f"{rate:.8f}", "1"])
    lead = ",".join(f"/radarState/leadOne/{name}" for name in ("dRel", "vRel", "status"))
    header = f"__time,/carState/vEgo,/carState/aEgo,{lead}"
    return _written(path, header, rows)


def sumo(path: Path, of: Platoon, plain: bool = False) -> Path:
    """Floating car data: texts as ids, -1 and no id where there is no leader; `plain`: names without their element."""
    header = (
        "timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_pos;"
    )
    header += "vehicle_lane;vehicle_slope;vehicle_acceleration;vehicle_leaderGap;vehicle_leaderSpeed;vehicle_leaderID"
    rows = []
    for i, t in enumerate(of.t):
        for k in range(of.speed.shape[1]):
            own = [
                f"{t:.2f}",
                f"car.{k}",
                0,
                0,
                90,
                "car",
                f"{of.speed[i, k]:.6f}",
                f"{of.position[i, k]:.4f}",
            ]
            ahead = of.lead[i, k]
            lead: list[object] = [-1, -1, ""]
            if ahead >= 0:
                gap = of.position[i, ahead] - LENGTH - of.position[i, k]
                lead = [f"{gap:.6f}", f"{of.speed[i, ahead]:.6f}", f"car.{ahead}"]
            rows.append([*own, "e0_0", 0, f"{of.accel[i, k]:.6f}", *lead])
    return _written(
        path, header.replace("timestep_", "").replace("vehicle_", "") if plain else header, rows, ";"
    )


def citysim(path: Path, of: Platoon, lanes: tuple[int, int] = (1, 2), head: bool = True) -> Path:
    """Both carriageways in one file: vehicles 1, 2, ... towards +x, 11, 12, ... towards -x; feet, mph, frames at 30/s.

    Args:
        path: of the file.
        of: drives both ways.
        lanes: of the two directions; they may be equal.
        head: whether there are the points of head and tail, and no length, as in the set's own files.
    """
    header = "frameNum,carId,carCenterXft,carCenterYft,speed,laneId," + (
        "headXft,headYft,tailXft,tailYft" if head else "length_ft"
    )
    rows: list[list[object]] = []
    for i in range(len(of.t)):
        for k in range(of.speed.shape[1]):
            for way, first, lane in ((1.0, 1, lanes[0]), (-1.0, 11, lanes[1])):
                front = of.position[i, k] if way > 0.0 else 3000.0 - of.position[i, k]
                y = 30.0 * lane
                shape: list[object] = [f"{LENGTH / METRES_PER_FT:.6f}"]
                if head:
                    shape = [f"{front / METRES_PER_FT:.5f}", y]
                    shape += [f"{(front - way * LENGTH) / METRES_PER_FT:.5f}", y]
                center = f"{(front - way * LENGTH / 2.0) / METRES_PER_FT:.5f}"
                speed = f"{of.speed[i, k] / 0.44704:.6f}"
                rows.append([i, first + k, center, y, speed, lane, *shape])
    return _written(path, header, rows)


def _parts(of: Platoon, n: int) -> list[slice]:
    """Stretches of equal length, as sets cut drives into episodes."""
    size = len(of.t) // n
    return [slice(k * size, (k + 1) * size) for k in range(n)]


def waymo(path: Path, of: Platoon, episodes: int = 3) -> Path:
    """Rows of both vehicles of each pair; every vehicle but the first and the last leads one and follows another."""
    header = (
        "segment_id,local_veh_id,length,local_time,follower_id,leader_id,filter_pos,filter_speed,filter_accer"
    )
    rows = []
    for segment, part in enumerate(_parts(of, episodes)):
        for k in range(1, of.speed.shape[1]):
            for who in (k - 1, k):
                for i in range(part.start, part.stop):
                    at = f"{of.position[i, who] - LENGTH / 2.0:.6f},{of.speed[i, who]:.6f},{of.accel[i, who]:.6f}"
                    t = of.t[i] - of.t[part.start]
                    rows.append([segment, who, LENGTH, f"{t:.1f}", k, k - 1, at])
    return _written(path, header, rows)


def lyft(path: Path, of: Platoon, episodes: int = 3) -> Path:
    """Cases of one pair each, centres and lengths."""
    header = "case_id,time,x_leader,x_follower,v_leader,v_follower,a_leader,a_follower,l_leader,l_follower"
    rows = []
    for case, part in enumerate(_parts(of, episodes)):
        for i in range(part.start, part.stop):
            numbers = (of.position[i, :2] - LENGTH / 2.0, of.speed[i, :2], of.accel[i, :2])
            cells = [f"{x:.6f}" for pair in numbers for x in pair]
            rows.append([case, f"{of.t[i] - of.t[part.start]:.1f}", *cells, LENGTH, LENGTH])
    return _written(path, header, rows)


def ultra_av(path: Path, of: Platoon, episodes: int = 3, unit: float = 1.0) -> Path:
    """Trajectories one below the other; `unit`: s of the time index."""
    header = "Trajectory_ID,Time_Index,ID_LV,Type_LV,Pos_LV,Speed_LV,Acc_LV,ID_FAV,Pos_FAV,Speed_FAV,Acc_FAV,"
    header += "Spatial_Gap,Spatial_Headway,Speed_Diff"
    rows = []
    for trajectory, part in enumerate(_parts(of, episodes)):
        for i in range(part.start, part.stop):
            lead, own = ([f"{x[i, k]:.6f}" for x in (of.position, of.speed, of.accel)] for k in (0, 1))
            gap = of.gap(1)[i]
            rate = of.speed[i, 0] - of.speed[i, 1]
            t = f"{(of.t[i] - of.t[part.start]) / unit:.6g}"
            rows.append(
                [trajectory, t, -1, 0, *lead, 0, *own, f"{gap:.6f}", f"{gap + LENGTH:.6f}", f"{rate:.6f}"]
            )
    return _written(path, header, rows)


def exid(path: Path, of: Platoon, heading: float = 217.0) -> Path:
    """exiD's tracks: 25 frames per s, centres in the plane, lists in a cell where a vehicle is on two lanes.

    The distance headway and the difference of speeds, whose definition and sign no public page states, are wrong on purpose.
    """
    header = (
        "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,xAcceleration,"
        "yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration,traveledDistance,latLaneCenterOffset,laneWidth,"
        "laneletId,laneChange,lonLaneletPos,laneletLength,leadDHW,leadDV,leadTHW,leadTTC,leadId,rearId"
    )
    x, y = np.cos(np.radians(heading)), np.sin(np.radians(heading))
    rows: list[list[object]] = []
    for k in range(of.speed.shape[1]):
        for i in range(len(of.t)):
            at, v, a = of.position[i, k] - LENGTH / 2.0, of.speed[i, k], of.accel[i, k]
            plane = [f"{each * way:.5f}" for each in (v, a) for way in (x, y)]
            lanes = (
                ["0.1;-3.6", 3.75, "1489;1500", 0, "10.0;2.5", 200]
                if i % 50 == 7
                else [0.1, 3.75, 1489, 0, 10, 200]
            )
            lead = of.lead[i, k] + 20 if of.lead[i, k] >= 0 else -1
            own = [3, k + 20, i, i, f"{at * x:.5f}", f"{at * y:.5f}", heading, 1.9, LENGTH, *plane]
            along = [f"{v:.5f}", 0, f"{a:.5f}", 0, f"{at:.3f}"]
            rows.append([*own, *along, *lanes, 77.7, 5.5, 1.5, -1, lead, -1])
    return _written(path, header, rows)


def sumo_xml(path: Path, of: Platoon, leader: bool = True) -> Path:
    """SUMO's --fcd-output as it is written, with the options in a comment and a person in each step."""
    text = '<?xml version="1.0" encoding="UTF-8"?>\n\n<!-- generated by Eclipse SUMO sumo Version 1.20.0\n'
    text += '<sumoConfiguration>\n    <vehicle id="in a comment" speed="99"/>\n</sumoConfiguration>\n-->\n\n<fcd-export>\n'
    parts = [text]
    for i, t in enumerate(of.t):
        parts.append(f'    <timestep time="{t:.2f}">\n')
        for k in range(of.speed.shape[1]):
            ahead = of.lead[i, k]
            front = of.position[i, k]
            own = (
                f'<vehicle id="Bus &lt;{k}&gt; nach Köln" x="{front:.4f}" y="-1.60" angle="90.00" type="car"'
            )
            own += f' speed="{of.speed[i, k]:.6f}" pos="{front:.4f}" lane="e0_0" slope="0.00"'
            if leader:
                gap = of.position[i, ahead] - LENGTH - front if ahead >= 0 else -1
                speed, name = (
                    (of.speed[i, ahead], f"Bus &lt;{ahead}&gt; nach Köln") if ahead >= 0 else (-1, "")
                )
                own += f' acceleration="{of.accel[i, k]:.6f}" leaderID="{name}" leaderSpeed="{speed:.6f}"'
                own += f' leaderGap="{gap:.6f}"'
            parts.append(f"        {own}/>\n")
        parts.append('        <person id="p" x="0" y="0" speed="1.2" pos="0" edge="e0"/>\n    </timestep>\n')
    path.write_text("".join([*parts, "</fcd-export>\n"]), encoding="utf-8")
    return path
