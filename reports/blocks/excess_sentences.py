"""Sentences of page one on how near the networks come to the reference, by relative excess."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import pandas as pd

from reports.run.finished_run import Run
from reports.statistics.body_shapes import rows_of_other_shapes
from reports.statistics.effects import Effect, is_recorded, recording_of
from reports.statistics.page_one_methods import EXTERNAL, LEARNED, leads
from reports.statistics.published import published_beside
from reports.statistics.relative_excess import (
    RELATIVE_EXCESS,
    TOTAL,
    Excess,
    excess_of,
    with_relative_excess,
)
from reports.statistics.verdicts import LESS, MORE, OPEN, TIED, compare_methods, standing, untested
from reports.tables.number_texts import listed, number

BY_CODE = "embedded library"  # how the source of a motion of the package that code makes begins


def relative_excesses(run: Run, worn: pd.DataFrame) -> list[str]:
    """Say which relative excess each network of page one has, and whether the first has less energy."""
    names = [n for n in leads(run, worn, by=(TOTAL,)) if run.methods[n].role in (*LEARNED, EXTERNAL)]
    rows = with_relative_excess(run, worn)
    known = {name: excess for name in names if (excess := excess_of(run, rows, name))}
    if not known:
        return []
    first, *others = known
    excess = known[first]
    # Those in which skinning has an excess: a network that failed in one has a remark on it.
    scenes = set(rows[(rows["metric"] == RELATIVE_EXCESS.name) & rows["usable"]]["scene"])
    count = len(scenes)
    beside = published_beside(run, first)
    motions = f"{count} {_kind(run, scenes)}motion{'' if count == 1 else 's'}"
    paired = [f"; {says}" for says in _paired(run, worn, first, others)]
    pooled = {name: f"pooled {number(of.pooled, 2)} %" if count > 1 else "" for name, of in known.items()}
    first_share = f"{_share(excess, pooled[first])}{f' ({beside})' if beside else ''}"
    shares = [
        f"{run.label(first)} has a relative excess of {first_share}",
        *(f"{run.label(name)} of {_share(known[name], pooled[name])}" for name in others),
    ]
    scale = "where the reference has 0 % and skinning alone 100 %"
    sentences = [f"On {motions} {listed(shares)}, {scale}{''.join(paired)}"]
    if count > 1:
        worst = listed(
            [f"{run.label(name)} {number(of.worst[1], 2)} %{of.fewer}" for name, of in known.items()]
        )
        sentences += [
            f"These percentages are geometric means over {_repeated(run, scenes, known)}; pooled: the ratio "
            f"of the sums over motions. Worst motions: {worst}"
        ]
    return [*sentences, _against_reference(run.label(first), excess)]


def on_other_bodies(run: Run) -> list[str]:
    """Say which relative excess each network has on bodies of other shapes, in the one motion of them."""
    rows = rows_of_other_shapes(run)
    networks = [name for name in run.ordered(set(rows["method"])) if run.methods[name].role in LEARNED]
    known = {name: excess for name in networks if (excess := excess_of(run, rows, name))}
    shares = [f"{run.label(name)} {_share(excess)}" for name, excess in known.items()]
    count = rows["scene"].nunique()
    where = f"on {count} other {'body' if count == 1 else 'bodies'}, in one motion,"
    return [f"{where} relative excesses are: {', '.join(shares)}"] if shares else []


def _kind(run: Run, scenes: Collection[str]) -> str:
    """Return what these scenes' motions are to the networks, before the word "motions"."""
    if set(scenes) <= set(run.trained_on):
        return ""
    validation = set(run.with_motion("validation")) & set(scenes)
    if not validation:
        return "unseen "
    return "validation " if validation == set(scenes) else "validation and other unseen "


def _repeated(run: Run, scenes: Collection[str], known: Mapping[str, Excess]) -> str:
    """Return what the means are taken over: "motions", or how many sources of which kinds, with theirs."""
    sources = {recording_of(scene) for scene in scenes}
    count = len(sources)
    if count == len(scenes):
        return "motions"
    recordings = {name for name in sources if is_recorded(name)}
    others = sources - recordings
    origins = run.config.get("motion_sources", {})
    made = all(origins.get(scene.partition("/")[2], "").startswith(BY_CODE) for scene in others)
    motions = f"motion{'' if len(others) == 1 else 's'}"
    kind = f"{motions} made by code" if made else f"other {motions}"
    recorded = f"{len(recordings)} recording{'' if len(recordings) == 1 else 's'}"
    parts = f"{recorded}, each averaged over its segments"
    if others:
        of_recordings, of_others = (_typical(run, known, recorded=kept) for kept in (True, False))
        parts += f" ({of_recordings}), and {len(others)} {kind} ({of_others})"
    return f"{count} sources treated as independent: {parts}"


def _typical(run: Run, known: Mapping[str, Excess], *, recorded: bool) -> str:
    """Return "SNUG 3.8 % and PBNS 12 %": typical over the recorded motions, or over the others."""
    shares = {name: number(excess.typical_of(recorded=recorded), 2) for name, excess in known.items()}
    return listed([f"{run.label(name)} {share} %" for name, share in shares.items()])


def _share(excess: Excess, *remarks: str) -> str:
    """Return a relative excess as "6.1 % (95 % interval 2.3 to 14)", and of how many roll-outs if not all."""
    inside = "; ".join(filter(None, [_interval(excess.effect), *remarks]))
    return f"{number(excess.typical, 2)} %{f' ({inside})' if inside else ''}{excess.fewer}"


def _interval(effect: Effect) -> str:
    """Return "95 % interval 2.3 to 14", empty of an effect without one."""
    ends = effect.interval
    return f"95 % interval {' to '.join(number(end, 2) for end in ends)}" if ends else ""


def _against_reference(label: str, excess: Excess) -> str:
    """Say how the energy of the method with this label compares with the reference's."""
    stands = standing(excess.effect, excess.effect.p_value())
    return {
        TIED: f"{label} ties with the reference",
        MORE: f"the excess of {label} is larger than the uncertainty of the reference",
        LESS: f"{label} has less energy than the reference, which is no better: still cloth has less",
    }.get(stands, f"whether {label} differs from the reference is inconclusive{untested(excess.effect)}")


def _paired(run: Run, rows: pd.DataFrame, one: str, others: Sequence[str]) -> list[str]:
    """Say which of these have more total energy than a method, paired by motion, and which less."""
    standings: dict[str, list[str]] = {}
    for other in others:
        compared = compare_methods(run, rows, run.metrics[TOTAL], one, other)
        if (effect := compared.effect) and compared.one and compared.other:
            p = effect.p_value()
            stands = standing(effect, p)
            shown = _tested(effect, p) if stands in (LESS, MORE) and p is not None else ""
            shown += compared.one.fewer or compared.other.fewer
            standings.setdefault(stands, []).append(f"{run.label(other)}{shown}")
    first = run.label(one)
    says = {
        LESS: f"paired by motion, {first} has less energy than {{}}",
        MORE: f"paired by motion, {first} has more energy than {{}}",
        TIED: f"paired by motion, {first} has as much energy as {{}}",
        OPEN: f"whether {first} or {{}} has less is inconclusive",
    }
    return [text.format(listed(standings[stands])) for stands, text in says.items() if stands in standings]


def _tested(effect: Effect, p: float) -> str:
    """Return " (−8.1 points, 95 % interval −12 to −4.0, p = 0.002)" of an effect on relative excess."""
    parts = (f"{number(effect.shown, 2)} points", _interval(effect), f"p = {number(p, 2)}")
    return f" ({', '.join(filter(None, parts))})"
