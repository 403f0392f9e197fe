"""Early-stopped solver in compiled calls: approximations of parts of this package that are held to them.

minimiser.CompiledLBFGS stands for minimise.LBFGS.
"""
