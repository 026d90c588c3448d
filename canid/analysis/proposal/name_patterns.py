"""Names that car makers give the signals of each role: data for `name_score`.

Patterns apply to a name as words (`signal_words.words`): "ApedPos_Pc_ActlArb" is "aped pos pc actl arb". Sources: the
public DBC files of opendbc, SAE J1939-71, AUTOSAR's short names (AISpecification), and the German, French, Japanese
and Korean makers' abbreviations.
"""

from __future__ import annotations

from typing import NamedTuple

# a name that can hardly mean anything else; one that usually means it; one that may mean it
STRONG, USUAL, POSSIBLE = 6.0, 4.0, 2.0


class RolePatterns(NamedTuple):
    """What the names of a role's signals contain, and what they must not."""

    found: tuple[tuple[str, float], ...]  # (pattern, points); the best one counts
    excluded: str  # in the signal's name: it is another quantity
    here: str = r"$^"  # in the message's name: speaks for it
    elsewhere: str = r"$^"  # in the message's name: speaks against it
    widest: int = 32  # bits
    narrowest: int = 6  # bits


_VEHICLE = r"(veh|vehicle|vhcl|vehi|car|ego|own|host|fzg|fahrzeug|vehicule|kfz)"
_SPEED = r"(spd|speed|vel|velo|velocity|v|geschw|geschwindigkeit|vitesse|vit)"
_ACCELERATOR = (
    r"(acc|accel|acceler|accelerator|accelerateur|acceleration|acclr|accr|acl|accl|gas|"
    r"throttle|fahr|drv|driver|driving)"
)
_PEDAL = r"(pedal|ped|pedl|pdl|pedale|pd)"
_AHEAD = (
    r"(lead|object|obj|objekt|zielobjekt|zielfahrzeug|target|tgt|trgt|vorausfahrer|vordermann|cible|preceding|precd|ahead|"
    r"front veh\w*|fwd veh\w*"
    r"|forward veh\w*|same lane( \d+)?|veh\w* ahead|prec veh\w*|fahrzeug voraus)"
)
_DISTANCE = r"(dist|distance|dst|range|rng|gap|abst|abstand|dx|clearance)"
_BRAKE = r"(brake|brk|brak|break|bremse|brems|frein|br)"

# what makes any name another quantity: counters, checksums, quality bits, buttons, limits, requests
NEVER = (
    r"\b(counter|count|cnt|ctr|cntr|crc\d*|checksum|chk\w*|chks\w*|cksum|cs|alive|rolling|"
    r"parity|qf|q ?bit|qbit|quality|qual\w*"
    r"|qlty|inval\w*|fault\w*|flt|falt|fail\w*|failure|err|error\w*|defect|def|plaus\w*|"
    r"unplaus\w*|spare|reserv\w*|unused|calib\w*"
    r"|cal|reset|dtc|timeout|button|btn|taste\w*|stored|saved|history|unit|einheit\w*|toggle|"
    r"menu|config\w*|cfg|installed"
    r"|existence|exist|serial|version|sensitivity|zaehler|frei|fehler\w*|komplement|"
    r"complement|backup|inhibit\w*|inh"
    r"|avail\w*|capab\w*|supported|protect\w*|crypt\w*|mac|freshness|selfcheck|unknown|maybe|"
    r"perhaps|odd|review|undefined|invert\w*|inv|q|odo\w*|trip|threshold|thresh|tolerance)\b"
)
_NOT_MEASURED = (
    r"\b(req|reqd|requ|request\w*|rq\w*|cmd|command\w*|desired|des|demand\w*|dmd|wunsch\w*|"
    r"soll\w*|consigne|set|setp\w*|setpoint|target|trgt"
    r"|trg|tgt|ziel\w*|limit\w*|lim|mx|max\w*|mn|min|virtual|virt|simul\w*|fake|predict\w*|"
    r"predicted|hold|reference model|default|dflt)\b"
)
_SHOWN = (
    r"\b(display\w*|dsply\w*|dspl\w*|disp|dis|displ|hud|cluster|clu|ui|anz\w*|anzeige\w*|"
    r"angez\w*|angezeigte|digital|dash\w*|rough|low ?res"
    r"|lowres|speedo(?!f)\w*|speedometer|tacho\w*|vanz\w*|affich\w*|indicated|gauge)\b"
)
_SHOWN_BY = (
    r"\b(cluster|clu\d*|hud|dash\w*|ic|ipc|ipm|icm|kombi|combi|instrument\w*|display|meter|"
    r"met\d*\w*|cmb|tableau|bsi|nav\w*|audio|radio"
    r"|infotainment|tmu|gps|gnss|apim|telem\w*|button\w*|switch\w*|ui|obd\w*|diag\w*|rsa\d*|"
    r"sign\w*|traffic|camera|cam|hvac|clima\w*)\b"
)
_SIDE = (
    r"\b(left|right|li|re|rear|lft|rgt|rght|vl|vr|hl|hr|lf|rf|lr|rr|rl|fl|fr|links|rechts|"
    r"gauche|droit\w*|side|lane (left|right))\b"
)

