"""Names of the signals that canid can do without, in the form of `name_patterns`."""

from __future__ import annotations

from canid.analysis.proposal.name_patterns import NEVER, POSSIBLE, STRONG, USUAL, RolePatterns

_COMMANDED = (
    r"\b(req\w*|rq\w*|cmd|command\w*|desired|wunsch\w*|soll\w*|target|trgt|limit\w*|lim|max|min|mx|mn)\b"
)
_SHOWN = r"\b(display\w*|dsply|hud|cluster|clu|ui|anz\w*|lamp|ind\w*|text|txt|msg)\b"
_OF_OTHERS = r"\b(lead|obj\w*|target|track|rel|relative)\b"
_SAT = r"(gps|gnss|sat)"

OPTIONAL_PATTERNS: dict[str, RolePatterns] = {
    "lead_speed": RolePatterns(
        (
            (
                r"\b(lead|target|obj\w*|preceding|forward veh\w*) ?(veh\w* )?(abs\w* )?(spd|speed|vel\w*)\b",
                USUAL,
            ),
            (r"\bspeed of (forward|preceding) vehicle\b", STRONG),
        ),
        rf"{NEVER}|{_SHOWN}|\b(rel|relative|relspeed|set|limit|lat|side|left|right|long|req\w*|lane)\b",
        narrowest=7,
    ),
    "lead_valid": RolePatterns(
        (
            (
                r"\b(lead|target|obj\w*|tgt) ?(veh\w* )?(is )?(valid|vld|validity|detected|present|"
                r"exists?|available|found|acquired)\b",
                STRONG,
            ),
        ),
        r"\b(side|left|right|rear|lane|lead stopped|button|req\w*|count\w*|cnt)\b",
        widest=2,
        narrowest=1,
    ),
    "cruise_active": RolePatterns(
        (
            (
                r"\b(cruise|acc|ccs?|tempomat|gra|rvv|aacc|tsk) ?(control |ctrl |ctl |sys |system |set |"
                r"func )?(is )?(active|actv|activated|engaged|engage|enabled|regelt|regulating|"
                r"operating)\b",
                STRONG,
            ),
            (r"\bcruise ?(control )?(on|state|status)\b|\bacc ?(on|status|sts|state|mode)\b", USUAL),
        ),
        rf"{NEVER}|{_COMMANDED}|{_SHOWN}|\b(accel\w*|pedal|brake\w*|brk|main|standby|cancel|"
        r"available|ready|ignition|key|type|warn\w*|speed|lead|stopped|torque|gas|throttle|relay|"
        r"resume|sw\w*|fcw|aeb|non|not|inactive|gap|dist\w*|lkas?|prchg|deny|dis)\b",
        elsewhere=r"\b(button\w*|switch\w*|hud|cluster|clu\d*|key\w*|ignition|terminal\w*|power|climate|"
        r"hvac)\b",
        widest=4,
        narrowest=1,
    ),
    "steering_assist": RolePatterns(
        (
            (
                r"\b(lkas?|lka|lane ?(keep\w*|centering|follow\w*) ?(assist )?|ldw lka|steer\w* assist|lfa|hca|tja|lcc) "
                r"?(control |ctrl |sys |system )?(is )?(active|actv|activated|engaged|steering|intervening)\b",
                STRONG,
            ),
        ),
        rf"{NEVER}|{_COMMANDED}|{_SHOWN}|\b(torque|angle|available|ready|warn\w*|button|sw\w*|key|dis\w*|not|non|"
        r"inactive|enabled|left|right|fault|err\w*|speed|count\w*|cnt)\b",
        elsewhere=r"\b(button\w*|switch\w*|hud|cluster|clu\d*|key\w*|display\w*)\b",
        widest=4,
        narrowest=1,
    ),
    "clutch": RolePatterns(
        (
            (
                r"\b(clutch|kupplung\w*|clu(?= (pedal|pdl|ped)\b)|embrayage|clth) ?(pedal |pdl |ped )?(pressed|prssed|"
                r"switch|sw|swtch|depressed|actuated|applied|betaetigt)\b",
                STRONG,
            ),
        ),
        rf"{NEVER}|\b(lock\w*|torque|slip|req\w*|start|interlock|low|compressor|ac|a c)\b",
        widest=2,
        narrowest=1,
    ),
    "accel": RolePatterns(
        (
            (
                r"\b(long|longitudinal|lgt|lng|longt|longitud) ?(comp )?(accel\w*|acc|accn|acce|beschl\w*|"
                r"a)\b|laengsbeschl\w*|l.ngsbeschl\w*",
                STRONG,
            ),
            (
                r"\b(accel\w*|acc|accn|a) ?(x|long|longitudinal|lgt|lng|veh)\b|\bveh\w* ?(lgt |"
                r"long )?(accel\w*|a)\b",
                STRONG - 1,
            ),
            (r"^(accel|acceleration)$", USUAL),
        ),
        rf"{NEVER}|{_COMMANDED}|{_OF_OTHERS}|\b(lat|lateral|vert\w*|pedal|ped|pos|stat|diag|status|"
        r"offset|ofst|bias|ref|setting|est|ovr|over ?gnd|y|z|quer\w*|torque|alt|unfiltered|hd|hdc|"
        r"crash)\b",
        elsewhere=r"\b(radar\w*|track\w*|obj\w*|lead|cruise|acc|control|command|airbag|ab|park\w*)\b",
        narrowest=7,
    ),
    "accel_command": RolePatterns(
        (
            (
                r"\b(accel\w*|acc) ?(cmd|command|request|req)\b|\b(acc|cruise|scc)\w* ?(accel\w*|"
                r"a) ?(req\w*|cmd|command|value)\b",
                STRONG,
            ),
        ),
        rf"{NEVER}|\b(alt|max|min|lim\w*|upper|lower|jerk|brake|brk|torque|pedal|gas|stat\w*|type|"
        r"raw|active|park\w*|lat\w*)\b",
        narrowest=7,
    ),
    "grade": RolePatterns(
        ((r"\b(road |street )?(grade|slope|incline|inclination|gradient|steigung)\b", USUAL),),
        rf"{NEVER}|\b(lat|lateral|pedal|temp\w*|map|pressure|up|down)\b",
        narrowest=6,
    ),
    "altitude": RolePatterns(
        ((r"\b(altitude|elevation)\b", USUAL),), rf"{NEVER}|\b(solar|angle|sun)\b", narrowest=10
    ),
    "east": RolePatterns(((r"^(gnss |gps |pos )?east\w*$", STRONG),), NEVER, narrowest=12),
    "north": RolePatterns(((r"^(gnss |gps |pos )?north\w*$", STRONG),), NEVER, narrowest=12),
    "lat": RolePatterns(((rf"^({_SAT} )?lat\w*tude$", STRONG),), NEVER, narrowest=16),
    "lon": RolePatterns(((rf"^({_SAT} )?lon\w*tude$", STRONG),), NEVER, narrowest=16),
    "yaw_rate": RolePatterns(
        (
            (
                r"\byaw ?(rate|rt|spd|speed|velocity)\b|\bgier(rate|geschw\w*)|\bveh\w* ?yaw ?(comp )?w\b|"
                r"vitesse ?lacet",
                STRONG,
            ),
        ),
        rf"{NEVER}|{_COMMANDED}|{_OF_OTHERS}|\b(offset|ofst|bias|valid|stat|status|diag|lin|"
        r"non ?lin|vz|sign|acc\w*|change|hit|trlr\w*|sta)\b",
        narrowest=8,
    ),
    "gnss_speed": RolePatterns(
        ((rf"\b{_SAT} ?(vehicle )?(spd|speed|vel\w*)\b", STRONG),),
        rf"{NEVER}|\b(vert\w*|limit)\b",
        narrowest=7,
    ),
    "wheel_speed": RolePatterns(
        ((r"\bwheel ?(spd|speed)( avg| average| mean)?$", STRONG),),
        rf"{NEVER}|\b(fl|fr|rl|rr|front|rear|left|right|yaw|lf|rf|lr|steer\w*)\b",
        narrowest=8,
    ),
    "gear": RolePatterns(
        (
            (
                r"\b(current|curr|actual|act|engaged|ist) ?(gear|gang)\b|\bgear ?(act\w*|engaged|current)\b",
                STRONG,
            ),
            (r"^(trans\w* )?gear$|\bgang\b|\brapport\b", STRONG - 1),
        ),
        rf"{NEVER}|{_COMMANDED}|{_SHOWN}|\b(lever|shift\w*|ratio|box|sel\w*|valid|next|"
        r"recommend\w*|steer\w*|neutral)\b",
        widest=8,
        narrowest=3,
    ),
    "reverse": RolePatterns(
        (
            (
                r"^reverse$|\breverse ?(gear|light|engaged|active|lamp)\b|rueckwaertsgang|rueckfahrlicht|"
                r"marche ar\w*",
                USUAL + 1,
            ),
        ),
        rf"{NEVER}|{_COMMANDED}|\b(lever|lock|possible|camera|anf|dist|schalter|traffic)\b",
        widest=2,
        narrowest=1,
    ),
    "engine_speed": RolePatterns(
        (
            (
                r"\b(engine|eng|motor|mot|moteur) ?(spd|speed|rpm|n|drehzahl)\b|motordrehzahl|"
                r"regime ?moteur|\beng ?rpm\b|^rpm$",
                STRONG,
            ),
            (r"\bn (mot|engine)\b|\baout n actl\b|\beng aout\b", USUAL),
        ),
        rf"{NEVER}|{_COMMANDED}|{_SHOWN}|\b(fan|idle|leerlauf\w*|turbo|turbine|starter|electric|em|"
        r"gen\w*|pump|wunsch)\b",
        narrowest=8,
    ),
    "lateral_offset": RolePatterns(
        ((r"\b(lateral|lane|lat) ?(offset|deviation|pos\w*)\b", USUAL),),
        rf"{NEVER}|{_COMMANDED}|{_OF_OTHERS}|\b(left|right|rate|accel\w*|track\w*|lh|rh|sensor\w*|mount\w*)\b",
        elsewhere=r"\b(radar\w*|track\w*|obj\w*|target\w*|park\w*)\b",
        narrowest=7,
    ),
    "steering_angle": RolePatterns(
        (
            (
                r"\b(steer\w*|str|strg|stw|ste) ?(wheel|whl|wh|whl comp|wheel comp)? ?(angle|angl|ang|an|"
                r"winkel|position)\b|lenk(rad)?winkel|angle ?volant|\bsas angle\b",
                STRONG,
            ),
            (r"\bst\w* ?angle\b", POSSIBLE),
        ),
        rf"{NEVER}|{_COMMANDED}|\b(rate|speed|spd|velocity|geschw\w*|offset|ofst|offst|brk\w*|"
        r"torque|tq|tor|vz|sign|frac\w*|fraction|rear|road ?wheel|delta|pinion|motor|init|calib|"
        r"comp est|status|stat|sta|valid|req|diag|column|apply|hp|sensor id|quality|trlr\w*|"
        r"trailer\w*|park\w*)\b",
        elsewhere=r"\b(park\w*|lkas?|lka|ipas|apa|command|control|hca|trailer\w*)\b",
        narrowest=9,
    ),
    "curvature": RolePatterns(
        ((r"\b(road |lane )?curv(ature)?\b", USUAL),),
        rf"{NEVER}|{_COMMANDED}|\b(rate|deriv\w*|left|right|range|conf\w*)\b",
        narrowest=8,
    ),
}
