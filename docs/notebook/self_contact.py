"""How much time a dressed simulation takes whose cloth does not cross itself: an experiment.

    python docs/notebook/self_contact.py GARMENT MOTION FRAMES

A barrier between parts of the cloth (IPC's, by ipctk) is added to the declared terms; contact with the body
stays the penalty. Each time step is minimised without the barrier first, by L-BFGS; cloth and pins then go
towards that answer until something would touch, and Newton's method minimises with the barrier. Prints, for
the reference as it is, for the barrier alone and for the barrier behind that first phase: CPU time of a
frame, faces that another triangle cuts, and the share of frames that converged.
"""

import sys
import time
from functools import partial

import ipctk
import numpy as np

from benchmarks.assets.assets import open_assets
from benchmarks.presets import find_preset
from benchmarks.process.timing import one_thread
from benchmarks.scenes import dressed_body, of_garment
from reference_sim import time_step
from reference_sim.contact.collisions import NO_OBSTACLE
from reference_sim.energies.contact_barrier import ContactBarrier
from reference_sim.minimise.minimisers import make_minimiser
from reference_sim.potential import Potential
from reference_sim.time_loop import simulate
from snug.motion.library import make_motion

DISTANCE, STIFFNESS = 1e-3, 100.0  # [m], [Pa]
ROUGH = 1e-3  # tolerance of the first phase
DECLARED = dressed_body.declared_energies


class SelfBarrier(ContactBarrier):
    """Barrier of the cloth against itself alone."""

    name = "self_barrier"

    def prepare(self, step):
        """Leave the obstacle to the penalty."""
        self.step = step
        self.collisions.begin(*NO_OBSTACLE)


class TwoPhaseStepper(time_step.TimeStepper):
    """Steps whose first guess is the minimum without terms that nothing may pass."""

    def reach(self, x, guess):
        """Minimise without the barrier, then go there as far as nothing meets, and minimise with it."""
        if self.potential.impassable:
            smooth = Potential([term for term in self.potential.energies if not term.impassable])
            options = self.options | {"method": "lbfgs", "tolerance": ROUGH}
            found = make_minimiser(smooth, **options).minimise(guess).positions
            guess = found if np.isfinite(found).all() else guess
        return super().reach(x, guess)


def faces_cut(x, faces):
    """Return how many faces an edge of another triangle passes through at x (V, 3) [m]."""
    x, faces = np.asfortranarray(x), np.asfortranarray(faces, dtype=np.int32)
    mesh = ipctk.CollisionMesh(x, ipctk.edges(faces), faces)
    search, cut = ipctk.LBVH(), set()
    search.build(x, mesh.edges, mesh.faces, 1e-9)
    for pair in search.detect_edge_face_candidates():
        edge, face = mesh.edges[pair.edge_id], mesh.faces[pair.face_id]
        if not set(edge) & set(face) and ipctk.is_edge_intersecting_triangle(*x[edge], *x[face]):
            cut.add(pair.face_id)
    return len(cut)


def measure(assets, garment, motion, frames, label):
    """Simulate and print one line."""
    built = of_garment(garment).scene(motion).at(find_preset("quick")).build(assets)
    faces, start = np.asarray(built.cloth.faces), built.start
    begun = time.process_time()
    trajectory = simulate(
        built.cloth, built.energies, dt=built.dt, frames=min(frames, built.frames),
        obstacle=built.obstacle, start=start,
    )  # fmt: skip
    milliseconds = 1e3 * (time.process_time() - begun) / (trajectory.frames - 1)
    cut = [faces_cut(x, faces) for x in trajectory.positions]
    print(
        f"{label}: {trajectory.frames} frames, {milliseconds:.0f} ms a frame; faces cut: {np.mean(cut):.2f} "
        f"in the mean, {max(cut)} at most, of {len(faces)}; converged in "
        f"{np.mean(trajectory.frame_fields['converged']):.0%} of frames; {trajectory.status}",
        flush=True,
    )


def main():
    """Measure a garment on a motion, three ways."""
    one_thread()
    ipctk.set_num_threads(1)
    garment, motion, frames = sys.argv[1], sys.argv[2], int(sys.argv[3])
    assets = open_assets(find_preset("quick"), [make_motion(motion)], [garment])
    measure(assets, garment, motion, frames, "without self-contact, first use")
    measure(assets, garment, motion, frames, "without self-contact")
    barrier = partial(SelfBarrier, distance=DISTANCE, stiffness=STIFFNESS)
    dressed_body.declared_energies = lambda cloth: (*DECLARED(cloth), barrier(cloth))
    measure(assets, garment, motion, frames, "barrier")
    import reference_sim.time_loop as time_loop

    time_loop.TimeStepper = TwoPhaseStepper
    measure(assets, garment, motion, frames, "barrier behind a first phase")


if __name__ == "__main__":
    main()
