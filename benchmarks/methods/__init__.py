"""Methods: everything that dresses a body or moves a sheet, and is measured.

| folder | what lies there |
| --- | --- |
| catalogue | declarations, in blocks: networks, ablations, equal_data, solvers; trainings of networks |
| networks | implementations that need a body: networks, skinning, collision post-processing, the bound |
| solvers | implementations that solve the time step: the reference, its variants, stopped solvers |
| minimisers | vertex block descent and XPBD on our energies, with the methods of both |
| outside | stored roll-outs and programs |
"""
