"""Cut a run in two halves of its motions and compare the verdicts: python docs/notebook/halves.py RUN_DIR.

Prints each claim with its verdicts in the whole run and in both halves, and how many contradict each
other: one half says that the claim holds, the other that it does not.
"""

from __future__ import annotations

import sys
from dataclasses import replace

from benchmarks.results.run_folder import RunFolder
from reports.finished_run import Run, read_run
from reports.statistics.paper_claims import FAILS, HOLDS, Claim, judge_claims


def verdicts(run: Run, scenes: set[str]) -> dict[Claim, str]:
    """Return the verdict of each claim that these scenes can judge."""
    energies = run.frame_energies[run.frame_energies["scene"].isin(scenes)]
    part = replace(run, frame=run.frame[run.frame["scene"].isin(scenes)], frame_energies=energies)
    return {line.claim: line.verdict for line in judge_claims(part)}


def main(folder: str) -> None:
    """Print the table."""
    run = read_run(RunFolder(folder))
    scenes = sorted(set(run.garment_rows["scene"]))
    whole, one, other = (verdicts(run, set(part)) for part in (scenes, scenes[::2], scenes[1::2]))
    against = 0
    for claim, verdict in whole.items():
        halves = one.get(claim, "-"), other.get(claim, "-")
        against += {*halves} == {HOLDS, FAILS}
        texts = (claim.metric, claim.lower, claim.higher, verdict, *halves)
        print(" ".join(text.ljust(24) for text in texts))
    print(f"{len(scenes)} motions, {len(whole)} claims, {against} contradict each other")


if __name__ == "__main__":
    main(sys.argv[1])
