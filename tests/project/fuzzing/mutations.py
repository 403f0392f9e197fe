"""Mutations of the bytes of a file, and of the values in JSON."""

from __future__ import annotations

import json
import random
import re

NUMBERS = (b"-1", b"0", b"1e300", b"nan", b"inf", b"99999999999999999999", b"9" * 5000, b"1000000000", b"")
VALUES = (None, True, -1, 0, 1e300, 10**30, "x", "\0" * 300, [], {}, [[]], {"a": {}}, float("nan"))


def bytes_of(data: bytes, draw: random.Random) -> bytes:
    """One to three mutations: bits, cuts, repeats, other numbers, words of ones."""
    for _ in range(draw.randint(1, 3)):
        at, end = sorted(draw.randint(0, len(data)) for _ in range(2))
        kind = draw.randrange(7)
        if kind == 0 and data:
            changed = bytearray(data)
            for _ in range(draw.randint(1, 8)):
                changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
            data = bytes(changed)
        elif kind == 1:
            data = data[:at]
        elif kind == 2:
            data = data[:at] + data[min(end, at + 64) :]
        elif kind == 3:
            data = data[:end] + data[at:]
        elif kind == 4:
            data = data[:at] + draw.choice((b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0" * 16)) + data[at + 8 :]
        elif kind == 5 and (matches := list(re.finditer(rb"\d+(\.\d+)?", data))):
            number = draw.choice(matches)
            data = data[: number.start()] + draw.choice(NUMBERS) + data[number.end() :]
        else:
            data = data[:at] + draw.randbytes(draw.randint(0, 40)) + data[at:]
    return data


def values_of(data: bytes, draw: random.Random) -> bytes:
    """One to three values anywhere in a JSON object are others, or are gone."""
    value = json.loads(data)
    for _ in range(draw.randint(1, 3)):
        inner, place = value, draw.choice(list(value) or ["x"])
        while isinstance(inner, dict | list) and draw.random() < 0.7:
            inside = inner.get(place) if isinstance(inner, dict) else inner[place]
            if not isinstance(inside, dict | list) or not inside:
                break
            inner = inside
            place = draw.choice(list(inner)) if isinstance(inner, dict) else draw.randrange(len(inner))
        if draw.random() < 0.2:
            inner.pop(place, None) if isinstance(inner, dict) else inner.pop(place)
        else:
            inner[place] = draw.choice(VALUES)
    return json.dumps(value).encode()
