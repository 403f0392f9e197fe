"""Small ASF and AMC files made in the test, of a skeleton like those of CMU."""

from pathlib import Path

import numpy as np

UNIT = 0.45


def cmu_like() -> str:
    """A skeleton with CMU's bone names: legs splayed, arms along x, hinge axes tilted as CMU's are."""
    s, c = np.sin(np.radians(20.0)), np.cos(np.radians(20.0))
    down, up = {"l": (s, -c, 0), "r": (-s, -c, 0)}, (0, 1, 0)
    bones = [
        ("lowerback", up, 2, (0, 0, 0), "rx ry rz", "root"),
        ("upperback", up, 2, (0, 0, 0), "", "lowerback"),
        ("thorax", up, 2, (0, 0, 0), "", "upperback"),
        ("lowerneck", up, 2, (0, 0, 0), "", "thorax"),
        ("upperneck", up, 2, (0, 0, 0), "", "lowerneck"),
        ("head", up, 2, (0, 0, 0), "rx", "upperneck"),
    ]
    for side, sign in (("l", 1), ("r", -1)):
        leg, arm = (0, 0, sign * 20.0), (180, -sign * 30, -sign * 90)
        bones += [
            (f"{side}hipjoint", (sign * 0.6, -0.7, 0.3), 2.4, (0, 0, 0), "", "root"),
            (f"{side}femur", down[side], 7.0, leg, "rx ry rz", f"{side}hipjoint"),
            (f"{side}tibia", down[side], 7.4, leg, "rx", f"{side}femur"),
            (f"{side}foot", (0, -0.2, 0.98), 2.3, (-90, 0, 0), "rx", f"{side}tibia"),
            (f"{side}toes", (0, 0, 1), 1.1, (-90, 0, 0), "", f"{side}foot"),
            (f"{side}clavicle", (sign * 0.93, 0.35, 0), 3.5, (0, 0, 0), "ry rz", "thorax"),
            (f"{side}humerus", (sign, 0, 0), 5.0, arm, "rx ry rz", f"{side}clavicle"),
            (f"{side}radius", (sign, 0, 0), 3.5, arm, "rx", f"{side}humerus"),
            (f"{side}wrist", (sign, 0, 0), 1.7, (0, sign * 90, sign * 90), "ry", f"{side}radius"),
            (f"{side}hand", (sign, 0, 0), 0.7, (0, sign * 90, sign * 90), "rx", f"{side}wrist"),
            (f"{side}fingers", (sign, 0, 0), 0.6, (0, sign * 90, sign * 90), "", f"{side}hand"),
        ]
    text = f"# comment\n:units\n length {UNIT}\n angle deg\n:root\n order TX TY TZ RX RY RZ\n"
    text += " axis XYZ\n position 0 0 0\n orientation 0 0 0\n:bonedata\n"
    for name, direction, length, axis, dof, _ in bones:
        text += f"begin\n name {name}\n direction {' '.join(map(str, direction))}\n length {length}\n"
        text += f" axis {' '.join(map(str, axis))} XYZ\n" + (f" dof {dof}\n" if dof else "") + "end\n"
    return text + ":hierarchy\nbegin\n" + "".join(f" {b[5]} {b[0]}\n" for b in bones) + "end\n"


def amc_frame(number: int, **bones: tuple[float, ...]) -> str:
    """One frame of the CMU-like skeleton: zero everywhere but for the bones given."""
    counts = {"root": 6, "lowerback": 3, "head": 1}
    for side in "lr":
        counts |= {f"{side}femur": 3, f"{side}tibia": 1, f"{side}foot": 1, f"{side}clavicle": 2}
        counts |= {f"{side}humerus": 3, f"{side}radius": 1, f"{side}wrist": 1, f"{side}hand": 1}
    values = {name: bones.get(name, (0.0,) * count) for name, count in counts.items()}
    return f"{number}\n" + "".join(f"{name} {' '.join(map(str, v))}\n" for name, v in values.items())


def write_clip(folder: Path, frames: list[str]) -> Path:
    (folder / "07.asf").write_text(cmu_like())
    clip = folder / "07_01.amc"
    clip.write_text(":FULLY-SPECIFIED\n:DEGREES\n" + "".join(frames))
    return clip
