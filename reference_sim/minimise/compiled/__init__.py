"""Early-stopped solver in compiled calls: approximations of parts of this package that are held to them.

minimiser.CompiledLBFGS stands for minimise.LBFGS, sliding_obstacle.SlidingObstacle for obstacle.Obstacle.
Each can be used, and is loaded, without the other.
"""
