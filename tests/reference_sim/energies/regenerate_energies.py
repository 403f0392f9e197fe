"""Print what changed in energies.csv; with --write keep it.

    python -m tests.reference_sim.energies.regenerate_energies [--write]

A change here is a change of physics or of the minimum that the solver finds: look at every line before
keeping it, and say in the commit why it had to be.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys

from tests.reference_sim.energies.regression_scenes import (
    COLUMNS,
    SCENES,
    STORE,
    Energies,
    computed,
    scales,
    stored,
)


def changes(old: Energies, new: Energies) -> list[str]:
    """One line for each term of each scene: how far it moved, as a share of its largest value."""
    lines, sizes = [], scales(old | new)
    for scene, term in dict.fromkeys((key[0], key[2]) for key in (*new, *old)):
        before = {key: v for key, v in old.items() if (key[0], key[2]) == (scene, term)}
        after = {key: v for key, v in new.items() if (key[0], key[2]) == (scene, term)}
        if before.keys() != after.keys():
            lines.append(f"{scene:10s} {term:12s} frames {len(before)} -> {len(after)}")
            continue
        worst = max(after, key=lambda key: abs(after[key] - before[key]))
        moved = abs(after[worst] - before[worst])
        if moved:
            lines.append(
                f"{scene:10s} {term:12s} frame {worst[1]}: {before[worst]:.12g} -> {after[worst]:.12g} J "
                f"({moved / sizes[scene, term]:.1e})"
            )
    return lines


def write(energies: Energies) -> None:
    """Store the table, whole or not at all."""
    STORE.parent.mkdir(exist_ok=True)
    temporary = STORE.with_suffix(".part")
    with temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([*key, repr(value)] for key, value in energies.items())
    os.replace(temporary, STORE)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the new energies")
    options = parser.parse_args(arguments)
    old = stored() if STORE.is_file() else {}
    new: Energies = {}
    for name in SCENES:
        new |= computed(name)
    differences = changes(old, new)
    print("\n".join(differences) if differences else "nothing changed, to the last bit")
    if options.write and differences:
        write(new)
        print(f"{len(new)} energies kept in {STORE.name}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
