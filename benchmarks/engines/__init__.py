"""Engines: cloth of other simulation engines, on specimens of SNUG's fabric, beside the reference.

| module | what lies there |
| --- | --- |
| engine | declaration of an engine; what an adapter has to do |
| registry | the visible tuple of engines |
| specimens | sheets that fall, fly and hang |
| roll_outs | roll-outs of engines, with their time |
| laws | what any engine owes: free fall, momentum, symmetry, reaction |
| newton_cloth, newton_energies | NVIDIA's newton and the energies that its solvers minimise |
| mujoco_cloth | MuJoCo |
| reference_cloth | the reference, as one more engine |
"""
