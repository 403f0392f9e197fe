"""Numbers as text: digits, units, dashes for what is absent or not finite."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

DASH = "–"
CSV_DASH = "-"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FIGURE_SPACE, _POINT_SPACE = "\u2007", "\u2008"


def number(value: float | None, digits: int = 3, *, trim: bool = False) -> str:
    """Return `value` to `digits` significant digits; a dash if absent or not finite.

    `trim` leaves out zeros at the end, for numbers that are exact.

    >>> number(0.064349), number(1734.0), number(2.5e-7), number(None)
    ('0.0643', '1,734', '2.50×10⁻⁷', '–')
    """
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= exponent < 6:
        text = f"{value:,.{max(digits - 1 - exponent, 0)}f}".replace("-", "−")
        return _trimmed(text) if trim else text
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    mantissa = _trimmed(mantissa) if trim else mantissa
    return f"{mantissa.replace('-', '−')}×10{str(int(power)).translate(_RAISED)}"


def _trimmed(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def with_spread(value: float | None, spread: float | None) -> str:
    """Return a number with its spread to two digits, without ± where there is no spread.

    >>> with_spread(0.5, 0.0123)
    '0.500 ± 0.012'
    """
    if spread is None or not math.isfinite(spread) or number(value) == DASH:
        return number(value)
    return f"{number(value)} ± {number(spread, 2)}"


def duration(seconds: float | None) -> str:
    """Return a duration in s, min or h; a dash if absent.

    >>> duration(75.0), duration(402.0), duration(104400.0)
    ('75.0 s', '6.70 min', '29.0 h')
    """
    if seconds is None or not math.isfinite(seconds):
        return DASH
    if seconds == 0.0:
        return "0 s"
    for limit, size, unit in ((120.0, 1.0, "s"), (7200.0, 60.0, "min")):
        if abs(seconds) < limit:
            return f"{number(seconds / size)} {unit}"
    return f"{number(seconds / 3600.0)} h"


def csv_number(value: float | None) -> str:
    """Return nine digits for a file; a dash if absent."""
    if value is None or not math.isfinite(value):
        return CSV_DASH
    return f"{value:.9g}"


def aligned(texts: Sequence[str]) -> list[str]:
    """Pad the texts on the right by spaces as wide as digits, so that decimal points stand in a column.

    Only plain decimals are padded; a dash, a spread or a power of ten is left as it is.
    """
    tails = [len(text.partition(".")[2]) if _is_plain(text) else 0 for text in texts]
    widest = max(tails, default=0)
    padded = []
    for text, tail in zip(texts, tails):
        if not _is_plain(text) or tail == widest:
            padded.append(text)
        else:
            padded.append(text + ("" if tail else _POINT_SPACE) + _FIGURE_SPACE * (widest - tail))
    return padded


def _is_plain(text: str) -> bool:
    return bool(text) and all(letter in "−,.0123456789" for letter in text)


def in_scenes(scenes: Collection[str]) -> str:
    """Return "in 1 scene", "in 2 scenes" or, of liveliest parts alone, "in 2 clips"."""
    kind = "clip" if all(name.endswith("@clip") for name in scenes) else "scene"
    return f"in {len(scenes)} {kind}{'' if len(scenes) == 1 else 's'}"


def listed(items: Sequence[str]) -> str:
    """Return the words as "a, b and c".

    >>> listed(["a", "b", "c"]), listed(["a"]), listed([])
    ('a, b and c', 'a', '')
    """
    return " and ".join(filter(None, [", ".join(items[:-1]), *items[-1:]]))
