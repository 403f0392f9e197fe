"""Sentences of a report: how near the networks come, how they move, at what cost, what went wrong."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache

import pandas as pd

from reports.blocks.printed_tables import cut
from reports.run.finished_run import Run
from reports.statistics import paper_claims
from reports.statistics.effects import Effect, is_recorded, recording_of
from reports.statistics.means_and_spreads import ensemble_spread, mean_of, pair, value_of
from reports.statistics.outcomes import (
    BAD,
    EXTERNAL,
    LEARNED,
    STRAIN,
    counted,
    leads,
    overstretched,
    published_beside,
    subjects,
)
from reports.statistics.pareto import (
    NETWORK,
    SMALLER_STEPS,
    beaten_by,
    compared_scenes,
    fastest,
    indistinct,
    points_of,
    reference_scenes,
    run_time,
    truncated,
)
from reports.statistics.relative_excess import (
    RELATIVE_EXCESS,
    TOTAL,
    Excess,
    excess_of,
    rows_of_other_shapes,
    with_relative_excess,
)
from reports.statistics.verdicts import (
    LESS,
    MORE,
    OPEN,
    TIED,
    compare_methods,
    measure_of,
    standing,
    untested,
)
from reports.tables.table import in_scenes, listed, number

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


CURVATURE, DISTANCE, GAP = "curvature/error", "distance/rms", "gap/energy"
FEW = 3  # scenes whose values are told one by one
SWING, ALIKE, INSIDE = "dynamics/amplitude", "dynamics/correlation", "penetration/surface"


@lru_cache(maxsize=4)
def topics(run: Run) -> list[tuple[str, list[str]]]:
    """Return (topic, sentences) for each topic of page one that the run can tell, the chief one first."""
    scenes = next(iter(run.garments(run.garment_rows).values()), [])
    worn = run.garment_rows[run.garment_rows["scene"].isin(scenes)]
    cells = run.cells("speed", "garments")
    compared = next(iter(compared_scenes(run, cells).values()), [])
    timed = cells[cells["scene"].isin(compared)] if compared else worn
    beside = cells[cells["scene"].isin(reference_scenes(run))]
    sentences = {
        "How near": relative_excesses(run, worn), "How it moves": _moves(run, worn),
        "At what cost": _cost(run, timed, compared), "How certain": _trust(run, beside, worn),
        "On other bodies": on_other_bodies(run),
    }  # fmt: skip
    finished = {
        topic: [unbroken(_ended(text)) for text in texts if text] for topic, texts in sentences.items()
    }
    return [(topic, texts) for topic, texts in finished.items() if texts]


def headline(run: Run) -> list[tuple[str, str]]:
    """Return (topic, its sentences as one paragraph) for each topic of page one that the run can tell."""
    return [(topic, " ".join(sentences)) for topic, sentences in topics(run)]


def _ended(sentence: str) -> str:
    """Return the sentence with a capital and a full stop."""
    return f"{sentence[:1].upper()}{sentence[1:].removesuffix('.')}."


def _moves(run: Run, worn: pd.DataFrame) -> list[str]:
    """Say what each subject lacks of the simulation's motion, and how much of it lies inside the body."""
    sentences: list[str] = []
    reference = value_of(worn, run.reference, INSIDE)
    for method in subjects(run, set(worn[worn["usable"]]["method"])):
        swing, alike, inside = (mean_of(worn, method, name) for name in (SWING, ALIKE, INSIDE))
        if swing is not None:
            amplitude = f"{number(100.0 * swing.value, 2)} % of the simulation's{swing.fewer}"
            sentence = (
                f"{run.label(method)} has {secondary_motion(swing.value)} secondary motion: its hem "
                f"amplitude is {amplitude}"
            )
            scale = " (1: the same motion up to its size)" if not sentences else ""
            correlated = ""
            if alike is not None:
                correlated = f", with a correlation of {number(alike.value, 2)}{alike.fewer}{scale}"
            sentences.append(f"{sentence}{correlated}")
        if inside is not None:
            beside = "" if reference is None else f", against {number(reference, 2)} % of the simulation's"
            surface = f"the surface of {run.label(method)}{inside.fewer}"
            sentences.append(f"{number(inside.value, 2)} % of {surface} lies inside the body{beside}")
    return sentences


def secondary_motion(amplitude: float) -> str:
    """Return how much of the simulation's secondary motion there is, in words."""
    if amplitude < 0.2:
        return "almost no"
    if amplitude < 0.8:
        return "less"
    return "about as much" if amplitude < 1.25 else "more"


def _first_subject(run: Run, rows: pd.DataFrame) -> str:
    """Return the first method that page one is about and these rows have, else the name of SNUG."""
    return next(iter(subjects(run, set(rows[rows["usable"]]["method"]))), NETWORK)


