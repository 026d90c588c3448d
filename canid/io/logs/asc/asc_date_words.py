"""Words of date lines: months and halves of the day in the languages of Windows, lower case and without accents."""

from __future__ import annotations

# The first letters of the months: English, German, French, Spanish, Italian, Portuguese, Dutch, Swedish, Danish;
# Polish, Czech; Russian; Turkish; Hungarian. Three letters, four where three are ambiguous (juin, juillet).
MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan ene gen janv sty led янв янва oca 一月",
            "feb fev fevr lut uno фев февр sub 二月",
            "mar mrz maa mrt mars marc bre мар март 三月",
            "apr avr abr avri kwi dub апр апре nis 四月",
            "may mai mag mei maj kve май мая 五月",
            "jun giu juin cze июн июнь haz 六月",
            "jul lug juil lip июл июль tem 七月",
            "aug aou ago aout sie srp авг авгу 八月",
            "sep set sept wrz zar сен сент eyl 九月",
            "oct okt ott out paz rij окт октя eki 十月",
            "nov ноя нояб kas 十一月",
            "dec dez dic gru pro дек дека ara 十二月",
        ),
        1,
    )
    for name in names.split()
}
# words that say nothing: between day and month, and parts of the weekday
EMPTY_WORDS = frozenset(["de", "del", "of", "feira", "den", "the", "le", "г", "года", "kl", "um"])
MORNING = frozenset(
    ["am", "vorm", "vormittags", "vm", "fm", "oo", "дп", "πμ", "上午", "凌晨", "早上", "午前", "오전"]
)
AFTERNOON = frozenset(
    ["pm", "nachm", "nachmittags", "nm", "em", "os", "пп", "μμ", "下午", "晚上", "午後", "오후"]
)
