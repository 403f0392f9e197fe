"""A net of these springs hangs from two corners: L-BFGS in float32, then Newton's method."""

from hencky import HenckySpring

from benchmarks.meshes import square_sheet
from reference_sim import Cloth, simulate
from reference_sim.energies import Gravity

positions, faces = square_sheet(8, 0.4)
cloth = Cloth(positions, faces, pins=[0, 8])
result = simulate(cloth, [HenckySpring(cloth), Gravity(cloth)], frames=10, method="lbfgs")
assert result.status == "converged", result.reason
print(f"its lowest point is at y = {result.positions[-1, :, 1].min():.3f} m")