def _cost(run: Run, timed: pd.DataFrame, scenes: list[str]) -> list[str]:
    """Say how long a frame takes, which solver is as accurate, and whether a method is as fast and better."""
    metric = run.metrics.get(run_time(timed))
    network = _first_subject(run, timed)
    compared = compare_methods(run, timed, metric, run.reference, network) if metric else None
    if compared is None or compared.effect is None or compared.other is None or not compared.other.value:
        return []
    ends = compared.effect.interval or (compared.effect.shown,)
    times = " to ".join(dict.fromkeys(number(end, 2) for end in ends))
    milliseconds = number(compared.other.value)
    whole = " from pose to vertices" if compared.metric.name == "cost/whole" else ""
    where = f", {in_scenes(scenes)}" if scenes else ""
    return [
        f"on one core {run.label(network)} takes {milliseconds} ms a frame{whole}, the simulation {times} "
        f"times as long{where}",
        *(_rivals(run, run.cells("speed", "garments"), scenes) if scenes else []),
    ]


def _trust(run: Run, timed: pd.DataFrame, worn: pd.DataFrame) -> list[str]:
    """Say which claims hold, how uncertain the reference itself is, and what its time step leaves out.

    Its uncertainty is that in all motions, where the run has its ensemble there, else that beside timed rows.
    """
    sentences = []
    lines = paper_claims.judged(run)
    counted = paper_claims.counts(lines)
    if counted:
        sentences.append(f"{_tests(lines, counted)}{_claims_that_fail(run, lines)}")
    where = in_scenes(set(timed[timed["method"] == run.reference]["scene"]))
    finest = max(_smaller_steps(run, timed), key=lambda name: run.methods[name].level or 0.0, default="")
    if finest and (left_out := _left_out_by_the_step(run, timed, finest)):
        sentences.append(f"{left_out}, {where}")
    for rows in (worn, timed):
        apart = [indistinct(run, rows, metric) for metric in (DISTANCE, CURVATURE)]
        if all(apart):
            where = in_scenes(set(ensemble_spread(run, rows, DISTANCE).index))
            sentences.append(
                "equally valid simulations (another start, contact search or tolerance) lie "
                f"{number(apart[0], 2)} mm and {number(apart[1], 2)} 1/m of mean curvature from the "
                f"reference, {where}: errors below that show no difference"
            )
            break
    return sentences


def _left_out_by_the_step(run: Run, timed: pd.DataFrame, finest: str) -> str:
    """Say how far the simulation with the smallest time steps lies from the reference, and a network.

    Empty where nothing but the times of that simulation is known.
    """
    steps = int(run.methods[finest].level or 0)
    strain, amplitude = (pair(timed, finest, run.reference, name) for name in ("energy/strain", SWING))
    ratios = [
        f"{number(one.value / other.value, 2)} times its {what}"
        for what, (one, other) in (("strain", strain), ("hem amplitude", amplitude))
        if one and other and other.value
    ]
    network = _first_subject(run, timed)
    away, far = (_in_each_scene(timed, name, DISTANCE) for name in (finest, network))
    beside = f", from which {run.label(network)} lies {far} mm" if far else ""
    has = [f"has {' and '.join(ratios)}"] if ratios else []
    distance = [f"lies {away} mm from the reference{beside}"] if away else []
    if not (has or distance):
        return ""
    return (
        "the reference minimises each time step of 1/30 s to convergence, but smaller steps change it: a "
        f"simulation with {steps} steps a frame {', and '.join([*has, *distance])}"
    )


def _in_each_scene(rows: pd.DataFrame, method: str, metric: str) -> str:
    """Return the method's values in few scenes as "26 and 49", in many their mean, empty without any."""
    scenes = sorted(
        set(rows[rows["usable"] & (rows["method"] == method) & (rows["metric"] == metric)]["scene"])
    )
    values = [value_of(rows, method, metric, [scene]) for scene in scenes]
    if len(scenes) > FEW:
        values = [value_of(rows, method, metric)]
    return listed(list(dict.fromkeys(number(value, 2) for value in values if value is not None)))


def _tests(lines: Sequence[paper_claims.Judged], counted: Counter[str]) -> str:
    """Return how many tests there are of how many primary claims, and how they ended, also by claim.

    Table 1 alone has several tests, one for each energy.
    """
    verdicts: dict[str, set[str]] = {}
    for line in lines:
        if line.claim.primary:
            verdicts.setdefault(line.claim.says, set()).add(line.verdict)
    tests, claims = counted.total(), len(verdicts)
    of_claims = f"{claims} primary claim{'' if claims == 1 else 's'} of the paper"
    outcome = f"of {tests} test{'' if tests == 1 else 's'} of {of_claims} {paper_claims.in_words(counted)}"
    if tests == claims:
        return outcome
    alike = Counter(next(iter(ends)) for ends in verdicts.values() if len(ends) == 1)
    mixed = claims - alike.total()
    differently = f"{mixed} {'has' if mixed == 1 else 'have'} tests that end differently" if mixed else ""
    parts = [paper_claims.in_words(alike), differently]
    return f"{outcome}; by claim, {', '.join(filter(None, parts))}"


