"""What the words of a heading say, in languages of Europe and East Asia: "speed of the lead vehicle".

A heading is understood only where each of its words is known: "speed limit", "lead distance filtered" and "throttle
position" stand for nothing. The names of `headings.ALIASES` come first.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

# what a word stands for; "": it adds nothing
_WORDS: dict[str, str] = {
    "": "the of an my is value signal measured actual current vehicle car veh obd can canbus sensor radar lidar "
        "fahrzeug des der die das zum zu von vom vor dem ist wert istwert gemessen gemessene aktuelle du de la le les "
        "au aux un une en mesure mesuree vehicule voiture actuelle del el al los coche vehiculo medida di della dello "
        "delle il lo veicolo auto misurata to do da veiculo het tot voertuig data field msg fzg vehicules veiculos "
        "vehiculos vozidla pojazdu pojazdow fordon автомобиля ao dal ajoneuvon auton jarmu autoe arac araca aracın "
        "autovehicul autovehiculului till til kjøretøy bilens bil 車両 车辆 차량 απο οχημα οχηματος 与 的 az との che "
        "vehiculaire vehiculaires vozila авто автомобіля",
    "between": "inter between entre zwischen tra mezi miedzy mellan между 间 間",
    "own": "own ego host self subject sv fv fav follower foll eigen eigenes eigene propre propio propia proprio "
        "propria oma sajat kendi propriu egen 自車 自车 本车 本車",
    "lead": "lead leader leading preceding lv ahead front target vordermann vordermanns vorausfahrend vorausfahrenden "
        "vorausfahrendes vorausfahrender voraus vorder precedent precedente delantero davanti devant frente "
        "voorligger poprzedzajacego framforvarande переднего лидера edella ajavaan edeltavaan elol halado haladohoz "
        "ondeki ondekine forankjørende forankørende 先行車 前車 前车 目标车 선행 앞차 선행차 leder lider precede haladotol "
        "poprzedzajacego 前方車両 前方车辆 ispred prednjeg попереднього",
    "relative": "relative rel relativ relativa relativo relatieve wzgledna relativni относительная відносна relativna "
        "suhteellinen bagıl goreli relatif sxetikh σχετικη 相対 相对 상대",
    "difference": "difference diff differenz kulonbseg ero roznica diferencia diferenca differenza delta",
    "closing": "closing approach approaching annaherungs annaherung rapprochement acercamiento avvicinamento",
    "speed": "speed velocity velo vel v spd geschwindigkeit vitesse velocidad velocita velocidade snelheid geschw "
        "predkosc hastighet hastighed rychlost скорость nopeus ajonopeus brzina швидкість sebesseg hız hızı viteza "
        "ταχυτητα 速度 車速 车速 속도 차속",
    "rate": "rate",
    "distance": "distance dist d space distanz distancia distanza odległosc vzdalenost дистанция расстояние etaisyys "
        "tavolsag mesafe mesafesi distanta udaljenost відстань дистанція αποσταση 距離 距离 거리",
    "gap": "gap range clearance abstand lucke interdistance afstand avstand odstep valimatka koveto kovetesi takip 車間 "
        "razmak 车间 차간 车间距 车距 跟车距离",
    "acceleration": "acceleration accel a ubrzanje beschleunigung aceleracion accelerazione aceleracao przyspieszenie "
        "zrychleni acceleratie ускорение kiihtyvyys gyorsulas ivme akselerasjon επιταχυνση 加速度 가속도 прискорення",
    "along": "longitudinal longit langs longitudinale",
    "accelerator": "accelerator gas fahrpedal gaspedal accelerateur acelerador acceleratore gazu plynovy газа speeder "
        "kaasu gaz gass gasa газу 油门 加速 アクセル γκαζιου 가속 акселератора kaasupolkimen kaasupoljin",
    "pedal": "pedal pedale pedaal pedał педаль педали poljin pedalı pedala πενταλ pdl 踏板 ペダル 페달 "
        "pedału polkimen papucica",
    "place": "position pos stellung winkel posicion posizione asento allas konumu pozitia θεση 開度 开度 位置 개도 "
        "połozenie posicao",
    "brake": "brake braking bremse brems frein freno jarru fek fren frana φρενο ブレーキ 制动 브레이크",
    "switch": "switch pressed active on light state status schalter licht betatigt aktiv",
    "time": "time t zeit uhrzeit zeitstempel temps tiempo tempo tijd czas tid cas время aika ido zaman timp χρονος 時間 "
        "vrijeme vreme час 時刻 时间 経過 시간",
    "stamp": "stamp stempel belyeg",
    "headway": "headway",
    "satellite": "gps gnss",
    "wheel": "wheel rad",
    "steering": "steering steer lenkung lenk lenkrad",
    "angle": "angle",
    "engine": "engine motor",
    "turns": "rpm drehzahl",
    "yaw": "yaw gier",
    "gear": "gear gang",
}  # fmt: skip
# what sets of meanings are; "along" is the direction that is meant anyway
_ROLES: dict[str, tuple[str, ...]] = {
    "time": ("time", "time stamp"),
    "speed": ("speed", "own speed"),
    "lead_speed": ("lead speed",),
    "range_rate": (
        "relative speed", "relative speed lead", "relative speed own", "relative speed lead own", "gap rate",
        "distance rate", "relative rate gap", "gap rate lead", "closing speed", "closing speed lead", "closing rate",
    ),
    "gap": (
        "gap", "gap lead", "gap own lead", "gap distance", "distance lead", "distance own lead", "relative distance",
        "relative distance lead", "gap distance lead", "distance between", "gap between",
    ),
    "headway": ("headway time", "gap time", "headway time lead", "gap time lead"),
    "accel": ("acceleration", "own acceleration"),
    "pedal": (
        "accelerator", "accelerator pedal", "accelerator place", "accelerator pedal place", "own accelerator pedal", "pedal",
        "pedal place", "pedal acceleration",
    ),
    "brake": ("brake", "brake pedal", "brake switch", "brake pedal switch", "brake pedal place switch"),
    "gnss_speed": ("satellite speed",),
    "wheel_speed": ("wheel speed",),
    "steering_angle": ("steering angle", "steering wheel angle", "steering place", "steering wheel place"),
    "engine_speed": ("engine speed", "engine turns", "turns"),
    "yaw_rate": ("yaw rate",),
    "gear": ("gear",),
}  # fmt: skip
_MEANING = {word: meaning for meaning, words in _WORDS.items() for word in words.split()}
_BY_MEANING = {frozenset(words.split()): role for role, sets in _ROLES.items() for words in sets}
# from here on letters are syllables or words, and blanks do not part words
_EAST_ASIA = "\u2e80"
# what a word joined of others may hold, longest first: shorter ones stand in too many other words
_PARTS = sorted((word for word in _MEANING if len(word) >= 3 or word > _EAST_ASIA), key=len, reverse=True)


def role_in_words(name: str) -> str | None:
    """The role that the words of a heading say; None: a word is not known, or together they name nothing.

    Args:
        name: `Heading.name`.

    Example:
        >>> role_in_words("speed_of_the_lead_vehicle"), role_in_words("fahrzeuggeschwindigkeit")
        ('lead_speed', 'speed')
        >>> role_in_words("speed_limit"), role_in_words("front_to_front_distance")
        (None, None)
    """
    words = name.split("_")
    meanings = _meanings(words)
    # a radar measures speeds of others
    role = None if meanings is None else _BY_MEANING.get(frozenset(meanings - {"along"}))
    return None if role in ("speed", "accel") and {"radar", "lidar"} & {*words} else role


def closing_in_words(name: str) -> bool:
    """Whether the words name the range rate with the other sign.

    Example:
        >>> closing_in_words("closing_speed_of_the_lead"), closing_in_words("relative_speed")
        (True, False)
    """
    return role_in_words(name) == "range_rate" and "closing" in (_meanings(name.split("_")) or ())


def undecided_in_words(name: str) -> str:
    """What the words leave open: "distance" (of what), or "difference" (of two speeds, of either sign); "": nothing.

    Example:
        >>> [undecided_in_words(name) for name in ("vzdalenost", "geschwindigkeitsdifferenz", "front_to_front_distance")]
        ['distance', 'difference', '']
    """
    meanings = (_meanings(name.split("_")) or set()) - {"lead", "own"}
    return (
        "distance"
        if meanings == {"distance"}
        else "difference"
        if meanings == {"speed", "difference"}
        else ""
    )


def says_accelerator(name: str) -> bool:
    """Whether a heading that has no role may still be that of the accelerator pedal.

    Example:
        >>> says_accelerator("throttle_position"), says_accelerator("accelerator_pedal_raw"), says_accelerator("pad")
        (True, True, False)
    """
    meanings = {meaning for word in name.split("_") for meaning in (_meanings([word]) or {word})}
    return bool({"throttle", "accelerator", "pedal"} & meanings) and not {"brake", "clutch"} & meanings


def _meanings(words: Sequence[str]) -> set[str] | None:
    """All meanings; None: a word has none, or they are of two places, as "front to front"."""
    if len({*words}) < len(words) and {"front", "rear"} & {*words}:
        return None
    out = set[str]()
    for word in words:
        parts = _parts(word)
        if parts is None:
            return None
        out.update(parts)
    return out - {""}


@lru_cache(4096)
def _parts(word: str) -> tuple[str, ...] | None:
    """The meanings of a word, which may be joined of several: "fahrzeug" + "geschwindigkeit"."""
    if word in _MEANING:
        return (_MEANING[word],)
    for part in _PARTS:
        if word.startswith(part):
            rest = word[len(part) :]
            # a German joint: "Annäherung-s-geschwindigkeit"
            for more in (rest, rest.removeprefix("s")):
                if (len(more) >= 3 or more > _EAST_ASIA) and (ending := _parts(more)) is not None:
                    return (_MEANING[part], *ending)
    return None