ROLE_PATTERNS: dict[str, RolePatterns] = {
    "pedal": RolePatterns(
        (
            (rf"\b{_ACCELERATOR} ?{_PEDAL}\d*\b", STRONG),
            (rf"\b{_PEDAL} ?(\w+ )?(acc|accel\w*|accr|accelerateur|gas|throttle|driver)\b", STRONG),
            (
                r"\ba ?ped(al)?\b|fahrpedal|gaspedal|acceleratorpedal|accel(erator)?ped(al)?\w*|"
                r"\bapp ?s\d?\b",
                STRONG,
            ),
            (r"\b(accped\w*|accpdl\w*|accelpdl\w*|gaspdl\w*|aclpdl\w*|acclpd\w*)\b", STRONG),
            (
                r"\b(pedal|pedale) ?(pos\w*|posn|position|value|wert|pct|percent\w*|stellung|weg|ratio|"
                r"rat)\b",
                USUAL,
            ),
            (r"\bpedalwert\b|enfoncement ?(pedale)?|position ?pedale|\bpedalstellung\b", USUAL),
            (
                r"\baccel\w* ?(actu\w* )?(pos\w*|posn|position|opening|pct|percent\w*)\b|\be ?accp\b|"
                r"\bpv av\b",
                USUAL,
            ),
            (r"^(\w+ )?pedal$", USUAL),
            (r"\bapp\d?\b( (pos|pct|percent|position|r|angle))?", USUAL),
            (
                r"\b(driver|drv|drvr|human|user) ?(gas|throttle|accel\w*)\b|\b(gas|throttle) ?(human|"
                r"driver|user)\b",
                USUAL + 1,
            ),
            (r"\bgas ?(pos\w*|posn)$", USUAL),
            (r"\bgas$", POSSIBLE),
            (r"\b(throttle|tps|papillon)\b", POSSIBLE),
        ),
        rf"{NEVER}|{_NOT_MEASURED}|{_SHOWN}|\b(bra?k\w*|brake\w*|brem\w*|b ?ped|frein|clutch|"
        r"clu\w*|kuppl\w*|embrayage|cl)\b"
        r"|\b(press|pressed|released|rel|depress\w*|active|inactive|act|on|off|kick ?down|kd|idle|"
        r"switch|sw|stat\w*|sts|status|state|flag)\b"
        r"|\b(grad|gradient\w*|fahrpedalgradient|rate|speed|spd|pc ?rate|derivative|dt|cruise|"
        r"acc torque|pcm|volt\w*|voltage|current"
        r"|remote|pedestrian\w*|valve|override|overr\w*|learn\w*|cc|acc gas|lvl|level|hpc|body|"
        r"plate|combo|full|maybe|safety|fahrpedalwerte|ungenau\w*|force|kraft|torque|mom\w*|"
        r"feedback|haptic|warning|warn|drosselklapp\w*)\b",
        r"\b(engine|eng\w*|ems\d*|motor|mo|gas|throttle|pedal\w*|accel\w*|ecm|pcm|powertrain|"
        r"power|pt|di|vcu|mcu|inverter|eec2|ecu\d*|drive\w*|accped|acc)\b",
        rf"{_SHOWN_BY}|\b(hud|cruise|command|cmd|control)\b",
        16,
        6,
    ),
    "speed": RolePatterns(
        (
            (
                rf"\b{_VEHICLE} ?((abs|abslt|ref|act|actual|long|lgt|lng|longitudinal|x|over ?gnd|"
                rf"over ?ground|ground|motion|true) )?{_SPEED}\b",
                STRONG,
            ),
            (
                r"\b(spd|speed|vel|velocity|v|vitesse|geschwindigkeit|geschw) ?(de |du |of )?(the )?(veh|"
                r"vehicle|vehicule|car|ego|fzg|fahrzeug)\b",
                STRONG,
            ),
            (
                r"\bv ?(signal|ref|ego|veh|fzg|fahrzeug|car|vehicle)\b|\b(vspd|vspeed|vehspd|vehspeed|"
                r"vehiclespeed|carspeed|vehspd\w*|vveh|vego|vfzg)\b",
                STRONG,
            ),
            (r"\bwheel based veh\w* speed\b|fahrzeuggeschw\w*|vehgeschw\w*|vitesse ?veh\w*", STRONG),
            (
                r"^(\w{1,4} )?(forward|longitudinal|long|lgt|ground|abs|true)? ?(speed|velocity|"
                r"geschwindigkeit|vitesse)( \d)?( (kph|kmh|mph|ms|mps))?$",
                USUAL + 1,
            ),
            (r"\b(xmission|transmission|trans) speed\b", STRONG + 0.5),
            (r"\brad kmh\b|\bgeschwindigkeit\b", USUAL),
            (r"\b(?<!sld )vs( [a-z]{2,4})?$", USUAL),
            (r"\bvx$|\bvlgt\b|\bsp ?1\b|\bspd$", POSSIBLE + 1),
            (r"^(\w+ )?speed( \d)?$", POSSIBLE),
        ),
        rf"{NEVER}|{_NOT_MEASURED}|{_SHOWN}|\b(lead|obj\w*|object|track|rel|relative|relativ\w*|"
        r"opp|other|preceding|ahead|fwd)\b|\bv?zielfahrzeug"
        r"|\b(wheel(?! based)|whl\w*|rad(?! kmh)|radgesch\w*|raddreh\w*|(?<!vehicule )roue\w*|"
        r"axle|shaft|turbine|turb|pump|fan|blower|wiper|wischer\w*|engine|eng (spd|speed)|motor|"
        r"mot|rotor|gen)\b"
        r"|\b(yaw|gier\w*|lat|lateral|latrl|vy|vert|roll|rol|pitch|steer\w*|strg|str|sas|angle|"
        r"angl|angular|ang|lenk\w*|volant|an|w|a)\b"
        r"|\b(cruise|cc|ccs|acc|gra|regel\w*|begrenz\w*|legal|road|map|fleet|gps|gnss|nav\w*|mpp|"
        r"urea|pedal|window|seat|charge|limp|trailer|trlr|over speed|overspeed|warn\w*|wrn|alert|"
        r"sign|zone|switch|sw)\b"
        r"|\b(stat|status|state|flag|direction|dir|fahrtrichtung|sign|decimal|inverse|offset|"
        r"slider|mode|mde|valid|vld|change|step|gear|shift|scale|factor|comp|corr|low ?speed|"
        r"high ?speed|up|down|zero|standstill|stop\w*|diff\w*|err|energy|e|pw|eff|id|on|l|l?ck|"
        r"lock|strt|start|time|rpm|uint|ueberw|ersatz|abbruch|stab|drv dir|qualifier|calc ?qf|tmp|"
        r"vr)\b",
        r"\b(esp\w*|esc\d*|abs\w*|vsc\w*|ebc\w*|ebcm|vdc|vsa|dsc|ehb|wheel\w*|speed\w*|motion|"
        r"dyn\w*|vehicle|veh|ecm|engine|eng|ems\d*|bremse\w*|brake\w*|brk|ccvs\d*|di|ego)\b",
        rf"{_SHOWN_BY}|\b(steer\w*|eps|mdps|sas\w*|object\w*|track\w*|radar\w*|target\w*|park\w*|"
        r"trailer\w*|cruise\w*|acc|button\w*|wiper|fan|blink\w*|curve|crz|event\w*)\b",
        32,
        8,
    ),
    "gap": RolePatterns(
        (
            (
                rf"\b{_AHEAD} ?(veh\w* |car )?(long\w* |lgt\w* |lng |x |rel\w* |act |"
                rf"radar )?{_DISTANCE}\b( (long|lgt|x|long l actl))?",
                STRONG,
            ),
            (
                r"\b(dist|distance|range|abst|abstand) ?(to |of |zu |zum |from |de la |du )?(the )?(lead|"
                r"obj|object|objekt|zielobjekt|target|tgt|front|forward|preceding|vehicle ahead|vorausf\w*|cible|leading)\b",
                STRONG,
            ),
            (r"\b(long|longitudinal|lgt) ?(dist|distance|pos|position|range)\b|\bdistance long\b", USUAL),
            (r"\binter ?veh\w* ?(dist\w*|gap)\b|\bdistance ?inter\w*", STRONG),
            (r"\bdistance gap\b", USUAL),
            (r"^(\w{1,5} )?(range|distance|dist|gap|abstand|headway dist\w*|following distance)$", USUAL - 1),
        ),
        rf"{NEVER}|{_SIDE}|{_SHOWN}|\b(lat|lateral|latrl|dy|y|vert|height|width|length|rate|rt|spd|"
        r"speed|vel\w*|v|accel\w*|a|setting|set\w*|sel\w*|req\w*|rq\w*|cmd|command|desired|des|"
        r"soll|wunsch"
        r"|park\w*|pas|pdc|ultra\w*|uss|sonar|curb|obst\w*|closest|(?<!same )lane|trk\d*|track\w*|"
        r"stop ?line|line|sign|total|travel\w*|remain\w*|fuel|el|nut|stopover|next|nav\w*|time|"
        r"zeit\w*|bar|level|lvl|index\w*|warn\w*|wrn"
        r"|valid|vld|stat|status|state|sts|conf\w*|std\w*|sigma|var|press|pressed|incr|decr|up|"
        r"down|inc|dec|stopped|alert|swap|follow|beam|maybe|oil|service|view|coverage|mode|mde|"
        r"class|type|branch|hdg|highlight"
        r"|offramp|solar|light|alt|tau|exit|turn|hazard|raw power|virtual|end|spacing|cross\w*|"
        r"hitch\w*|lc|fap|lsc|ntfy|fcw|min|max|mx|mn|lim\w*|threshold|num|numb|rear|anz\w*|"
        r"tempor\w*|mod)\b",
        r"\b(radar\w*|rdr|mrr|lrr|srr|acc\w*|scc\d*|lead\w*|fwd|front|object\w*|obj\w*|adas|"
        r"camera|cam|fcm|fr cmr|cmbb|distronic|adr|ds1\w*|aebs\d*)\b",
        rf"{_SHOWN_BY.replace('|camera|cam', '')}|\b(park\w*|pas\d*|pdc|ultrasonic|apa|sonar|"
        r"button\w*|trip|fuel|corner|side|blind|bsm|bsd|rcta|rear)\b",
        24,
        7,
    ),
    "range_rate": RolePatterns(
        (
            (
                r"\b(rel|relative|relativ|rltv) ?((long\w*|lgt|lng|obj|object|veh\w*|x|radial) )?(spd|"
                r"speed|vel|velo|velocity|v|vx|geschw\w*|vitesse)\b",
                STRONG,
            ),
            (r"\b(spd|speed|vel|velo|velocity|v|vx|vitesse|geschw) ?(rel|relative|relativ)\b", STRONG),
            (
                r"\brange ?rate\b|\brng ?rate?\b|\b(closing|approach) ?(spd|speed|vel\w*|rate)\b|"
                r"relgeschw\w*|relativgeschw\w*|differenzgeschw\w*",
                STRONG,
            ),
            (
                r"\bobj rel long v\b|\brelv\b|\bvrel\b|\bv ?rel\b|\b(dist|distance|gap) ?rate\b|"
                r"\brelspd\b|\brelvel\b",
                STRONG,
            ),
            (
                r"\b(tgt|target|lead|obj\w*) ?(veh )?v ?gap\b|\b(obj\w*|lead|target|tgt|trgt) ?(vx|"
                r"long\w* ?(spd|speed|vel\w*))\b",
                USUAL - 1,
            ),
        ),
        rf"{NEVER}|{_SIDE}|{_SHOWN}|\b(lat|lateral|latrl|vy|dy|trk\d*|track\w*|accel\w*|accn|"
        r"steer\w*|stw|wheel|whl\w*|yaw|angle|ang|an|valid|vld|stat|status|state|std\w*|sigma|var|"
        r"req\w*|cmd|set\w*|warn\w*|pressure|max|min|mx|mn|lim\w*|desired|rear|torque|fan)\b",
        r"\b(radar\w*|rdr|mrr|lrr|acc\w*|scc\d*|lead\w*|fwd|front|object\w*|obj\w*|adas|camera|"
        r"cam|fcm|cmbb|adr|ds1\w*|aebs\d*|pcr\w*)\b",
        r"\b(cluster|hud|park\w*|pas\d*|corner|side|blind|bsm|bsd|rcta|pcr|rear|steer\w*)\b",
        24,
        6,
    ),
    "brake": RolePatterns(
        (
            (
                r"\b(driver|fahrer|fa|user|operator|usr|drv|drvr) ?(is |has )?(brak\w*|bremst|brk\w*|"
                r"brake)( ?(pedal|applied|appl|apply|pressed|active))?\b",
                STRONG + 0.5,
            ),
            (
                rf"\b{_BRAKE} ?(pedal|ped|pedl|pdl)? ?(is )?(pressed|prssed|press|psd|depressed|applied|"
                r"appd|appl|apply|drv appl|drvr appd|actuated|betaetigt|activated)\b",
                STRONG,
            ),
            (
                rf"\b{_BRAKE} ?(pedal|ped|pedl|pdl)? ?(on|sw|swt|swtch|switch|on off sw\w*|active|status|"
                r"state|sts|stat|d actl|drv appl|drv)\b",
                STRONG - 1,
            ),
            (
                r"\bb ?ped ?(drv )?appl\b|\bbrk ?on\b|\bbls\b|bremslichtschalter|bremspedal|bremst\b|"
                r"\bbrake ?pedal$",
                STRONG - 1,
            ),
            (
                r"\b(contact|etat|position|pedale|appui) ?(de )?(pedale )?frein|frein principal|\bfrein\b",
                USUAL,
            ),
            (
                r"\b(main|service) ?(brake|brk)( switch| sw)?\b|\b(brake|brk) ?(signal|sig)( \d)?$|"
                r"\b(human ?brak\w*|brak\w* ?human)\b",
                USUAL + 1,
            ),
            (
                r"\b(stop|brake) ?(light|lamp)s? ?(sw\w*|switch|on|stat\w*|active)?$|\b(brake|"
                r"break) ?light\w*$|\bstoplamp\w*|\bbremslicht\b|\bstp ?sw\b",
                USUAL,
            ),
            (r"^(\w{1,4} )?(brake|brk|brakes|bremse|breaking|braking|brake act|brk act)( \d)?$", USUAL + 1),
        ),
        rf"{NEVER}|\b(park\w*|hand\w*|handbremse|epb|pb|pbrake|prk\w*|hold|hld|avh|ahb|acc|cruise|"
        r"crz|cmbb|aeb|anb|awv|fcw|fcam?|pcs|ped brake|es|tsk|adr|erron\w*|defaut\w*|process|req|"
        r"rq\w*|request\w*|cmd|command\w*|ctl|ctrl|control|computer"
        r"|fluid|wear|pad|belag|temp\w*|bremsentemp|warn\w*|wrn|lining|trailer|trlr\w*|trl|"
        r"anhaenger|aag|emerg\w*|emgcy|not|notbrems\w*|no|abs|esc|stab|prefill|prchg|pre|pressure|"
        r"pressur|preasure|druck|bremsdruck|decel|dec|wip\w*"
        r"|assist|asst|bas|bst|bstr|booster|konsistenz|regen\w*|rgen|rekup\w*|reku|ecd|exh|"
        r"exhaust|eng brk|retarder|eco|chime|msg\w*|txt|allw|deny|dis|dny|disabled|bias|force|"
        r"torque|tq|mom\w*|percent|pct|pos|position|amount|level|lvl|related"
        r"|hint|prompt|text|ind|indic\w*|icon|sound|system|sys|type|off|released|unavail\w*|hw|"
        r"redundant|target|trg|limit|lim|lh|rh|open|li|re|vac\w*|thermal|circuit|gain|mode|mde|"
        r"drum|disc|disk|vehicle hold|release|rel|status bits|shift lock|lck|lock|interlock|to|"
        r"left|right|rear|bulb|ahead|lead|veh\w* ahead|blink\w*|high|esf|cnt|move|wheel|brake 2|"
        r"mass)\b",
        r"\b(engine\w*|eng|ems\d*|motor|esp\w*|esc\d*|vsc\w*|brake\w*|brk\w*|bremse\w*|pedal\w*|"
        r"abs\w*|ebcm|powertrain|pt|tcs\d*|vdc|vsa|di|ibst|ccvs\d*|ebs|dynamics|dscs?)\b",
        r"\b(park\w*|epb|trailer\w*|trlr\w*|anhaenger|hud|camera|adas|acc\w*|aeb|fcw|lkas|lka|es|"
        r"cruise|crz|radar|collision|cluster|clu\d*|dash\w*|kombi|light\w*|licht\w*|lamp\w*|"
        r"seat\w*|door\w*|command|cmd|body|obd\w*|diag\w*|hold|elv|apa|\w*pilot\w*|assist\w*|"
        r"aebfb)\b",
        4,
        1,
    ),
}