def _claims_that_fail(run: Run, lines: Sequence[paper_claims.Judged]) -> str:
    """Return a clause that names the primary claims that do not hold, empty where there are none."""
    failed = []
    for line in lines:
        if line.claim.primary and line.verdict == paper_claims.FAILS:
            lower, higher = run.label(line.claim.lower), run.label(line.claim.higher)
            measure = measure_of(line.compared).title.lower()
            says, _, condition = line.claim.says.partition(paper_claims.STRICTER)
            tested = f" (tested as {measure}: {lower} {line.claim.relation} {higher})"
            stricter = f", in a test stricter than these words: {condition}"
            failed.append(f"“{says.partition('; tested')[0]}”{stricter if condition else tested}")
    return f"; what does not hold is {listed(failed)}" if failed else ""


def _smaller_steps(run: Run, rows: pd.DataFrame) -> list[str]:
    """Return the simulations with smaller time steps among these rows."""
    have = set(rows[rows["usable"]]["method"])
    return [name for name, method in run.methods.items() if method.family == SMALLER_STEPS and name in have]


def _rivals(run: Run, frame: pd.DataFrame, scenes: Sequence[str]) -> list[str]:
    """Return a sentence on the fastest solver that is as accurate, and one on a method as fast and better."""
    points = points_of(run, frame, scenes, GAP)
    network = next((p for p in points if p.method == NETWORK), None)
    if network is None:
        return []
    snug = run.label(network.method)
    best, solver = beaten_by(points, network), fastest(truncated(run, points), network.error)
    sentences = []
    if solver is not None:
        sentences.append(
            "of the solvers stopped early that start from no network, the fastest that comes at least as "
            "near to the minimum of each time step "
            f"({run.label(solver.method)}: {number(solver.error)} J{solver.fewer} above it; {snug}: "
            f"{number(network.error)} J{network.fewer}) takes {number(solver.time)} ms, "
            f"{number(solver.time / network.time, 2)} times as long as {snug}"
        )
    if best is not None:
        within = " within repeats" if best.time > network.time else ""
        apart = network.error - best.error > network.error_spread + best.error_spread
        scatter = "" if apart else ", by less than seeds and equally valid simulations scatter"
        sentences.append(
            f"{run.label(best.method)} is no slower{within} and has an energy gap of {number(best.error)} J"
            f"{best.fewer}, below the {number(network.error)} J{network.fewer} of {snug}{scatter}"
        )
    return sentences


def unbroken(text: str) -> str:
    """Return the text with each number on the line of its unit."""
    return re.sub(r"(?<=\d) (?=(J|ms|mm|1/m|%)\b|%)", "\u00a0", text)


MOST = 5  # failures on page one
FILES = 12  # names of files that could not be read


def worst(run: Run) -> list[tuple[str, str]]:
    """Say what went worst: counts of endings, then single failures by name."""
    counts = endings(run)
    if run.problems:
        counts += f" {len(run.problems)} files could not be read: see the end."
    named = [(name, cut(event)) for name, event in failures(run)]
    return [("What went worst", counts), *named] if counts or named else []


def endings(run: Run) -> str:
    """Say how many cells, checks and stress tests ended how, with every kind that is not ok."""
    parts = []
    for kind, counts in counted(run).items():
        bad = [f"{counts[name]} {name}" for name in (*BAD, "skipped") if counts[name]]
        parts.append(f"of {sum(counts.values()):,} {kind} {', '.join(bad) if bad else 'all ended well'}")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def failures(run: Run) -> list[tuple[str, str]]:
    """Name the worst: failed cells and checks first, then stress tests, then overstretched networks.

    There are MOST of them in all, some of each kind.
    """
    rows = run.frame[run.frame["status"].isin(BAD)]
    rows = rows.assign(rank=rows["status"].map(BAD.index)).sort_values("rank", kind="stable")
    rows = rows.drop_duplicates(["scene", "method", "seed"])
    is_case = rows["case"] != ""
    kinds: list[list[tuple[str, str]]] = [
        [
            (
                f"{run.label(row.method)}, {row.scene}" + (f", seed {row.seed}" if row.seed else ""),
                f"{row.status}: {row.reason}",
            )
            for row in part.itertuples()
        ]
        for part in (rows[~is_case], rows[is_case])
    ]
    kinds.append(
        [
            (
                f"{run.label(method)}, {scene}",
                f"{STRAIN[metric]} {number(strain)} J, {number(ratio)} times the simulation's",
            )
            for method, scene, metric, strain, ratio in overstretched(run)[:3]
        ]
    )
    chosen: list[tuple[str, str]] = []
    for left, kind in zip((3, 2, 1), kinds):
        chosen += kind[: max((MOST - len(chosen)) // left, 1)]
    return chosen[:MOST]


def unread_files(run: Run) -> list[tuple[str, str]]:
    """Name the files of the run that could not be read."""
    more = [f"and {len(run.problems) - FILES} more"] if len(run.problems) > FILES else []
    files = "; ".join([*run.problems[:FILES], *more])
    return [("Files of this run that could not be read, missing above", files)] if files else []
